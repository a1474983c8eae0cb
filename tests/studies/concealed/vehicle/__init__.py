"""Whole drives of a vehicle over several grounds, in which none, one or two causes are hidden."""
