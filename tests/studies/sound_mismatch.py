"""`explain_sound` on independent drives: named right, false alarms, seconds, and the benefit of cleaning.

The drives are made here, by other means than the package's own: contact sound is real footsteps (scattered along the
way as grains, louder with speed) where the folder of recordings is given, else noise bands and clicks; the background
of half of them is real rain, sea or fire. Gear lines are phase-continuous, lugs are blows that vary, wind is shaped by
a von Karman spectrum at the Strouhal number of its speed and gusts, resonances are second-order filters.

    python tests/studies/sound_mismatch.py --data ../shared/data --drives 30 --nulls 60 --classify 12 [--write]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.signal
import soundfile
import soxr
from bevameter.audio.explain.explain import SoundExplanation, explain_sound
from bevameter.audio.features import RATE_HZ, WINDOW_S
from bevameter.audio.train import train_audio_windows
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.signal_to_noise import NOISE_FREE_DB
from bevameter.framework.core.recording.types import Labels, SoundBlock
from bevameter.framework.scenario.contact_sound import VOICES, contact_sound
from measured import write
from sound_benefit import Gain, gain_of, heard

RATE = 22050
EFFECTS = ("gear_mesh", "lug_passing", "wind_noise", "resonance", "steady_tone")
LEVELS = {
    # dB of the added sound over contact sound and background together; of a resonance, the height of its peak.
    "gear_mesh": {"plain": -15.0, "hidden": -25.0, "buried": -32.0},
    "lug_passing": {"plain": -5.0, "hidden": -12.0, "buried": -20.0},
    "wind_noise": {"plain": 6.0, "hidden": 0.0, "buried": -6.0},
    "resonance": {"plain": 12.0, "hidden": 8.0, "buried": 5.0},
    "steady_tone": {"plain": -18.0, "hidden": -28.0, "buried": -36.0},
}
QUIET_NOISES = ("Rain", "Sea_waves", "Fire_crackling")
"""Noises without lines or rhythms of their own."""


class ArraySound:
    """A `SoundStream` of samples in memory."""

    def __init__(self, samples: np.ndarray, rate: int = RATE, start_s: float = 0.0):
        self.samples, self.sample_rate, self.start_s = samples.astype(np.float32), rate, start_s

    @property
    def duration_s(self) -> float:
        return len(self.samples) / self.sample_rate

    def blocks(self, block_s: float, hop_s: float):
        length, hop = round(block_s * self.sample_rate), round(hop_s * self.sample_rate)
        for first in range(0, len(self.samples) - length + 1, hop):
            yield SoundBlock(self.start_s + first / self.sample_rate, self.samples[first : first + length])


@dataclass
class Drive:
    """Sound (m,) at RATE, its speeds at the same samples, and the wheel's channels at 10 Hz."""

    sound: np.ndarray
    wheel: np.ndarray
    travel: np.ndarray
    time_s: np.ndarray
    wheel_10: np.ndarray
    travel_10: np.ndarray
    legs: tuple[str, ...]

    def explain(self, **options) -> SoundExplanation:
        stream = ArraySound(np.clip(self.sound, -1.0, 1.0))
        return explain_sound(stream, self.time_s, self.wheel_10, self.travel_10, **options)


def speeds(duration_s: float, rng: np.random.Generator, vary: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Travel and wheel speed at RATE: slow and fast phases, accelerations of up to 1 m/s2, wandering slip."""
    n = int(duration_s * RATE)
    if not vary:
        v = np.full(n, rng.uniform(0.8, 2.5))
        return v, v / rng.uniform(0.15, 0.35) / 0.95
    knots = int(duration_s / rng.uniform(4.0, 9.0)) + 3
    coarse = np.exp(rng.uniform(np.log(0.3), np.log(rng.uniform(1.5, 3.5)), knots))
    t = np.linspace(0.0, 1.0, n)
    v = np.interp(t, np.linspace(0, 1, knots), coarse)
    smooth = scipy.signal.windows.hann(RATE)[::50]
    slow = np.convolve(np.pad(v[::50], len(smooth) // 2, "edge"), smooth / smooth.sum(), "same")
    v = np.interp(np.arange(n), np.arange(len(slow)) * 50 - len(smooth) // 2 * 50, slow)
    slip = 0.08 + 0.05 * np.interp(t, np.linspace(0, 1, knots), rng.uniform(-1, 1, knots))
    return v, v / rng.uniform(0.15, 0.35) / (1.0 - slip)


@lru_cache(maxsize=8)
def clips(data: Path, source: str) -> dict[str, list[np.ndarray]]:
    """Real clips at RATE, by class of ground (source nox, minetest) or of noise (source noise)."""
    noise = source == "noise"
    folder = data / "noise" if noise else data / "contact-sound" / source
    answer: dict[str, list[np.ndarray]] = {}
    for row in pd.read_csv(folder / "index.csv").itertuples():
        samples, rate = soundfile.read(folder / str(row.file), dtype="float32")
        samples = samples if samples.ndim == 1 else samples.mean(axis=1)
        if samples.std() > 1e-4:
            name = row._2 if noise else row.common_class
            answer.setdefault(str(name), []).append(soxr.resample(samples, rate, RATE))
    return answer


def contact(v: np.ndarray, legs: tuple[str, ...], data: Path | None, rng: np.random.Generator) -> np.ndarray:
    """Contact sound of grounds in turn along a drive, power growing with V to 1.5 to 2.4."""
    sound = np.zeros(len(v) + 2 * RATE, np.float32)
    edges = np.linspace(0, len(v), len(legs) + 1).astype(int)
    growth = rng.uniform(0.25, 0.7)
    for name, first, last in zip(legs, edges[:-1], edges[1:], strict=True):
        way = np.cumsum(v[first:last]) / RATE
        own = np.zeros(last - first + 2 * RATE, np.float32)
        if data is None:
            own += synthetic_ground(v[first:last], growth, rng)
        else:
            count = int(rng.uniform(6, 14) * way[-1])
            for place in np.sort(rng.uniform(0, way[-1], count)):
                at = int(np.searchsorted(way, place))
                clip = clips(data, "nox")[name][int(rng.integers(len(clips(data, "nox")[name])))]
                clip = soxr.resample(clip[: RATE // 2], RATE, RATE * np.exp(rng.normal(0, 0.08)), quality="QQ")
                gain = v[first + min(at, last - first - 1)] ** growth * np.exp(rng.normal(0, 0.5))
                own[at : at + clip.size] += gain * clip
        sound[first : first + len(own)] += own * (0.04 * np.exp(rng.normal(0, 0.2)) / max(own.std(), 1e-9))
    return sound[: len(v)]


def synthetic_ground(v: np.ndarray, growth: float, rng: np.random.Generator) -> np.ndarray:
    """Noise bands and clicks for a ground where no recordings are at hand, two seconds longer than v (m,)."""
    n = len(v) + 2 * RATE
    gain = np.pad(v, (0, 2 * RATE), "edge") ** (growth + 0.5)
    sound = np.zeros(n)
    for _ in range(3):
        low = np.exp(rng.uniform(np.log(80), np.log(3000)))
        band = scipy.signal.butter(1, [low, min(low * rng.uniform(2, 8), 9500)], "bandpass", fs=RATE, output="sos")
        part = scipy.signal.sosfilt(band, rng.standard_normal(n))
        sound += rng.uniform(0.3, 1.0) * part / part.std()
    clicks = rng.standard_normal(n) * (rng.random(n) < rng.uniform(20, 200) / RATE)
    band = scipy.signal.butter(2, [300, rng.uniform(2000, 8000)], "bandpass", fs=RATE, output="sos")
    part = scipy.signal.sosfilt(band, clicks)
    return ((sound + rng.uniform(0, 2) * part / part.std()) * gain).astype(np.float32)


def background(n: int, data: Path | None, rng: np.random.Generator) -> np.ndarray:
    """The microphone's own noise and, on half of the drives, rain, sea or fire, clip after clip, of unit power."""
    sound = 0.2 * rng.standard_normal(n)
    if data is not None and rng.random() < 0.5:
        own = clips(data, "noise")[QUIET_NOISES[int(rng.integers(3))]]
        tape: list[np.ndarray] = []
        while sum(len(c) for c in tape) < n:
            # No clip is repeated at the same pitch: a loop would be a line.
            clip = own[int(rng.integers(len(own)))]
            clip = soxr.resample(clip, RATE, RATE * np.exp(rng.normal(0, 0.05)), quality="QQ")
            tape.append(clip / max(clip.std(), 1e-6))
        sound = sound + np.concatenate(tape)[:n]
    return sound / sound.std()


def clean_drive(
    data: Path | None, rng: np.random.Generator, duration_s: float = 100.0, vary: bool = True, grounds: int = 4
) -> Drive:
    """A drive over grounds with nothing but contact sound and background."""
    v, omega = speeds(duration_s, rng, vary)
    names = sorted(clips(data, "nox")) if data is not None else [f"ground {i}" for i in range(12)]
    legs = tuple(str(x) for x in rng.choice(names, grounds, replace=False))
    sound = contact(v, legs, data, rng)
    sound = sound + background(len(v), data, rng) * sound.std() * 10 ** (rng.uniform(-35, -15) / 20)
    time_s = np.arange(0.0, duration_s + 0.05, 0.1)
    at = np.minimum((time_s * RATE).astype(int), len(v) - 1)
    noise = rng.normal(0, [[0.005], [0.003]], (2, time_s.size))
    return Drive(sound, omega, v, time_s, omega[at] + noise[0], v[at] + noise[1], legs)


def _scaled(part: np.ndarray, drive: Drive, level_dB: float) -> np.ndarray:
    return part * (drive.sound.std() / part.std() * 10 ** (level_dB / 20))


def add(effect: str, drive: Drive, level_dB: float, rng: np.random.Generator) -> dict[str, float]:
    """Add an effect to a drive in place, and give its true parameters."""
    n, t = len(drive.sound), np.arange(len(drive.sound)) / RATE
    theta = np.cumsum(drive.wheel) / RATE
    if effect == "gear_mesh":
        order = float(rng.uniform(45, 300))
        order += 0.25 if abs(order - round(order)) < 0.15 else 0.0
        wander = np.interp(t, np.arange(0, t[-1] + 4, 4.0), rng.normal(0, 0.4, int(t[-1] // 4) + 2))
        part = np.cos(order * theta + wander)
        for k in range(2, int(rng.integers(2, 5))):
            part += rng.uniform(0.2, 0.7) * np.cos(k * order * theta + rng.uniform(0, 6))
        part *= 1.0 + 0.3 * np.cos(theta)
        part *= np.sqrt(drive.wheel / drive.wheel.mean())
        truth = {"order": order}
    elif effect == "lug_passing":
        lugs = int(rng.integers(8, 31))
        passed = np.flatnonzero(np.diff(np.floor(lugs * theta / (2 * np.pi))) > 0)
        train = np.zeros(n)
        train[passed] = drive.travel[passed] ** 0.8 * np.exp(rng.normal(0, 0.3, passed.size))
        time = np.arange(int(0.02 * RATE)) / RATE
        ring = np.exp(-time / rng.uniform(0.0008, 0.003)) * np.sin(2 * np.pi * rng.uniform(300, 2000) * time)
        part = scipy.signal.fftconvolve(train, ring)[:n] + 0.1 * train
        truth = {"lug_count": float(lugs)}
    elif effect == "wind_noise":
        part = windy(drive.travel, rng)
        truth = {}
    elif effect == "steady_tone":
        frequency = float(np.exp(rng.uniform(np.log(90), np.log(3500))))
        part = np.cos(2 * np.pi * frequency * t)
        truth = {"frequency": frequency}
    else:
        frequency, q = float(np.exp(rng.uniform(np.log(200), np.log(3000)))), float(rng.uniform(8, 35))
        b, a = scipy.signal.iirpeak(frequency, q, fs=RATE)
        drive.sound = drive.sound + (10 ** (level_dB / 20) - 1.0) * scipy.signal.lfilter(b, a, drive.sound)
        return {"frequency": frequency}
    drive.sound = drive.sound + _scaled(part, drive, level_dB)
    return truth


def windy(v: np.ndarray, rng: np.random.Generator, screen_m: float = 0.04) -> np.ndarray:
    """Wind on a screen: von Karman's spectrum at Strouhal number f D / V, pressure with V^2, gusts of 15 %."""
    size, hop = 4096, 2048
    count = len(v) // hop + 2
    gust = np.exp(0.15 * np.convolve(rng.standard_normal(count + 8), np.ones(9) / 3, "valid"))
    speed = np.interp(np.arange(count) * hop, np.arange(len(v)), v) * gust
    f = np.fft.rfftfreq(size, 1 / RATE)
    strouhal = f * 6.0 * screen_m / speed[:, None]
    shape = speed[:, None] ** 4 * (screen_m / speed[:, None]) * (1 + strouhal**2) ** (-8 / 6) * (f > 8)
    noise = rng.standard_normal((count, f.size)) + 1j * rng.standard_normal((count, f.size))
    pieces = np.fft.irfft(noise * np.sqrt(shape), size, axis=1) * np.sqrt(scipy.signal.windows.hann(size, sym=False))
    sound = np.zeros((count + 1) * hop)
    for index, piece in enumerate(pieces):
        sound[index * hop : index * hop + size] += piece
    return sound[: len(v)]


def right(effect: str, truth: dict[str, float], found: SoundExplanation) -> bool:
    """Whether the effect is named with probability of a half or more, and in its place."""
    tolerance = {"order": 0.01, "lug_count": 1e-6, "frequency": 0.02}
    for cause in found.findings.missing:
        if cause.effect != effect or cause.probability < 0.5:
            continue
        places = {name: [cause.parameters[name].value] if name in cause.parameters else [] for name in truth}
        if all(any(abs(p / value - 1) < tolerance[name] for p in places[name]) for name, value in truth.items()):
            return True
    return False


def false_names(truth: set[str], found: SoundExplanation) -> list[str]:
    """Causes asserted (probability 0.75 or more) that are not in the drive."""
    return [c.effect for c in found.findings.missing if c.probability >= 0.75 and c.effect not in truth]


def interval(k: int, n: int) -> str:
    """Wilson's 95 % interval of a share, in percent."""
    z, p = 1.96, k / max(n, 1)
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return f"{100 * p:.0f} % ({100 * max(middle - half, 0):.0f}-{100 * min(middle + half, 1):.0f})"


# Benefit of cleaning for the classifier.


def clean_classifier(rng: np.random.Generator, sites: int = 10) -> TerrainClassifier:
    """A classifier trained on the package's synthetic grounds, with a microphone's own noise only."""
    windows, labels, groups = [], [], []
    length = round(WINDOW_S * RATE_HZ)
    for name in VOICES:
        for site in range(sites):
            seed = int(rng.integers(2**32))
            for _ in range(4):
                start = np.exp(rng.uniform(np.log(0.2), np.log(3.5)))
                v = np.linspace(start, start * np.exp(rng.normal(0, 0.3)), int(3.1 * RATE))
                sound = contact_sound(name, v, RATE, rng, site=np.random.default_rng(seed))
                sound = soxr.resample(sound + 0.0006 * rng.standard_normal(len(v)), RATE, RATE_HZ)
                for k in range(3):
                    windows.append(sound[k * length : (k + 1) * length].astype(np.float32))
                    labels.append(name)
                    groups.append(f"{name}-{site}")
    snr = np.full(len(windows), NOISE_FREE_DB + 10.0)
    return train_audio_windows(
        np.stack(windows), labels, groups, snr, rng, candidates=("logistic",)
    ).classifier  # fmt: skip


def labelled_drive(rng: np.random.Generator, duration_s: float = 96.0) -> tuple[Drive, Labels]:
    """A drive over all synthetic grounds at sites of its own, in random order."""
    v, omega = speeds(duration_s, rng)
    names = tuple(str(x) for x in rng.permutation(list(VOICES)))
    edges = np.linspace(0, len(v), len(names) + 1).astype(int)
    parts = [contact_sound(name, v[a:b], RATE, rng) for name, a, b in zip(names, edges[:-1], edges[1:], strict=True)]
    sound = np.concatenate(parts) + 0.0006 * rng.standard_normal(len(v))
    time_s = np.arange(0.0, duration_s + 0.05, 0.1)
    at = np.minimum((time_s * RATE).astype(int), len(v) - 1)
    drive = Drive(sound, omega, v, time_s, omega[at] + rng.normal(0, 0.005, at.size), v[at], names)
    return drive, Labels(edges[:-1] / RATE, edges[1:] / RATE, names)


NOISE_FOR_CLASSES = {"gear_mesh": (-5.0, 5.0), "lug_passing": (-5.0, 5.0), "wind_noise": (0.0, 15.0),
                     "resonance": (10.0, 20.0), "steady_tone": (-5.0, 5.0)}  # fmt: skip
"""Levels [dB] of the effects in the drives that are classified, drawn evenly."""


def classify_study(
    model: TerrainClassifier,
    effect: str | None,
    drives: int,
    seed: int,
    duration_s: float = 96.0,
    level_dB: tuple[float, float] | None = None,
) -> tuple[Gain, int]:
    """Recognise the ground on drives with an effect, before and after cleaning; also how many were cleaned."""
    rng = np.random.default_rng([seed, 99])
    before, after, cleaned = [], [], 0
    for _ in range(drives):
        drive, labels = labelled_drive(rng, duration_s)
        if effect is not None:
            add(effect, drive, rng.uniform(*(level_dB or NOISE_FOR_CLASSES[effect])), rng)
            drive.sound *= min(1.0, 0.95 / np.abs(drive.sound).max())
        found = drive.explain()
        before.append(heard(ArraySound(np.clip(drive.sound, -1, 1)), model, labels))
        after.append(heard(found.cleaned, model, labels) if found.subtraction else before[-1])
        cleaned += bool(found.subtraction)
    return gain_of(before, after, rng), cleaned


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=None, help="folder with contact-sound/ and noise/")
    parser.add_argument("--drives", type=int, default=30, help="drives for each effect and level")
    parser.add_argument("--nulls", type=int, default=60)
    parser.add_argument("--classify", type=int, default=12, help="drives for each effect")
    parser.add_argument("--only", nargs="*", default=list(EFFECTS))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="write sound-named and sound-cleaned of docs/measured")
    options = parser.parse_args()
    rng = np.random.default_rng([options.seed, 1])
    alarms, mentioned, seconds = [], 0, []
    for _ in range(options.nulls):
        drive = clean_drive(options.data, rng)
        found = drive.explain()
        seconds.append(found.findings.seconds / (len(drive.sound) / RATE / 60))
        alarms.append(false_names(set(), found))
        mentioned += bool(found.findings.missing)
    if options.nulls:
        wrong = sum(bool(a) for a in alarms)
        print(f"nulls: {wrong} of {options.nulls} with a false name, {interval(wrong, options.nulls)}; {alarms}")
        print(f"nulls with anything listed: {mentioned}; seconds per minute of sound: {np.median(seconds):.2f}")
    rows = []
    for effect in options.only if options.drives else ():
        rows.append([f"`{effect}`"])
        for level, level_dB in LEVELS[effect].items():
            named, false, n, begun = 0, [], options.drives, time.monotonic()
            for index in range(n):
                own = np.random.default_rng([options.seed, 2, EFFECTS.index(effect), index])
                drive = clean_drive(options.data, own)
                truth = add(effect, drive, level_dB, own)
                drive.sound *= min(1.0, 0.95 / np.abs(drive.sound).max())
                found = drive.explain()
                named += right(effect, truth, found)
                false += false_names({effect}, found)
            rows[-1].append(f"{level_dB:g} dB: {named} of {n}")
            print(f"{effect:12s} {level:7s} {level_dB:6.1f} dB: named right {interval(named, n)} of {n}; "
                  f"false names {false}; {time.monotonic() - begun:.0f} s", flush=True)  # fmt: skip
    if options.write and rows:
        of = "real footsteps" if options.data is not None else "noise bands and clicks"
        data = f"Simulated, of {of}; {options.drives} drives a cell"
        write("sound-named", ("effect", *LEVELS["gear_mesh"]), rows, data=data)
    rows = []
    if options.classify:
        model = clean_classifier(np.random.default_rng([options.seed, 3]))
        for effect in (None, *options.only):
            gain, cleaned = classify_study(model, effect, options.classify, options.seed)
            difference = f"{gain.difference:+.3f} ({gain.low:.3f} to {gain.high:.3f})"
            rows.append((f"`{effect}`" if effect else "nothing", f"{gain.before:.3f}", f"{gain.after:.3f}", difference))
            print(f"classes under {effect or 'nothing':12s}: {gain.before:.3f} -> {gain.after:.3f} "
                  f"({gain.difference:+.3f}, {gain.low:+.3f} to {gain.high:+.3f}), known {gain.known_before:.2f} -> "
                  f"{gain.known_after:.2f}, {gain.drives} drives, {cleaned} cleaned", flush=True)  # fmt: skip
    if options.write and rows:
        data = f"Simulated; {options.classify} drives a row"
        write("sound-cleaned", ("under", "before", "after", "difference"), rows, data=data)


if __name__ == "__main__":
    main()
