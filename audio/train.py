"""Trains the ear: from labelled contact sound to a classifier that carries over to another microphone and place."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier, TrainingOutcome
from ..framework.core.classifier.labelled import LabelledFile, readable
from ..framework.core.classifier.signal_to_noise import NOISE_FREE_DB
from ..framework.core.errors import InputError
from ..framework.core.recording.sound import read_sound
from .augment import add_noise, place, varied_window
from .classify import SETTINGS
from .features import FEATURE_NAMES, RATE_HZ, WINDOW_S, cut_windows, resample
from .quality import SILENT_RMS, NoiseModel, features_and_noise, noise_inputs

FILE_WINDOWS = 24
"""At most so many windows of one file, evenly spread: more of the same take say little that is new."""
TARGET_ROWS = 2600
"""About so many windows, varied copies included, are what the choice of a model needs."""
COPIES = (2, 4)
SNR_DB = (-15.0, 40.0)
NOISY_SHARE = 0.55
USABLE_DB = 12.0
"""Copies with more noise than this teach what noise is, not what ground sounds like [dB]: windows as noisy get a
quality of nearly 0, and learning from them costs more on another source than it gives."""
CANDIDATES = ("kernel", "trees")
"""A linear model is as good on takes held out, and worse on another source (`tests/studies/sound_on_sources.py`)."""


def train_audio(
    labelled: Sequence[LabelledFile],
    rng: np.random.Generator,
    progress: Callable[[float], None] | None = None,
    *,
    notes: Sequence[str] = (),
) -> TrainingOutcome:
    """Train a sound classifier on labelled files.

    Parameters
    ----------
    labelled
        Sound files with class and group (`framework.core.classifier.labelled.read_labelled`); `start_s` and `end_s` of
        a file are honoured.
    rng
        Varies the copies and draws the splits.
    progress
        Called with the share done, 0 to 1.
    notes
        What the report is to say of the material among its warnings.

    Raises
    ------
    InputError
        No file of a class is a whole sound; a class is silent; there are fewer than two classes.
    """
    said, kept, waves = list(notes), [], []
    for item, wave in readable(labelled, _read, said):
        kept.append(item)
        waves.append(wave)
        if progress:
            progress(0.2 * len(kept) / len(labelled))
    source = os.path.commonpath([item.file for item in labelled]) if labelled else "labelled sounds"
    rest = None if progress is None else (lambda share: progress(0.2 + 0.8 * share))
    return train_audio_arrays(
        waves, [item.class_name for item in kept], [item.group for item in kept], rng,
        progress=rest, source=source, notes=said, samples=kept,
    )  # fmt: skip


def _read(item: LabelledFile) -> tuple[np.ndarray, int]:
    return read_sound(item.file, item.start_s or 0.0, item.end_s)


def train_audio_arrays(
    waves: Sequence[tuple[np.ndarray, float]],
    labels: Sequence[str],
    groups: Sequence[str],
    rng: np.random.Generator,
    *,
    progress: Callable[[float], None] | None = None,
    source: str | Path = "labelled sounds",
    notes: Sequence[str] = (),
    samples: Sequence[LabelledFile] = (),
) -> TrainingOutcome:
    """Train a sound classifier on sounds in memory.

    Parameters
    ----------
    waves
        n pairs: mono samples (m,) in [-1, 1] and their sample rate [Hz].
    labels, groups : (n,)
        Class, and what must stay on one side of a split (source, site, take).
    source
        What to name in an error.
    notes
        What the report is to say of the material among its warnings.
    samples
        The n labelled files, where they came from such.

    Raises
    ------
    InputError
        There are fewer than two classes, or no sound, or none of a class.
    """
    material = _Material.gather(waves, labels, groups)
    if not material.pieces:
        raise InputError(source, "no sound that is louder than silence", expected="labelled contact sounds")
    notes = [*notes, *_silence(material.silent, Counter(labels), source)]
    windows, origin, snr_dB = material.varied(rng)
    label, group = np.asarray(material.labels)[origin], np.asarray(material.groups)[origin]
    as_recorded = np.arange(len(windows)) < len(material.pieces)
    return _train(
        windows, label, group, snr_dB, as_recorded, rng, progress, source, notes=notes,
        samples=material.stretches(samples), sample_of=origin,
    )  # fmt: skip


def _silence(silent: Counter[str], there: Counter[str], source: str | Path) -> list[str]:
    """Say how many sounds of each class are silent; raises `InputError` where all are."""
    for name, count in silent.items():
        if count == there[name]:
            raise InputError(
                source, f"{count} of {count} sounds are silent", expected="contact sound of every class",
                place=f"class {name!r}",
            )  # fmt: skip
    return [f"Silent and left out in {name}: {count} of {there[name]} sounds." for name, count in silent.items()]


def train_audio_windows(
    windows: np.ndarray,
    labels: Sequence[str],
    groups: Sequence[str],
    snr_dB: np.ndarray,
    rng: np.random.Generator,
    *,
    progress: Callable[[float], None] | None = None,
    candidates: Sequence[str] | None = None,
) -> TrainingOutcome:
    """Train a sound classifier on windows whose noise is known; nothing is varied any more.

    Parameters
    ----------
    windows : (n, m)
        float32, `WINDOW_S` long at `RATE_HZ`.
    labels, groups : (n,)
        Class, and what must stay on one side of a split.
    snr_dB : (n,)
        Contact sound over noise [dB], `NOISE_FREE_DB` and more where there is none to speak of.
    candidates
        Kinds of classifiers to choose from, of `bevameter.framework.core.classifier.fitting.CANDIDATES`.

    Raises
    ------
    InputError
        Fewer than two classes are left.
    """
    label, group = np.asarray(labels), np.asarray(groups)
    return _train(windows, label, group, snr_dB, snr_dB >= NOISE_FREE_DB, rng, progress, "labelled windows", candidates)


def _train(
    windows: np.ndarray,
    label: np.ndarray,
    group: np.ndarray,
    snr_dB: np.ndarray,
    as_recorded: np.ndarray,
    rng: np.random.Generator,
    progress: Callable[[float], None] | None,
    source: str | Path,
    candidates: Sequence[str] | None = None,
    notes: Sequence[str] = (),
    samples: Sequence[LabelledFile] = (),
    sample_of: np.ndarray | None = None,
) -> TrainingOutcome:
    features, measures = features_and_noise(windows)
    usable = np.isfinite(features).all(axis=1)
    noise, held_dB = NoiseModel.fit(
        noise_inputs(features, measures)[usable], snr_dB[usable], group[usable], as_recorded[usable]
    )
    quality = np.zeros(len(windows))
    quality[usable] = noise.ratio.clear(held_dB)
    taught = snr_dB >= USABLE_DB
    return TerrainClassifier.train(
        features[taught], label[taught], group[taught],
        modality="audio", feature_names=FEATURE_NAMES, settings=SETTINGS | {"noise": noise.settings()},
        rng=rng, candidates=candidates or CANDIDATES, degraded=~as_recorded[taught], quality=quality[taught],
        samples=samples, sample_of=None if sample_of is None else sample_of[taught],
        source=source, notes=notes, progress=progress,
    )  # fmt: skip


class _Material:
    """Pieces of labelled sound at the working rate, each a little longer than a window where the sound is.

    `silent` counts by class the sounds that have none.
    """

    def __init__(self) -> None:
        self.pieces: list[np.ndarray] = []
        self.labels: list[str] = []
        self.groups: list[str] = []
        self.owners: list[int] = []
        self.starts_s: list[float] = []
        self.silent: Counter[str] = Counter()

    @staticmethod
    def gather(waves: Sequence[tuple[np.ndarray, float]], labels: Sequence[str], groups: Sequence[str]) -> _Material:
        material = _Material()
        for index, ((samples, rate_hz), label, group) in enumerate(zip(waves, labels, groups, strict=True)):
            starts_s, pieces = _loud_pieces(resample(samples, rate_hz))
            material.pieces += pieces
            material.starts_s += starts_s
            material.owners += [index] * len(pieces)
            material.labels += [label] * len(pieces)
            material.groups += [group] * len(pieces)
            if not pieces:
                material.silent[label] += 1
        return material

    def stretches(self, samples: Sequence[LabelledFile]) -> list[LabelledFile]:
        """Give the stretch of its file that each piece is; none where there are no files."""
        if not samples:
            return []
        found = []
        for owner, start_s, piece in zip(self.owners, self.starts_s, self.pieces, strict=True):
            begin = (samples[owner].start_s or 0.0) + start_s
            # To the millisecond below: resampled sound may be part of a sample longer than the file.
            end = begin + min(WINDOW_S, math.floor(1e3 * piece.size / RATE_HZ) / 1e3)
            found.append(replace(samples[owner], start_s=begin, end_s=end))
        return found

    def varied(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Windows as recorded, then varied copies: (n, window), index of the piece (n,), noise added [dB] (n,)."""
        count = len(self.pieces)
        copies = int(np.clip(round(TARGET_ROWS / count), *COPIES))
        window = round(WINDOW_S * RATE_HZ)
        windows = np.zeros((count * (1 + copies), window), dtype=np.float32)
        origin = np.tile(np.arange(count), 1 + copies)
        snr_dB = np.full(len(windows), NOISE_FREE_DB)
        for row, index in enumerate(origin):
            piece = self.pieces[index]
            if row < count:
                windows[row] = np.resize(piece, window)
                continue
            varied = varied_window(piece, rng) if rng.random() < 0.9 else place(piece, rng)
            if rng.random() < NOISY_SHARE:
                snr_dB[row] = rng.uniform(*SNR_DB)
                varied = add_noise(varied, snr_dB[row], rng)
            windows[row] = varied
        return windows, origin, snr_dB


def _loud_pieces(sound: np.ndarray) -> tuple[list[float], list[np.ndarray]]:
    """Cut sound (m,) at the working rate where its windows begin [s], and leave out what is silent."""
    if sound.size == 0:
        return [], []
    window = round(WINDOW_S * RATE_HZ)
    starts = np.round(cut_windows(sound)[1] * RATE_HZ).astype(int)
    keep = np.unique(np.linspace(0, starts.size - 1, min(starts.size, FILE_WINDOWS)).astype(int))
    found = [(start / RATE_HZ, sound[start : start + window + window // 3]) for start in starts[keep].tolist()]
    loud = [(start_s, piece) for start_s, piece in found if np.sqrt(np.mean(np.square(piece))) >= SILENT_RMS]
    return [start_s for start_s, _ in loud], [piece for _, piece in loud]
