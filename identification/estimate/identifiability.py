"""What the data determine, what they do not, and what driving would."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ...framework.core.soil import PARAMETERS, PLAUSIBLE, PUBLISHED, Quantity, ShearStrength
from ...framework.core.vehicle import Wheel
from ..mechanics.soil import from_internal
from ..mechanics.stresses import FINE
from ..mechanics.textbook import PEAK_SHARE
from .intervals import Intervals
from .solution import Solution

SHARE_OF_STRENGTH = 0.25
"""Cohesion or friction is separable if its half interval is below this share of the shear strength [-]."""

TWO_SIDED = 1.96
"""Standard deviations in half of a 95 % interval of a normal distribution [-]."""

GROSSLY_WRONG = 3.0
"""Misfit beyond which nothing counts as determined: what is left out of the model weighs more than the noise [-]."""

MOST_OF_SOILS = 0.5
"""Nothing whose interval spans more than this share of what soils have is separable, however little it matters [-]."""

_SOILS_HAVE = {"c_Pa": PLAUSIBLE["c_Pa"], **PUBLISHED}

_ENOUGH = 0.5
"""Range of the load, as a share of its mean, from which on more of it is not what lacks [-]."""

_LOW_SLIP, _HIGH_SLIP = 0.05, 0.3
"""Slips between which most of the shear stress builds up on soils of usual k [-]."""

FACTOR = 2.0
"""k, stiffness or n is separable if its interval is within this factor of its value [-]."""


def strengths(
    solution: Solution, covariance: np.ndarray, intervals: Intervals, wheel: Wheel
) -> tuple[ShearStrength, ...]:
    """Shear strength, Eq. 1, at the 10th, 50th and 90th percentile of the mean normal stress under the rim.

    The interval is the projection of the likelihood region: along the profile of cohesion (of friction, where cohesion
    is held) as far as that goes, and across it by what is left of the variance. Where c and phi are not separable it
    stays tight, because only their sum enters.
    """
    vector = solution.fit.vector
    values = {name: from_internal(name, value) for name, value in zip(PARAMETERS, vector.tolist(), strict=False)}
    answer = []
    for stress in np.percentile(mean_stress(solution.fit.theta_1, values, wheel), [10.0, 50.0, 90.0]):
        gradient = np.array([1.0, stress])
        value = float(gradient @ vector[:2])
        along = next((index for index in (0, 1) if index in intervals.ends), None)
        if along is None:
            answer.append(ShearStrength(float(stress), value, value, value))
            continue
        cross = float(gradient @ covariance[:2, along])
        across = float(gradient @ covariance[:2, :2] @ gradient) - cross**2 / max(covariance[along, along], 1e-300)
        across = solution.quantile * math.sqrt(max(across, 0.0))
        reached = [value, *(float(gradient @ end[:2]) for end in intervals.ends[along])]
        low = value - math.hypot(value - min(reached), across)
        high = value + math.hypot(max(reached) - value, across)
        answer.append(ShearStrength(float(stress), value, max(low, 0.0), high))
    return tuple(answer)


def wald_strengths(
    stresses_Pa: np.ndarray, mean: np.ndarray, covariance: np.ndarray, quantile: float
) -> tuple[ShearStrength, ...]:
    """Shear strength, Eq. 1, at normal stresses [Pa], with intervals of so many standard deviations.

    `mean` (2,) and `covariance` (2, 2) are those of c [Pa] and tan phi.
    """
    answer = []
    for stress in stresses_Pa.tolist():
        gradient = np.array([1.0, stress])
        value = float(gradient @ mean)
        half = quantile * math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))
        answer.append(ShearStrength(stress, value, max(value - half, 0.0), value + half))
    return tuple(answer)


def mean_stress(theta_1: np.ndarray, values: dict[str, float], wheel: Wheel) -> np.ndarray:
    """Normal stress [Pa] averaged over the contact, (n,): both zones of Eq. 8-9 have the same average."""
    nodes, weights = FINE
    ahead = theta_1[:, None] * (1.0 - (1.0 - PEAK_SHARE) * nodes)
    depth = np.maximum(np.cos(ahead) - np.cos(theta_1)[:, None], 0.0)
    aspect = wheel.radius_m / wheel.width_m
    return values["stiffness_Pa"] * ((aspect * depth) ** values["n"] @ weights)


def is_search_limit(name: str, value: float) -> bool:
    """Say whether an end of an interval is only where the search stops (`PLAUSIBLE`), not what the data say.

    Zero cohesion and zero friction are limits of nature, and count as ends.
    """
    low, high = PLAUSIBLE[name]
    return math.isclose(value, high, rel_tol=1e-6) or (low > 0.0 and math.isclose(value, low, rel_tol=1e-6))


def is_unbounded(strength: ShearStrength, quantities: Mapping[str, Quantity]) -> bool:
    """Say whether the upper end of a shear strength is only where the search for cohesion or friction stops."""
    if strength.high_Pa >= PLAUSIBLE["c_Pa"][1] * (1.0 - 1e-6):
        return True
    steepest = PLAUSIBLE["phi_rad"][1]
    most = strength.normal_stress_Pa * math.tan(steepest) * (1.0 - 1e-6)
    return is_search_limit("phi_rad", quantities["phi_rad"].high) and strength.high_Pa >= most


def separable(
    quantities: Mapping[str, Quantity], strength: tuple[ShearStrength, ...], free: np.ndarray, misfit: float
) -> dict[str, bool]:
    """Say of each parameter whether the data determine it by itself; none where the model is grossly wrong."""
    if misfit > GROSSLY_WRONG:
        return {name: not free[index] for index, name in enumerate(PARAMETERS)}
    middle = strength[len(strength) // 2]
    most = SHARE_OF_STRENGTH * middle.value_Pa
    answer = {}
    for index, name in enumerate(PARAMETERS):
        quantity = quantities[name]
        if not free[index]:
            answer[name] = True
        elif _spans_soils(name, quantity):
            answer[name] = False
        elif name == "c_Pa":
            answer[name] = TWO_SIDED * quantity.sd <= most
        elif name == "phi_rad":
            slope = 1.0 / math.cos(quantity.value) ** 2
            answer[name] = TWO_SIDED * quantity.sd * slope * middle.normal_stress_Pa <= most
        else:
            answer[name] = quantity.high <= FACTOR * quantity.value and quantity.low >= quantity.value / FACTOR
    return answer


def _spans_soils(name: str, quantity: Quantity) -> bool:
    """Say whether an interval holds most of the values that soils have; of k and stiffness `FACTOR` says enough."""
    if name not in _SOILS_HAVE:
        return False
    low, high = _SOILS_HAVE[name]
    return min(quantity.high, high) - max(quantity.low, low) > MOST_OF_SOILS * (high - low)


def advise(
    channels: np.ndarray, determined: Mapping[str, bool], strength: Sequence[ShearStrength], misfit: float
) -> str:
    """Say what driving would determine what these data do not; empty where nothing is missing.

    Parameters
    ----------
    channels : (n, 5)
        Load [N], torque [N m], sinkage [m], slip [-], drawbar pull [N].
    determined
        From `separable`.
    strength
        Shear strength at low, middle and high stress.
    misfit
        As in `SoilEstimate`.
    """
    if misfit > GROSSLY_WRONG:
        return "find out first what the model leaves out: until then no driving determines its parameters"
    advice = []
    load, slip = channels[:, 0], channels[:, 3]
    low_slip, high_slip = np.nanpercentile(slip, [5.0, 95.0])
    if not (determined["c_Pa"] and determined["phi_rad"]):
        labels = [label for name, label in (("c_Pa", "cohesion"), ("phi_rad", "friction")) if not determined[name]]
        middle = strength[len(strength) // 2]
        known = middle.high_Pa - middle.low_Pa <= 2.0 * SHARE_OF_STRENGTH * middle.value_Pa
        together = ", though the shear strength c + sigma tan(phi) is" if known else ", nor is the shear strength"
        verb = "is" if len(labels) == 1 else "are"
        advice.append(f"{' and '.join(labels)} {verb} not determined{together}: {_vary_load(load)}")
    if not determined["k_m"]:
        advice.append(f"the shear modulus k is not determined: {_vary_slip(float(low_slip), float(high_slip))}")
    if not (determined["stiffness_Pa"] and determined["n"]):
        which = [label for name, label in (("stiffness_Pa", "stiffness"), ("n", "n")) if not determined[name]]
        verb = "is" if len(which) == 1 else "are"
        advice.append(f"{' and '.join(which)} {verb} not determined: {_vary_load(load)}")
    if advice and not np.isfinite(channels[:, 4]).any():
        advice.append("measuring drawbar pull would help all of them")
    elif advice and not np.isfinite(channels[:, 1]).any():
        advice.append("measuring torque would help all of them")
    return "; ".join(advice)


def _vary_load(load: np.ndarray) -> str:
    if not np.isfinite(load).any():
        return "measure the load and vary it by half of its mean or more, by payload or on slopes"
    low, high = np.nanpercentile(load, [5.0, 95.0])
    if high - low >= _ENOUGH * float(np.nanmean(load)):
        return f"record more rows, for the load varies enough ({low:.0f} to {high:.0f} N)"
    return f"vary the load by half of its mean or more, by payload or on slopes (now {low:.0f} to {high:.0f} N)"


def _vary_slip(low: float, high: float) -> str:
    """Say which slips show how shear stress builds up, where these do not span them."""
    if low <= _LOW_SLIP and high >= _HIGH_SLIP:
        return f"record more rows, for slip varies enough ({low:.2f} to {high:.2f})"
    return f"measure at slips from {_LOW_SLIP:g} to {_HIGH_SLIP:g}, too (now {low:.2f} to {high:.2f})"
