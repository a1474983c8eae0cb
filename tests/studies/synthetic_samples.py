"""Labelled looks, sounds and runs of the synthetic world, for the small models that the package trains by itself.

They come from the generators that also make the traverses, and go the same way through camera and microphone: ground is
seen in perspective by a camera that moves, stored as JPEG and cut into cells as on a drive; a wheel is heard among
its drive's whine, wind and engines; the demo's vehicle is shaken. Only the sites, how the camera is mounted, speeds and
the load are others. A group is one site.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from bevameter.audio.augment import NOISES, sounding_power
from bevameter.audio.features import RATE_HZ, WINDOW_S, resample
from bevameter.framework.core.classifier.labelled import LabelledFile
from bevameter.framework.core.classifier.signal_to_noise import NOISE_FREE_DB
from bevameter.framework.core.recording.camera import decode_image
from bevameter.framework.core.recording.types import VibrationRun, WheelTable
from bevameter.framework.core.recording.vibration import of_wheels
from bevameter.framework.scenario.contact_sound import VOICES, contact_sound, engine, motor_whine, wind
from bevameter.framework.scenario.ground import PAINTERS, paint_tile
from bevameter.framework.scenario.plan import Plan, make_plan
from bevameter.framework.scenario.presets import PRESETS, Leg
from bevameter.framework.scenario.roughness import ROUGHNESS
from bevameter.framework.scenario.seeing import TARGET_LEVEL, jpeg
from bevameter.framework.scenario.vibration import CHANNELS, felt
from bevameter.framework.scenario.vibration import RATE_HZ as FELT_RATE_HZ
from bevameter.framework.scenario.view import GroundSite, View
from bevameter.framework.scenario.wheels import wheel_rows
from bevameter.vision.project import GroundPatches, ground_patches

SAMPLE_CLASSES = tuple(sorted(PAINTERS))
"""Classes of the synthetic world."""

# How ground is looked at.
# The ripples of sand come and go over a quarter of a tile: a small one has no place that is all smooth.
_TILE_PX = {"sand": 1024}
_USUAL_TILE_PX = 512
_EYES = 10
_FRAMES_PER_SITE = 3
_CELL_M = 0.5
_EXPOSURE_S = (0.004, 0.02)
_SPEED_M_S = (0.1, 4.0)
_SHARP = 0.02
"""Travel during the exposure, over the side of a cell, below which a look counts as sharp: about a pixel [-]."""

# How a wheel is listened to.
_SOUND_RATE_HZ = 22050
_SOUNDS_PER_SITE = 3
_WINDOWS_PER_SOUND = 3
_SNR_DB = (-30.0, 35.0)
_NOISY_SHARE = 0.55
_FLOOR = 0.0006

# How a vehicle is shaken.
_SLOW_S, _FAST_S = 16.0, 20.0
_FAST_M_S = (0.6, 4.5)
_LOAD_SD = 0.05


@dataclass(frozen=True)
class LookSamples:
    """Cells of ground as a moving camera sees them.

    Parameters
    ----------
    patches : (n, 64, 64, 3)
        uint8, blue, green, red; rectified.
    labels, groups
        Class and site of each.
    blurred : (n,)
        True where motion has smeared it by more than a pixel or so.
    """

    patches: np.ndarray
    labels: list[str]
    groups: list[str]
    blurred: np.ndarray


@dataclass(frozen=True)
class SoundSamples:
    """Windows of sound under the wheels.

    Parameters
    ----------
    windows : (n, m)
        float32 in [-1, 1], at `bevameter.audio.features.RATE_HZ`, each `WINDOW_S` long.
    labels, groups
        Class and site of each; the sounds of one site share its voice.
    snr_dB : (n,)
        Contact sound over wind, engine or other noise [dB]; `NOISE_FREE_DB` where there was none.
    """

    windows: np.ndarray
    labels: list[str]
    groups: list[str]
    snr_dB: np.ndarray


@dataclass(frozen=True)
class _Eye:
    """A camera and the cells that it looks at."""

    view: View
    layout: GroundPatches


def labelled_looks(
    rng: np.random.Generator, sites_per_class: int, progress: Callable[[float], None] | None = None
) -> LookSamples:
    """Make looks at cells of ground, as `bevameter.vision.observe.observe_ground` cuts them on a drive.

    Parameters
    ----------
    rng
        Source of randomness.
    sites_per_class
        Sites of each of `SAMPLE_CLASSES`, each seen by a few cameras.
    progress
        Called with the share done, 0 to 1.
    """
    tiles = (
        (name, f"{name}-{index:03d}", paint_tile(name, rng, size=_TILE_PX.get(name, _USUAL_TILE_PX)))
        for name, index in _sites(sites_per_class, progress)
    )
    return looks_at(tiles, rng)


def looks_at(tiles: Iterable[tuple[str, str, np.ndarray]], rng: np.random.Generator) -> LookSamples:
    """Make looks at ground that is paved with tiles.

    Parameters
    ----------
    tiles
        Class, group and picture (s, s, 3) of each, blue, green, red; `RESOLUTION_M` a pixel.
    rng
        Source of randomness.
    """
    eyes = [_eye(rng) for _ in range(_EYES)]
    patches, labels, groups, blurred = [], [], [], []
    for name, group, tile in tiles:
        site = GroundSite.make(tile, rng, None)
        level = TARGET_LEVEL
        for number in rng.integers(len(eyes), size=_FRAMES_PER_SITE):
            eye = eyes[number]
            image, travel_m = _taken(site, eye.view, TARGET_LEVEL / max(level, 5.0), rng)
            level = float(image[image.shape[0] // 3 :: 8, ::8].mean())
            cut = eye.layout.cut(image)
            patches.append(cut)
            labels += [name] * len(cut)
            groups += [group] * len(cut)
            blurred.append(np.full(len(cut), travel_m > _SHARP * eye.layout.side_m))
    return LookSamples(np.concatenate(patches), labels, groups, np.concatenate(blurred))


def _sites(sites_per_class: int, progress: Callable[[float], None] | None) -> Iterator[tuple[str, int]]:
    """Class and number of each site; `progress` is called as they are used."""
    for place, name in enumerate(SAMPLE_CLASSES):
        for index in range(sites_per_class):
            yield name, index
            if progress is not None:
                progress((place + (index + 1) / sites_per_class) / len(SAMPLE_CLASSES))


def _eye(rng: np.random.Generator) -> _Eye:
    """A camera of the presets' kind with another lens, mounted otherwise, on a map of other cells."""
    usual = PRESETS["demo"].vehicle.camera
    if usual is None:
        raise ValueError("the demo's vehicle has no camera")
    while True:
        focal = usual.matrix[0][0] * math.exp(rng.normal(0.0, 0.15))
        camera = usual.model_copy(
            update={
                "matrix": ((focal, 0.0, usual.matrix[0][2]), (0.0, focal, usual.matrix[1][2]), (0.0, 0.0, 1.0)),
                "height_m": usual.height_m * math.exp(rng.normal(0.0, 0.2)),
                "pitch_rad": usual.pitch_rad + rng.normal(0.0, 0.07),
                "distortion": (rng.uniform(-0.15, 0.02), 0.01, 0.0, 0.0) if rng.random() < 0.5 else (),
            }
        )
        layout = ground_patches(camera, _CELL_M * math.exp(rng.normal(0.0, 0.15)))
        if len(layout) >= 3:
            return _Eye(View(camera, rng), layout)


def _log_uniform(rng: np.random.Generator, ends: tuple[float, float]) -> float:
    return math.exp(rng.uniform(math.log(ends[0]), math.log(ends[1])))


def _taken(site: GroundSite, view: View, gain: float, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """An image as it is read back from its file, and how far the vehicle moved while it was exposed [m]."""
    place = (rng.uniform(-50.0, 50.0), rng.uniform(-50.0, 50.0), rng.uniform(-math.pi, math.pi))
    speed, exposure = _log_uniform(rng, _SPEED_M_S), _log_uniform(rng, _EXPOSURE_S)
    # The automatic exposure lags behind, and a bright or dark neighbourhood fools it.
    shown = float(np.clip(gain * math.exp(rng.normal(0.0, 0.15)), 0.4, 3.0))
    image = view.frame([site], place, speed * exposure, shown, rng)
    return decode_image(jpeg(image), "sample"), speed * exposure


def labelled_sounds(
    rng: np.random.Generator, sites_per_class: int, progress: Callable[[float], None] | None = None
) -> SoundSamples:
    """Make windows of contact sound at many speeds, with the drive's whine, the microphone's own noise, and others'.

    Parameters
    ----------
    rng
        Source of randomness.
    sites_per_class
        Sites of each of `SAMPLE_CLASSES`.
    progress
        Called with the share done, 0 to 1.
    """
    windows, labels, groups, snr_dB = [], [], [], []
    for name, index in _sites(sites_per_class, progress):
        voice_seed = int(rng.integers(2**32))
        for _ in range(_SOUNDS_PER_SITE):
            for window in _contact(name, voice_seed, rng):
                mixed, ratio = _among_noise(window, rng)
                windows.append(mixed)
                labels.append(name)
                groups.append(f"{name}-{index:03d}")
                snr_dB.append(ratio)
    return SoundSamples(np.stack(windows), labels, groups, np.array(snr_dB))


def _contact(name: str, voice_seed: int, rng: np.random.Generator) -> np.ndarray:
    """Windows (k, m) of the sound of a wheel on a site, at the working rate."""
    count = int((_WINDOWS_PER_SOUND * WINDOW_S + 0.05) * _SOUND_RATE_HZ)
    start = _log_uniform(rng, _SPEED_M_S)
    end = start * math.exp(rng.normal(0.0, 0.3))
    speed = np.linspace(start, end, count)
    sound = contact_sound(name, speed, _SOUND_RATE_HZ, rng, site=np.random.default_rng(voice_seed))
    sound = sound + motor_whine(speed / 0.25 / (1.0 - rng.uniform(0.0, 0.6)), _SOUND_RATE_HZ, rng)
    sound += _FLOOR * rng.standard_normal(count, dtype=np.float32)
    length = round(WINDOW_S * RATE_HZ)
    return resample(sound, _SOUND_RATE_HZ)[: _WINDOWS_PER_SOUND * length].reshape(_WINDOWS_PER_SOUND, length)


def _among_noise(window: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """A window (m,) with a disturbance or without, clipped as a recorder clips, and its ratio to that [dB]."""
    ratio_dB = NOISE_FREE_DB
    if rng.random() < _NOISY_SHARE:
        ratio_dB = float(rng.uniform(*_SNR_DB))
        own = (wind, engine)
        kind = int(rng.integers(len(own) + 1))
        other = NOISES[int(rng.integers(len(NOISES)))]
        noise = own[kind](len(window), RATE_HZ, rng) if kind < len(own) else other(len(window), rng)
        power = float(np.mean(np.square(noise)))
        window = window + noise * math.sqrt(sounding_power(window) / max(power, 1e-12)) * 10 ** (-ratio_dB / 20)
    gain = min(1.0, 3.0 / max(float(np.abs(window).max()), 1e-9)) * math.exp(rng.normal(0.0, 0.25))
    return np.clip(window * gain, -1.0, 1.0).astype(np.float32), ratio_dB


def labelled_runs(rng: np.random.Generator, sites_per_class: int) -> tuple[list[VibrationRun], list[LabelledFile]]:
    """Make runs of the demo's vehicle over one ground each, slow and then at a speed of its own; give their labels.

    Parameters
    ----------
    rng
        Source of randomness.
    sites_per_class
        Sites of each of `SAMPLE_CLASSES`, one run on each.
    """
    runs, labels = [], []
    for name, index in _sites(sites_per_class, None):
        usual = PRESETS["camera-imu"]
        driven = replace(
            usual, legs=(Leg(name, _SLOW_S, _FAST_S),), faults=(), fast_speed_m_s=_log_uniform(rng, _FAST_M_S),
            loads_N=tuple(np.multiply(usual.loads_N, math.exp(rng.normal(0.0, _LOAD_SD))).tolist()),
        )  # fmt: skip
        runs.append(felt_run(make_plan(driven, int(rng.integers(2**32)))))
        labels.append(LabelledFile(Path(f"{name}-{index:03d}"), name, f"{name}-{index:03d}"))
    return runs, labels


def felt_run(plan: Plan) -> VibrationRun:
    """Give what the inertial sensor and the wheels of a drive record, as it is read back from a recording."""
    channels = np.concatenate(list(felt(plan)))
    rows = wheel_rows(plan)
    table = WheelTable(rows.recorded, rows.wheel, None, Path("drive"))
    time_s = np.arange(len(channels)) / FELT_RATE_HZ
    return VibrationRun(time_s, CHANNELS, channels, *of_wheels(table, time_s), FELT_RATE_HZ, Path("drive"))


if not set(VOICES) == set(PAINTERS) == set(ROUGHNESS):
    raise RuntimeError("every class of the synthetic world has a look, a voice and a roughness")
