"""Explain the sound of a drive: what in it is more than contact sound, what that is, and the sound without it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...framework.core.recording.types import SoundStream
from .alignment import FOLDS, HeldOutGain
from .answer import Explained, Located, Parameter, SoundFindings, SpectralFit
from .cleaning import CleanedSound, Subtraction, TrackedLine
from .combs import Comb
from .drive_spectra import STRETCH_S, DriveSpectra, Track, drive_spectra, reference_level
from .families import SURE, causes_of, comb_cause, without_subtraction
from .lines import FALSE_DISCOVERY_RATE, Line, find_lines
from .resonances import ResonanceFinding, find_resonances
from .wind import WindFinding, find_wind

LEAST_STRETCHES = 5
"""Nothing can be held out of less."""
_PRIOR_NATS = 3.0
"""Held-out gain from which a cause is as likely as not: one in twenty drives is taken to have any one cause."""
_LEAST_NATS = 6.0
"""A line that gains less than this, after paying for the places searched, is not worth a statement."""
_NOISE_DB = 10.0 / np.log(10.0) * np.pi / np.sqrt(6.0)
"""Standard deviation of 10 log10 of an exponential variable [dB]: the scatter of one block's spectrum."""
_NO_EXCESS = "the excess of what was found at {place} is not known: it stands too high, or wanders too far, for that"
_ANOTHER_SOURCE = "a tap on the vehicle at rest: the ring of the lugs' blows goes with them, that of the mount stays"
_ANOTHER_GROUND = "drive on a ground that sounds different: what belongs to the vehicle stays"


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

    def to_json(self) -> dict:
        """Give the findings as JSON-able values."""
        return self.findings.to_json()


@dataclass(frozen=True)
class _Cause:
    """A cause with where it was located and what it adds to the fit."""

    explained: Explained
    places: tuple[tuple[str, float, float, float, float, float], ...]
    gains: tuple[HeldOutGain | WindFinding | ResonanceFinding, ...]
    noise_dB: float


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
        (docs/sound-mismatch.md), so it is not done unasked.
    rng
        Draws the surrogates; seed 0 where absent.
    progress
        Told the share done, 0 to 1.

    Raises
    ------
    InputError
        The channels are no track, or no sound was recorded while there was one.
    """
    begun = time.monotonic()
    rng = np.random.default_rng(0) if rng is None else rng
    tell = progress or (lambda _: None)
    track = Track.of(time_s, wheel_speed_rad_s, travel_speed_m_s)
    spectra = drive_spectra(sound, track)
    tell(0.4)
    if spectra.stretches.size < LEAST_STRETCHES:
        heard = spectra.stretches.size * STRETCH_S
        note = f"{heard:g} s of sound: {LEAST_STRETCHES * STRETCH_S:g} s are needed to hold any out"
        findings = SoundFindings("unknown", (), (), None, (*spectra.skipped, note), time.monotonic() - begun)
        return SoundExplanation(findings, sound, Subtraction())
    lines, comb = find_lines(spectra, rng, lug_count)
    tell(0.7)
    humps = find_resonances(spectra, lines, rng, None if reference is None else reference_level(reference))
    # The flanks of a sharp resonance are no tones of their own.
    lines = [line for line in lines if not any(_within_hump(line, hump) for hump in humps)]
    causes, tracked = _line_causes(lines, lug_count)
    if comb is not None:
        causes.insert(0, _comb_cause(comb, spectra, lug_count))
        tracked.append(TrackedLine(comb.place, True, comb.teeth, tuple(gain.line.excess for gain in comb.gains)))
    wind = find_wind(spectra, rng)
    tell(0.9)
    notes = list(spectra.skipped)
    if isinstance(wind, str):
        notes.append(wind)
    elif (cause := _wind_cause(wind, spectra, subtract_wind)) is not None:
        causes.append(cause)
    lugs = any(cause.explained.effect == "lug_passing" for cause in causes)
    hump_causes = [_resonance_cause(hump, lugs) for hump in humps]
    causes += [cause for cause in hump_causes if cause is not None]
    notes += [_NO_EXCESS.format(place=_place_in_words(c)) for c in causes if _lacks_excess(c)]
    subtraction = Subtraction(
        tuple(tracked),
        wind.model if not isinstance(wind, str) and _applied(causes, "wind_noise") else None,
        tuple(h for h, c in zip(humps, hump_causes, strict=True) if c is not None and c.explained.applied),
    )
    findings = SoundFindings(
        _verdict(causes), _located(causes), tuple(c.explained for c in causes), _fit(causes, spectra), tuple(notes),
        time.monotonic() - begun,
    )  # fmt: skip
    tell(1.0)
    return SoundExplanation(findings, CleanedSound(sound, track, subtraction) if subtraction else sound, subtraction)


def _lacks_excess(cause: _Cause) -> bool:
    excess = cause.explained.parameters.get("excess")
    return excess is not None and excess.value is None


def _place_in_words(cause: _Cause) -> str:
    variable, low, high, *_ = cause.places[0]
    middle = 0.5 * (low + high)
    return f"{middle:.4g} Hz" if variable == "frequency_Hz" else f"order {middle:.4g}"


def _comb_cause(comb: Comb, spectra: DriveSpectra, lug_count: int | None) -> _Cause:
    low, high = (float(x) for x in np.quantile(spectra.shaft_hz, [0.02, 0.98]))
    top = spectra.top_hz
    places = tuple(
        ("wheel_order", k * (comb.place - 2.0 * comb.sd), k * (comb.place + 2.0 * comb.sd),
         min(k * comb.place * low, top), min(k * comb.place * high, top), comb.p_value)
        for k in comb.teeth
    )  # fmt: skip
    return _Cause(comb_cause(comb, lug_count), places, comb.gains, float(_NOISE_DB))


def _line_causes(lines: list[Line], lug_count: int | None) -> tuple[list[_Cause], list[TrackedLine]]:
    """Causes of lines worth a statement, and the lines that are subtracted."""
    answer, subtracted = [], []
    for explained, own in causes_of(lines, lug_count):
        if sum(line.gain.nats for line in own) < _LEAST_NATS + np.log(5000.0) - _PRIOR_NATS:
            continue
        tonal = [line for line in own if line.family != "envelope"]
        helps = sum(line.gain.after_dB2 for line in tonal) < sum(line.gain.before_dB2 for line in tonal)
        cause = explained if explained.applied and tonal and helps else without_subtraction(explained)
        if cause.applied:
            subtracted += [TrackedLine(t.place, t.family == "order", (1,), (t.excess,)) for t in tonal]
        places = tuple(_place(line) for line in own)
        answer.append(_Cause(cause, places, tuple(line.gain for line in own), float(_NOISE_DB)))
    return answer, subtracted


def _place(line: Line) -> tuple[str, float, float, float, float, float]:
    variable = "frequency_Hz" if line.family == "fixed" else "wheel_order"
    return (
        variable, line.place - 2.0 * line.sd, line.place + 2.0 * line.sd, line.from_hz, line.to_hz, line.p_value,
    )  # fmt: skip


def _wind_cause(wind: WindFinding, spectra: DriveSpectra, subtract: bool) -> _Cause | None:
    if wind.p_value > FALSE_DISCOVERY_RATE or wind.nats < _PRIOR_NATS:
        return None
    probability = float(1.0 / (1.0 + np.exp(-(wind.nats - _PRIOR_NATS))))
    unit = "ln of full scale squared per Hz at 100 Hz and 1 m/s"
    explained = Explained(
        "wind_noise", probability,
        {"level": Parameter(wind.model.log_w, wind.sd[0], unit),
         "exponent": Parameter(wind.model.exponent, wind.sd[1], "1"),
         "slope": Parameter(wind.model.slope, wind.sd[2], "1")},
        wind.nats, applied=subtract and wind.after_dB2 < wind.before_dB2 and probability > SURE,
        would_tell="" if probability > SURE else "accelerate over a wider range of speed on one ground",
    )  # fmt: skip
    place = ("travel_speed", *wind.speed_m_s, float(spectra.band_hz[0]), wind.top_hz, wind.p_value)
    return _Cause(explained, (place,), (wind,), wind.noise_dB)


def _within_hump(line: Line, hump: ResonanceFinding) -> bool:
    middle, q = hump.frequency_hz[0], hump.q[0]
    weak = line.excess < 0.5 * hump.gain[0]
    return line.family == "fixed" and weak and abs(line.place - middle) < 1.5 * middle / q


def _resonance_cause(hump: ResonanceFinding, lugs: bool) -> _Cause | None:
    """Name a hump; on a single ground, or where lugs strike, it may be theirs."""
    if hump.nats < _PRIOR_NATS:
        return None
    rivals = (("contact sound of this ground",) if hump.grounds == 1 else ()) + (("lug_passing",) if lugs else ())
    sure = float(1.0 / (1.0 + np.exp(-(hump.nats - _PRIOR_NATS))))
    tells = ([_ANOTHER_GROUND] if hump.grounds == 1 else []) + ([_ANOTHER_SOURCE] if lugs else [])
    middle, q = hump.frequency_hz[0], hump.q[0]
    explained = Explained(
        "resonance", sure / (1 + len(rivals)),
        {"frequency": Parameter(*hump.frequency_hz, "Hz"), "quality_factor": Parameter(*hump.q, "1"),
         "gain": Parameter(*hump.gain, "1")},
        hump.nats, frequencies_Hz=(middle,), applied=not rivals and hump.after_dB2 < hump.before_dB2,
        indistinguishable_from=rivals, would_tell="; ".join(tells),
    )  # fmt: skip
    half = 0.5 * middle / q
    place = ("frequency_Hz", middle - half, middle + half, middle - half, middle + half, hump.p_value)
    return _Cause(explained, (place,), (hump,), 0.0)


def _applied(causes: list[_Cause], effect: str) -> bool:
    return any(cause.explained.effect == effect and cause.explained.applied for cause in causes)


def _verdict(causes: list[_Cause]) -> str:
    """The worst of what is to be said, as in CONTRACTS.md."""
    explained = [cause.explained for cause in causes]
    if not explained:
        return "none"
    sure = [e for e in explained if e.probability >= SURE]
    if not sure:
        return "cannot_tell"
    named = [e for e in sure if e.effect != "unknown"]
    if not named:
        return "unknown"
    return "physics" if all(e.effect == "lug_passing" for e in named) else "instrument"


def _located(causes: list[_Cause]) -> tuple[Located, ...]:
    total = sum(max(gain.nats, 0.0) for cause in causes for gain in cause.gains) or 1.0
    return tuple(
        Located(variable, low, high, from_hz, to_hz, max(gain.nats, 0.0) / total, p)  # pyright: ignore[reportArgumentType]
        for cause in causes
        for (variable, low, high, from_hz, to_hz, p), gain in zip(cause.places, cause.gains, strict=False)
    )


def _fit(causes: list[_Cause], spectra: DriveSpectra) -> SpectralFit | None:
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
