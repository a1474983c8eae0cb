"""The truth of a concealed recording, for JSON: seen by the scorer and never by the tool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .drives import Plan
from .effects import Effect
from .effects_ground import SoilPatch
from .mechanics import Channels, Ground
from .strength import LEVELS, Found
from .table import Recorded
from .turns import Track
from .weighing import Case, Refit, soil

COMPARABLE: dict[tuple[str, str], dict[str, tuple[str, float]]] = {
    ("slip_sinkage", "exponent"): {"n1": ("n1", 0.0)},
    ("stress_peak_shift", "forward"): {"a1": ("a1", 0.0)},
    ("stress_peak_shift", "balanced"): {"a0": ("a0", 0.0), "a1": ("a1", 0.0)},
    ("exit_angle", "proportional"): {"s": ("exit_ratio", 0.0)},
    ("shear_hump", "residual"): {"K_r": ("residual_ratio", 0.0)},
    ("slope_gravity", "mass"): {"m": ("mass_kg", 0.0)},
    ("slope_gravity", "load"): {"s": ("load_share", 0.0)},
    ("inertia", "both"): {"J": ("wheel_inertia_kg_m2", 0.0), "m": ("mass_kg", 0.0)},
    ("inertia", "wheel"): {"J": ("wheel_inertia_kg_m2", 0.0)},
    ("inertia", "carriage"): {"m": ("mass_kg", 0.0)},
    ("drivetrain_friction", "viscous"): {"b_v": ("viscous_Nms", 0.0)},
    ("torque_offset", "constant"): {"T_0": ("offset_Nm", 0.0)},
    ("torque_gain", "constant"): {"g": ("gain", -1.0)},
    ("load_gain", "constant"): {"g": ("gain", -1.0)},
    ("sinkage_offset", "constant"): {"z_0": ("offset_m", 0.0)},
    ("rolling_radius", "constant"): {"e": ("radius_ratio", -1.0)},
    ("time_lag", "delay"): {"tau": ("lag_s", 0.0)},
}
"""By slug and form, the names that the answer gives to parameters of the same meaning: the generator's own name, and
what is added to its value. Parameters of other forms have no counterpart and are not compared."""


def truth_of(
    seed: int, level: str, plan: Plan, kind: str, case: Case, found: Sequence[Found], shares: Sequence[float],
    textbook: Refit,
) -> dict:  # fmt: skip
    """Give the truth: effects, soil, strength, protocol, and the fit of the textbook to it."""
    reached = all(f.reached for f in found) and all(share > 0.3 for share in shares)
    return {
        "schema": 1,
        "seed": seed,
        "level": level if found else "null",
        "asked_nats": LEVELS[level] if found else 0.0,
        "nats": textbook.nats,
        "reached": reached,
        "reason": "; ".join(f"{f.effect.slug}: {f.reason}" for f in found if f.reason),
        "protocol": plan.protocol,
        "rate_Hz": plan.rate_Hz,
        "soil_kind": kind,
        "columns": list(plan.columns),
        "soil": soil_dict(case.ground),
        "textbook_soil": soil_dict(soil(textbook.parameters)),
        "textbook_r2": dict(zip(case.names, np.round(textbook.r2, 5).tolist(), strict=True)),
        "soil_known": bool(case.known),
        "variation": {
            "stiffness_sd": case.variation.stiffness_sd,
            "strength_sd": case.variation.strength_sd,
            "length_m": case.variation.length_m,
        },
        "noise": {name: case.sensors.deviation(name) for name in ("load_N", *case.names)},
        "effects": [
            effect_dict(f, case.names, shares[index] if shares else None, plan.track) for index, f in enumerate(found)
        ],
    }


def soil_dict(ground: Ground) -> dict[str, float]:
    """Give a soil's parameters by the names of the contracts."""
    return {name: float(getattr(ground, name)) for name in ("c_Pa", "phi_rad", "k_m", "stiffness_Pa", "n")}


def effect_dict(found: Found, answers: Sequence[str], share: float | None, track: Track | None) -> dict:
    """Give one hidden effect, and where its interval lies on a track that turns."""
    effect = found.effect
    places = _places(effect, track)
    return {
        "effect": effect.slug,
        "kind": effect.kind,
        "form": effect.form,
        "parameters": effect.parameters(),
        "comparable": {
            name: effect.parameters()[own] + shift
            for name, (own, shift) in COMPARABLE.get((effect.slug, effect.form), {}).items()
        },
        "magnitude": effect.magnitude,
        "nats_alone": found.nats,
        "share_beside_the_other": share,
        "channels": list(right_channels(effect, answers)),
        "variables": [*places] or list(effect.variables),
        "places": places,
    }


def _places(effect: Effect, track: Track | None) -> dict[str, list[float]]:
    """Give the interval of a patch, by the variables of place; empty for other effects."""
    if not isinstance(effect, SoilPatch):
        return {}
    interval = [effect.start_m, effect.end_m]
    if track is None:
        return {"x_m": interval}
    x, y = track.at(np.linspace(effect.start_m, effect.end_m, 100)).T.tolist()
    return {"distance_m": interval, "x_m": [min(x), max(x)], "y_m": [min(y), max(y)]}


def right_channels(effect: Effect, answers: Sequence[str]) -> tuple[str, ...]:
    """Channels where the mismatch may rightly be located."""
    own = getattr(effect, "channel", None)
    if own is not None:
        return (own,)
    return tuple(name for name in effect.channels if name in answers or name in ("load_N", "slip"))


def oracle_rmse(case: Case, recorded: Recorded, oracle: Channels) -> dict[str, float]:
    """Give the root-mean-square error of the true model with the soil's mean, by answer, on sound rows."""
    errors = {}
    for name in case.names:
        off = recorded.columns[name] - getattr(oracle, name)
        off = off[recorded.sound & np.isfinite(off)]
        errors[name] = float(np.sqrt(np.mean(off**2)))
    return errors
