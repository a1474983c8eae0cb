"""Evidence of camera, microphone and vibration fused into one belief over classes for each cell of the ground.

How the evidence is put together, for one cell:

1. **Looks of one sense** at the same cell share what they get wrong (the same stone, the same light), so they are
   averaged, not multiplied. With looks whose log-probabilities correlate by rho given the class, the average of n
   looks is worth ``n_eff = n / (1 + (n - 1) rho)`` independent ones (the variance of a mean of equicorrelated values;
   Kish 1965, *Survey Sampling*, section 5.4, "design effect"), and for Gaussian features
   ``n_eff * mean(log p)`` is then exactly the log-posterior of all of them together. Looks are weighted by their
   quality, and n is Kish's ``(sum q)^2 / sum q^2``. rho is estimated from the data (`look_correlation`).
2. **Senses** err independently of each other given the class. They are joined by a logarithmic opinion pool
   (Genest & Zidek 1986, *Statistical Science* 1(1), 114-135, Eq. 3.9, doi:10.1214/ss/1177013825) whose weights are
   their qualities, as learnt when the model was trained (`core.classifier.trust`): a sense of quality 1 counts as in
   Bayes' rule, one of quality 0 or unknown not at all.
3. **Class sets are united.** A class that a sense does not know gets no vote from it: its mass against that of the
   classes the sense knows is left as it was (Jeffrey's rule). It is not set to zero.
   Before any vote a class has the weight of the best sense here that knows it; so where one sense alone is open its
   own verdict comes out, over its own classes.
4. **Contradiction**: where two senses are sharp and name different classes that both know, one of them is wrong
   although its gates were open. The belief's quality is lowered by the product of their sharpnesses.

Evidence is summed up as it arrives, so memory grows with the ground covered, not with the length of the recording.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_softmax

from .core.evidence import ClassEvidence
from .core.pooling import cell_keys, cells_from_keys, pooled, rows_of_keys
from .sense_map import SenseMap, SummedLooks, look_correlation

CONTRADICTION_SAID = 0.25
"""Contradiction from which on it is given as a reason [-]."""


@dataclass(frozen=True)
class Belief(ClassEvidence):
    """What is believed of n ground cells: evidence over the classes that any sense knows, and where it is from.

    The quality is that of the best sense, lowered where the senses contradict each other; unknown is a cell where no
    sense was open.

    Parameters
    ----------
    cells : (n, 2)
        Integer cell indices: cell (i, j) covers ``[i, i + 1) * cell_size_m`` in x and likewise in y.
    sense_weights
        By sense, (n,): the quality with which it voted [-], 0 where it did not.
    looks
        By sense, (n,): how many of its looks had an open gate.
    effective_looks
        By sense, (n,): the number of independent looks that those are worth [-].
    last_seen_s : (n,)
        Time of the last look, open or closed [s]; NaN where there was none.
    """

    cells: np.ndarray
    sense_weights: Mapping[str, np.ndarray]
    looks: Mapping[str, np.ndarray]
    effective_looks: Mapping[str, np.ndarray]
    last_seen_s: np.ndarray

    def rows(self, cells: np.ndarray) -> np.ndarray:
        """Find cells, (m, 2): their rows in this belief, (m,), -1 where a cell is not in it."""
        keys = cell_keys(self.cells)
        order = np.argsort(keys)
        row = rows_of_keys(keys[order], cell_keys(cells))
        return np.where(row < 0, -1, order[row]) if len(self) else row


def fuse(
    maps: Sequence[SenseMap],
    *,
    cells: np.ndarray | None = None,
    only: np.ndarray | None = None,
    correlation: Mapping[str, float] | None = None,
) -> Belief:
    """Fuse what the senses saw into one belief a cell.

    Parameters
    ----------
    maps
        One for each sense. The order does not matter.
    cells : (m, 2), optional
        Further cells to give an answer for, the track's say, though nobody may have looked there.
    only : (m, 2), optional
        Cells to give an answer for, and for no others.
    correlation
        Correlation between looks by sense, in [0, 1] [-]; estimated from the data where absent.

    Returns
    -------
    Belief
        Over all cells that were looked at and those of `cells`, or over those of `only`, in order of cell index.
    """
    known = correlation or {}
    among = None if only is None else np.unique(cell_keys(np.asarray(only)))
    summed = sorted((one.summed(among) for one in maps), key=lambda one: one.sense)
    parts = [one.keys for one in summed] if among is None else [among]
    if cells is not None and len(cells):
        parts.append(cell_keys(np.asarray(cells)))
    keys = np.unique(np.concatenate(parts)) if parts else np.empty(0, dtype=np.int64)
    classes = tuple(sorted({name for one in summed for name in one.classes}))
    votes = [_vote(one, keys, classes, known.get(one.sense)) for one in summed]

    prior = np.zeros((len(keys), len(classes)))
    log_ratio = np.zeros_like(prior)
    for vote in votes:
        prior = np.maximum(prior, vote.weight[:, None] * vote.knows)
        log_ratio += vote.log_ratio
    unknown = prior.sum(axis=1) <= 0.0
    with np.errstate(divide="ignore"):
        logs = np.where(unknown[:, None], 0.0, np.log(prior) + log_ratio)
    best_weight = np.max([vote.weight for vote in votes], axis=0) if votes else np.zeros(len(keys))
    contradiction, said = _contradictions(votes, classes, len(keys))
    return Belief(
        classes=classes,
        cells=cells_from_keys(keys),
        probabilities=pooled(logs),
        quality=np.where(unknown, 0.0, best_weight * (1.0 - contradiction)),
        unknown=unknown,
        reasons=_reasons(votes, unknown, said),
        sense_weights={vote.sense: vote.weight for vote in votes},
        looks={vote.sense: vote.looks for vote in votes},
        effective_looks={vote.sense: vote.effective for vote in votes},
        last_seen_s=_last_seen(summed, keys),
    )


@dataclass(frozen=True)
class _Vote:
    """One sense's vote on all cells: log of (probability times number of its classes), 0 for classes it knows not."""

    sense: str
    knows: np.ndarray
    weight: np.ndarray
    log_ratio: np.ndarray
    probabilities: np.ndarray
    looks: np.ndarray
    effective: np.ndarray
    closed_reason: np.ndarray


def _vote(summed: SummedLooks, keys: np.ndarray, classes: tuple[str, ...], rho: float | None) -> _Vote:
    rho = look_correlation(summed) if rho is None else rho
    row = np.searchsorted(keys, summed.keys)
    column = np.searchsorted(classes, summed.classes)
    n, k = len(keys), max(len(summed.classes), 1)
    effective = summed.kish / (1.0 + np.maximum(summed.kish - 1.0, 0.0) * rho)
    tempered = (summed.weight * effective)[:, None] * summed.mean_logs
    tempered = log_softmax(tempered, axis=1) if tempered.size else tempered

    def spread(values: np.ndarray) -> np.ndarray:
        answer = np.zeros(n)
        answer[row] = values
        return answer

    log_ratio, probabilities = np.zeros((n, len(classes))), np.zeros((n, len(classes)))
    log_ratio[np.ix_(row, column)] = tempered + np.log(k)
    probabilities[np.ix_(row, column)] = np.exp(tempered)
    knows = np.zeros(len(classes))
    knows[column] = 1.0
    reason = np.full(n, "", dtype=object)
    reason[row] = np.asarray(summed.closed_reason, dtype=object)
    return _Vote(
        summed.sense, knows, spread(summed.weight), log_ratio, probabilities, spread(summed.looks).astype(np.int64),
        spread(effective), reason,
    )  # fmt: skip


def _contradictions(votes: Sequence[_Vote], classes: tuple[str, ...], n: int) -> tuple[np.ndarray, dict[int, str]]:
    """How far the senses contradict each other, (n,) in [0, 1], and in words where it is worth saying, by row."""
    worst, said = np.zeros(n), {}
    for index, first in enumerate(votes):
        for second in votes[index + 1 :]:
            if not (first.knows.any() and second.knows.any()):
                continue
            top = [np.argmax(vote.probabilities, axis=1) for vote in (first, second)]
            both_know = (second.knows[top[0]] > 0) & (first.knows[top[1]] > 0)
            apart = (top[0] != top[1]) & both_know & (first.weight > 0) & (second.weight > 0)
            conflict = np.where(apart, _sharpness(first) * _sharpness(second), 0.0)
            for row in np.flatnonzero((conflict >= CONTRADICTION_SAID) & (conflict > worst)):
                said[int(row)] = (
                    f"{first.sense} says {classes[top[0][row]]}, {second.sense} says {classes[top[1][row]]}"
                )
            worst = np.maximum(worst, conflict)
    return worst, said


def _sharpness(vote: _Vote) -> np.ndarray:
    """0 for a uniform vote, 1 for certainty: (n,)."""
    k = vote.knows.sum()
    return np.clip((vote.probabilities.max(axis=1) - 1.0 / k) / max(1.0 - 1.0 / k, 1e-12), 0.0, 1.0)


def _reasons(votes: Sequence[_Vote], unknown: np.ndarray, said: Mapping[int, str]) -> tuple[tuple[str, ...], ...]:
    closed = [
        tuple(f"{vote.sense}: {vote.closed_reason[row]}" for vote in votes if vote.closed_reason[row])
        or ("no sense looked here",)
        if unknown[row]
        else (said[row],)
        if row in said
        else ()
        for row in range(len(unknown))
    ]
    return tuple(closed)


def _last_seen(summed: Sequence[SummedLooks], keys: np.ndarray) -> np.ndarray:
    last = np.full(len(keys), -np.inf)
    for one in summed:
        row = np.searchsorted(keys, one.keys)
        last[row] = np.maximum(last[row], one.last_s)
    return np.where(np.isfinite(last), last, np.nan)
