"""Listens to a recording's sound as it streams by: class evidence under the wheels, in constant memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier
from ..framework.core.evidence import ClassEvidence
from ..framework.core.recording.types import SoundBlock, SoundStream
from .classify import noise_model, sound_evidence
from .features import HOP_S
from .quality import NoiseModel

_RUN_BLOCKS = 64


@dataclass(frozen=True)
class SoundEvidence:
    """What m windows of sound are evidence of; each from `start_s` to `end_s` (m,) on the recording's clock [s]."""

    start_s: np.ndarray
    end_s: np.ndarray
    evidence: ClassEvidence


def listen(sound_stream: SoundStream, model: TerrainClassifier) -> Iterator[SoundEvidence]:
    """Classify streamed sound in windows of `WINDOW_S` that start `HOP_S` apart.

    Memory is that of about half a minute of sound, however long the recording. A stretch that could not be read, or
    that is missing between two blocks, comes as one item that is unknown, with the reason.

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
    run: list[SoundBlock] = []
    fresh = 0
    expected_s: float | None = None
    for block in sound_stream.blocks(HOP_S, HOP_S):
        gap_s = 0.0 if expected_s is None else block.start_s - expected_s
        expected_s = block.start_s + HOP_S
        if run and (block.samples is None or abs(gap_s) > 1.5 / rate or len(run) > _RUN_BLOCKS):
            if fresh:
                yield _hear(run, rate, model, noise)
            whole = block.samples is not None and abs(gap_s) <= 1.5 / rate
            # The last half window is also the first half of the next one, unless the sound breaks off there.
            run, fresh = (run[-1:] if whole else []), 0
        if gap_s > 1.5 / rate:
            yield _nothing(block.start_s - gap_s, block.start_s, "no sound was recorded", model)
        if block.samples is None:
            yield _nothing(block.start_s, block.start_s + HOP_S, block.problem or "sound could not be read", model)
        else:
            run.append(block)
            fresh += 1
    if fresh:
        yield _hear(run, rate, model, noise)


def _hear(run: list[SoundBlock], rate: int, model: TerrainClassifier, noise: NoiseModel) -> SoundEvidence:
    recorded = [block.samples if block.channels is None else block.channels for block in run]
    samples = np.concatenate([piece for piece in recorded if piece is not None])
    start_s, end_s, evidence = sound_evidence(samples, rate, model, noise)
    return SoundEvidence(run[0].start_s + start_s, run[0].start_s + end_s, evidence)


def _nothing(start_s: float, end_s: float, reason: str, model: TerrainClassifier) -> SoundEvidence:
    return SoundEvidence(np.array([start_s]), np.array([end_s]), ClassEvidence.nothing(model.classes, [(reason,)]))
