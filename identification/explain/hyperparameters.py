"""The numbers of `explain` that were chosen on recordings: on training seeds alone, by
tests/studies/hyperparameters.py.
"""

PRIOR_EFFECT = 0.02
"""Prior probability of each effect of the catalogue [-]."""

PRIOR_UNKNOWN = 0.05
"""Prior probability of something that the catalogue lacks [-]."""

TEMPERATURE = 1.0
"""What differences of ln evidence are divided by: published forms of one effect differ, and so do scores [-]."""
