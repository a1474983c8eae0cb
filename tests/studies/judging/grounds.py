"""What only drives over several grounds have to tell: where a cause acts, what it belongs to, the soil of each ground.

Of the answer's `missing`: `where` is ``""`` for an effect that acts everywhere, ``"on NAME only"``, NAME being a class
or a wheel, or ``"by class"``, on all classes but on each in its own way; `belongs_to` is ``"ground"`` or ``"vehicle"``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

Z95 = 1.959964
"""Half the width of a 95 % interval in standard deviations."""

SOIL = ("c_Pa", "phi_rad")
"""Parameters of a ground's soil that are scored."""


def score_of_drive(truth: Mapping[str, Any], answer: Mapping[str, Any], understood: bool) -> dict[str, Any]:
    """Score what only drives have.

    Parameters
    ----------
    truth
        Its `grounds`: class, start_s, end_s and soil of each; of each effect `where` it acts (``"everywhere"``,
        ``{"class": name}`` or ``{"wheel": name}``) and what it `belongs_to`.
    answer
        Likewise, with `soil` as value and sd of each parameter.
    understood
        Whether soils are scored: there is no cause, or one was named rightly.

    Returns
    -------
    dict
        `of_drive`; `acts_on` (where a single effect acts), `where_right` (for each hidden effect that is named, where
        it acts and whether that was told), `belongs_right` (of the most probable name; None where nothing was named or
        both are hidden), `soil_intervals` (whether each ground's interval holds the truth, by parameter).
    """
    grounds = truth.get("grounds")
    if grounds is None:
        return {"of_drive": False, "acts_on": None, "where_right": [], "belongs_right": None, "soil_intervals": {}}
    effects = truth["effects"]
    return {
        "of_drive": True,
        "acts_on": _place(effects[0]["where"])[0] if len(effects) == 1 else None,
        "where_right": _where(effects, answer),
        "belongs_right": _belongs(effects, answer),
        "soil_intervals": _soils(grounds, answer.get("grounds") or ()) if understood else {},
    }


def _place(where: str | Mapping[str, str]) -> tuple[str, str]:
    """Give what a truth's effect is confined to, class or wheel, and its name."""
    return (where, "") if isinstance(where, str) else next(iter(where.items()))


def _where(effects: Sequence[Mapping[str, Any]], answer: Mapping[str, Any]) -> list[tuple[str, bool]]:
    """Of each hidden effect that the answer lists: is it said to act there, and there only?

    Of several forms of it the most probable one counts.
    """
    told = []
    for effect in effects:
        items = [item for item in answer["missing"] if item["effect"] == effect["effect"]]
        if not items:
            continue
        said = _most_probable(items).get("where") or ""
        only = re.fullmatch(r"on (.+) only", said)
        kind, name = _place(effect["where"])
        told.append((kind, only is None if kind == "everywhere" else only is not None and only[1] == name))
    return told


def _belongs(effects: Sequence[Mapping[str, Any]], answer: Mapping[str, Any]) -> bool | None:
    owners = {effect["belongs_to"] for effect in effects}
    items = [item for item in answer["missing"] if item["kind"] != "unknown"]
    if len(owners) != 1 or not items:
        return None
    return _most_probable(items).get("belongs_to") in owners


def _most_probable(items: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    return max(items, key=lambda item: float(item.get("probability") or 0.0))


def _soils(grounds: Sequence[Mapping[str, Any]], answered: Sequence[Mapping[str, Any]]) -> dict[str, list[bool]]:
    """Does the interval, value +- 1.96 sd, of each ground's soil hold the truth?

    A ground is that of the answer of its class that overlaps it most; one that the answer lacks, or whose soil it does
    not give, is not counted.
    """
    held: dict[str, list[bool]] = {name: [] for name in SOIL}
    for ground in grounds:
        same = [each for each in answered if each.get("class") == ground["class"] and _overlap(ground, each) > 0.0]
        if not same:
            continue
        soil = max(same, key=lambda each: _overlap(ground, each)).get("soil") or {}
        for name in SOIL:
            estimate = soil.get(name) or {}
            if estimate.get("value") is None or estimate.get("sd") is None:
                continue
            half = Z95 * float(estimate["sd"])
            low, high = float(estimate["value"]) - half, float(estimate["value"]) + half
            low = max(low, 0.0) if name == "c_Pa" else low
            held[name].append(bool(low <= ground["soil"][name] <= high))
    return held


def _overlap(one: Mapping[str, Any], other: Mapping[str, Any]) -> float:
    """Give how long both last at a time [s]; an end that is not stated is open."""
    start = one["start_s"] if other.get("start_s") is None else max(one["start_s"], float(other["start_s"]))
    end = one["end_s"] if other.get("end_s") is None else min(one["end_s"], float(other["end_s"]))
    return float(end - start)
