"""Image networks of a user's own: what is refused, what is stored, and that two runtimes agree."""

import shutil
import sys

import cv2
import numpy as np
import pytest
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.errors import InputError
from bevameter.framework.senses import classify_files, train_sense
from bevameter.vision import backbone as module
from bevameter.vision.backbone import open_backbone, recorded_backbone
from networks import convolution


@pytest.fixture(params=["onnxruntime", "opencv"])
def runtime(request, monkeypatch):
    if request.param == "onnxruntime":
        pytest.importorskip("onnxruntime", reason="the extra `onnx` is not installed")
    else:
        monkeypatch.setitem(sys.modules, "onnxruntime", None)
    module._reproducing.cache_clear()
    return request.param


@pytest.fixture
def network(tmp_path):
    path = tmp_path / "small.onnx"
    path.write_bytes(convolution(np.random.default_rng(4)))
    path.with_suffix(".toml").write_text("size_px = 32\n")
    return path


def patches(rng, n=5, side=32):
    return rng.integers(0, 256, (n, side, side, 3), dtype=np.uint8)


def test_features_are_pooled_and_independent_of_the_batch(runtime, network, rng):
    opened = open_backbone(network)
    images = patches(rng, 40)
    features = opened.features(images)
    assert features.shape == (40, 6)
    np.testing.assert_allclose(opened.features(images[[0, 39]]), features[[0, 39]], rtol=1e-4, atol=1e-5)
    assert "mean = (0.485, 0.456, 0.406)" in opened.assumed
    assert "size_px" not in opened.assumed


def test_what_is_stated_changes_what_the_network_sees(runtime, network, rng):
    images = patches(rng)
    before = open_backbone(network).features(images)
    network.with_suffix(".toml").write_text('size_px = 32\ncolour_order = "bgr"\nmean = [0, 0, 0]\nsd = [1, 1, 1]\n')
    opened = open_backbone(network)
    assert opened.assumed == ""
    assert np.abs(opened.features(images) - before).max() > 0.1


def test_another_file_or_other_features_are_refused(runtime, network, tmp_path, monkeypatch):
    record = open_backbone(network).record()
    assert recorded_backbone(record, tmp_path / "m.skops").sha256 == record["sha256"]
    wrong = record | {"test_features": [value + 0.01 for value in record["test_features"]]}
    with pytest.raises(InputError, match="does not give the features"):
        recorded_backbone(wrong, tmp_path / "m.skops")
    with pytest.raises(InputError, match="sha256"):
        recorded_backbone({key: record[key] for key in record if key != "sha256"}, tmp_path / "m.skops")
    module._reproducing.cache_clear()
    network.write_bytes(convolution(np.random.default_rng(5)))
    with pytest.raises(InputError, match=r"small\.onnx: SHA-256 .* the backbone of"):
        recorded_backbone(record, tmp_path / "m.skops")
    network.unlink()
    with pytest.raises(InputError, match=r"small\.onnx: no such file"):
        recorded_backbone(record, tmp_path / "m.skops")


@pytest.mark.parametrize(
    "content",
    [b"", b"\x08\x08", b"not a network" * 50, bytes(range(256)) * 20, convolution(np.random.default_rng(0))[:-700],
     convolution(np.random.default_rng(0), channels=4)],
)  # fmt: skip
def test_what_is_no_image_network_is_one_error(runtime, content, tmp_path):
    path = tmp_path / "bad.onnx"
    path.write_bytes(content)
    path.with_suffix(".toml").write_text("size_px = 32\n")
    with pytest.raises(InputError, match=r"bad\.onnx") as caught:
        open_backbone(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [("size_px = 8", "key size_px"), ("std = [1, 1, 1]", "key std: no such key"), ("sd = [1, 1, 0]", r"key sd\.2"),
     ('colour_order = "cmyk"', "key colour_order"), ("mean = 0.5", "key mean"), ("mean = [nan, 0, 0]", r"key mean\.0")],
)  # fmt: skip
def test_a_wrong_description_is_named(text, said, network):
    network.with_suffix(".toml").write_text(text)
    with pytest.raises(InputError, match=rf"small\.toml, {said}"):
        open_backbone(network)


def test_a_fixed_batch_and_a_wrong_size_are_named(network):
    network.with_suffix(".toml").write_text("size_px = 48")
    with pytest.raises(InputError, match=r"small\.toml, key size_px: 48 px .expected 32 px"):
        open_backbone(network)
    network.with_suffix(".toml").write_text("size_px = 32")
    network.write_bytes(convolution(np.random.default_rng(0), batch=1))
    with pytest.raises(InputError, match="a fixed batch of 1"):
        open_backbone(network)


def test_training_and_classifying_with_a_network(runtime, network, tmp_path, rng):
    for name, sigma in (("coarse", 4.0), ("fine", 0.7)):
        (tmp_path / "photos" / name).mkdir(parents=True)
        for index in range(4):
            grain = cv2.GaussianBlur(rng.normal(size=(96, 96, 3)), (0, 0), sigma)
            image = np.clip(120 + 30 * grain / grain.std(), 0, 255).astype(np.uint8)
            cv2.imwrite(str(tmp_path / "photos" / name / f"{index}.png"), image)
    with pytest.raises(InputError, match="audio takes none"):
        train_sense("audio", tmp_path / "photos", backbone=network)
    outcome = train_sense("vision", tmp_path / "photos", backbone=network)
    assert any("Assumed of the backbone" in text for text in outcome.report["warnings"])
    assert any("ms a patch" in text for text in outcome.report["warnings"])
    model = tmp_path / "models" / "vision.skops"
    outcome.classifier.save(model)
    assert TerrainClassifier.load(model).version == outcome.classifier.version
    moved = model.parent / network.name
    shutil.move(network, moved)  # next to the model it is found, too
    rows = classify_files("vision", sorted((tmp_path / "photos").glob("*/*.png")), model)
    assert [row["class"] for row in rows] == ["coarse"] * 4 + ["fine"] * 4
    moved.write_bytes(moved.read_bytes() + b"\x00")
    module._reproducing.cache_clear()
    with pytest.raises(InputError, match="SHA-256"):
        classify_files("vision", sorted((tmp_path / "photos").glob("*/*.png")), model)


def test_the_runtimes_agree_on_a_real_network(shared_models, monkeypatch, rng):
    pytest.importorskip("onnxruntime", reason="the extra `onnx` is not installed")
    file = shared_models / "efficientnet-lite0.onnx"
    images = patches(rng, 2, 128)
    first = open_backbone(file)
    assert first.runtime.startswith("ONNX Runtime")
    assert first.preprocessing.size_px == 128
    features = first.features(images)
    content = file.read_bytes()
    other = module.Backbone(file, first.sha256, first.preprocessing, "OpenCV", module.opencv(content)).features(images)
    assert np.linalg.norm(other - features) < module.TOLERANCE * np.linalg.norm(features)
