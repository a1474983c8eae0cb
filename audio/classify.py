"""What ground was it? Classes of windows of recorded sound, and of whole files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
import soundfile

from ..framework.core.classifier.classifier import TerrainClassifier
from ..framework.core.errors import InputError
from ..framework.core.evidence import ClassEvidence
from ..framework.core.recording.channels import mixed
from ..framework.core.recording.sound import read_channels, read_sound
from .features import FEATURE_NAMES, HOP_S, RATE_HZ, WINDOW_S, cut_windows, resample
from .quality import MEASURES, NoiseModel, assess, features_and_noise, recording_faults

SETTINGS = {"rate_hz": RATE_HZ, "window_s": WINDOW_S, "hop_s": HOP_S}
"""How features are made; a model that was trained otherwise is refused."""


def noise_model(model: TerrainClassifier) -> NoiseModel:
    """Take the noise model out of a sound classifier.

    Raises
    ------
    InputError
        The classifier is not one of sound, or its features were made in another way than this version makes them.
    """
    source = model.source
    if model.modality != "audio":
        raise InputError(source, "does not listen", expected="a model of modality 'audio'")
    made = {name: model.settings.get(name) for name in SETTINGS}
    if made != SETTINGS or model.feature_names != FEATURE_NAMES:
        raise InputError(source, f"trained with features of {made}", expected=f"features of {SETTINGS}; train it again")
    try:
        return NoiseModel.from_settings(model.settings.get("noise"), len(FEATURE_NAMES) + len(MEASURES))
    except (TypeError, ValueError) as error:
        expected = "a model that `bevameter train audio` wrote"
        raise InputError(source, str(error), expected=expected, place="key settings.noise") from None


def sound_evidence(
    samples: np.ndarray, rate_hz: float, model: TerrainClassifier, noise: NoiseModel | None = None
) -> tuple[np.ndarray, np.ndarray, ClassEvidence]:
    """Classify a stretch of sound window by window.

    Parameters
    ----------
    samples : (m,) or (m, c)
        Sound in [-1, 1] at `rate_hz` [Hz], m > 0; what is classified of c channels is their mix.
    model
        A classifier of modality ``"audio"``.
    noise
        Its noise model, where the caller has taken it out before.

    Returns
    -------
    start_s, end_s : (n,)
        The windows [s], counted from the first sample; a stretch shorter than a window is one window.
    evidence
        n items.

    Raises
    ------
    InputError
        The model is no sound classifier of this version.
    """
    noise = noise or noise_model(model)
    windows, start_s = cut_windows(resample(mixed(samples), rate_hz))
    end_s = np.minimum(start_s + WINDOW_S, len(samples) / rate_hz)
    features, measures = features_and_noise(windows)
    quality, reasons = assess(features, measures, recording_faults(samples, rate_hz, start_s, end_s), noise)
    # A silent window has no features: it is unknown because it is silent, and for no other reason.
    features = np.where((quality > 0)[:, None], features, 0.0)
    return start_s, end_s, model.evidence(features, quality, reasons)


def classify_sounds(files: Iterable[str | Path] | Sequence[Path], model: TerrainClassifier) -> list[dict]:
    """Classify sound files window by window; a file shorter than a window gives one row.

    Returns
    -------
    list of dict
        ``file, start_s, end_s, class, probabilities, quality, unknown, reasons`` for each file and window.

    Raises
    ------
    InputError
        A file is missing, empty, damaged or no sound; the model is no sound classifier of this version.
    """
    noise = noise_model(model)
    rows: list[dict] = []
    for file in map(Path, files):
        samples, rate_hz = read_channels(file)
        start_s, end_s, evidence = sound_evidence(samples, rate_hz, model, noise)
        rows += evidence.as_rows(file, start_s, end_s)
    return rows


def clip(file: str | Path, start_s: float, end_s: float | None) -> bytes:
    """Give a stretch of a sound file as WAV at the working rate, its peak at half of full scale.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    sound = resample(*read_sound(Path(file), start_s, end_s))
    stream = BytesIO()
    soundfile.write(
        stream, 0.5 * sound / max(float(np.abs(sound).max(initial=0.0)), 1e-9), RATE_HZ, "PCM_16", format="WAV"
    )
    return stream.getvalue()
