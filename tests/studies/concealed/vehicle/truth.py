"""The truth of a drive, for JSON: seen by the scorer and never by the tool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..strength import LEVELS, Found
from ..truth import effect_dict, soil_dict
from ..weighing import Refit, soil
from .confined import Confined
from .counting import Counted
from .faults import COMPARABLE, belongs_to
from .grounds import Stretches
from .journey import Journey


def truth_of(
    seed: int, level: str, journey: Journey, stretches: Stretches, counted: Counted, confined: Sequence[Confined],
    found: Sequence[Found], shares: Sequence[float], textbook: Refit,
) -> dict:  # fmt: skip
    """Give the truth: effects and where they act, grounds with their soils, strength."""
    names = counted.cases[0].names
    starts, ends = journey.borders_s[:-1].tolist(), journey.borders_s[1:].tolist()
    grounds = zip(stretches.classes, starts, ends, stretches.soils, textbook.parameters, counted.cases, strict=True)
    effects = []
    for index, (each, strength) in enumerate(zip(confined, found, strict=True)):
        slug, form = each.effect.slug, each.effect.form
        one = effect_dict(strength, names, shares[index] if shares else None, journey.path)
        own = COMPARABLE.get((slug, form), {})
        one["comparable"] |= {name: one["parameters"][key] + shift for name, (key, shift) in own.items()}
        effects.append({**one, "where": each.where, "belongs_to": belongs_to(slug)})
    return {
        "schema": 1,
        "seed": seed,
        "level": level if found else "null",
        "asked_nats": LEVELS[level] if found else 0.0,
        "nats": textbook.nats,
        "reached": all(f.reached for f in found) and all(share > 0.3 for share in shares),
        "reason": "; ".join(f"{f.effect.slug}: {f.reason}" for f in found if f.reason),
        "protocol": "drive",
        "columns": list(journey.columns),
        "grounds": [
            {
                "class": name, "start_s": start, "end_s": end, "soil": soil_dict(own),
                "textbook_soil": soil_dict(soil(fitted)),
                "variation": {
                    "stiffness_sd": case.variation.stiffness_sd, "strength_sd": case.variation.strength_sd,
                    "length_m": case.variation.length_m,
                },
            }
            for name, start, end, own, fitted, case in grounds
        ],
        "textbook_r2": dict(zip(names, np.round(textbook.r2, 5).tolist(), strict=True)),
        "effects": effects,
    }  # fmt: skip
