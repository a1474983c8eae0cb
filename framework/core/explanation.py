"""What explanations share, of wheel and of sound: what is missing, how probable it is, and the verdict on it."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

import numpy as np

from .quantities import finite_or_none

Verdict = Literal["none", "physics", "instrument", "unknown", "cannot_tell"]
"""``"none"``: nothing beyond noise. ``"cannot_tell"``: something, whose possible causes the data do not separate."""

UNKNOWN = "unknown"
"""Slug and kind of what the catalogue lacks."""

ASSERTED = 0.8
"""Probability from which on an effect is asserted [-]."""

Hypothesis = TypeVar("Hypothesis", bound=Hashable)


@dataclass(frozen=True)
class Estimate:
    """A value, its standard deviation and their unit; NaN where a number is not known."""

    value: float
    sd: float = math.nan
    unit: str = ""

    def to_json(self) -> dict[str, Any]:
        """Give them by name; null where a number is not known."""
        numbers = {"value": finite_or_none(self.value), "sd": finite_or_none(self.sd)}
        return numbers | ({"unit": self.unit} if self.unit else {})


@dataclass(frozen=True)
class Missing:
    """Something that was left out, with its share of the probability.

    `kind` is ``"physics"``, ``"instrument"`` or ``"unknown"``; `form` says which published form, or which channel;
    `where` on which wheel or class of ground it acts, if not everywhere; `belongs_to` is ``"ground"`` or ``"vehicle"``.
    """

    effect: str
    kind: str
    form: str
    probability: float
    parameters: dict[str, Estimate]
    equation: str
    source: str
    indistinguishable_from: tuple[str, ...] = ()
    would_tell: str = ""
    description: str = ""
    where: str = ""
    belongs_to: str = ""

    def to_json(self) -> dict[str, Any]:
        """Lay it out as an entry of the documented JSON's `missing` (CONTRACTS.md)."""
        return {
            "effect": self.effect, "kind": self.kind, "form": self.form, "probability": self.probability,
            "where": self.where, "belongs_to": self.belongs_to or None,
            "parameters": estimates_json(self.parameters), "equation": self.equation, "source": self.source,
            "indistinguishable_from": list(self.indistinguishable_from), "would_tell": self.would_tell,
            **({"description": self.description} if self.description else {}),
        }  # fmt: skip


def estimates_json(estimates: Mapping[str, Estimate]) -> dict[str, Any]:
    """Lay estimates out by name."""
    return {name: each.to_json() for name, each in estimates.items()}


def verdict_of(missing: Iterable[Missing]) -> Verdict:
    """Give the verdict on what is listed: where something unknown is more probable than not, names are conditional on a
    model that is incomplete, and none of them is the answer.
    """
    listed = tuple(missing)
    sure = [each for each in listed if each.probability >= ASSERTED]
    if not listed:
        return "none"
    if any(each.kind == UNKNOWN and each.probability > 0.5 for each in listed):
        return "unknown"
    if not sure:
        return "cannot_tell"
    return "physics" if any(each.kind == "physics" for each in sure) else "instrument"


def posterior(log_weights: Mapping[Hypothesis, float]) -> dict[Hypothesis, float]:
    """Give posterior probabilities of hypotheses from ln of prior times evidence, up to a common constant [nats]."""
    whole = np.logaddexp.reduce(list(log_weights.values()))
    return {each: float(np.exp(value - whole)) for each, value in log_weights.items()}


def probability(log_evidence: float, prior: float) -> float:
    """Give the posterior probability of one effect [-] against its absence.

    Parameters
    ----------
    log_evidence
        Ln of the evidence with it over that without it [nats].
    prior
        Prior probability [-].
    """
    return posterior({True: log_evidence + math.log(prior), False: math.log(1.0 - prior)})[True]
