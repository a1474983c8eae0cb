"""Training, classifying and listening on synthetic grounds, and on the footsteps of ../shared/data."""

from __future__ import annotations

import csv

import numpy as np
import pytest
import soundfile
from bevameter.audio import train
from bevameter.audio.classify import classify_sounds, sound_evidence
from bevameter.audio.listen import listen
from bevameter.audio.train import train_audio, train_audio_arrays
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.labelled import LabelledFile
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.sound import SoundFileStream, read_sound
from bevameter.framework.core.recording.types import SoundBlock
from bevameter.framework.senses import train_sense

RATE = 22050


def ground(name, rng, seconds=4.0):
    """Sound of a wheel: coarse grains that knock, fine sand that hisses, or hard ground that rings."""
    count = int(seconds * RATE)
    hits_per_s, length, ring = {"gravel": (60, 0.004, 0), "sand": (3000, 0.001, 0), "hard": (6, 0.03, 900)}[name]
    train_of_hits = np.zeros(count)
    hits = rng.integers(0, count, int(seconds * hits_per_s))
    np.add.at(train_of_hits, hits, rng.exponential(size=hits.size))
    time = np.arange(int(6 * length * RATE)) / RATE
    grain = np.exp(-time / length) * (np.sin(2 * np.pi * ring * time) if ring else rng.normal(size=time.size))
    sound = np.convolve(train_of_hits, grain)[:count] + 1e-4 * rng.normal(size=count)
    return (rng.uniform(0.05, 0.5) * sound / np.abs(sound).max()).astype(np.float32)


@pytest.fixture(scope="module")
def outcome():
    rng = np.random.default_rng(7)
    names = ["gravel", "sand", "hard"] * 4
    waves = [(ground(name, rng), RATE) for name in names]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, "TARGET_ROWS", 300)
        patch.setattr(train, "CANDIDATES", ("logistic",))
        return train_audio_arrays(waves, names, [f"site {i // 3}" for i in range(12)], rng)


def test_grounds_are_distinguished_on_a_site_not_trained_on(outcome, tmp_path):
    assert outcome.report["balanced_accuracy"]["low"] > 0.6
    rng = np.random.default_rng(8)
    files = []
    for name in ("gravel", "sand", "hard"):
        files.append(tmp_path / f"{name}.flac")
        soundfile.write(files[-1], ground(name, rng), RATE)
    rows = classify_sounds(files, outcome.classifier)
    assert len(rows) == 3 * 7
    assert set(rows[0]) == {
        "file", "start_s", "end_s", "class", "probabilities", "quality", "unknown", "reasons",
    }  # fmt: skip
    right = [row["class"] == row["file"].rsplit("/", 1)[-1].removesuffix(".flac") for row in rows]
    assert np.mean(right) > 0.7
    assert rows[1]["start_s"] == 0.5
    assert rows[1]["end_s"] == 1.5
    for row in rows:
        assert sum(row["probabilities"].values()) == pytest.approx(1.0)


def test_a_clip_shorter_than_a_window_gives_one_row(outcome, tmp_path):
    soundfile.write(tmp_path / "step.wav", ground("gravel", np.random.default_rng(9), 0.4), RATE)
    (row,) = classify_sounds([tmp_path / "step.wav"], outcome.classifier)
    assert row["end_s"] == pytest.approx(0.4)


def test_silence_is_unknown_with_its_reason(outcome, tmp_path):
    soundfile.write(tmp_path / "silent.wav", np.zeros(2 * RATE), RATE)
    rows = classify_sounds([tmp_path / "silent.wav"], outcome.classifier)
    assert all(row["unknown"] and row["class"] == "unknown" and row["reasons"] == ["silent"] for row in rows)


def test_listening_to_a_stream_agrees_with_classifying_the_file(outcome, tmp_path):
    rng = np.random.default_rng(10)
    sound = np.concatenate([ground(name, rng, 20.0) for name in ("gravel", "sand", "hard")])
    sound[25 * RATE : 30 * RATE] = 0
    soundfile.write(tmp_path / "drive.flac", sound, RATE)
    start_s, _, whole = sound_evidence(*read_sound(tmp_path / "drive.flac"), outcome.classifier)
    heard = list(listen(SoundFileStream(tmp_path / "drive.flac", start_s=100.0), outcome.classifier))
    assert len(heard) > 1
    streamed = np.concatenate([part.start_s for part in heard])
    np.testing.assert_allclose(streamed, 100.0 + start_s, atol=1e-3)
    unknown = np.concatenate([part.evidence.unknown for part in heard])
    assert unknown[(streamed >= 125) & (streamed <= 129)].all()
    labels = [name for part in heard for name in part.evidence.labels()]
    assert np.mean([a == b for a, b in zip(labels, whole.labels(), strict=True)]) > 0.95


def test_one_clipped_channel_of_two_is_heard_in_a_file_and_in_a_stream(outcome, tmp_path):
    sound = ground("gravel", np.random.default_rng(12), 4.0)
    both = np.stack([np.clip(40 * sound, -0.5, 0.5), sound], axis=1)
    soundfile.write(tmp_path / "drive.wav", both, RATE)
    rows = classify_sounds([tmp_path / "drive.wav"], outcome.classifier)
    (heard,) = listen(SoundFileStream(tmp_path / "drive.wav"), outcome.classifier)
    for reasons in (*(row["reasons"] for row in rows), *heard.evidence.reasons):
        assert any(reason.startswith("clipped") for reason in reasons)


class Broken:
    """A microphone that loses 5 s (one block given as a problem, the rest not at all)."""

    sample_rate, start_s, duration_s = RATE, 0.0, 20.0

    def blocks(self, block_s, hop_s):
        sound = ground("gravel", np.random.default_rng(11), 20.0)
        for start in np.arange(0.0, 20.0, hop_s):
            if start == 8.0:
                yield SoundBlock(start, None, "lost")
            elif not 8.0 < start < 13.0:
                at = round(start * RATE)
                yield SoundBlock(start, sound[at : at + round(block_s * RATE)])


def test_what_was_not_recorded_is_unknown(outcome):
    parts = list(listen(Broken(), outcome.classifier))
    start = np.concatenate([part.start_s for part in parts])
    end = np.concatenate([part.end_s for part in parts])
    reasons = [reason for part in parts for reason in part.evidence.reasons]
    assert (np.diff(start) > 0).all()
    lost = np.flatnonzero((start >= 8.0) & (end <= 13.0 + 1e-6))
    assert [reasons[i] for i in lost] == [("lost",), ("no sound was recorded",)]
    assert end[lost[-1]] == pytest.approx(13.0)
    assert not np.concatenate([part.evidence.unknown for part in parts])[start > 13].any()


def test_a_model_of_another_sense_or_another_version_is_refused(outcome):
    model = outcome.classifier
    for other in (
        TerrainClassifier(
            "vision", *(getattr(model, f) for f in ("classes", "feature_names", "settings", "report", "fitted"))
        ),
        TerrainClassifier(
            "audio", model.classes, model.feature_names, model.settings | {"window_s": 9.0}, model.report, model.fitted
        ),
        TerrainClassifier(
            "audio", model.classes, model.feature_names, model.settings | {"noise": {}}, model.report, model.fitted
        ),
    ):
        with pytest.raises(InputError):
            sound_evidence(np.ones(RATE, dtype=np.float32), RATE, other)


def test_training_needs_sound_and_two_classes(tmp_path, rng):
    with pytest.raises(InputError, match="louder than silence"):
        train_audio_arrays([(np.zeros(RATE), RATE)], ["sand"], ["a"], rng)
    with pytest.raises(InputError, match="two classes"):
        train_audio_arrays([(ground("sand", rng), RATE)] * 2, ["sand"] * 2, ["a", "b"], rng)
    (tmp_path / "text.flac").write_text("no sound")
    with pytest.raises(InputError, match=r"text\.flac"):
        train_audio([LabelledFile(tmp_path / "text.flac", "sand", "a")], rng)


def test_silent_sounds_are_counted_and_a_silent_class_is_refused(tmp_path):
    rng = np.random.default_rng(12)
    for name in ("sand", "gravel"):
        (tmp_path / name).mkdir()
        for index in range(3):
            soundfile.write(tmp_path / name / f"{index}.wav", ground(name, rng, 1.5), RATE)
    for index in range(2):
        soundfile.write(tmp_path / "sand" / f"silent {index}.wav", np.zeros(RATE + index), RATE)
    (tmp_path / "sand" / "notes.txt").write_text("made up")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, "CANDIDATES", ("logistic",))
        warnings = train_sense("audio", tmp_path).report["warnings"]
    assert warnings[:2] == [
        "Passed over in sand: .txt (1); used: 5.", "Silent and left out in sand: 2 of 5 sounds."
    ]  # fmt: skip
    for path in (tmp_path / "sand").glob("?.wav"):
        path.unlink()
    with pytest.raises(InputError, match="class 'sand': 2 of 2 sounds are silent"):
        train_sense("audio", tmp_path)


def footsteps(folder, keep=lambda row: True):
    with (folder / "index.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if keep(row)]
    return rows, [read_sound(folder / row["file"]) for row in rows]


@pytest.fixture(scope="module")
def footstep_ear(shared_data):
    """A classifier of footsteps on ten grounds, trained on one source; its copies fewer, so that tests are short."""
    rows, waves = footsteps(shared_data / "contact-sound" / "nox", lambda row: not row["dup"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, "TARGET_ROWS", 1100)
        patch.setattr(train, "CANDIDATES", ("kernel",))
        names, groups = [row["common_class"] for row in rows], [row["group"] for row in rows]
        return train_audio_arrays(waves, names, groups, np.random.default_rng(1)).classifier


def judged(model, waves, names):
    """Class of each clip, whether it was right, its quality, and whether anything is said with confidence."""
    parts = [sound_evidence(*wave, model)[2] for wave in waves]
    p = np.stack([part.probabilities.mean(axis=0) for part in parts])
    quality = np.array([part.quality.mean() for part in parts])
    right = np.array([model.classes[i] == name for i, name in zip(p.argmax(axis=1), names, strict=True)])
    return right, quality, p.max(axis=1)


@pytest.mark.slow
def test_footsteps_carry_over_to_another_source(footstep_ear, shared_data):
    rows, waves = footsteps(
        shared_data / "contact-sound" / "minetest", lambda row: row["common_class"] in footstep_ear.classes
    )
    names = np.array([row["common_class"] for row in rows])
    right, _, _ = judged(footstep_ear, waves, names)
    balanced = np.mean([right[names == name].mean() for name in np.unique(names)])
    assert len(names) == 28
    assert balanced > 0.25  # 28 footsteps of 10 grounds among 11 classes: chance is 0.09


@pytest.mark.slow
def test_real_noise_lowers_the_quality_of_footsteps(footstep_ear, shared_data):
    rng = np.random.default_rng(2)
    rows, waves = footsteps(shared_data / "contact-sound" / "minetest")
    noise_files = sorted((shared_data / "noise").glob("*/*.flac"))
    noises = [read_sound(path)[0] for path in noise_files[:: len(noise_files) // 40]]
    noises = [noise for noise in noises if np.sqrt(np.mean(noise**2)) > 1e-3]
    names = [row["common_class"] for row in rows]
    quality = []
    for snr_dB in (20, 5, -5):
        noisy = []
        for sound, rate in waves:
            noise = np.resize(noises[int(rng.integers(len(noises)))], sound.size)
            noise = noise * np.sqrt(np.mean(sound**2) / max(np.mean(noise**2), 1e-9)) * 10 ** (-snr_dB / 20)
            mixed = sound + noise
            noisy.append(((mixed / max(1.0, np.abs(mixed).max())).astype(np.float32), rate))
        quality.append(judged(footstep_ear, noisy, names)[1].mean())
    assert quality[0] > quality[1] > quality[2]
    assert quality[2] < 0.6 * quality[0]
