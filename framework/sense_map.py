"""What the senses observe of a recording's ground, summed up cell by cell as it arrives; how far looks go together.

Memory grows with the ground covered, not with the length of the recording.
"""

from __future__ import annotations

import re
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .core.cell_sums import CLOSED, OPEN, QQ, SQUARES, CellSums, Q
from .core.evidence import ClassEvidence
from .core.pooling import cell_keys, centred_logs, sums_by
from .senses import Observation

Progress = Callable[[str, float], None]
"""Called with the name of a stage and the share of it that is done, in [0, 1]. What it raises ends the work."""

CORRELATION_RANGE = (1.0 / 3.0, 1.0)
"""Bounds of the correlation between looks [-]. The lower one allows at most three independent looks: what a whole
stretch of ground has in common (wet, in shadow) looks like its class to the estimate of rho, which is then too low."""

PRIOR_CORRELATION, PRIOR_CELLS = 0.8, 20.0
"""Correlation assumed before any data [-], and the number of repeatedly seen cells it is worth."""

_NOWHERE = "where no place was recorded"
_BUFFER_LOOKS, _RECENT_CELLS = 100_000, 10_000
_MAX_REASONS = 32
_OTHER = "other reasons"
_PATH, _REMARK, _NUMBER = (
    re.compile(r"^\S*[/\\].*?: "),
    re.compile(r"\s*\([^()]*\)"),
    re.compile(r"(?<!\w)-?\d+(?:\.\d+)?|\d+(?:\.\d+)?"),
)


@dataclass
class SenseRecord:
    """What one sense did during a recording.

    Parameters
    ----------
    sense
        Its instrument: ``"camera"``.
    name
        Its name: ``"vision"``.
    map
        What it observed of the ground.
    items
        Looks at a cell (camera) or windows of time.
    opened
        How many of them had an open gate.
    quality_sum
        Sum of the open ones' qualities [-].
    said
        How many open items named a class, by class.
    closed, doubted
        How many items were closed, or open with a reservation, by reason.
    absent
        Why the sense was not there at all; empty where it was.
    """

    sense: str
    name: str
    map: SenseMap
    items: int = 0
    opened: int = 0
    quality_sum: float = 0.0
    said: Counter[str] = field(default_factory=Counter)
    closed: Counter[str] = field(default_factory=Counter)
    doubted: Counter[str] = field(default_factory=Counter)
    absent: str = ""

    def add(self, observation: Observation) -> None:
        """Take n items into the counts, and into the map where they are of cells of the ground."""
        evidence, item = observation.evidence, observation.item
        is_open = ~evidence.unknown & (evidence.quality > 0)
        self.items += len(evidence)
        self.opened += int(is_open.sum())
        self.quality_sum += float(evidence.quality[is_open].sum())
        best = np.argmax(evidence.probabilities[is_open], axis=1)
        for index, number in enumerate(np.bincount(best, minlength=len(evidence.classes)).tolist()):
            if number:
                self.said[evidence.classes[index]] += number
        for texts, one_open in zip(evidence.reasons, is_open.tolist(), strict=True):
            if texts:
                (self.doubted if one_open else self.closed).update(map(kind_of_reason, texts))
        if nowhere := len(evidence) - len(np.unique(item)):
            self.doubted[_NOWHERE] += nowhere
        self.map.add(observation.cells, evidence.select(item), observation.time_s[item])


class SenseMap:
    """What one sense saw of the ground, summed up cell by cell as it arrives; threads may share it.

    Parameters
    ----------
    sense
        Its name in reasons: ``"camera"``.
    """

    def __init__(self, sense: str):
        self.sense = sense
        self.classes: tuple[str, ...] = ()
        self.reason_names: list[str] = []
        self._settled, self._recent = CellSums.none(), CellSums.none()
        self._buffer: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
        self._buffered = 0
        self._lock = threading.RLock()

    def add(self, cells: np.ndarray, evidence: ClassEvidence, time_s: np.ndarray) -> None:
        """Take in m looks.

        Parameters
        ----------
        cells : (m, 2)
            The cell of each look.
        evidence
            The m looks. All calls of one sense are over the same classes.
        time_s : (m,)
            When [s].

        Raises
        ------
        ValueError
            The classes differ from those of an earlier call.
        """
        if not len(evidence):
            return
        quality = np.where(evidence.unknown, 0.0, evidence.quality)
        finite = np.isfinite(evidence.probabilities).all(axis=1) & np.isfinite(quality)
        quality = np.where(finite, np.clip(quality, 0.0, 1.0), 0.0)
        logs = centred_logs(np.where(finite[:, None], evidence.probabilities, 1.0))
        with self._lock:
            self._check_classes(evidence.classes)
            reason = self._reason_ids(evidence.reasons, quality <= 0.0)
            self._buffer.append((cell_keys(cells), quality, logs, reason, np.asarray(time_s, dtype=float)))
            self._buffered += len(evidence)
            if self._buffered >= _BUFFER_LOOKS:
                self._sum_up()

    def _check_classes(self, classes: tuple[str, ...]) -> None:
        if not self.classes:
            self.classes = classes
        elif classes != self.classes:
            raise ValueError(f"{self.sense}: evidence over {classes}, earlier over {self.classes}")

    def _reason_ids(self, reasons: Sequence[tuple[str, ...]], closed: np.ndarray) -> np.ndarray:
        ids = np.full(len(reasons), -1)
        for row in np.flatnonzero(closed).tolist():
            name = ", ".join(kind_of_reason(text) for text in reasons[row]) or "quality 0"
            if name not in self.reason_names:
                name = name if len(self.reason_names) < _MAX_REASONS - 1 else _OTHER
                if name not in self.reason_names:
                    self.reason_names.append(name)
            ids[row] = self.reason_names.index(name)
        return ids

    def _sum_up(self) -> None:
        """Add what is buffered to the recent sums."""
        if not self._buffer:
            return
        keys, quality, logs, reason, time_s = (np.concatenate(part) for part in zip(*self._buffer, strict=True))
        self._buffer, self._buffered = [], 0
        union, row = np.unique(keys, return_inverse=True)
        looks = np.column_stack(
            [quality > 0, quality <= 0, quality, quality**2, quality * np.sum(logs**2, axis=1)]
        ).astype(float)
        counts = np.zeros((len(union), len(self.reason_names)))
        closed = reason >= 0
        np.add.at(counts, (row[closed], reason[closed]), 1.0)
        last = np.full(len(union), -np.inf)
        np.maximum.at(last, row, time_s)
        sums, weighted = (sums_by(row, each, len(union)) for each in (looks, quality[:, None] * logs))
        self._recent = self._recent.plus(CellSums(union, sums, weighted, counts, last))

    def settle(self) -> CellSums:
        """Give the sums over the looks since the last time that this was called."""
        with self._lock:
            self._sum_up()
            recent, self._recent = self._recent, CellSums.none()
            self._settled = self._settled.plus(recent)
            return recent

    def restore(self, sums: CellSums, classes: tuple[str, ...], reason_names: Sequence[str]) -> None:
        """Take in sums that `settle` gave of another map of this sense, whose reasons these were."""
        with self._lock:
            self._check_classes(classes)
            self.reason_names += [name for name in reason_names if name not in self.reason_names]
            reasons = np.zeros((len(sums.keys), len(self.reason_names)))
            reasons[:, [self.reason_names.index(name) for name in reason_names]] = sums.reasons
            self._recent = self._recent.plus(replace(sums, reasons=reasons))
            if len(self._recent.keys) > _RECENT_CELLS:
                self.settle()

    def summed(self, among: np.ndarray | None = None) -> SummedLooks:
        """Give the sums over all looks so far, one row a cell that was looked at; only of those `among` keys if any."""
        with self._lock:
            self._sum_up()
            settled, recent, names = self._settled, self._recent, tuple(self.reason_names)
        if among is not None:
            settled, recent = settled.among(among), recent.among(among)
        cells = settled.plus(recent)
        total = cells.sums[:, Q]
        safe = np.where(total > 0, total, 1.0)
        logs = cells.logs if len(cells.keys) else np.empty((0, len(self.classes)))
        mean_logs = np.where(total[:, None] > 0, logs / safe[:, None], 0.0)
        kish = np.where(total > 0, total**2 / np.where(total > 0, cells.sums[:, QQ], 1.0), 0.0)
        within = cells.sums[:, SQUARES] - total * np.sum(mean_logs**2, axis=1)
        return SummedLooks(
            sense=self.sense,
            classes=self.classes,
            keys=cells.keys,
            looks=cells.sums[:, OPEN].astype(np.int64),
            closed=cells.sums[:, CLOSED].astype(np.int64),
            weight=np.where(total > 0, cells.sums[:, QQ] / safe, 0.0),
            total_quality=total,
            kish=kish,
            mean_logs=mean_logs,
            within_squares=np.maximum(within, 0.0),
            last_s=cells.last_s,
            sums=cells,
            reason_names=names,
        )


@dataclass(frozen=True)
class SummedLooks:
    """What one sense saw of n cells: see `SenseMap.summed`.

    Parameters
    ----------
    sense
        Its name.
    classes
        Names of the k classes that it knows.
    keys : (n,)
        The cells, as `cell_keys`, sorted.
    looks, closed : (n,)
        How many looks had an open gate, and how many a closed one.
    weight : (n,)
        Quality-weighted mean quality of the open looks [-].
    total_quality : (n,)
        Sum of their qualities [-].
    kish : (n,)
        Their effective number, were they independent [-].
    mean_logs : (n, k)
        Their quality-weighted mean centred log-probabilities.
    within_squares : (n,)
        Quality-weighted sum of squares about that mean.
    last_s : (n,)
        Time of the last look, open or closed [s].
    sums, reason_names
        What they are of.
    """

    sense: str
    classes: tuple[str, ...]
    keys: np.ndarray
    looks: np.ndarray
    closed: np.ndarray
    weight: np.ndarray
    total_quality: np.ndarray
    kish: np.ndarray
    mean_logs: np.ndarray
    within_squares: np.ndarray
    last_s: np.ndarray
    sums: CellSums
    reason_names: tuple[str, ...]

    @property
    def closed_reason(self) -> tuple[str, ...]:
        """Why most of the closed looks at each cell were closed, n texts; empty where none was."""
        return self.sums.main_reasons(self.reason_names)


def kind_of_reason(text: str) -> str:
    """Leave out of a reason what differs from item to item (file, numbers, remarks in brackets), so that it counts."""
    text = _REMARK.sub("", _PATH.sub("", text))
    return _NUMBER.sub("…", text).strip()


def look_correlation(summed: SummedLooks) -> float:
    """Estimate how far looks of one sense at one cell go together, given the class [-].

    The intraclass correlation of a one-way random-effects model on the centred log-probabilities: variance between
    cells of the same class against that between looks at one cell. The class is the sense's own verdict on the cell.
    Shrunk towards `PRIOR_CORRELATION`, and kept in `CORRELATION_RANGE`.
    """
    several = summed.looks >= 2
    cells = int(several.sum())
    if not cells:
        return PRIOR_CORRELATION
    total, kish = summed.total_quality[several], summed.kish[several]
    logs = summed.mean_logs[several]
    freedom = np.sum(total * (1.0 - 1.0 / kish))
    within = np.sum(summed.within_squares[several]) / max(freedom, 1e-12)
    verdict = np.argmax(logs, axis=1)
    k = len(summed.classes)
    count = np.bincount(verdict, minlength=k)
    means = sums_by(verdict, logs, k) / np.maximum(count, 1)[:, None]
    spread = np.sum((logs - means[verdict]) ** 2) / max(cells - np.count_nonzero(count), 1)
    between = max(spread - within * float(np.mean(1.0 / kish)), 0.0)
    estimate = between / (between + within) if between + within > 0 else 1.0
    shrunk = (cells * estimate + PRIOR_CELLS * PRIOR_CORRELATION) / (cells + PRIOR_CELLS)
    return float(np.clip(shrunk, *CORRELATION_RANGE))
