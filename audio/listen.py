"""Listens to a recording's sound as it streams by: class evidence under the wheels, in constant memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier
from ..framework.core.evidence import ClassEvidence
from ..framework.core.recording.types import SoundBlock, SoundStream
from .classify import noise_model, sound_evidence
from .features import HOP_S
from .quality import NoiseModel

_BATCH_WINDOWS = 64
"""Windows are given together up to so many, unless a block is `urgent` [-]."""


@dataclass(frozen=True)
class SoundEvidence:
    """What m windows of sound are evidence of; each from `start_s` to `end_s` (m,) on the recording's clock [s]."""

    start_s: np.ndarray
    end_s: np.ndarray
    evidence: ClassEvidence

    @staticmethod
    def concatenate(parts: Sequence[SoundEvidence]) -> SoundEvidence:
        """Join windows, at least one part."""
        start_s, end_s = (np.concatenate([getattr(part, name) for part in parts]) for name in ("start_s", "end_s"))
        return SoundEvidence(start_s, end_s, ClassEvidence.concatenate([part.evidence for part in parts]))


def listen(sound_stream: SoundStream, model: TerrainClassifier) -> Iterator[SoundEvidence]:
    """Classify streamed sound in windows of `WINDOW_S` that start `HOP_S` apart, each by itself.

    Memory does not grow with the recording. A stretch that could not be read, or that is missing between two blocks,
    comes as one item that is unknown, with the reason. Sound between two such stretches that is shorter than a window
    is a window of its own.

    Yields
    ------
    SoundEvidence
        A few dozen windows at a time, in order of time.

    Raises
    ------
    InputError
        The model is no sound classifier of this version.
    """
    noise = noise_model(model)
    rate = sound_stream.sample_rate
    parts: list[SoundEvidence] = []
    before: SoundBlock | None = None  # the first half of the next window
    is_heard = False  # `before`, in a window
    expected_s: float | None = None
    for block in sound_stream.blocks(HOP_S, HOP_S):
        gap_s = 0.0 if expected_s is None else block.start_s - expected_s
        expected_s = block.start_s + HOP_S
        if before is not None and (block.samples is None or abs(gap_s) > 1.5 / rate):
            parts += [] if is_heard else [_hear([before], rate, model, noise)]
            before = None
        if gap_s > 1.5 / rate:
            parts.append(_nothing(block.start_s - gap_s, block.start_s, "no sound was recorded", model))
        if block.samples is None:
            parts.append(_nothing(block.start_s, expected_s, block.problem or "sound could not be read", model))
        else:
            parts += [] if before is None else [_hear([before, block], rate, model, noise)]
            before, is_heard = block, before is not None
        if parts and (block.urgent or len(parts) >= _BATCH_WINDOWS):
            yield SoundEvidence.concatenate(parts)
            parts = []
    if before is not None and not is_heard:
        parts.append(_hear([before], rate, model, noise))
    if parts:
        yield SoundEvidence.concatenate(parts)


def _hear(run: Sequence[SoundBlock], rate: int, model: TerrainClassifier, noise: NoiseModel) -> SoundEvidence:
    recorded = [block.samples if block.channels is None else block.channels for block in run]
    samples = np.concatenate([piece for piece in recorded if piece is not None])
    start_s, end_s, evidence = sound_evidence(samples, rate, model, noise)
    return SoundEvidence(run[0].start_s + start_s, run[0].start_s + end_s, evidence)


def _nothing(start_s: float, end_s: float, reason: str, model: TerrainClassifier) -> SoundEvidence:
    return SoundEvidence(np.array([start_s]), np.array([end_s]), ClassEvidence.nothing(model.classes, [(reason,)]))
