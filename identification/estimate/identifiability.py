"""What the data determine, what they do not, and what driving would."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...framework.core.soil import PARAMETERS, PLAUSIBLE, PUBLISHED, Quantity, ShearStrength
from ..mechanics.stresses import FINE
from ..mechanics.textbook import PEAK_SHARE, TextbookWheel
from .intervals import Intervals
from .solution import Solution

SHARE_OF_STRENGTH = 0.25
"""Cohesion or friction is separable if its half interval is below this share of the shear strength [-]."""

_TWO_SIDED = 1.96

GROSSLY_WRONG = 3.0
"""Misfit beyond which nothing counts as determined: what is left out of the model weighs more than the noise [-]."""

MOST_OF_SOILS = 0.5
"""Nothing whose interval spans more than this share of what soils have is separable, however little it matters [-]."""

_SOILS_HAVE = {"c_Pa": PLAUSIBLE["c_Pa"], **PUBLISHED}

FACTOR = 2.0
"""k, stiffness or n is separable if its interval is within this factor of its value [-]."""


def strengths(
    solution: Solution, covariance: np.ndarray, intervals: Intervals, model: TextbookWheel
) -> tuple[ShearStrength, ...]:
    """Shear strength, Eq. 1, at the 10th, 50th and 90th percentile of the mean normal stress under the rim.

    The interval is the projection of the likelihood region: along the profile of cohesion (of friction, where cohesion
    is held) as far as that goes, and across it by what is left of the variance. Where c and phi are not separable it
    stays tight, because only their sum enters.
    """
    vector = solution.fit.vector
    values = model.from_vector(vector[: len(model.names)])
    answer = []
    for stress in np.percentile(_mean_stress(solution.fit.theta_1, values, model), [10.0, 50.0, 90.0]):
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


def _mean_stress(theta_1: np.ndarray, values: dict[str, float], model: TextbookWheel) -> np.ndarray:
    """Normal stress [Pa] averaged over the contact, (n,): both zones of Eq. 8-9 have the same average."""
    nodes, weights = FINE
    ahead = theta_1[:, None] * (1.0 - (1.0 - PEAK_SHARE) * nodes)
    depth = np.maximum(np.cos(ahead) - np.cos(theta_1)[:, None], 0.0)
    aspect = model.wheel.radius_m / model.wheel.width_m
    return values["stiffness_Pa"] * ((aspect * depth) ** values["n"] @ weights)


def is_search_limit(name: str, value: float) -> bool:
    """Say whether an end of an interval is only where the search stops (`PLAUSIBLE`), not what the data say.

    Zero cohesion and zero friction are limits of nature, and count as ends.
    """
    low, high = PLAUSIBLE[name]
    return math.isclose(value, high, rel_tol=1e-6) or (low > 0.0 and math.isclose(value, low, rel_tol=1e-6))


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
            answer[name] = _TWO_SIDED * quantity.sd <= most
        elif name == "phi_rad":
            slope = 1.0 / math.cos(quantity.value) ** 2
            answer[name] = _TWO_SIDED * quantity.sd * slope * middle.normal_stress_Pa <= most
        else:
            answer[name] = quantity.high <= FACTOR * quantity.value and quantity.low >= quantity.value / FACTOR
    return answer


def _spans_soils(name: str, quantity: Quantity) -> bool:
    """Say whether an interval holds most of the values that soils have; of k and stiffness `FACTOR` says enough."""
    if name not in _SOILS_HAVE:
        return False
    low, high = _SOILS_HAVE[name]
    return min(quantity.high, high) - max(quantity.low, low) > MOST_OF_SOILS * (high - low)


def advise(channels: np.ndarray, determined: Mapping[str, bool], covariance: np.ndarray, misfit: float) -> str:
    """Say what driving would determine what these data do not; empty where nothing is missing.

    Parameters
    ----------
    channels : (n, 5)
        Load [N], torque [N m], sinkage [m], slip [-], drawbar pull [N].
    determined
        From `separable`.
    covariance : (p, p)
        Of the parameter vector.
    misfit
        As in `SoilEstimate`.
    """
    if misfit > GROSSLY_WRONG:
        return "find out first what the model leaves out: until then no driving determines its parameters"
    advice = []
    load, slip = channels[:, 0], channels[:, 3]
    low_slip, high_slip = np.nanpercentile(slip, [5.0, 95.0])
    if not (determined["c_Pa"] and determined["phi_rad"]):
        sd = np.sqrt(np.maximum(np.diag(covariance)[:2], 1e-300))
        correlation = covariance[0, 1] / (sd[0] * sd[1])
        known = "their sum, the shear strength, is known" if correlation < -0.9 else "the samples are too few or noisy"
        which = " and ".join(
            label for name, label in (("c_Pa", "cohesion"), ("phi_rad", "friction")) if not determined[name]
        )
        advice.append(f"{which} not determined by itself ({known}): {_vary_load(load)}")
    if not determined["k_m"]:
        advice.append(
            f"the shear modulus k is not determined: drive at slips from 0.02 to 0.3 (driven {low_slip:.2f} to "
            f"{high_slip:.2f})"
        )
    if not (determined["stiffness_Pa"] and determined["n"]):
        advice.append(f"stiffness and n are determined only together: {_vary_load(load)}")
    if advice and not np.isfinite(channels[:, 4]).any():
        advice.append("measuring drawbar pull would help all of them")
    elif advice and not np.isfinite(channels[:, 1]).any():
        advice.append("measuring torque would help all of them")
    return "; ".join(advice)


def _vary_load(load: np.ndarray) -> str:
    if not np.isfinite(load).any():
        return "measure the load and vary it by half of its mean or more"
    low, high = np.nanpercentile(load, [5.0, 95.0])
    if high - low >= float(np.nanmean(load)):
        return "drive longer, for the load varies enough as it is"
    return f"vary the load more, by half of its mean or more (driven {low:.0f} to {high:.0f} N)"
