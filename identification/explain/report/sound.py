"""Contact sound in the report and in print, from the JSON of `audio.mismatch` (a dict: audio is not imported here)."""

from __future__ import annotations

from html import escape
from typing import Any

from ....framework.core.html import table
from ..quantities import KINDS, number, p_value, percent, shown, spread

_VERDICTS = {
    "none": "The sound is that of the contact: nothing else was found in it.",
    "physics": "The sound holds more than the contact.",
    "instrument": "The microphone or its chain adds to the sound.",
    "unknown": "The sound holds something that nothing in the catalogue explains.",
    "cannot_tell": "The sound holds more than the contact; the data do not separate the possible causes.",
}
_TOO_LITTLE = "There is too little sound to say what it holds."
_CAUSES_PRINTED = 5


def sound_verdict(sound: dict[str, Any]) -> str:
    """Give the verdict on the sound in one sentence."""
    verdict = str(sound.get("verdict", "unknown"))
    if verdict == "unknown" and not sound.get("missing"):
        return _TOO_LITTLE
    return _VERDICTS.get(verdict, verdict)


def sound_lines(sound: dict[str, Any]) -> list[str]:
    """Give the answer in lines of text: verdict, the likeliest causes with their numbers, and the notes."""
    causes = sorted(sound.get("missing") or (), key=lambda each: -float(each.get("probability", 0.0)))
    lines = [sound_verdict(sound)]
    for each in causes[:_CAUSES_PRINTED]:
        lines += _cause_lines(each)
    if len(causes) > _CAUSES_PRINTED:
        lines.append(f"and {len(causes) - _CAUSES_PRINTED} less probable, which JSON and report list")
    return [*lines, *(f"note: {note}" for note in sound.get("notes") or ())]


def _cause_lines(cause: dict[str, Any]) -> list[str]:
    effect, kind = str(cause.get("effect", "")), str(cause.get("kind", ""))
    probability = percent(float(cause.get("probability", 0.0)))
    lines = [f"{_words(effect)} ({effect}; {KINDS.get(kind, kind)}): {probability}"]
    for name, value in (cause.get("parameters") or {}).items():
        unit = str(value.get("unit") or "1")
        middle, sd = _float(value.get("value")), value.get("sd")
        value_and_sd = number(middle) if sd is None else spread(middle, _float(sd))
        lines.append(f"  {_words(name)} = {value_and_sd}" + (f" {unit}" if unit != "1" else ""))
    if cause.get("indistinguishable_from"):
        lines.append(
            f"  indistinguishable from: {', '.join(_words(str(each)) for each in cause['indistinguishable_from'])}"
        )
    if cause.get("would_tell"):
        lines.append(f"  to decide: {cause['would_tell']}")
    return lines


def _words(slug: str) -> str:
    return slug.replace("_", " ")


def sound_section(sound: dict[str, Any]) -> str:
    """Give the section as HTML.

    Parameters
    ----------
    sound
        Keys as in CONTRACTS.md: verdict, located, missing, fit, notes; those that are absent are passed over.
    """
    body = f"<h2>Sound</h2><p><strong>{escape(sound_verdict(sound))}</strong></p>"
    if sound.get("located"):
        body += table(
            ["depends on", "from", "to", "from [Hz]", "to [Hz]", "share", "p"],
            [
                [
                    shown(str(each.get("variable", ""))).name.replace("_", " "),
                    *(_cell(each.get(key)) for key in ("from", "to", "from_Hz", "to_Hz")),
                    f"{100.0 * float(each['share']):.0f} %" if each.get("share") is not None else "",
                    p_value(float(each["p_value"])) if each.get("p_value") is not None else "",
                ]
                for each in sound["located"]
            ],
        )
    body += "".join(_cause(each) for each in sound.get("missing") or ())
    if sound.get("fit"):
        body += _fit(sound["fit"])
    return body + "".join(f"<p class=note>{escape(str(note))}</p>" for note in sound.get("notes") or ())


def _cause(cause: dict[str, Any]) -> str:
    effect, equation, source = (escape(str(cause.get(key, ""))) for key in ("effect", "equation", "source"))
    body = f"<h3>{effect.replace('_', ' ')}: {percent(float(cause.get('probability', 0.0)))}</h3>"
    body += f"<p>Equation: <code>{equation}</code><br>Source: {source}"
    if "subtracted" in cause:
        body += "<br>" + (
            "Subtracted from the sound." if cause["subtracted"] else "Left in the sound: subtracting it does not help."
        )
    body += "</p>"
    rows = [
        [name, spread(_float(value.get("value")), _float(value.get("sd"))), str(value.get("unit") or "-")]
        for name, value in (cause.get("parameters") or {}).items()
    ]
    if rows:
        body += table(["parameter", "value ± standard deviation", "unit"], rows)
    if cause.get("indistinguishable_from"):
        alike = ", ".join(str(each).replace("_", " ") for each in cause["indistinguishable_from"])
        body += f"<p>These data do not separate it from: {escape(alike)}.</p>"
    if cause.get("would_tell"):
        body += f"<p>To decide: {escape(str(cause['would_tell']))}.</p>"
    return body


def _fit(fit: dict[str, Any]) -> str:
    before, after, noise, cells = (_cell(fit.get(key)) for key in ("rms_before_dB", "rms_after_dB", "noise_dB", "n"))
    gained = _gained(_float(fit.get("nats_gained")), _float(fit.get("nats_sd")))
    return (
        f"<p>Held-out spectra ({escape(str(fit.get('split', '')))}): error {before} dB before, {after} dB after, where "
        f"a perfect model would leave {noise} dB; {gained} nats gained over {cells} cells.</p>"
    )


def _gained(nats: float, sd: float) -> str:
    """Give the nats gained, as a bound where all stretches gained the same: the most that one may count."""
    return f"at least {number(nats)}" if sd <= 1e-9 * abs(nats) else spread(nats, sd)


def _float(value: Any) -> float:
    return float("nan") if value is None else float(value)


def _cell(value: Any) -> str:
    if isinstance(value, int):
        return str(value)
    return number(_float(value)) if value is None or isinstance(value, float) else str(value)
