"""The three numbers of `explain` that recordings decide, chosen on training recordings by `studies/hyperparameters`."""

PRIOR_EFFECT = 0.01
"""Prior probability of each effect of the catalogue [-]."""

PRIOR_UNKNOWN = 0.05
"""Prior probability of something that the catalogue lacks [-]."""

TEMPERATURE = 5.0
"""What differences of ln evidence are divided by [-]: published forms of one effect differ, the catalogue holds some of
them, and the variation of the ground is no exact Matern process, so that evidence is sharper than it should be."""
