"""Soil parameters from the rows that count: likelihood, optimisation, intervals, identifiability, form error."""
