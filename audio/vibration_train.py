"""Trains the sense of vibration on labelled runs of an inertial sensor, and on copies as a worse sensor gives them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier, TrainingOutcome
from ..framework.core.classifier.labelled import LabelledFile, readable
from ..framework.core.classifier.signal_to_noise import NOISE_FREE_DB, SignalToNoise
from ..framework.core.errors import InputError
from ..framework.core.recording.types import VibrationRun
from .vibration import SETTINGS, filled, run_of
from .vibration_augment import ratio_dB, worsened
from .vibration_features import WINDOW_S, VibrationChannels, cut_run, vibration_features, window_samples
from .vibration_quality import levels, noise_columns, rated

CANDIDATES = ("logistic", "whitened logistic")
SPARED = 0.4
"""Share of the training windows that are shown a second time without what the wheels recorded."""
COPIES = 3
"""So many times each run is made worse, each time in another way, and as often again with less of its vibration."""
WORSE = 1 / 3
"""Share of the training windows that are shown once more, from one of these copies, and as many of the faded ones."""
FADED = 0.02
"""Least share of the vibration that is left in faded copies [-]: they teach how noise shows where nothing else does."""
DROWNED_DB = -7.0
"""Vibration over what is none of the ground's, below which nothing is to be trusted [dB]: of 48 real runs, windows held
out are recognised half as often there, chance aside."""
USABLE_DB = 5.0
"""Copies with more noise than this teach what noise is, not what ground feels like [dB]."""


def train_vibration(
    labelled: Sequence[LabelledFile],
    rng: np.random.Generator,
    progress: Callable[[float], None] | None = None,
    *,
    notes: Sequence[str] = (),
) -> TrainingOutcome:
    """Train a classifier of vibration on labelled runs.

    Channels that all inertial files share are used, and those of the wheel drives (`wheel_file` of the index) where any
    run has them. Some windows are learnt twice, with the wheels' channels and without, so that the classifier also
    answers for a run whose wheels were not recorded; and some as a worse sensor would have recorded them.

    Parameters
    ----------
    labelled
        Vibration files, or bags, with class and group (`bevameter.framework.core.classifier.labelled.read_labelled`).
    rng
        Draws the splits.
    progress
        Called with the share done, 0 to 1.
    notes
        What the report is to say of the material among its warnings.

    Raises
    ------
    InputError
        No file of a class can be read, the files share no channel, no stretch of a class holds a window, or there are
        fewer than two classes.
    """
    if not labelled:
        raise InputError("labelled vibration", "no file", expected="vibration files of at least two classes")
    said, kept, runs = list(notes), [], []
    for item, run in readable(labelled, _read, said):
        kept.append(item)
        runs.append(run)
        if progress:
            progress(0.3 * len(kept) / len(labelled))
    rest = None if progress is None else (lambda share: progress(0.3 + 0.7 * share))
    return _train(runs, kept, rng, rest, said)


def train_vibration_runs(
    runs: Sequence[VibrationRun], labelled: Sequence[LabelledFile], rng: np.random.Generator,
    *, candidates: Sequence[str] = CANDIDATES,
) -> TrainingOutcome:  # fmt: skip
    """Train on runs in memory.

    Parameters
    ----------
    runs
        n runs; channels that all of them share are used, as in `train_vibration`.
    labelled
        Of each run the file that it is from, with class, group and stretch.
    rng
        Draws the splits.
    candidates
        Kinds of classifiers to choose from, of `bevameter.framework.core.classifier.fitting.CANDIDATES`.

    Raises
    ------
    InputError
        As in `train_vibration`.
    """
    return _train(runs, labelled, rng, None, (), candidates)


def _train(
    runs: Sequence[VibrationRun], kept: Sequence[LabelledFile], rng: np.random.Generator,
    progress: Callable[[float], None] | None, notes: Sequence[str], candidates: Sequence[str] = CANDIDATES,
) -> TrainingOutcome:  # fmt: skip
    channels = _shared_channels(runs)
    cuts = [_Windows.of(run, item, channels, rng) for run, item in zip(runs, kept, strict=True)]
    owner = np.repeat(np.arange(len(cuts)), [len(cut.samples) for cut in cuts])
    label, group = (np.array([getattr(item, name) for item in kept])[owner] for name in ("class_name", "group"))
    _refuse_without_window(kept, set(label.tolist()))
    features = np.concatenate([cut.features for cut in cuts])
    fill = _usual(features)
    spared = np.flatnonzero(rng.random(len(features)) < SPARED) if _wheel_columns(channels).size else np.arange(0)
    worse_dB = np.concatenate([cut.worse_dB for cut in cuts])
    worse = np.flatnonzero(np.isfinite(worse_dB))
    worse_features = np.concatenate([cut.worse for cut in cuts])[worse]
    bare = rng.random(len(worse)) < SPARED
    worse_features[bare] = _without_wheels(worse_features[bare], channels)
    rows = filled(
        np.concatenate([features, _without_wheels(features[spared], channels), worse_features]), fill, channels
    )
    order = np.concatenate([np.arange(len(features)), spared, worse])
    snr_dB = np.concatenate([np.full(len(features) + len(spared), NOISE_FREE_DB), worse_dB[worse]])
    faded = np.concatenate([cut.faded for cut in cuts])[worse]
    level = np.nanmean(features[:, levels(channels)], axis=1)
    level = level[np.isfinite(level)]
    quietest = float(np.quantile(level, 0.01)) if level.size else 0.0
    quality = rated(rows, channels, quietest, None)[0]
    whole = np.isfinite(rows).all(axis=1)
    if not whole.any():
        raise InputError(kept[0].file, "no window without a gap, nor in others", expected="an unbroken recording")
    noise, held_dB = SignalToNoise.fit(
        rows[whole, noise_columns(channels)], snr_dB[whole], group[order][whole], drowned_dB=DROWNED_DB
    )
    quality[whole] *= noise.clear(held_dB)
    settings = SETTINGS | {
        "inertial": list(channels.inertial), "drive": list(channels.drive), "speed": list(channels.speed),
        "fill": np.round(fill, 9).tolist(), "quietest": quietest, "noise": noise.settings(),
    }  # fmt: skip
    taught = (snr_dB >= USABLE_DB) & ~np.concatenate([np.zeros(len(order) - len(worse), dtype=bool), faded])
    mounting = len(channels.names) - channels.of_mounting
    order = order[taught]
    return TerrainClassifier.train(
        rows[taught], label[order], group[order],
        modality="vibration", feature_names=channels.names, settings=settings, rng=rng, candidates=candidates,
        columns=dict.fromkeys(candidates, (0, mounting)), gate_ends=tuple(sorted({mounting, len(channels.names)})),
        degraded=np.flatnonzero(taught) >= len(features), quality=quality[taught],
        samples=[sample for cut in cuts for sample in cut.samples], sample_of=order,
        source=Path(kept[0].file).parent, notes=notes, progress=progress,
    )  # fmt: skip


@dataclass(frozen=True)
class _Windows:
    """The n windows of a run's labelled stretch, as they came and from copies of the run that were made worse.

    `features` and `worse` (n, d) are those of `vibration_features`; `worse_dB` (n,) is how far the ground's vibration
    stands above what was changed [dB], NaN in a gap and where no worse copy was taken; `faded` (n,) marks copies with
    less of the vibration. The features that tell how the sensor is mounted are as they came in the copies, too: noise
    must not teach the gate that any mounting will do.
    """

    samples: list[LabelledFile]
    features: np.ndarray
    worse: np.ndarray
    worse_dB: np.ndarray
    faded: np.ndarray

    @staticmethod
    def of(run: VibrationRun, item: LabelledFile, channels: VibrationChannels, rng: np.random.Generator) -> _Windows:
        first, length = cut_run(len(run.time_s), run.sample_rate_Hz), window_samples(run)
        start = first / run.sample_rate_Hz
        low, high = item.start_s or 0.0, np.inf if item.end_s is None else item.end_s
        inside = (start >= low - 1e-9) & (start + WINDOW_S <= max(high, low + WINDOW_S) + 1e-6)
        if not inside.any():
            nothing = np.empty((0, len(channels.names)))
            return _Windows([], nothing, nothing, np.empty(0), np.empty(0, dtype=bool))
        rows = slice(int(first[inside][0]), int(first[inside][-1]) + length)
        run = replace(run, time_s=run.time_s[rows], channels=run.channels[rows], wheel=run.wheel[rows])
        features, first = vibration_features(run, channels)
        n = len(first)
        worse, worse_dB = np.full_like(features, np.nan), np.full(n, np.nan)
        taken = np.where(rng.random(n) < 2 * WORSE, rng.integers(2 * COPIES, size=n), -1)
        for number in range(2 * COPIES):
            own = np.flatnonzero(taken == number)
            faded = 1.0 if number < COPIES else float(np.exp(rng.uniform(np.log(FADED), 0.0)))
            copy, without = worsened(run, rng, faded)
            worse[own] = vibration_features(replace(run, channels=copy), channels)[0][own]
            worse_dB[own] = ratio_dB(copy, without, first[own], length)
        mounting = len(channels.names) - channels.of_mounting
        worse[:, mounting:] = features[:, mounting:]
        samples = [replace(item, start_s=at, end_s=at + WINDOW_S) for at in start[inside].tolist()]
        return _Windows(samples, features, worse, worse_dB, taken >= COPIES)


def _read(item: LabelledFile) -> VibrationRun:
    return run_of(item.file, item.extra.get("wheel_file") or None)


def _refuse_without_window(labelled: Sequence[LabelledFile], taught: set[str]) -> None:
    """Name the first file of a class of which no stretch holds a window: the class would be missing without a word."""
    for item in labelled:
        if item.class_name not in taught:
            raise InputError(
                item.file, f"no window of class {item.class_name!r} in its stretch, nor in others of the class",
                expected=f"a stretch of {WINDOW_S:g} s or more",
            )  # fmt: skip


def _shared_channels(runs: Sequence[VibrationRun]) -> VibrationChannels:
    recorded = [set(np.array(run.names)[np.isfinite(run.channels).any(axis=0)].tolist()) for run in runs]
    inertial = tuple(name for name in runs[0].names if all(name in names for names in recorded))
    if not inertial:
        odd = next((run for run, names in zip(runs, recorded, strict=True) if not names & recorded[0]), runs[-1])
        raise InputError(odd.source, f"columns {', '.join(odd.names)}", expected=", ".join(runs[0].names))
    found = [VibrationChannels.of(run) for run in runs if run.wheel_names]
    drive = tuple(name for name in (found[0].drive if found else ()) if all(name in part.drive for part in found))
    speed = tuple(name for name in (found[0].speed if found else ()) if all(name in part.speed for part in found))
    return VibrationChannels(inertial, drive, speed)


def _wheel_columns(channels: VibrationChannels) -> np.ndarray:
    return np.concatenate([np.arange(block.start, block.stop) for block in channels.blocks().values()])


def _without_wheels(features: np.ndarray, channels: VibrationChannels) -> np.ndarray:
    features = features.copy()
    for block in channels.blocks().values():
        if block.stop > block.start:
            features[:, block.start : block.stop - 1] = np.nan
            features[:, block.stop - 1] = 0.0
    return features


def _usual(features: np.ndarray) -> np.ndarray:
    """Mean of each column over the rows that have it, 0 where none has: (d,)."""
    there = np.isfinite(features)
    return np.where(there, features, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
