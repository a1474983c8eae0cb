"""Number of lugs found from a comb of lines, in whitened spectra with known lines."""

import numpy as np
import pytest
from bevameter.audio.explain.alignment import Aligned, null_of
from bevameter.audio.explain.combs import find_comb


def spectra(rng: np.random.Generator, lines: dict[float, float]) -> Aligned:
    """Noise in 160 blocks of 20 stretches, 2000 bins of 1 Hz, with lines at orders of so many times its power more."""
    stretch = np.repeat(np.arange(20), 8)
    speed = np.repeat(rng.uniform(1.0, 1.8, 20), 8) * rng.uniform(0.98, 1.02, 160)
    power = np.ones((160, 2000))
    for order, more in lines.items():
        at = np.floor(order * speed + 0.5).astype(int)
        inside = np.flatnonzero(at < 2000)
        power[inside, at[inside]] += more
    multiples = np.arange(3.0, 1050.0, 0.25)
    return Aligned("order", rng.exponential(power), speed, 1.0, 20, stretch, multiples)


def lugs_found(rng: np.random.Generator, lines: dict[float, float]) -> int:
    family = spectra(rng, lines)
    comb = find_comb(family, null_of(family, rng))
    return 0 if comb is None else comb.lugs


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("lugs", [11, 15, 29])
def test_lugs_are_counted_from_harmonics_near_a_resonance_only(lugs, seed):
    ringing = {float(order): 1.5 for order in range(lugs, 1050, lugs) if 550 < order < 1000}
    assert lugs_found(np.random.default_rng([seed, lugs]), ringing) == lugs


@pytest.mark.parametrize("seed", range(4))
def test_a_divisor_of_the_number_of_lugs_is_not_found(seed):
    heard = {float(order): 1.0 for order in range(45, 1050, 45)}
    assert lugs_found(np.random.default_rng(seed), heard) == 45


@pytest.mark.parametrize("seed", range(6))
def test_noise_and_a_few_strong_lines_are_no_comb(seed):
    rng = np.random.default_rng(seed)
    assert lugs_found(rng, {}) == 0
    assert lugs_found(rng, {float(order): 30.0 for order in (210, 420, 630, 840)}) == 0
    assert lugs_found(rng, {171.0: 200.0, 342.0: 200.0}) == 0
