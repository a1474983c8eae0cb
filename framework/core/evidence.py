"""What a sense says about the terrain class, and how far it is to be trusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

UNKNOWN = "unknown"
"""The answer where no class may be named."""


@dataclass(frozen=True)
class ClassEvidence:
    """Class probabilities for n ground cells or sound windows, each with a quality and its reasons.

    The same type carries one item or thousands: what is on a hot path is never one object a sample.

    Parameters
    ----------
    classes
        Names of the k classes, sorted.
    probabilities : (n, k)
        Calibrated class probabilities [-]. A row of an ``unknown`` item is uniform.
    quality : (n,)
        Weight of the item in an opinion pool, in [0, 1] [-]: 0 when a gate closed, 1 where its probabilities are right
        as they stand.
    unknown : (n,)
        True where a gate closed: no class may be named.
    reasons
        n tuples of short phrases that say why quality is low; empty where nothing is wrong.
    """

    classes: tuple[str, ...]
    probabilities: np.ndarray
    quality: np.ndarray
    unknown: np.ndarray
    reasons: tuple[tuple[str, ...], ...]

    def __post_init__(self) -> None:
        n = len(self.quality)
        if self.probabilities.shape != (n, len(self.classes)) or len(self.unknown) != n or len(self.reasons) != n:
            raise ValueError(
                f"evidence of {n} items needs ({n}, {len(self.classes)}) probabilities, {n} unknown flags and {n} "
                f"reasons, got {self.probabilities.shape}, {len(self.unknown)} and {len(self.reasons)}"
            )

    def __len__(self) -> int:
        return len(self.quality)

    def labels(self) -> list[str]:
        """Give the most probable class of each item, or ``"unknown"``: n names."""
        if not self.classes:
            return [UNKNOWN] * len(self)
        best = np.argmax(self.probabilities, axis=1)
        return [UNKNOWN if closed else self.classes[index] for index, closed in zip(best, self.unknown, strict=True)]

    def select(self, rows: np.ndarray | slice) -> ClassEvidence:
        """Give the items of a boolean mask, an index array or a slice, as new evidence."""
        index = np.arange(len(self))[rows]
        return ClassEvidence(
            self.classes, self.probabilities[index], self.quality[index], self.unknown[index],
            tuple(self.reasons[item] for item in index.tolist()),
        )  # fmt: skip

    def as_rows(
        self, file: str | Path, start_s: np.ndarray | None = None, end_s: np.ndarray | None = None
    ) -> list[dict]:
        """Lay n items out as rows of `bevameter classify` (CONTRACTS.md).

        Parameters
        ----------
        file
            What they are of.
        start_s, end_s : (n,)
            Their stretches of it [s]; absent where an item is of the whole file.
        """

        def seconds(times: np.ndarray | None, item: int) -> float | None:
            return None if times is None else round(float(times[item]), 6)

        return [
            {
                "file": str(file),
                "start_s": seconds(start_s, item),
                "end_s": seconds(end_s, item),
                "class": name,
                "probabilities": dict(zip(self.classes, self.probabilities[item].tolist(), strict=True)),
                "quality": float(self.quality[item]),
                "unknown": bool(self.unknown[item]),
                "reasons": list(self.reasons[item]),
            }
            for item, name in enumerate(self.labels())
        ]

    @staticmethod
    def nothing(classes: Sequence[str], reasons: Sequence[tuple[str, ...]]) -> ClassEvidence:
        """Evidence that says nothing: every item unknown, for the reasons given (one tuple an item)."""
        n, k = len(reasons), len(classes)
        return ClassEvidence(
            tuple(classes), np.full((n, k), 1.0 / max(k, 1)), np.zeros(n), np.ones(n, dtype=bool), tuple(reasons)
        )

    @staticmethod
    def concatenate(parts: Sequence[ClassEvidence]) -> ClassEvidence:
        """Join evidence over the same classes; raises `ValueError` where the classes differ or nothing is given."""
        if not parts:
            raise ValueError("no evidence to join")
        if any(part.classes != parts[0].classes for part in parts):
            raise ValueError("evidence to be joined is over different classes")
        return ClassEvidence(
            parts[0].classes,
            np.concatenate([part.probabilities for part in parts]),
            np.concatenate([part.quality for part in parts]),
            np.concatenate([part.unknown for part in parts]),
            tuple(reason for part in parts for reason in part.reasons),
        )
