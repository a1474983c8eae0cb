"""The camera's classifier from end to end: training, photographs, and the ground ahead of a drive."""

import csv
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.labelled import LabelledFile, read_labelled
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.types import Frame, always
from bevameter.framework.core.vehicle import Camera
from bevameter.vision import train as training
from bevameter.vision.augment import motion_blur
from bevameter.vision.classify import classify_images, image_evidence
from bevameter.vision.observe import observe_ground
from bevameter.vision.project import ground_patches
from bevameter.vision.train import train_vision, train_vision_arrays


def ground(rng, kind, size=160):
    """Fine grain, stones, or blades: one photograph of synthetic ground."""
    noise = rng.normal(size=(size, size))
    if kind == "fine":
        height = cv2.GaussianBlur(noise, (0, 0), rng.uniform(0.6, 0.9))
    elif kind == "stones":
        height = (cv2.GaussianBlur(noise, (0, 0), rng.uniform(4, 5)) > 0) + 0.03 * noise
    else:
        height = motion_blur(noise.astype(np.float32), 25, rng.uniform(0, np.pi))
    height = (height - height.mean()) / height.std()
    colour = rng.uniform(0.8, 1.2, 3)
    return np.clip((rng.uniform(90, 140) + 25 * height)[..., None] * colour, 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(2)
    kinds = [kind for kind in ("blades", "fine", "stones") for _ in range(6)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "ROWS_WANTED", 18 * 14)
        images = [ground(rng, kind) for kind in kinds]
        return train_vision_arrays(images, kinds, [f"p{i}" for i in range(18)], rng).classifier


def unweighted(model):
    """The model with the score of an image as the weight of what it shows: a weight that is learnt may be 1 for all."""
    return replace(model, fitted=replace(model.fitted, trust=None))


def written(folder, name, image):
    path = folder / name
    assert cv2.imwrite(str(path), image)
    return path


def test_unseen_photographs_are_named(model, tmp_path, rng):
    kinds = ["blades", "fine", "stones"] * 3
    files = [written(tmp_path, f"{i}.png", ground(rng, kind)) for i, kind in enumerate(kinds)]
    rows = classify_images(files, model)
    assert [row["file"] for row in rows] == [str(file) for file in files]
    assert sum(row["class"] == kind for row, kind in zip(rows, kinds, strict=True)) >= 7
    for row in rows:
        assert set(row) == {"file", "start_s", "end_s", "class", "probabilities", "quality", "unknown", "reasons"}
        assert sum(row["probabilities"].values()) == pytest.approx(1.0)
        assert 0 <= row["quality"] <= 1


def test_a_photograph_without_colour_is_unknown_to_a_model_that_never_saw_one(model, rng):
    shown = ground(rng, "fine")
    images = [np.repeat(shown[:, :, 1:2], 3, axis=2), shown]
    assert not image_evidence(model, images).unknown.any()  # some of its training patches were grey
    never = replace(model, settings=model.settings | {"grey_share": 0})
    evidence = image_evidence(never, images)
    assert evidence.unknown.tolist() == [True, False]
    assert "no colour" in evidence.reasons[0][0]


@pytest.mark.parametrize("kind", ["noise", "sky", "black", "white", "checker"])
def test_images_without_ground_are_unknown(model, kind, rng):
    """Colour noise, a sky, nothing at all, a chessboard."""
    sky = np.linspace(180, 240, 160)[:, None, None] * np.array([1.0, 0.8, 0.6]) + rng.normal(0, 0.6, (160, 160, 3))
    checker = np.kron(np.indices((8, 8)).sum(axis=0) % 2, np.ones((20, 20)))[..., None] * [250.0, 20.0, 60.0]
    images = {
        "noise": rng.integers(0, 256, (160, 160, 3)),
        "sky": sky,
        "black": np.zeros((160, 160, 3)),
        "white": np.full((160, 160, 3), 255),
        "checker": checker,
    }
    evidence = image_evidence(model, [np.clip(images[kind], 0, 255).astype(np.uint8)])
    assert evidence.unknown[0]
    assert evidence.quality[0] == 0
    assert evidence.reasons[0]


def test_damaged_and_tiny_images_are_input_errors(model, tmp_path, rng):
    whole = written(tmp_path, "whole.jpg", ground(rng, "fine"))
    half = tmp_path / "half.jpg"
    half.write_bytes(whole.read_bytes()[:2000])
    tiny = written(tmp_path, "tiny.png", ground(rng, "fine", 12))
    for path, said in ((half, "half.jpg"), (tiny, "12 x 12 px"), (tmp_path / "none.png", "no such file")):
        with pytest.raises(InputError, match=said):
            classify_images([whole, path], model)


def test_models_of_other_senses_are_refused(tmp_path, rng):
    x = rng.normal(size=(40, 2))
    labels, groups = np.repeat(["a", "b"], 20), np.arange(40).astype(str)
    other = TerrainClassifier.train(
        x, labels, groups, modality="audio", feature_names="xy", settings={}, rng=rng, candidates=("logistic",)
    ).classifier
    with pytest.raises(InputError, match="other features"):
        classify_images([], other)


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        (None, "None where"),
        ({}, "{} where"),
        ({"sharp": "x", "blurred": -3.0}, "sharp is 'x'"),
        ({"sharp": math.inf, "blurred": -3.0}, "sharp is inf"),
        ({"sharp": -4.0, "blurred": -3.0}, "sharp, -4, is not above blurred, -3"),
    ],
)
def test_damaged_limits_of_sharpness_are_named(limits, says, model, tmp_path, rng):
    picture = written(tmp_path, "a.png", ground(rng, "fine"))
    damaged = replace(model, settings=model.settings | {"limits": limits}, file=tmp_path / "m.skops")
    with pytest.raises(InputError, match=rf"m\.skops, key settings\.limits: {says}"):
        classify_images([picture], damaged)


def test_quality_falls_with_noise_and_noise_alone_is_unknown(model):
    rng = np.random.default_rng(6)
    shown = [ground(rng, kind) for kind in ("blades", "stones") for _ in range(6)]
    mean, quiet = [], []
    for sd in (0, 15, 40):
        evidence = image_evidence(
            unweighted(model),
            [np.clip(image + rng.normal(0, sd, image.shape), 0, 255).astype(np.uint8) for image in shown],
        )
        mean.append(evidence.quality.mean())
        quiet.append(np.mean(["noise" not in reasons for reasons in evidence.reasons]))
    assert mean[0] > 0.85
    assert (np.diff(mean) < 0).all()
    assert mean[-1] < 0.05
    assert quiet[0] > 0.5
    assert quiet[-1] == 0
    alone = [np.clip(rng.normal(128, sd, (160, 160, 3)), 0, 255).astype(np.uint8) for sd in (20, 40, 80)]
    assert image_evidence(model, alone).unknown.all()


def test_models_of_before_do_not_judge_noise(model, rng):
    settings = {key: value for key, value in model.settings.items() if key != "noise"}
    loud = np.clip(ground(rng, "stones") + rng.normal(0, 40, (160, 160, 3)), 0, 255).astype(np.uint8)
    now, before = (image_evidence(each, [loud]) for each in (model, replace(model, settings=settings)))
    assert "noise" in now.reasons[0]
    assert "noise" not in before.reasons[0]
    assert before.quality[0] > now.quality[0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (None, "no noise model"),
        ({"mean": None}, "mean of the noise model"),
        ({"scale": [1.0]}, "scale of the noise model"),
        ({"intercept": "x"}, "intercept of the noise model"),
        ({"low_dB": 99.0}, "the noise model is damaged"),
    ],
)
def test_a_damaged_noise_model_is_named(change, says, model, tmp_path, rng):
    picture = written(tmp_path, "a.png", ground(rng, "fine"))
    noise = change and model.settings["noise"] | change
    damaged = replace(model, settings=model.settings | {"noise": noise}, file=tmp_path / "m.skops")
    with pytest.raises(InputError, match=rf"m\.skops, key settings\.noise: {says}"):
        classify_images([picture], damaged)


def test_training_refuses_what_it_cannot_use(tmp_path, rng):
    with pytest.raises(InputError, match="image 0"):
        train_vision_arrays([np.zeros((8, 8, 3), dtype=np.uint8)], ["a"], ["g"], rng)
    with pytest.raises(InputError, match="no photograph"):
        train_vision([], rng)
    text = tmp_path / "text.jpg"
    text.write_text("not an image")
    with pytest.raises(InputError, match=r"text\.jpg"):
        train_vision([LabelledFile(text, "a", "g")], rng)


# The ground ahead ----------------------------------------------------------------------------------------------------


def lens():
    return Camera(
        matrix=((420.0, 0.0, 319.5), (0.0, 420.0, 239.5), (0.0, 0.0, 1.0)),
        width_px=640,
        height_px=480,
        height_m=0.9,
        pitch_rad=math.radians(25.0),
        forward_m=0.4,
        exposure_s=0.01,
    )


class Film:
    def __init__(self, images, step_s=0.2):
        self.images, self.step_s = images, step_s

    def __len__(self):
        return len(self.images)

    def frames(self, wanted=always):
        for index, image in enumerate(self.images):
            if wanted(index * self.step_s):
                yield Frame(index * self.step_s, image, "cut off" if image is None else None)


def straight(speed, x=0.0, y=0.0, yaw=0.0):
    def pose(time_s):
        way = speed * np.asarray(time_s)
        return x + way * np.cos(yaw), y + way * np.sin(yaw), np.full_like(way, yaw)

    return pose, lambda time_s: np.full(np.shape(time_s), speed)


def test_cells_lie_ahead_in_the_site_frame(model, rng):
    pose, speed = straight(2.0, x=10.0, y=-3.0, yaw=math.pi / 2)
    film = Film([ground(rng, "fine", 640)[:480]] * 11)
    parts = list(observe_ground(film, lens(), pose, speed, model, 0.5))
    k = len(ground_patches(lens(), 0.5))
    assert [len(part) for part in parts] == [8 * k, 3 * k]
    slow = list(observe_ground(film, lens(), *straight(1.0), model, 0.5))
    assert sum(map(len, slow)) == 6 * k  # 0.2 m a frame: every other one has moved half a cell
    # Facing along +y: what is ahead has larger y, what is to the left smaller x.
    first = parts[0]
    expected_y = -3.0 + ground_patches(lens(), 0.5).centre_m[:, 0]
    assert np.abs(first.y_m[:k] - expected_y).max() <= 0.25 + 1e-9
    assert np.abs(first.x_m[:k] - (10.0 - ground_patches(lens(), 0.5).centre_m[:, 1])).max() <= 0.25 + 1e-9
    for values in (first.x_m, first.y_m):
        np.testing.assert_allclose((values / 0.5) % 1, 0.5)
    assert not first.evidence.unknown.all()


def test_frames_without_a_picture_are_unknown_with_the_reason(model, rng):
    pose, speed = straight(5.0)
    good = ground(rng, "fine", 640)[:480]
    blank = np.full((480, 640, 3), 120, dtype=np.uint8)
    grey = np.repeat(good[:, :, 1:2], 3, axis=2)
    film = Film([good, None, np.zeros_like(good), np.full_like(good, 255), blank, good[:100], grey])
    coloured = replace(model, settings=model.settings | {"grey_share": 0})
    part = next(iter(observe_ground(film, lens(), pose, speed, coloured, 0.5)))
    k = len(part) // 7
    said = [part.evidence.reasons[i * k] for i in range(7)]
    assert said[1:5] == [("cut off",), ("black image",), ("white image",), ("blank image",)]
    assert "640 x 100" in said[5][0]
    assert "no colour" in said[6][0]
    assert part.evidence.unknown[k:].all()


def test_a_vehicle_at_rest_or_lost_gives_no_more_evidence(model, rng):
    film = Film([ground(rng, "fine", 640)[:480]] * 6)
    pose, speed = straight(0.0)
    assert sum(len(part) for part in observe_ground(film, lens(), pose, speed, model, 0.5)) == len(
        ground_patches(lens(), 0.5)
    )

    def lost(time_s):
        nowhere = np.full(np.shape(time_s), np.nan)
        return nowhere, nowhere, nowhere

    assert not list(observe_ground(film, lens(), lost, speed, model, 0.5))


def test_speed_for_the_exposure_costs_quality(model, rng):
    film = Film([ground(rng, "fine", 640)[:480]])
    slow, fast = (
        next(iter(observe_ground(film, lens(), *straight(v), unweighted(model), 0.5))).evidence.quality
        for v in (1.0, 30.0)
    )
    assert fast.sum() < slow.sum()


# Real photographs ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_held_out_photographs_are_named_better_than_by_chance(shared_data, monkeypatch):
    """Seven classes, one photograph in three held out: chance is 0.14. Also with 11 px of motion blur."""
    folder = shared_data / "ground-photos"
    with (folder / "index.csv").open() as stream:
        large = {row["file"] for row in csv.DictReader(stream) if row["tier"] == "large"}
    labelled = [item for item in read_labelled(folder) if item.file.relative_to(folder).as_posix() in large]
    labelled = [item for item in labelled if item.class_name not in ("concrete", "pavement")]
    by_class: dict[str, list[str]] = {}
    for item in labelled:
        groups = by_class.setdefault(item.class_name, [])
        if item.group not in groups:
            groups.append(item.group)
    held = {group for groups in by_class.values() for group in groups[1::3]}
    monkeypatch.setattr(training, "ROWS_WANTED", 16 * len(labelled))
    outcome = train_vision([item for item in labelled if item.group not in held], np.random.default_rng(0))
    test = [item for item in labelled if item.group in held]
    images = [training.read_image(item.file) for item in test]
    truth = np.array([item.class_name for item in test])
    for blur in (0, 11):
        evidence = image_evidence(outcome.classifier, [motion_blur(image, blur, 0.0) for image in images])
        best = np.array(evidence.classes)[evidence.probabilities.argmax(axis=1)]
        recall = [np.mean(best[truth == name] == name) for name in np.unique(truth)]
        print(f"blur {blur} px: balanced accuracy {np.mean(recall):.2f}, n = {len(test)}")
        assert np.mean(recall) > 0.3
        assert evidence.unknown.mean() < 0.3
