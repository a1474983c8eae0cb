"""Mechanics of a wheel on deformable soil: stresses on the rim, equilibrium, and the wheel models made of them."""
