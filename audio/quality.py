"""How far a window of sound is to be trusted, and why not: gaps, clipping, wind, engine tones, noise.

There are two kinds of fault. Faults of the recording itself (nothing recorded, overdriven) are measured on the
samples as they came and follow from what a recorder can do. Background noise has no such yardstick: whether a rumble
is wind or the ground depends on what the classifier was trained on. So its measures are compared with the training
sound, and how much of it there is is estimated by a regression fitted on training sound to which known noise was added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..framework.core.classifier.signal_to_noise import SignalToNoise, checked_numbers
from ..framework.core.recording.channels import mixed
from .features import FEATURE_NAMES, batch_features, frequencies, spectra_in_batches

SILENT_RMS = 1e-4
"""Root mean square below which a window holds nothing but the rounding of a 16-bit recorder: -80 dB of full scale."""
GAP_S = 0.02
"""Samples that stay exactly the same for so long are no sound but a gap [s]."""
_FULL_SCALE = 0.9995
_LEAST_CLIP = 0.02
_WIND_HZ = 150.0
_TONE_BINS = slice(1, 97)
MEASURES = ("low_share_dB", "low_fluctuation", "tonality_dB", "floor_dB", "flatness_dB")
"""Measures of background noise, columns of what `features_and_noise` gives."""


@dataclass(frozen=True)
class RecordingFaults:
    """Faults of the recorder in n windows: root mean square of full scale, shares in [0, 1] clipped and missing."""

    rms: np.ndarray
    clipped: np.ndarray
    missing: np.ndarray


def recording_faults(samples: np.ndarray, rate_hz: float, start_s: np.ndarray, end_s: np.ndarray) -> RecordingFaults:
    """Look for silence, gaps and clipping in sound as it was recorded (resampling would blur all three).

    Parameters
    ----------
    samples : (m,) or (m, c)
        Sound in [-1, 1] at `rate_hz` [Hz]. Silence and gaps are those of the mix; clipping is that of the channel that
        is clipped most, since a mix hides it.
    start_s, end_s : (n,)
        The windows [s], counted from the first sample.
    """
    channels = np.asarray(samples).reshape(len(samples), -1)
    first = np.clip(np.round(np.asarray(start_s) * rate_hz).astype(int), 0, len(channels))
    last = np.clip(np.round(np.asarray(end_s) * rate_hz).astype(int), first, len(channels))
    sound = mixed(channels).astype(np.float64)
    finite = np.isfinite(sound)
    sound[~finite] = 0.0

    windows = [slice(*ends) for ends in zip(first.tolist(), last.tolist(), strict=True)]
    missing = _in_gap(_held(sound), rate_hz) | ~finite
    clipped = np.max([_clipped_shares(channel, windows, rate_hz) for channel in channels.T], axis=0)
    return RecordingFaults(np.sqrt(_shares(sound**2, windows)), clipped, _shares(missing, windows))


def _shares(values: np.ndarray, windows: Sequence[slice]) -> np.ndarray:
    """Give the mean of values or flags (m,) in each window, (n,); 0 in one without samples."""
    sums, sizes = np.array([(values[each].sum(), values[each].size) for each in windows], dtype=float).reshape(-1, 2).T
    return sums / np.maximum(sizes, 1)


def _clipped_shares(channel: np.ndarray, windows: Sequence[slice], rate_hz: float) -> np.ndarray:
    """Give the share of samples of one channel (m,) at full scale or at a level that cut them off, by window (n,)."""
    channel = np.nan_to_num(channel.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    held = _held(channel)
    equal = (held | np.append(held[1:], False)) & ~_in_gap(held, rate_hz)
    cut = np.abs(channel) >= _FULL_SCALE
    shares = _shares(cut, windows)
    for index, window in enumerate(windows):
        alike = channel[window][equal[window]]
        if alike.size:
            swing, mean = channel[window], channel[window].mean()
            flat = [_flattened(sign * (swing - mean), sign * (alike - mean)) for sign in (1, -1)]
            shares[index] = np.mean(cut[window] | flat[0] | flat[1])
    return shares


def _flattened(side: np.ndarray, alike: np.ndarray) -> np.ndarray:
    """Mark where a recorder cut off one side of a swing (m,), before or after a louder sound went through whole.

    There neighbours share one level, more than share the level below, and ten times as many as there are samples beyond
    it; `alike` are the samples that equal a neighbour.
    """
    level, count = np.unique(alike[alike > 0.0], return_counts=True)
    piled = np.flatnonzero((level > _LEAST_CLIP) & (count > np.append(0, count[:-1])))
    cut_off, shared, most = np.inf, 0, count[piled].max(initial=0)
    for index in piled[::-1]:
        beyond = np.count_nonzero(side > level[index])
        if 10 * beyond > most:
            break  # and no lower level has fewer
        if count[index] >= max(10 * beyond, shared):
            cut_off, shared = level[index], count[index]
    return side == cut_off


def _held(samples: np.ndarray) -> np.ndarray:
    """Mark the samples (m,) that equal the one before."""
    return np.concatenate([[False], samples[1:] == samples[:-1]])


def _in_gap(held: np.ndarray, rate_hz: float) -> np.ndarray:
    """Mark the samples that lie in a run of unchanged samples of at least `GAP_S`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(np.int8)))
    begin, end = edges[::2], edges[1::2]
    marks = np.zeros(held.size, dtype=bool)
    for index in np.flatnonzero(end - begin >= GAP_S * rate_hz):
        marks[begin[index] : end[index]] = True
    return marks


def features_and_noise(windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Describe windows, and measure what wind, engines and hiss do to them.

    Parameters
    ----------
    windows : (n, m)
        Mono sound at the working rate; gain does not matter.

    Returns
    -------
    features : (n, d)
        Columns as `features.FEATURE_NAMES` [-]; a row of silence, or with a sample that is not finite, is NaN.
    measures : (n, 5)
        Columns as `MEASURES`: power below 150 Hz against the rest [dB]; how that low power fluctuates from frame to
        frame (standard deviation of its logarithm) [-]; how far the strongest lines stand above the spectrum around
        them [dB]; the quietest tenth of the frames against the loudest [dB]; flatness of the mean spectrum [dB].
    """
    features, measures = np.empty((len(windows), len(FEATURE_NAMES))), np.empty((len(windows), len(MEASURES)))
    for rows, power in spectra_in_batches(windows):
        features[rows], measures[rows] = batch_features(power)[1], _batch_measures(power)
    return features, measures


def _batch_measures(power: np.ndarray) -> np.ndarray:
    power = power / np.maximum(power.max(axis=(1, 2), keepdims=True), 1e-20) + np.float32(1e-9)
    split = int(np.searchsorted(frequencies(), _WIND_HZ))
    rumble, rest = power[:, :, :split].sum(axis=2), power[:, :, split:].sum(axis=2)
    order = np.argsort(rest, axis=1)
    frames = np.take_along_axis(rest, order, axis=1)
    tenth = max(1, frames.shape[1] // 10)
    floor = frames[:, :tenth].mean(axis=1) / frames[:, -tenth:].mean(axis=1)
    # Lines show where the quietest frames, which no contact disturbs, still hold a comb of peaks.
    quiet = np.take_along_axis(power[:, :, _TONE_BINS], order[:, : power.shape[1] // 3, None], axis=1)
    ratio = np.abs(np.diff(np.log(quiet.mean(axis=1)), n=2, axis=1))
    spectrum = power[:, :, split:].mean(axis=1)
    return np.stack(
        [
            10 * np.log10(rumble.mean(axis=1) / rest.mean(axis=1)),
            np.log(rumble).std(axis=1),
            10 / np.log(10) * np.quantile(ratio, 0.9, axis=1),
            10 * np.log10(floor),
            10 / np.log(10) * (np.log(spectrum).mean(axis=1) - np.log(spectrum.mean(axis=1))),
        ],
        axis=1,
    )


DROWNED_DB = 5.0
"""Signal-to-noise ratio at which sound is not to be trusted any more [dB]: footsteps are recognised half as often."""


@dataclass(frozen=True)
class NoiseModel:
    """Estimates from features and noise measures how far contact sound stands above the background, and by what.

    Parameters
    ----------
    ratio
        The estimate.
    usual_mean, usual_sd : (5,)
        Noise measures of training sound as it came: what is more than usual names the noise.
    """

    ratio: SignalToNoise
    usual_mean: np.ndarray
    usual_sd: np.ndarray

    @staticmethod
    def fit(
        inputs: np.ndarray, snr_dB: np.ndarray, groups: np.ndarray, as_recorded: np.ndarray
    ) -> tuple[NoiseModel, np.ndarray]:
        """Fit to training sound with known noise added.

        Parameters
        ----------
        inputs : (n, d)
            Features, then noise measures (`noise_inputs`), finite.
        snr_dB, groups : (n,)
            As `SignalToNoise.fit` takes them.
        as_recorded : (n,)
            True for training sound as it came.

        Returns
        -------
        model
            Fitted to all of it.
        held_dB : (n,)
            What models that have not seen its group estimate of each [dB].
        """
        ratio, held_dB = SignalToNoise.fit(inputs, snr_dB, groups, drowned_dB=DROWNED_DB)
        usual = inputs[as_recorded, -len(MEASURES) :]
        return NoiseModel(ratio, usual.mean(axis=0), np.maximum(usual.std(axis=0), 0.1)), held_dB

    def kind(self, measures: np.ndarray) -> list[str]:
        """Name the noise by what stands out most from training sound: n phrases for measures (n, 5)."""
        excess = (measures - self.usual_mean) / self.usual_sd
        low, lines = excess[:, MEASURES.index("low_share_dB")], excess[:, MEASURES.index("tonality_dB")]
        wind, tones = (low > 2) & (low >= lines), (lines > 2) & (lines > low)
        names = np.where(wind, "wind or rumble", np.where(tones, "engine or other tones", "noise"))
        return [str(name) for name in names]

    def settings(self) -> dict:
        """Give the model as JSON-able numbers."""
        return self.ratio.settings() | {name: np.round(getattr(self, name), 9).tolist() for name in _USUAL}

    @staticmethod
    def from_settings(settings: object, width: int) -> NoiseModel:
        """Make the model of `width` inputs from its settings; raises `ValueError` where they are no such model."""
        given = settings if isinstance(settings, dict) else {}
        usual = checked_numbers(
            {key: given[key] for key in _USUAL if key in given}, dict.fromkeys(_USUAL, len(MEASURES))
        )
        ratio = SignalToNoise.from_settings({key: given[key] for key in given if key not in _USUAL}, width)
        if not (usual["usual_sd"] > 0).all():
            raise ValueError("the noise model is damaged")
        return NoiseModel(ratio, **usual)


_USUAL = ("usual_mean", "usual_sd")


def noise_inputs(features: np.ndarray, measures: np.ndarray) -> np.ndarray:
    """Join features (n, d) and noise measures (n, 5) to what `NoiseModel` takes, (n, d + 5)."""
    return np.concatenate([features, measures], axis=1)


def assess(
    features: np.ndarray, measures: np.ndarray, faults: RecordingFaults, model: NoiseModel
) -> tuple[np.ndarray, list[tuple[str, ...]]]:
    """Rate n windows.

    Returns
    -------
    quality : (n,)
        In [0, 1] [-]: the product of what gaps, clipping and noise leave.
    reasons
        n tuples of phrases, one for each fault that costs more than a quarter of the quality.
    """
    silent = ~(faults.rms >= SILENT_RMS)
    recorded = np.clip((0.5 - faults.missing) / 0.45, 0.0, 1.0)
    clear = np.clip((0.1 - faults.clipped) / 0.095, 0.0, 1.0)
    ratio = model.ratio.estimate(noise_inputs(features, measures))
    above = model.ratio.clear(ratio)
    quality = np.where(silent, 0.0, recorded * clear * above)
    kinds = model.kind(measures)
    reasons: list[tuple[str, ...]] = [()] * len(quality)
    for index in np.flatnonzero(silent | (np.minimum(np.minimum(recorded, clear), above) < 0.75)):
        said = []
        if silent[index]:
            said.append("silent")
        else:
            if recorded[index] < 0.75:
                said.append(f"{faults.missing[index]:.0%} of the sound is missing")
            if clear[index] < 0.75:
                said.append(f"clipped: {faults.clipped[index]:.1%} of the samples")
            if above[index] < 0.75 and np.isfinite(ratio[index]):
                said.append(f"{kinds[index]}: contact sound {ratio[index]:.0f} dB above the background")
        reasons[index] = tuple(said)
    return quality, reasons
