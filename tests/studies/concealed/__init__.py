"""Recordings in which one or two effects that the textbook wheel leaves out are hidden.

Nothing here imports `bevameter`: mechanics, quadrature, root finding, forms of the effects and the fit that sets their
strength are this package's own.
"""
