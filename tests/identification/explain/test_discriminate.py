"""Which drive is proposed where something is missing that the catalogue lacks."""

from dataclasses import replace

import numpy as np
import pytest
from bevameter.identification.explain.discriminate import propose_drive


def drive(fitted, **varied):
    """A drive on which no condition varies but those given."""
    samples = fitted[0].samples.drive
    rows = len(samples)
    constant = {"load_N": np.full(rows, 100.0), "rim_speed_m_s": np.full(rows, 0.1), "slip": np.full(rows, 0.2)}
    return replace(samples, **constant | {name: np.linspace(*span, rows) for name, span in varied.items()})


@pytest.mark.parametrize(
    ("varied", "proposed"),
    [
        ({"slip": (0.0, 0.6)}, "repeat the drive at another load_N"),
        ({"slip": (0.0, 0.6), "load_N": (50.0, 150.0)}, "vary slip with load_N held constant"),
        ({"load_N": (50.0, 150.0)}, "vary slip with load_N held constant"),
    ],
)
def test_what_was_driven_already_is_not_proposed(fitted, varied, proposed):
    assert propose_drive(drive(fitted, **varied), "slip") == proposed
