"""How rough the ground is: height profiles along two parallel tracks, by terrain class.

The one-sided spectrum of height is C n^-N over the spatial frequency n [cycles/m]. ISO 8608 writes it as
G_d(0.1) (n / 0.1)^-w. Ground is taken to be isotropic. The coherence of two tracks then follows from the spectrum: that
of V. D. Kamash and J. D. Robson, J. Sound Vib. 57 (1978), 89-100.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy import fft
from scipy.special import kv

STEP_M = 0.01
"""Distance between the points of a profile [m]."""

LONGEST_M = 20.0
"""Longest wavelength of a profile [m]: longer waves are slopes of the ground, which `wheels.slope` gives."""

SPREAD = 0.35
"""Standard deviation of ln C between places of one class [-]: the factor of 4 of a class of ISO 8608, taken as 4 sd."""


@dataclass(frozen=True)
class Roughness:
    """The spectrum of a class's height: C [m^2 / (cycles/m)] at 1 cycle/m, exponent N [-], and where it is from."""

    coefficient: float
    exponent: float
    source: str


def _iso(class_mean_m3: float, exponent: float, source: str) -> Roughness:
    """Give the roughness of a geometric mean G_d(0.1) of a class of ISO 8608."""
    return Roughness(class_mean_m3 * 0.1**exponent, exponent, source)


ROUGHNESS: dict[str, Roughness] = {
    "asphalt": Roughness(4.8e-7, 2.1, "Wong 2010, chapter 7, table of C_sp and N: smooth highway"),
    "gravel": Roughness(4.4e-6, 2.1, "Wong 2010, chapter 7, table of C_sp and N: highway with gravel"),
    "grass": Roughness(3.0e-4, 1.6, "Wong 2010, chapter 7, table of C_sp and N: pasture"),
    "loam": Roughness(6.5e-4, 1.6, "Wong 2010, chapter 7, table of C_sp and N: plowed field"),
    "sand": _iso(4096e-6, 2.5, "ISO 8608 class E; exponent chosen: loose grains hold no short steep waves"),
    "clay": _iso(1024e-6, 2.0, "ISO 8608 class D and its exponent; the class chosen, as of a dry lake's bed"),
}
"""By class name."""


def profiles(terrain: str, length_m: float, apart_m: float, rng: np.random.Generator) -> np.ndarray:
    """Draw the heights of two parallel tracks over ground of one class in one place.

    Parameters
    ----------
    terrain
        One of `ROUGHNESS`.
    length_m
        Length of the tracks [m].
    apart_m
        Distance between them [m].
    rng
        Source of randomness: another draw is another place.

    Returns
    -------
    (2, n)
        Heights [m], `STEP_M` apart, of mean 0.
    """
    rough = ROUGHNESS[terrain]
    coefficient = rough.coefficient * math.exp(rng.normal(0.0, SPREAD))
    count = cast("int", fft.next_fast_len(math.ceil((length_m + LONGEST_M) / STEP_M) + 1, real=True))
    frequency = fft.rfftfreq(count, STEP_M)
    waves = frequency >= 1.0 / LONGEST_M
    power = np.zeros(len(frequency))
    power[waves] = coefficient * frequency[waves] ** -rough.exponent
    shared = np.ones(len(frequency))
    shared[waves] = coherence(frequency[waves], apart_m, rough.exponent)
    common, left, right = rng.standard_normal((3, len(frequency), 2)).view(complex)[..., 0]
    # One-sided power S of a mode is |X|^2 2 / (count fs), X of irfft's scaling; |noise|^2 is 2 on average.
    size = np.sqrt(power * count / STEP_M) / 2.0
    own = np.sqrt(1.0 - shared)
    modes = size * (np.sqrt(shared) * common + own * np.stack([left, right]))
    return np.asarray(fft.irfft(modes, count))[:, : math.ceil(length_m / STEP_M) + 1]


def coherence(frequency: np.ndarray, apart_m: float, exponent: float) -> np.ndarray:
    """Cross spectrum over spectrum of two parallel tracks of isotropic ground, (n,) [-].

    Parameters
    ----------
    frequency : (n,)
        Spatial frequency along the tracks, above 0 [cycles/m].
    apart_m
        Distance between the tracks [m].
    exponent
        N of the spectrum n^-N [-].
    """
    order, turn = exponent / 2.0, 2.0 * np.pi * frequency * apart_m
    bessel = np.asarray(kv(order, turn), dtype=float)
    return np.clip(2.0 ** (1.0 - order) / math.gamma(order) * turn**order * bessel, 0.0, 1.0)


def pressed(heights: np.ndarray, contact_m: float) -> np.ndarray:
    """Give the heights (k, n) that a wheel of a contact length meets [m]: their mean, weighted by a parabolic pressure.

    The footprint's average of K. M. Captain, A. B. Boghani and D. N. Wormley, Vehicle System Dynamics 8 (1979), 1-32.
    """
    half = max(round(0.5 * contact_m / STEP_M), 1)
    weight = 1.0 - (np.arange(-half, half + 1) / (half + 1.0)) ** 2
    padded = np.pad(heights, ((0, 0), (half, half)), mode="edge")
    return np.stack([np.convolve(row, weight / weight.sum(), mode="valid") for row in padded])
