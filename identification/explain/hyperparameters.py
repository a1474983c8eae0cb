"""Hyper-parameters of `explain`, chosen on training recordings by `tests/studies/hyperparameters`."""

PRIOR_EFFECT = 0.04
"""Prior probability of each effect of the catalogue [-]."""

PRIOR_UNKNOWN = 0.1
"""Prior probability of something that the catalogue lacks [-]: one drive in ten is taken to have it."""

TEMPERATURE = 4.0
"""Divisor of differences of log evidence [-]: published forms of an effect differ, the catalogue has some of them, and
the variation of the ground is no exact Matern process, so that the evidence is overconfident."""
