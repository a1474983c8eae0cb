"""What the sound of a drive holds besides contact sound, in the report and in print."""

from __future__ import annotations

from html import escape

from ....framework.core.html import table
from ....framework.core.sound_explanation import SoundFindings, SoundRegion, SpectralFit
from ..quantities import number, p_value, shown, with_sd
from ..words import missing_lines
from .missing import missing_section

_VERDICTS = {
    "none": "The sound is that of the contact: nothing else was found in it.",
    "physics": "The sound holds more than the contact.",
    "instrument": "The microphone or its chain adds to the sound.",
    "unknown": "The sound holds something that nothing in the catalogue explains.",
    "cannot_tell": "The sound holds more than the contact; the data do not separate the possible causes.",
}
_TOO_LITTLE = "There is too little sound to say what it holds."
_CAUSES_PRINTED = 5


def sound_verdict(sound: SoundFindings) -> str:
    """Give the verdict on the sound in one sentence."""
    if sound.verdict == "unknown" and not sound.missing:
        return _TOO_LITTLE
    return _VERDICTS[sound.verdict]


def sound_lines(sound: SoundFindings) -> list[str]:
    """Give the answer in lines of text: verdict, the most probable causes with their parameters, and the notes."""
    causes = sorted(sound.missing, key=lambda each: -each.probability)
    lines = [sound_verdict(sound)]
    for each in causes[:_CAUSES_PRINTED]:
        lines += missing_lines(each)
    if len(causes) > _CAUSES_PRINTED:
        lines.append(f"and {len(causes) - _CAUSES_PRINTED} less probable, which JSON and report list")
    return [*lines, *(f"note: {note}" for note in sound.notes)]


def sound_section(sound: SoundFindings) -> str:
    """Give the section as HTML."""
    body = f"<h2>Sound</h2><p><strong>{escape(sound_verdict(sound))}</strong></p>"
    if sound.located:
        headers = ["depends on", "from", "to", "from [Hz]", "to [Hz]", "share", "p"]
        body += table(headers, [_region_row(region) for region in sound.located])
    for cause in sound.missing:
        done = "Subtracted from the sound." if cause.subtracted else "Left in the sound: subtracting it does not help."
        body += f"{missing_section(cause)}<p>{done}</p>"
    if sound.fit is not None:
        body += _fit(sound.fit)
    return body + "".join(f"<p class=note>{escape(note)}</p>" for note in sound.notes)


def _region_row(region: SoundRegion) -> list[str]:
    numbers = (region.start, region.end, region.from_Hz, region.to_Hz)
    name = shown(region.variable).name.replace("_", " ")
    return [name, *map(number, numbers), f"{100.0 * region.share:.0f} %", p_value(region.p_value)]


def _fit(fit: SpectralFit) -> str:
    before, after, noise = map(number, (fit.rms_before_dB, fit.rms_after_dB, fit.noise_dB))
    # Where all stretches gained the same, each counts at the most that one may: a bound.
    bound = fit.nats_sd <= 1e-9 * abs(fit.nats_gained)
    gained = f"at least {number(fit.nats_gained)}" if bound else with_sd(fit.nats_gained, fit.nats_sd)
    return (
        f"<p>Held-out spectra ({escape(fit.split)}): error {before} dB before, {after} dB after, where a perfect model "
        f"would leave {noise} dB; {gained} nats gained over {fit.n} cells.</p>"
    )
