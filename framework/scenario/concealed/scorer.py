"""How well an explanation (the JSON of `bevameter explain`, CONTRACTS.md) answers a concealed recording's truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

VERDICTS = ("none", "physics", "instrument", "unknown", "cannot_tell")

Z95 = 1.959964
"""Half the width of a 95 % interval in standard deviations."""

LOOK_ALIKE_PROBABILITY = 0.5
"""A look-alike that is named where the true effect is not in the catalogue has to be below this."""

MOST_ALIKE = 6
"""A longer list of effects said to be indistinguishable names nothing."""

COMPARABLE: Mapping[tuple[str, str], tuple[str, ...]] = {
    ("slip_sinkage", "exponent"): ("n1",),
    ("stress_peak_shift", "forward"): ("a1",),
    ("stress_peak_shift", "balanced"): ("a0", "a1"),
    ("exit_angle", "proportional"): ("exit_ratio",),
    ("exit_angle", "rebound"): ("rebound_ratio",),
    ("shear_hump", "residual"): ("residual_ratio",),
    ("rate_dependence", "power"): ("exponent",),
    ("multipass_compaction", "exponential"): ("stiffness_gain", "saturation_passes"),
    ("slope_gravity", "mass"): ("mass_kg",),
    ("slope_gravity", "load"): ("load_share",),
    ("inertia", "both"): ("wheel_inertia_kg_m2", "mass_kg"),
    ("inertia", "wheel"): ("wheel_inertia_kg_m2",),
    ("inertia", "carriage"): ("mass_kg",),
    ("drivetrain_friction", "viscous"): ("viscous_Nms",),
    ("torque_offset", "constant"): ("offset_Nm",),
    ("torque_gain", "constant"): ("gain",),
    ("load_gain", "constant"): ("gain",),
    ("sinkage_offset", "constant"): ("offset_m",),
    ("rolling_radius", "constant"): ("radius_ratio",),
    ("time_lag", "delay"): ("lag_s",),
}
"""Parameters that mean the same in whichever program fits them, by slug and form; others are not compared."""


def score(
    truth: Mapping[str, Any], answer: Mapping[str, Any] | None, seconds: float | None = None,
    same: Mapping[str, str] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Score one answer.

    Parameters
    ----------
    truth
        `ConcealedRecording.truth`.
    answer
        What `explain` gave, or None where it failed: then nothing is right, and nothing is falsely named.
    seconds
        How long it took, where it was measured from outside [s].
    same
        The answer's names of parameters, ``"slug.name"``, by this module's, where they differ.

    Returns
    -------
    dict
        For JSON. A measure that does not apply to this recording is None: `named`, `named_count`, `indistinguishable`,
        `falsely_named`, `false_alarm`, `kind_right`, `first_kind_right`, `both_named`, `located_channel`,
        `located_variable`, `intervals` (a list of whether each comparable parameter's 95 % interval holds the truth),
        `error_ratio` (held-out error after, over the oracle's, by channel), `statements` (probability and whether it is
        right), `seconds`.
    """
    hidden = [effect["effect"] for effect in truth["effects"]]
    result: dict[str, Any] = {
        "seed": truth["seed"], "level": truth["level"], "protocol": truth["protocol"], "hidden": hidden,
        "forms": [effect["form"] for effect in truth["effects"]], "reached": truth["reached"],
        "failed": answer is None, "verdict": None if answer is None else answer["verdict"],
    }  # fmt: skip
    answer = answer if answer is not None else {"verdict": "failed", "missing": [], "located": [], "fit": {}}
    asserted = [item["effect"] for item in answer["missing"]]
    result["asserted"] = asserted
    result |= _naming(hidden, answer)
    result["kind_right"], result["first_kind_right"] = _kind(truth, answer)
    result |= _location(truth, answer)
    result["intervals"] = _intervals(truth, answer, same or {})
    result["error_ratio"] = _error_ratio(truth, answer)
    result["statements"] = _statements(hidden, answer)
    result["seconds"] = answer.get("seconds") if seconds is None else seconds
    return result


def _group(item: Mapping[str, Any]) -> set[str]:
    """Give an asserted effect with all that it is said to be indistinguishable from, where these are few."""
    group = {item["effect"], *item.get("indistinguishable_from", ())}
    return group if len(group) <= MOST_ALIKE else {item["effect"]}


def _naming(hidden: Sequence[str], answer: Mapping[str, Any]) -> dict[str, Any]:
    """Which of the hidden effects were named, outright or within a group said to be indistinguishable.

    An answer "cannot_tell" names the whole of its list as one group.
    """
    items = answer["missing"]
    undecided = answer["verdict"] == "cannot_tell"
    if not hidden:
        return {
            "named": None, "named_count": None, "indistinguishable": None, "falsely_named": None, "both_named": None,
            "false_alarm": None if answer["verdict"] == "failed" else answer["verdict"] != "none",
        }  # fmt: skip
    outright = set() if undecided else {item["effect"] for item in items}
    groups = set().union(*(_group(item) for item in items)) if items else set()
    if undecided and len(groups) > MOST_ALIKE:
        groups = set()
    found = [slug for slug in hidden if slug in groups]
    wrong = not undecided and any(not _group(item) & set(hidden) for item in items)
    return {
        "named": bool(found) and not wrong,
        "named_count": len(found),
        "indistinguishable": any(slug not in outright for slug in found),
        "falsely_named": wrong,
        "both_named": len(found) == 2 if len(hidden) == 2 else None,
        "false_alarm": None,
    }


def _kind(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> tuple[bool | None, bool | None]:
    """Was physics told from instruments, by all that is listed and by the most probable name of it?

    None where nothing of either kind was asserted, or both are hidden: where nothing was found, nothing was told. By
    all, an undecided answer is right only if all that it lists is of one kind.
    """
    kinds = {effect["kind"] for effect in truth["effects"]}
    if len(kinds) != 1 or not answer["missing"]:
        return None, None
    first = max(answer["missing"], key=lambda item: float(item.get("probability") or 0.0))
    return {item["kind"] for item in answer["missing"]} == kinds, first["kind"] in kinds


def _location(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> dict[str, bool | None]:
    """Are the channel and the variable with the greatest share right ones, and the patch's place?

    Only what was located counts; none located where an effect is hidden is wrong.
    """
    if not truth["effects"]:
        return {"located_channel": None, "located_variable": None, "located_interval": None}
    channels = set().union(*(effect["channels"] for effect in truth["effects"]))
    variables = set().union(*(effect["variables"] for effect in truth["effects"]))
    located = sorted(answer["located"], key=lambda item: -float(item.get("share") or 0.0))
    if not located:
        return {"located_channel": False, "located_variable": False, "located_interval": _place(truth, located)}
    return {
        "located_channel": located[0]["channel"] in channels,
        "located_variable": located[0]["variable"] in variables,
        "located_interval": _place(truth, located),
    }


def _place(truth: Mapping[str, Any], located: Sequence[Mapping[str, Any]]) -> bool | None:
    """Does the interval located along the track overlap the hidden patch by more than half of the shorter of both?"""
    patches = [effect["places"] for effect in truth["effects"] if effect["effect"] == "soil_patch"]
    if not patches:
        return None
    spots = [item for item in located if item["variable"] in patches[0]]
    if not spots:
        return False
    low, high = float(spots[0]["from"]), float(spots[0]["to"])
    start, end = patches[0][spots[0]["variable"]]
    return min(high, end) - max(low, start) > 0.5 * min(high - low, end - start)


def _intervals(truth: Mapping[str, Any], answer: Mapping[str, Any], same: Mapping[str, str]) -> list[bool]:
    """Does each comparable parameter's interval, value +- 1.96 sd or low to high, hold the truth?

    Only effects that are named outright count, and only those parameters whose name the answer gives.
    """
    if answer["verdict"] == "cannot_tell":
        return []
    given = {item["effect"]: item.get("parameters") or {} for item in answer["missing"]}
    held = []
    for effect in truth["effects"]:
        slug = effect["effect"]
        for name in COMPARABLE.get((slug, effect["form"]), ()):
            estimate = given.get(slug, {}).get(same.get(f"{slug}.{name}", name))
            if not isinstance(estimate, Mapping) or estimate.get("sd") is None:
                continue
            low = estimate.get("low", estimate["value"] - Z95 * estimate["sd"])
            high = estimate.get("high", estimate["value"] + Z95 * estimate["sd"])
            held.append(bool(low <= effect["parameters"][name] <= high))
    return held


def _error_ratio(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> dict[str, float]:
    """Give the held-out error after, over the error of the oracle that knows effect and soil, by channel."""
    channels = (answer.get("fit") or {}).get("channels") or {}
    return {
        name: float(channels[name]["rmse_after"]) / oracle
        for name, oracle in truth["oracle_rmse"].items()
        if channels.get(name, {}).get("rmse_after") is not None and oracle > 0.0
    }


def _statements(hidden: Sequence[str], answer: Mapping[str, Any]) -> list[tuple[float, bool]]:
    """Give each asserted effect's probability, and whether that effect is hidden."""
    return [
        (float(item["probability"]), item["effect"] in hidden)
        for item in answer["missing"]
        if item.get("probability") is not None
    ]


def score_left_out(truth: Mapping[str, Any], answer: Mapping[str, Any] | None) -> dict[str, Any]:
    """Score an answer of a tool whose catalogue lacks what is hidden.

    `right` where the verdict is ``unknown``, or where every effect named has a low probability; `silent` where nothing
    was found, which is no confident wrong name either; `confident_wrong` otherwise.
    """
    base = {
        "seed": truth["seed"], "level": truth["level"], "protocol": truth["protocol"],
        "hidden": [effect["effect"] for effect in truth["effects"]], "reached": truth["reached"],
        "failed": answer is None, "verdict": None if answer is None else answer["verdict"],
    }  # fmt: skip
    if answer is None:
        return {**base, "asserted": [], "right": False, "silent": False, "confident_wrong": False}
    likely = [item for item in answer["missing"] if float(item.get("probability") or 0.0) >= LOOK_ALIKE_PROBABILITY]
    confident = bool(likely) and answer["verdict"] in ("physics", "instrument")
    silent = answer["verdict"] == "none"
    return {
        **base, "asserted": [item["effect"] for item in answer["missing"]], "right": not confident and not silent,
        "silent": silent, "confident_wrong": confident,
    }  # fmt: skip
