"""Terrain from vibration: trains on labelled runs of an inertial sensor, and classifies other runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier, TrainingOutcome
from ..framework.core.classifier.labelled import LabelledFile, readable
from ..framework.core.errors import InputError
from ..framework.core.evidence import ClassEvidence
from ..framework.core.recording.readers import read_recording
from ..framework.core.recording.tables import read_table
from ..framework.core.recording.types import VibrationRun
from ..framework.core.recording.vibration import SAMPLE_RATE_HZ, read_vibration_run
from .vibration_features import HOP_S, WINDOW_S, VibrationChannels, vibration_features

SETTINGS = {"rate_hz": SAMPLE_RATE_HZ, "window_s": WINDOW_S, "hop_s": HOP_S}
"""How features are made; a model that was trained otherwise is refused."""
CANDIDATES = ("logistic", "whitened logistic")
SPARED = 0.4
"""Share of the training windows that are shown a second time without what the wheels recorded."""
STILL = np.log(2.0)
"""So far below the quietest training windows the vehicle is at standstill: half their amplitude."""


_BAGS = (".bag", ".mcap", ".db3")


def _read(item: LabelledFile) -> VibrationRun:
    return _run_of(item.file, item.extra.get("wheel_file") or None)


def _run_of(file: Path, wheel_file: str | Path | None) -> VibrationRun:
    """Read a vibration file with that of its wheels, or the inertial sensor and wheels of a bag."""
    if file.suffix.lower() not in _BAGS:
        return read_vibration_run(file, wheel_file)
    run = read_recording(file).vibration
    if run is None:
        raise InputError(file, "no inertial sensor of 20 Hz or more in it", expected="a topic of sensor_msgs/Imu")
    return run


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
    answers for a run whose wheels were not recorded.

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
    blocks, label, group, samples = [], [], [], []
    for run, item in zip(runs, kept, strict=True):
        rows, first = vibration_features(run, channels)
        start = first / run.sample_rate_Hz
        low, high = item.start_s or 0.0, np.inf if item.end_s is None else item.end_s
        inside = (start >= low - 1e-9) & (start + WINDOW_S <= max(high, low + WINDOW_S) + 1e-6)
        rows = rows[inside]
        blocks.append(rows)
        samples += [replace(item, start_s=at, end_s=at + WINDOW_S) for at in start[inside].tolist()]
        label += [item.class_name] * len(rows)
        group += [item.group] * len(rows)
    _refuse_without_window(kept, set(label))
    features = np.concatenate(blocks)
    fill = _usual(features)
    full = _filled(features, fill)
    spared = np.flatnonzero(rng.random(len(features)) < SPARED) if _wheel_columns(channels).size else np.arange(0)
    without = _filled(_without_wheels(features[spared], channels), fill)
    level = np.nanmean(features[:, _levels(channels)], axis=1)
    level = level[np.isfinite(level)]
    settings = SETTINGS | {
        "inertial": list(channels.inertial), "drive": list(channels.drive), "speed": list(channels.speed),
        "fill": np.round(fill, 9).tolist(), "quietest": float(np.quantile(level, 0.01)) if level.size else 0.0,
    }  # fmt: skip
    order = np.concatenate([np.arange(len(features)), spared])
    return TerrainClassifier.train(
        np.concatenate([full, without]), np.asarray(label)[order], np.asarray(group)[order],
        modality="vibration", feature_names=channels.names, settings=settings, rng=rng, candidates=candidates,
        columns=dict.fromkeys(candidates, (0, len(channels.names) - channels.of_mounting)),
        degraded=np.arange(len(order)) >= len(features), samples=samples, sample_of=order,
        source=Path(kept[0].file).parent, notes=notes, progress=progress,
    )  # fmt: skip


def classify_vibration(files: Iterable[str | Path], model: TerrainClassifier) -> list[dict]:
    """Classify vibration files window by window.

    What the wheel drives recorded in the same run is joined where an `index.csv` in the file's folder, or in the one
    above, names it in its column `wheel_file`.

    Returns
    -------
    list of dict
        ``file, start_s, end_s, class, probabilities, quality, unknown, reasons`` for each file and window; times
        count from the file's first sample.

    Raises
    ------
    InputError
        A file cannot be read or lacks a channel; the model is none of vibration, or of another version.
    """
    channels, *_ = _opened(model)
    rows: list[dict] = []
    for file in map(Path, files):
        run = _run_of(file, wheel_file_of(file) if channels.drive or channels.speed else None)
        start_s, end_s, evidence = vibration_evidence(run, model)
        rows += evidence.as_rows(file, start_s, end_s)
    return rows


def vibration_evidence(run: VibrationRun, model: TerrainClassifier) -> tuple[np.ndarray, np.ndarray, ClassEvidence]:
    """Classify a run window by window.

    Parameters
    ----------
    run
        It has every inertial channel of the model.
    model
        A classifier of modality ``"vibration"``.

    Returns
    -------
    start_s, end_s : (n,)
        The windows [s], counted from the first sample; a run shorter than a window is one window.
    evidence
        n items.

    Raises
    ------
    InputError
        The run lacks a channel, or the model is none of vibration, or of another version.
    """
    channels, fill, quietest = _opened(model)
    if missing := [name for name in channels.inertial if name not in run.names]:
        raise InputError(run.source, f"no column {', '.join(missing)}", expected=", ".join(channels.inertial))
    features, first = vibration_features(run, channels)
    quality, reasons = _rated(features, channels, quietest)
    start_s = first / run.sample_rate_Hz
    features = np.where((quality > 0)[:, None], _filled(features, fill), 0.0)
    end_s = start_s + min(WINDOW_S, len(run.time_s) / run.sample_rate_Hz)
    return start_s, end_s, model.evidence(features, quality, reasons)


def wheel_file_of(file: Path) -> Path | None:
    """Find the wheel drives' file of a vibration run by the `index.csv` in its folder or the one above, if any."""
    file = Path(os.path.realpath(file))
    for folder in file.parents[:2]:
        index = folder / "index.csv"
        if not os.path.isfile(index):
            continue
        table = read_table(index)
        if not {"file", "wheel_file"} <= set(table.text):
            continue
        for name, wheel in zip(table.text["file"], table.text["wheel_file"], strict=True):
            found = Path(os.path.realpath(folder / str(wheel)))
            if wheel and os.path.realpath(folder / str(name)) == str(file) and found.is_relative_to(folder):
                return found
    return None


def _refuse_without_window(labelled: Sequence[LabelledFile], taught: set[str]) -> None:
    """Name the first file of a class of which no stretch holds a window: the class would be missing without a word."""
    for item in labelled:
        if item.class_name not in taught:
            raise InputError(
                item.file, f"no window of class {item.class_name!r} in its stretch, nor in others of the class",
                expected=f"a stretch of {WINDOW_S:g} s or more",
            )  # fmt: skip


def _shared_channels(runs: Sequence[VibrationRun]) -> VibrationChannels:
    inertial = tuple(name for name in runs[0].names if all(name in run.names for run in runs))
    if not inertial:
        odd = next(run for run in runs if not set(run.names) & set(runs[0].names))
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


def _filled(features: np.ndarray, fill: np.ndarray) -> np.ndarray:
    """Put what is usual in place of a missing block; a row whose inertial part is missing stays as it is."""
    absent = np.asarray(np.isnan(features))
    return np.where(absent & ~absent[:, [0]], fill, features)


def _levels(channels: VibrationChannels) -> list[int]:
    return [index for index, name in enumerate(channels.names) if name.endswith("_level")]


def _rated(
    features: np.ndarray, channels: VibrationChannels, quietest: float
) -> tuple[np.ndarray, list[tuple[str, ...]]]:
    """Rate windows: gaps, a sensor that is stuck, a vehicle that stands."""
    level = features[:, _levels(channels)]
    gap = np.asarray(~np.isfinite(level).all(axis=1))
    stuck = np.asarray((level < np.log(2e-8)).any(axis=1))
    with np.errstate(invalid="ignore"):
        moving = np.clip((level.mean(axis=1) - quietest + STILL) / STILL, 0.0, 1.0)
    quality: np.ndarray = np.where(gap | stuck, 0.0, np.nan_to_num(moving))
    reasons: list[tuple[str, ...]] = [()] * len(quality)
    for index in np.flatnonzero(quality < 0.75):
        if gap[index]:
            reasons[index] = ("the vibration was not recorded",)
        elif stuck[index]:
            reasons[index] = ("a channel does not change",)
        else:
            reasons[index] = ("hardly any vibration: the vehicle stands, or nearly",)
    return quality, reasons


def _opened(model: TerrainClassifier) -> tuple[VibrationChannels, np.ndarray, float]:
    """Take channels, filling and threshold out of a model, or say that it is not one of vibration."""
    source = model.source
    if model.modality != "vibration":
        raise InputError(source, "does not feel vibration", expected="a model of modality 'vibration'")
    made = {name: model.settings.get(name) for name in SETTINGS}
    if made != SETTINGS:
        raise InputError(source, f"trained with features of {made}", expected=f"features of {SETTINGS}; train it again")
    try:
        channels = VibrationChannels(*(tuple(map(str, model.settings[key])) for key in ("inertial", "drive", "speed")))
        fill = np.asarray(model.settings["fill"], dtype=float)
        quietest = float(model.settings["quietest"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(source, f"damaged settings: {error}", expected="a model of `bevameter train`") from None
    if channels.names != tuple(model.feature_names) or fill.shape != (len(channels.names),):
        raise InputError(source, "settings and features do not agree", expected="a model of `bevameter train`")
    return channels, fill, quietest
