"""`explain_sound` on drives of an independent generator (tests/studies/sound_mismatch.py)."""

import json

import numpy as np
import pytest
from bevameter.audio.explain.cleaning import Subtraction, TrackedLine
from bevameter.audio.explain.drive_spectra import Speeds, whitened
from bevameter.audio.explain.explain import explain_sound
from bevameter.audio.explain.wind import WindModel
from bevameter.audio.features import RATE_HZ
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.types import SoundBlock
from sound_benefit import Heard, gain_of


def drive_with(study, effect, level_dB, seed=5, **options):
    rng = np.random.default_rng([seed, 77])
    drive = study.clean_drive(None, rng, duration_s=64.0, **options)
    truth = study.add(effect, drive, level_dB, rng) if effect else {}
    drive.sound *= min(1.0, 0.95 / np.abs(drive.sound).max())
    return drive, truth


@pytest.fixture(scope="module")
def geared(study):
    drive, truth = drive_with(study, "gear_mesh", 0.0)
    clean, _ = drive_with(study, None, 0.0)
    return drive, truth, clean, drive.explain()


def test_a_gear_is_named_by_its_order(study, geared):
    _, truth, _, found = geared
    assert study.right("gear_mesh", truth, found)
    assert study.false_names({"gear_mesh"}, found) == []


@pytest.mark.parametrize(("effect", "level_dB"), [("lug_passing", -5), ("resonance", 12), ("steady_tone", -18)])
def test_an_effect_is_named_in_its_place_and_nothing_else(study, effect, level_dB):
    drive, truth = drive_with(study, effect, level_dB)
    found = drive.explain()
    assert study.right(effect, truth, found), found.findings.missing
    assert study.false_names({effect}, found) == []
    assert found.findings.fit.rms_after_dB < found.findings.fit.rms_before_dB


def test_wind_is_named_with_its_exponent(study):
    drive, _ = drive_with(study, "wind_noise", 8.0, seed=3)
    found = drive.explain(subtract_wind=True)
    wind = next(c for c in found.findings.missing if c.effect == "wind_noise")
    # The generator's exponent is between 4 (low Strouhal numbers) and 5.7 (high ones).
    assert 3.5 < wind.parameters["exponent"].value < 6.5
    assert wind.subtracted
    assert found.subtraction.wind is not None


def test_nothing_is_named_on_drives_with_contact_sound_only(study):
    for seed in range(2):
        drive, _ = drive_with(study, None, 0.0, seed=seed)
        found = drive.explain()
        assert found.findings.verdict == "none", found.findings.missing
        assert not found.subtraction
        assert isinstance(found.cleaned, study.ArraySound)


def test_real_footsteps_and_weather_are_no_fault(study, shared_data):
    rng = np.random.default_rng(41)
    drive = study.clean_drive(shared_data, rng, duration_s=64.0)
    assert study.false_names(set(), drive.explain()) == []


def test_a_gear_is_found_among_real_footsteps_and_weather(study, shared_data):
    rng = np.random.default_rng(42)
    drive = study.clean_drive(shared_data, rng, duration_s=64.0)
    truth = study.add("gear_mesh", drive, -20.0, rng)
    assert study.right("gear_mesh", truth, drive.explain())


def test_at_one_speed_order_and_tone_cannot_be_distinguished(study):
    drive, _ = drive_with(study, "gear_mesh", -12.0, vary=False)
    found = drive.explain()
    assert found.findings.verdict == "cannot_tell"
    assert {"steady_tone", "unknown"} <= {c.effect for c in found.findings.missing}
    assert all("varied speed" in c.would_tell for c in found.findings.missing)
    assert max(c.probability for c in found.findings.missing) < 0.75


def test_cleaned_sound_is_closer_to_the_clean(study, geared):
    drive, _, clean, found = geared
    blocks = list(found.cleaned.blocks(0.5, 0.5))
    cleaned = np.concatenate([b.samples for b in blocks])
    assert [b.start_s for b in blocks[:3]] == [0.0, 0.5, 1.0]
    recorded, alone = (study.soxr.resample(x, study.RATE, RATE_HZ)[: cleaned.size] for x in (drive.sound, clean.sound))
    # The drive was turned down as a whole to fit full scale: the gain is that of the best fit.
    alone = alone * float(alone @ cleaned / (alone @ alone))
    assert np.mean((cleaned - alone) ** 2) < 0.2 * np.mean((recorded - alone) ** 2)


def test_a_reference_separates_a_resonance_from_the_ground(study):
    """On a single ground a resonance may be the ground's own; clean sound of that ground separates the two."""
    rng = np.random.default_rng(15)
    drive = study.clean_drive(None, rng, duration_s=64.0, grounds=1)
    clean = study.ArraySound(drive.sound.copy())
    study.add("resonance", drive, 16.0, rng)
    alone = [c for c in drive.explain().findings.missing if c.effect == "resonance"]
    assert alone
    assert all(c.probability <= 0.5 and c.indistinguishable_from and not c.subtracted for c in alone)
    referenced = [c for c in drive.explain(reference=clean).findings.missing if c.effect == "resonance"]
    assert referenced
    assert referenced[0].probability > 0.5


def test_the_json_is_plain_and_has_its_schema(geared):
    answer = json.loads(json.dumps(geared[3].findings.to_json(), allow_nan=False))
    assert answer["schema"] == 1
    assert answer["verdict"] == "instrument"
    assert {"channel", "variable", "from", "to", "share", "p_value"} <= set(answer["located"][0])
    assert sum(place["share"] for place in answer["located"]) == pytest.approx(1.0)
    cause = answer["missing"][0]
    assert {"effect", "kind", "probability", "parameters", "equation", "source", "would_tell"} <= set(cause)
    assert set(cause["parameters"]["order"]) == {"value", "sd", "unit"}


class Gappy:
    """Sound whose second half cannot be read."""

    sample_rate, start_s, duration_s = 16000, 10.0, 64.0

    def blocks(self, block_s, hop_s):
        rng = np.random.default_rng(0)
        for first in np.arange(self.start_s, self.start_s + self.duration_s - block_s + 1e-9, hop_s):
            if first >= 58.0:
                yield SoundBlock(float(first), None, "damaged")
            else:
                yield SoundBlock(float(first), 0.1 * rng.standard_normal(round(block_s * 16000)).astype(np.float32))


def test_unreadable_sound_is_left_out_and_reported():
    time_s = np.arange(10.0, 75.0, 0.1)
    speed = 4.0 + np.sin(time_s)
    speed[30:35] = np.nan
    found = explain_sound(Gappy(), time_s, speed, 0.2 * speed)
    assert found.findings.verdict == "none"
    assert any("damaged" in note for note in found.findings.notes)


def test_too_little_sound_is_reported_and_none_is_an_error():
    speed = np.full(100, 4.0)
    short = explain_sound(Gappy(), np.linspace(10.0, 30.0, 100), speed, 0.2 * speed)
    assert short.findings.verdict == "unknown"
    assert any("are needed" in note for note in short.findings.notes)
    with pytest.raises(InputError, match="no wheel speed recorded"):
        explain_sound(Gappy(), np.linspace(500.0, 530.0, 100), speed, 0.2 * speed)
    with pytest.raises(InputError, match="runs backwards"):
        explain_sound(Gappy(), np.linspace(30.0, 10.0, 100), speed, 0.2 * speed)
    with pytest.raises(InputError, match="one length"):
        explain_sound(Gappy(), np.linspace(10.0, 30.0, 99), speed, speed)


def test_whitened_noise_of_any_colour_has_mean_one(rng):
    power = rng.exponential(size=(400, 2000)) * np.linspace(1.0, 40.0, 2000) ** -3
    assert whitened(power, 16)[:, 100:-100].mean() == pytest.approx(1.0, abs=0.05)


def test_a_line_is_removed_and_its_surroundings_are_kept(rng):
    track = Speeds(np.array([0.0, 20.0]), np.array([3.0, 9.0]), np.array([1.0, 2.0]))
    count = 10 * RATE_HZ
    angle = track.angle(0.0, count, RATE_HZ)
    noise = 0.01 * rng.standard_normal(count).astype(np.float32)
    line = 0.1 * np.cos(150.3 * angle + 1.0)
    taken = Subtraction((TrackedLine(150.3, True, (1,), (3000.0,)),))
    left = taken.apply((noise + line).astype(np.float32), 0.0, track)
    inner = slice(RATE_HZ, -RATE_HZ)
    assert np.std((left - noise)[inner]) < 0.05 * np.std(line)


def test_wind_is_attenuated_and_louder_sound_is_kept(rng):
    track = Speeds(np.array([0.0, 20.0]), np.array([5.0, 5.0]), np.array([2.0, 2.0]))
    noise = rng.standard_normal(5 * RATE_HZ).astype(np.float32) * 0.01
    density = 2.0 * 0.01**2 / RATE_HZ
    model = WindModel(float(np.log(density)) - 5.0 * float(np.log(2.0)), 5.0, 0.0)
    held = Subtraction(wind=model).apply(noise, 0.0, track)
    assert np.std(held) < 0.45 * np.std(noise)
    loud = Subtraction(wind=model).apply(10.0 * noise, 0.0, track)
    assert np.std(loud - 10.0 * noise) < 0.05 * np.std(10.0 * noise)


def test_gain_is_shown_only_where_drives_agree(rng):
    truth = np.array(["a", "b"] * 20, dtype=object)
    bad, good = np.array(["a"] * 40, dtype=object), truth.copy()
    known = np.ones(40, dtype=bool)
    before, after = [Heard(truth, bad, known)] * 5, [Heard(truth, good, known)] * 5
    gain = gain_of(before, after, rng)
    assert (gain.before, gain.after, gain.helps) == (0.5, 1.0, True)
    assert not gain_of(after, after, rng).helps
    assert gain_of(before, after[:1] + before[1:], rng).difference == pytest.approx(0.1)


@pytest.mark.slow
def test_classification_under_gear_noise_improves(study):
    model = study.clean_classifier(np.random.default_rng(2), sites=2)
    gain, cleaned = study.classify_study(model, "gear_mesh", drives=1, seed=3, duration_s=60.0, level_dB=(12.0, 12.0))
    assert cleaned == 1
    assert gain.after > gain.before + 0.1
