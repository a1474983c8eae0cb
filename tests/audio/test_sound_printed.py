"""What `bevameter explain` prints about sound."""

from dataclasses import replace

import numpy as np
import pytest
from bevameter.framework.cli.main import app
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.sound_explanation import SoundCause, SoundFindings
from bevameter.identification.explain.report.sound import sound_lines, sound_section
from explanations import SOUND, explanation
from typer.testing import CliRunner

TONE = SoundCause(
    "steady_tone", "instrument", "", 0.97,
    {"frequency": Estimate(203.31, 0.012, "Hz"), "excess": Estimate(np.nan, np.nan, "dB in 1 Hz"),
     "harmonics": Estimate(2.0, np.nan)},
    "a cos(2 pi f_0 t + phi)", "A sinusoid", ("gear_mesh",), "drive at varied speed",
)  # fmt: skip


def printed(monkeypatch, sound):
    monkeypatch.setattr("bevameter.framework.explain.explain", lambda *_, **__: explanation(sound=sound))
    result = CliRunner().invoke(app, ["explain", "wheel.csv"])
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_sound_is_printed(monkeypatch):
    text = printed(monkeypatch, replace(SOUND, verdict="instrument", missing=(TONE,), notes=("one stretch left out",)))
    for said in (
        "\nSound\nThe microphone or its chain adds to the sound.",
        "Steady tone (steady_tone; instrument or configuration): 97 %",
        "  frequency = 203.310 ± 0.012 Hz\n", "  excess = unknown dB in 1 Hz\n", "  harmonics = 2 (sd unknown)\n",
        "  indistinguishable from: gear mesh\n", ": drive at varied speed\n", "note: one stretch left out",
    ):  # fmt: skip
        assert said in text, said


def test_sound_without_findings_is_printed_and_missing_sound_is_not(monkeypatch):
    nothing = SoundFindings("none")
    assert "The sound is that of the contact: nothing else was found in it." in printed(monkeypatch, nothing)
    assert "Sound" not in printed(monkeypatch, None)


def test_the_likeliest_causes_are_printed_and_the_rest_counted():
    many = tuple(replace(TONE, probability=p) for p in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.999))
    lines = sound_lines(replace(SOUND, missing=many))
    heads = [line for line in lines if line.startswith("Steady tone")]
    assert len(heads) == 5
    assert heads[0].endswith("> 99.5 %")
    assert "and 2 less probable, which JSON and report list" in lines


@pytest.mark.parametrize("said", [lambda sound: "\n".join(sound_lines(sound)), sound_section], ids=["print", "report"])
def test_too_little_sound_is_not_taken_for_an_unknown_cause(said):
    short = SoundFindings("unknown", notes=("16 s of sound",))
    text = said(short)
    assert "There is too little sound to say what it holds." in text
    assert "catalogue" not in text
    assert "catalogue" in said(replace(short, missing=(TONE,)))


def test_stretches_that_all_count_at_their_most_give_a_bound():
    page = sound_section(replace(SOUND, fit=replace(SOUND.fit, nats_gained=1380.0, nats_sd=0.0)))
    assert "at least 1380 nats gained" in page
    assert "given" not in page
    scattered = sound_section(replace(SOUND, fit=replace(SOUND.fit, nats_gained=1380.0, nats_sd=80.0)))
    assert "1380 ± 80 nats gained" in scattered
