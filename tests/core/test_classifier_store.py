"""Models on disk: a saved model is read back unchanged, and anything else is refused."""

import io
import json
import pickle
import zipfile
from functools import partial

import numpy as np
import pytest
import skops.io
from bevameter.framework.core.classifier import fitting, store
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.errors import InputError
from sklearn.preprocessing import FunctionTransformer
from sklearn.tree import DecisionTreeClassifier


@pytest.fixture(scope="module", autouse=True)
def small_forests():
    """Forests of a few trees: how the base treats them is tested here, not how well they do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "TREES", 8)
        yield


@pytest.fixture(scope="module")
def trained():
    rng = np.random.default_rng(7)
    y = np.repeat(["gravel", "sand"], 60)
    x = rng.normal(size=(120, 5)) + (y == "sand")[:, None]
    groups = np.tile(np.repeat(np.arange(6), 10), 2).astype(str)
    settings = {"rate_hz": 16000, "bands": [1.0, 2.0]}
    return TerrainClassifier.train(
        x, y, np.char.add(y, groups), modality="audio", feature_names=list("abcde"), settings=settings, rng=rng
    ).classifier


@pytest.fixture
def saved(trained, tmp_path):
    path = tmp_path / "model.skops"
    trained.save(path)
    return path


def rewritten(path, change):
    """The archive with its entries as `change` (a function of a dict of bytes) leaves them."""
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    change(entries)
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return path


def payload(path):
    return skops.io.load(path, trusted=["sklearn.tree._tree.Tree"])


def test_what_was_saved_comes_back(trained, saved, rng):
    model = TerrainClassifier.load(saved, modality="audio")
    x = rng.normal(size=(30, 5))
    before, after = (m.evidence(x, np.ones(30)) for m in (trained, model))
    np.testing.assert_array_equal(before.probabilities, after.probabilities)
    assert before.reasons == after.reasons
    assert (model.classes, model.settings, model.feature_names) == (
        ("gravel", "sand"),
        trained.settings,
        trained.feature_names,
    )
    assert model.report == trained.report
    assert model.version == trained.version
    assert len(model.version) == 64


def test_saving_again_keeps_the_version_and_leaves_no_part_behind(saved, tmp_path):
    model = TerrainClassifier.load(saved)
    model.save(tmp_path / "again.skops")
    assert TerrainClassifier.load(tmp_path / "again.skops").version == model.version
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.skops", "model.skops"]


def test_another_modality_is_refused(saved):
    with pytest.raises(InputError, match=r"model\.skops: a model for audio \(expected a model for vision\)"):
        TerrainClassifier.load(saved, modality="vision")


@pytest.mark.parametrize("data", [b"", b"not a model", b"PK\x03\x04" + b"\0" * 60, pickle.dumps({"a": 1})])
def test_other_files_are_refused(tmp_path, data):
    path = tmp_path / "other.skops"
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"other\.skops: not a readable model"):
        TerrainClassifier.load(path)


def test_missing_file_and_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        TerrainClassifier.load(tmp_path / "none.skops")
    with pytest.raises(InputError):
        TerrainClassifier.load(tmp_path)


@pytest.mark.parametrize("share", [0.2, 0.7, 0.99])
def test_a_cut_off_file_is_refused(saved, share):
    data = saved.read_bytes()
    saved.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(InputError, match="not a readable model"):
        TerrainClassifier.load(saved)


@pytest.mark.parametrize(
    ("thing", "named"),
    [
        (FunctionTransformer(partial(print, "run")), "FunctionTransformer"),
        ({"f": np.sum}, "numpy"),
        ({"f": DecisionTreeClassifier}, "DecisionTreeClassifier"),
        ({"m": DecisionTreeClassifier().fit([[0.0], [1.0]], [0, 1])}, "DecisionTreeClassifier"),
        ({"o": np.random.default_rng(0)}, "Generator"),
    ],
)
def test_a_type_that_is_not_allowed_is_named(tmp_path, thing, named):
    path = tmp_path / "hostile.skops"
    skops.io.dump(thing, path)
    with pytest.raises(InputError, match=f"holds the type .*{named}"):
        TerrainClassifier.load(path)


def test_a_skops_file_of_another_program_is_refused(tmp_path):
    path = tmp_path / "other.skops"
    skops.io.dump({"metadata": json.dumps({"format": "cake"})}, path)
    with pytest.raises(InputError, match="another program"):
        TerrainClassifier.load(path)


def test_a_later_format_is_refused(saved):
    content = payload(saved)
    meta = json.loads(content["metadata"])
    content["metadata"] = json.dumps(meta | {"format_version": 99})
    skops.io.dump(content, saved)
    with pytest.raises(InputError, match="format version 99"):
        TerrainClassifier.load(saved)


@pytest.mark.parametrize(
    "change",
    [
        {"temperature": 0.0},
        {"temperature": float("nan")},
        {"threshold": -1.0},
        {"correlation": 7.0},
        {"classes": ["gravel"]},
        {"feature_names": ["a"]},
        {"member_temperatures": []},
    ],
)
def test_metadata_that_do_not_fit_are_refused(saved, change):
    content = payload(saved)
    content["metadata"] = json.dumps(json.loads(content["metadata"]) | change)
    skops.io.dump(content, saved)
    with pytest.raises(InputError):
        TerrainClassifier.load(saved)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"settings": [1, 2]}, "key settings: "),
        ({"report": []}, "key report: "),
        ({"modality": ["audio"]}, "key modality"),
        ({"classes": "ab"}, "key classes: 'ab'"),
        ({"classes": [{"a": 1}, None]}, r"key classes\.0: "),
        ({"classes": ["sand", "sand"]}, "key classes: 'sand' stands twice"),
        ({"classes": ["grass", "Unknown"]}, "key classes: 'Unknown'"),
        ({"classes": ["sand", "Sand"]}, "key classes: classes 'sand' and 'Sand'"),
        ({"classes": ["sa\nnd", "\x1b[31m"]}, r"key classes: a class named 'sa\\nnd'"),
        ({"feature_names": list("aacde")}, "key feature_names: 'a' stands twice"),
        ({"temperature": "1.0"}, "key temperature: '1.0'"),
        ({"threshold": float("inf")}, "key threshold: inf"),
        ({"member_temperatures": [1, 1, 1, 1]}, "key member_temperatures: 4 for 1 members"),
        ({"member_columns": [[0, 99]]}, "key member_columns: 0 to 99"),
        ({"member_temperatures": 1.0}, "key member_temperatures: 1.0"),
        ({"trust": {"quality": [0.5], "weight": [2.0], "groups": [9]}}, "key trust: damaged: weight outside 0 to 1"),
        ({"trust": {"quality": [0.5], "weight": [1.0]}}, "key trust: damaged"),
        ({"together": {"quality": [0.5], "weight": [1.0]}}, "key together: damaged"),
        ({"gate_ends": [3, 3, 5]}, r"key gate_ends: \[3, 3, 5\]"),
        ({"gate_ends": [2, 4]}, r"key gate_ends: \[2, 4\] .*rising columns up to 5"),
        ({"gate_ends": [0, 5]}, r"key gate_ends\.0: 0"),
    ],
)
def test_metadata_of_another_kind_are_refused_by_key(saved, change, says):
    content = payload(saved)
    content["metadata"] = json.dumps(json.loads(content["metadata"]) | change)
    skops.io.dump(content, saved)
    with pytest.raises(InputError, match=rf"model\.skops, {says}"):
        TerrainClassifier.load(saved)


def test_the_blocks_of_the_gate_are_kept(tmp_path):
    rng = np.random.default_rng(8)
    x, y, groups = rng.normal(size=(80, 4)), np.repeat(["gravel", "sand"], 40), np.tile(np.arange(8), 10).astype(str)
    model = TerrainClassifier.train(
        x, y, groups, modality="audio", feature_names=list("abcd"), settings={}, rng=rng, gate_ends=(3, 4)
    ).classifier
    model.save(tmp_path / "m.skops")
    again = TerrainClassifier.load(tmp_path / "m.skops")
    assert again.fitted.gate.ends == (3, 4)
    assert again.version == model.version


@pytest.mark.parametrize("key", ["classes", "settings", "correlation"])
def test_metadata_that_lack_a_key_are_refused(saved, key):
    content = payload(saved)
    meta = json.loads(content["metadata"])
    del meta[key]
    content["metadata"] = json.dumps(meta)
    skops.io.dump(content, saved)
    with pytest.raises(InputError, match=f"key {key}: Field required"):
        TerrainClassifier.load(saved)


def test_arrays_that_are_not_finite_are_refused(saved):
    content = payload(saved)
    content["arrays"]["mean"] = np.full(5, np.nan)
    skops.io.dump(content, saved)
    with pytest.raises(InputError, match="mean of shape"):
        TerrainClassifier.load(saved)


@pytest.mark.parametrize("field", ["left_child", "feature"])
def test_a_tree_with_invalid_nodes_is_refused(tmp_path, field):
    rng = np.random.default_rng(1)
    y = np.repeat(["a", "b"], 40)
    x = rng.normal(size=(80, 2)) + (y == "a")[:, None]
    group = np.repeat(np.arange(8), 10).astype(str)
    model = TerrainClassifier.train(
        x, y, group, modality="m", feature_names="xy", settings={}, rng=rng, candidates=("trees",)
    ).classifier
    path = tmp_path / "trees.skops"
    model.save(path)

    def damage(entries):
        for name, data in entries.items():
            if name.endswith(".npy"):
                array = np.load(io.BytesIO(data)).copy()
                if array.dtype.names and len(array) > 3:
                    array[field][0] = 10_000_000 if field == "feature" else 0
                    buffer = io.BytesIO()
                    np.save(buffer, array)
                    entries[name] = buffer.getvalue()
                    return
        raise AssertionError("no tree found")

    rewritten(path, damage)
    with pytest.raises(InputError, match="not a readable model"):
        TerrainClassifier.load(path)


def test_an_array_shorter_than_its_header_states_is_refused(saved):
    def damage(entries):
        name = next(name for name in entries if name.endswith(".npy"))
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
        entries[name] = header.getvalue() + b"\0" * 16

    with pytest.raises(InputError, match="not a readable model"):
        TerrainClassifier.load(rewritten(saved, damage))


def test_an_archive_that_unpacks_to_too_much_is_refused(saved, monkeypatch):
    monkeypatch.setattr(store, "MAX_CONTENT_BYTES", 1000)
    with pytest.raises(InputError, match="expected a smaller model"):
        TerrainClassifier.load(saved)
    monkeypatch.setattr(store, "MAX_FILE_BYTES", 100)
    with pytest.raises(InputError, match="at most 100 bytes"):
        TerrainClassifier.load(saved)


def test_a_schema_nested_without_end_is_refused(saved):
    def damage(entries):
        entries["schema.json"] = b'{"a":' * 50_000 + b"1" + b"}" * 50_000

    with pytest.raises(InputError, match="not a readable model"):
        TerrainClassifier.load(rewritten(saved, damage))


def test_a_place_that_cannot_be_written_is_an_input_error(trained, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        trained.save(tmp_path / "file" / "model.skops")


def test_a_failed_save_leaves_the_old_model(trained, saved, monkeypatch):
    before = saved.read_bytes()
    monkeypatch.setattr(store, "_dump", lambda model: (_ for _ in ()).throw(RuntimeError("full")))
    with pytest.raises(RuntimeError, match="full"):
        trained.save(saved)
    assert saved.read_bytes() == before
    assert len(list(saved.parent.iterdir())) == 1
