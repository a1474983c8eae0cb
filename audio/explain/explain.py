"""Explain the sound of a drive: what in it is more than contact sound, what that is, and the sound without it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...framework.core.explanation import verdict_of
from ...framework.core.recording.types import SoundStream
from ...framework.core.sound_explanation import SoundFindings, SoundRegion, SpectralFit
from .alignment import FOLDS
from .causes import Cause, comb_cause, line_causes, resonance_cause, wind_cause
from .cleaning import CleanedSound, Subtraction, TrackedLine
from .drive_spectra import STRETCH_S, DriveSpectra, Speeds, drive_spectra, reference_level
from .lines import Line, find_lines
from .resonances import ResonanceFinding, find_resonances
from .wind import find_wind

LEAST_STRETCHES = 5
"""Nothing can be held out of less."""
_NO_EXCESS = "the excess of what was found at {place} is not known: it stands too high, or wanders too far, for that"


@dataclass(frozen=True)
class SoundExplanation:
    """What was found in the sound of a drive, and the sound without it.

    Parameters
    ----------
    findings
        What was located, named, and how held-out spectra gain.
    cleaned
        The sound with all that is subtracted taken away, as a stream at `bevameter.audio.features.RATE_HZ`; the
        recorded stream itself where nothing is.
    subtraction
        What was taken away.
    """

    findings: SoundFindings
    cleaned: SoundStream
    subtraction: Subtraction


def explain_sound(
    sound: SoundStream,
    time_s: np.ndarray,
    wheel_speed_rad_s: np.ndarray,
    travel_speed_m_s: np.ndarray,
    *,
    reference: SoundStream | None = None,
    lug_count: int | None = None,
    subtract_wind: bool = False,
    rng: np.random.Generator | None = None,
    progress: Callable[[float], None] | None = None,
) -> SoundExplanation:
    """Find, name and take away what in a drive's sound is not contact sound.

    Contact sound is what is smooth in frequency and grows with speed as on one ground; what stands out of it is tested
    against surrogates of the drive (false discovery rate `FALSE_DISCOVERY_RATE`), named by held-out stretches, and
    subtracted where held-out spectra come closer to contact sound by it.

    Parameters
    ----------
    sound
        The recorded sound.
    time_s, wheel_speed_rad_s, travel_speed_m_s : (n,)
        The wheel's channels on the recording's clock; rows with NaN are left out.
    reference
        Contact sound known to be clean, of the same microphone on the same ground: what stands in it is no fault.
    lug_count
        How many lugs the wheel has, where that is known.
    subtract_wind
        Whether wind is held down in the cleaned sound: brings spectra closer, but was not shown to help the classifier
        (docs/sound.md), so it is off by default.
    rng
        Draws the surrogates; seed 0 where absent.
    progress
        Called with the share done, 0 to 1.

    Raises
    ------
    InputError
        The channels are no track, or no sound was recorded while there was one.
    """
    begun = time.monotonic()
    rng = np.random.default_rng(0) if rng is None else rng
    report = progress or (lambda _: None)
    speeds = Speeds.of(time_s, wheel_speed_rad_s, travel_speed_m_s)
    spectra = drive_spectra(sound, speeds)
    report(0.4)
    if spectra.stretches.size < LEAST_STRETCHES:
        heard = spectra.stretches.size * STRETCH_S
        note = f"{heard:g} s of sound: {LEAST_STRETCHES * STRETCH_S:g} s are needed to hold any out"
        findings = SoundFindings("unknown", notes=(*spectra.skipped, note), seconds=time.monotonic() - begun)
        return SoundExplanation(findings, sound, Subtraction())
    lines, comb = find_lines(spectra, rng, lug_count)
    report(0.7)
    humps = find_resonances(spectra, lines, rng, None if reference is None else reference_level(reference))
    # The flanks of a sharp resonance are no tones of their own.
    lines = [line for line in lines if not any(_within_hump(line, hump) for hump in humps)]
    named = line_causes(lines, lug_count)
    causes = [cause for cause, _ in named]
    tracked = [TrackedLine(t.place, t.family == "order", (1,), (t.excess,)) for _, taken in named for t in taken]
    if comb is not None:
        causes.insert(0, comb_cause(comb, spectra, lug_count))
        tracked.append(TrackedLine(comb.place, True, comb.teeth, tuple(gain.line.excess for gain in comb.gains)))
    wind = find_wind(spectra, rng)
    report(0.9)
    blown = None if isinstance(wind, str) else wind_cause(wind, subtract=subtract_wind)
    lugs = any(cause.found.effect == "lug_passing" for cause in causes)
    ringing = [(hump, cause) for hump in humps if (cause := resonance_cause(hump, lugs=lugs)) is not None]
    causes += [*([] if blown is None else [blown]), *(cause for _, cause in ringing)]
    subtraction = Subtraction(
        tuple(tracked),
        wind.model if not isinstance(wind, str) and blown is not None and blown.found.subtracted else None,
        tuple(hump for hump, cause in ringing if cause.found.subtracted),
    )
    notes = [*spectra.skipped, *([wind] if isinstance(wind, str) else [])]
    notes += [_NO_EXCESS.format(place=_place_in_words(c)) for c in causes if _lacks_excess(c)]
    missing = tuple(cause.found for cause in causes)
    findings = SoundFindings(
        verdict_of(missing), _located(causes), missing, _fit(causes, spectra), tuple(notes), time.monotonic() - begun
    )
    report(1.0)
    return SoundExplanation(findings, CleanedSound(sound, speeds, subtraction) if subtraction else sound, subtraction)


def _within_hump(line: Line, hump: ResonanceFinding) -> bool:
    middle, q = hump.frequency_hz[0], hump.q[0]
    weak = line.excess < 0.5 * hump.gain[0]
    return line.family == "fixed" and weak and abs(line.place - middle) < 1.5 * middle / q


def _lacks_excess(cause: Cause) -> bool:
    excess = cause.found.parameters.get("excess")
    return excess is not None and not np.isfinite(excess.value)


def _place_in_words(cause: Cause) -> str:
    first = cause.places[0]
    middle = 0.5 * (first.start + first.end)
    return f"{middle:.4g} Hz" if first.variable == "frequency_Hz" else f"order {middle:.4g}"


def _located(causes: list[Cause]) -> tuple[SoundRegion, ...]:
    pairs = [pair for cause in causes for pair in zip(cause.places, cause.gains, strict=True)]
    total = sum(max(gain.nats, 0.0) for _, gain in pairs) or 1.0
    return tuple(replace(place, share=max(gain.nats, 0.0) / total) for place, gain in pairs)


def _fit(causes: list[Cause], spectra: DriveSpectra) -> SpectralFit | None:
    gains = [(gain, cause.noise_dB) for cause in causes for gain in cause.gains]
    n = sum(gain.n for gain, _ in gains)
    if n == 0:
        return None
    nats = [gain.by_stretch for gain, _ in gains]
    width = max(len(part) for part in nats)
    by_stretch = sum(np.pad(part, (0, width - len(part))) for part in nats)
    return SpectralFit(
        f"{spectra.stretches.size} stretches of {STRETCH_S:g} s, {FOLDS} folds, every fifth held out in turn",
        float(np.sqrt(sum(gain.before_dB2 for gain, _ in gains) / n)),
        float(np.sqrt(sum(gain.after_dB2 for gain, _ in gains) / n)),
        float(np.sqrt(sum(gain.n * noise**2 for gain, noise in gains) / n)),
        float(np.sum(by_stretch)), float(np.std(by_stretch) * np.sqrt(width)), n,
    )  # fmt: skip
