"""Recordings in which one or two effects that the textbook wheel leaves out are hidden, and the scoring of answers.

Nothing here shares code with the identification it is made to test: mechanics, quadrature, root finding, forms of the
effects and the fit that sets their strength are this package's own.
"""
