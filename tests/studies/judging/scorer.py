"""How well an explanation (the JSON of `bevameter explain`, CONTRACTS.md) answers a recording's truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .grounds import Z95, score_of_drive

CONFIDENT = 0.8
"""From this probability on a wrong name is a confident one [-]."""

MOST_ALIKE = 6
"""A longer list of effects said to be indistinguishable names nothing."""

BEYOND = "beyond"
"""The name, in a truth, of a cause that no catalogue holds."""


def score(
    truth: Mapping[str, Any], answer: Mapping[str, Any] | None, seconds: float | None = None, left_out: bool = False
) -> dict[str, Any]:
    """Score one answer.

    Parameters
    ----------
    truth
        `level`, `effects` and, where they are known, `reached`, `oracle_rmse` and `grounds`. Of each effect `effect`
        (its slug, or ``"beyond"``), `kind` and, where they are known, `channels` and `variables` that rightly locate
        it, `places` (of a patch of soil) and `comparable` (true values by the answer's names of parameters).
    answer
        What `explain` gave, or None where it failed: then nothing is right, and nothing is falsely named.
    seconds
        How long it took [s].
    left_out
        Whether the tool's catalogue lacked the effects, so that every name is wrong.

    Returns
    -------
    dict
        For JSON. `case` is ``"null"``, ``"single"``, ``"pair"``, ``"beyond"`` or ``"left_out"``. A measure that does
        not apply is None or empty: `named` (one effect at least, and nothing falsely), `both_named`,
        `indistinguishable`, `falsely_named`, `false_alarm`, `kind_right`, `first_kind_right`, `located_channel`,
        `located_variable`, `located_interval`, `confident_wrong`, `silent`, `intervals` (whether each comparable
        parameter's 95 % interval holds the truth), `error_ratio` (held-out error after, over the oracle's, by
        channel), `statements` (probability and whether it is right), `seconds`; and those of
        `grounds.score_of_drive`.
    """
    hidden = [effect["effect"] for effect in truth["effects"]]
    case = "left_out" if left_out else "beyond" if BEYOND in hidden else ("null", "single", "pair")[len(hidden)]
    result: dict[str, Any] = {
        "case": case, "level": truth["level"], "hidden": hidden, "reached": truth.get("reached", True),
        "failed": answer is None, "verdict": None if answer is None else answer["verdict"], "seconds": seconds,
    }  # fmt: skip
    answer = answer if answer is not None else {"verdict": "failed", "missing": [], "located": [], "fit": {}}
    result["asserted"] = [(item["effect"], item.get("probability")) for item in answer["missing"]]
    catalogued = case in ("single", "pair")
    result |= _naming(hidden, answer) if catalogued else dict.fromkeys(_NAMING)
    result |= _location(truth, answer) if catalogued else dict.fromkeys(_LOCATION)
    result["kind_right"], result["first_kind_right"] = _kind(truth, answer) if catalogued else (None, None)
    result["false_alarm"] = answer["verdict"] != "none" if case == "null" and not result["failed"] else None
    result["confident_wrong"] = result["silent"] = None
    if case in ("beyond", "left_out"):
        result["confident_wrong"] = _confident_wrong([] if left_out else hidden, answer)
        result["silent"] = answer["verdict"] == "none"
    result["intervals"] = _intervals(truth, answer) if catalogued else []
    result["error_ratio"] = _error_ratio(truth, answer) if catalogued else {}
    result["statements"] = [] if left_out else _statements(hidden, answer)
    return result | score_of_drive(truth, answer, case == "null" or bool(result["named"]))


_NAMING = ("named", "both_named", "indistinguishable", "falsely_named")
_LOCATION = ("located_channel", "located_variable", "located_interval")


def _names(answer: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Give what the answer names; that something is unknown is no name."""
    return [item for item in answer["missing"] if item["kind"] != "unknown"]


def _group(item: Mapping[str, Any]) -> set[str]:
    """Give an asserted effect with all that it is said to be indistinguishable from, where these are few."""
    group = {item["effect"], *item.get("indistinguishable_from", ())}
    return group if len(group) <= MOST_ALIKE else {item["effect"]}


def _naming(hidden: Sequence[str], answer: Mapping[str, Any]) -> dict[str, Any]:
    """Which of the hidden effects were named, outright or within a group said to be indistinguishable.

    An answer "cannot_tell" names the whole of its list as one group; "unknown" names nothing, whatever it mentions.
    """
    items = _names(answer) if answer["verdict"] != "unknown" else []
    undecided = answer["verdict"] == "cannot_tell"
    outright = set() if undecided else {item["effect"] for item in items}
    groups = set().union(*(_group(item) for item in items))
    if undecided and len(groups) > MOST_ALIKE:
        groups = set()
    found = [slug for slug in hidden if slug in groups]
    wrong = not undecided and any(not _group(item) & set(hidden) for item in items)
    return {
        "named": bool(found) and not wrong,
        "both_named": len(found) == 2 if len(hidden) == 2 else None,
        "indistinguishable": any(slug not in outright for slug in found),
        "falsely_named": wrong,
    }


def _confident_wrong(hidden: Sequence[str], answer: Mapping[str, Any]) -> bool:
    """Is an effect asserted with confidence that neither is hidden nor looks like one that is?"""
    if answer["verdict"] in ("unknown", "cannot_tell"):
        return False
    sure = [item for item in _names(answer) if float(item.get("probability") or 0.0) >= CONFIDENT]
    return any(not _group(item) & set(hidden) for item in sure)


def _kind(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> tuple[bool | None, bool | None]:
    """Was the kind, physics or instrument, right, by all that is listed and by its most probable name?

    None where nothing of either kind was asserted, or both are hidden. By all, an undecided answer is right only if all
    that it lists is of one kind.
    """
    kinds = {effect["kind"] for effect in truth["effects"]}
    if len(kinds) != 1 or not answer["missing"]:
        return None, None
    first = max(answer["missing"], key=lambda item: float(item.get("probability") or 0.0))
    return {item["kind"] for item in answer["missing"]} == kinds, first["kind"] in kinds


def _location(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> dict[str, bool | None]:
    """Are the channel and the variable with the greatest share right ones, and the patch's place?

    None located is wrong.
    """
    located = sorted(answer["located"], key=lambda item: -float(item.get("share") or 0.0))

    def right(member: str) -> bool | None:
        wanted = set().union(*(effect.get(f"{member}s", ()) for effect in truth["effects"]))
        return bool(located) and located[0][member] in wanted if wanted else None

    return {
        "located_channel": right("channel"),
        "located_variable": right("variable"),
        "located_interval": _place(truth, located),
    }


def _place(truth: Mapping[str, Any], located: Sequence[Mapping[str, Any]]) -> bool | None:
    """Does the interval located along the track overlap the hidden patch by more than half of the shorter of both?"""
    patches = [effect["places"] for effect in truth["effects"] if effect.get("places")]
    if not patches:
        return None
    spots = [item for item in located if item["variable"] in patches[0]]
    if not spots:
        return False
    low, high = float(spots[0]["from"]), float(spots[0]["to"])
    start, end = patches[0][spots[0]["variable"]]
    return min(high, end) - max(low, start) > 0.5 * min(high - low, end - start)


def _intervals(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> list[bool]:
    """Does each comparable parameter's interval, value +- 1.96 sd or low to high, hold the truth?

    Only effects that are named outright count, and only those parameters whose name the answer gives.
    """
    if answer["verdict"] == "cannot_tell":
        return []
    given = {item["effect"]: item for item in answer["missing"]}
    held = []
    for effect in truth["effects"]:
        item = given.get(effect["effect"], {})
        if "low-pass" in item.get("form", ""):  # its time is no delay
            continue
        for name, value in effect.get("comparable", {}).items():
            estimate = (item.get("parameters") or {}).get(name)
            if not isinstance(estimate, Mapping) or estimate.get("sd") is None:
                continue
            low = estimate.get("low", estimate["value"] - Z95 * estimate["sd"])
            high = estimate.get("high", estimate["value"] + Z95 * estimate["sd"])
            held.append(bool(low <= value <= high))
    return held


def _error_ratio(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> dict[str, float]:
    """Give the held-out error after, over the error of the oracle that knows effect and soil, by channel."""
    channels = (answer.get("fit") or {}).get("channels") or {}
    return {
        name: float(channels[name]["rmse_after"]) / oracle
        for name, oracle in truth.get("oracle_rmse", {}).items()
        if channels.get(name, {}).get("rmse_after") is not None and oracle > 0.0
    }


def _statements(hidden: Sequence[str], answer: Mapping[str, Any]) -> list[tuple[float, bool]]:
    """Give each asserted effect's probability, and whether that effect is hidden; of the unknown likewise."""
    return [
        (float(item["probability"]), item["effect"] in hidden or (item["kind"] == "unknown" and BEYOND in hidden))
        for item in answer["missing"]
        if item.get("probability") is not None
    ]
