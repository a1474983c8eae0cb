"""Terrain from vibration: classifies runs of an inertial sensor."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier
from ..framework.core.classifier.signal_to_noise import SignalToNoise
from ..framework.core.errors import InputError
from ..framework.core.evidence import ClassEvidence
from ..framework.core.recording.readers import read_recording
from ..framework.core.recording.tables import read_table
from ..framework.core.recording.types import VibrationRun
from ..framework.core.recording.vibration import SAMPLE_RATE_HZ, read_vibration_run
from .vibration_features import HOP_S, WINDOW_S, VibrationChannels, vibration_features
from .vibration_quality import noise_columns, rated

SETTINGS = {"rate_hz": SAMPLE_RATE_HZ, "window_s": WINDOW_S, "hop_s": HOP_S}
"""How features are made; a model that was trained otherwise is refused."""
_BAGS = (".bag", ".mcap", ".db3")


def run_of(file: Path, wheel_file: str | Path | None) -> VibrationRun:
    """Read a vibration file with that of its wheels, or the inertial sensor and wheels of a bag."""
    if file.suffix.lower() not in _BAGS:
        return read_vibration_run(file, wheel_file)
    run = read_recording(file).vibration
    if run is None:
        raise InputError(file, "no inertial sensor of 20 Hz or more in it", expected="a topic of sensor_msgs/Imu")
    return run


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
        run = run_of(file, wheel_file_of(file) if channels.drive or channels.speed else None)
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
    channels, fill, quietest, noise = _opened(model)
    if missing := [name for name in channels.inertial if name not in run.names]:
        raise InputError(run.source, f"no column {', '.join(missing)}", expected=", ".join(channels.inertial))
    features, first = vibration_features(run, channels)
    quality, reasons = rated(features, channels, quietest, noise)
    start_s = first / run.sample_rate_Hz
    features = np.where((quality > 0)[:, None], filled(features, fill, channels), 0.0)
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


def filled(features: np.ndarray, fill: np.ndarray, channels: VibrationChannels) -> np.ndarray:
    """Put what is usual in place of a missing block; a row whose inertial part is missing stays as it is."""
    absent = np.asarray(np.isnan(features))
    return np.where(absent & ~absent[:, noise_columns(channels)].any(axis=1, keepdims=True), fill, features)


def _opened(model: TerrainClassifier) -> tuple[VibrationChannels, np.ndarray, float, SignalToNoise | None]:
    """Take channels, filling, threshold and noise out of a model, or say that it is not one of vibration.

    Models of before have no estimate of noise: None.
    """
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
        noise = model.settings.get("noise")
        noise = None if noise is None else SignalToNoise.from_settings(noise, noise_columns(channels).stop)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(source, f"damaged settings: {error}", expected="a model of `bevameter train`") from None
    if channels.names != tuple(model.feature_names) or fill.shape != (len(channels.names),):
        raise InputError(source, "settings and features do not agree", expected="a model of `bevameter train`")
    return channels, fill, quietest, noise
