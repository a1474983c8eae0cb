"""Classifiers on disk: skops archives whose every type, size and tree is checked before anything is built from them."""

from __future__ import annotations

import hashlib
import io
import json
import warnings
import zipfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import skops.io
from pydantic import BaseModel, ConfigDict, Field
from sklearn.decomposition import PCA
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.kernel_approximation import Nystroem
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import Pipeline

from ..class_names import check_class_names
from ..errors import InputError
from ..files import whole
from ..models import checked
from .classifier import TerrainClassifier
from .fitting import Fitted, fold_map
from .gate import Gate
from .trust import Trust

FORMAT = "bevameter terrain classifier"
FORMAT_VERSION = 1

MAX_FILE_BYTES = 128 * 2**20
MAX_CONTENT_BYTES = 1024 * 2**20
MAX_SCHEMA_BYTES = 64 * 2**20
MAX_ENTRIES = 20_000

_ALLOWED = {
    ("builtins", "dict", "DictNode"),
    ("builtins", "list", "ListNode"),
    ("builtins", "tuple", "TupleNode"),
    ("builtins", "str", "JsonNode"),
    ("builtins", "str", "TypeNode"),
    ("numpy", "ndarray", "NdArrayNode"),
    ("numpy", "int64", "NdArrayNode"),
    ("numpy", "float64", "NdArrayNode"),
    ("sklearn.ensemble._forest", "ExtraTreesClassifier", "ObjectNode"),
    ("sklearn.tree._classes", "ExtraTreeClassifier", "ObjectNode"),
    ("sklearn.tree._tree", "Tree", "TreeNode"),
    ("sklearn.linear_model._logistic", "LogisticRegression", "ObjectNode"),
    ("sklearn.kernel_approximation", "Nystroem", "ObjectNode"),
    ("sklearn.decomposition._pca", "PCA", "ObjectNode"),
    ("sklearn.pipeline", "Pipeline", "ObjectNode"),
}
"""(module, class, loader) of everything that a model may be made of."""
_ARRAYS = ("mean", "scale", "whitening", "centres")
_Temperature = Annotated[float, Field(gt=0, lt=1e3)]


class Metadata(BaseModel):
    """Metadata of a terrain classifier, as they stand in its file; see `TerrainClassifier` and `Fitted`."""

    model_config = ConfigDict(strict=True, frozen=True)

    modality: str
    classes: Annotated[list[str], Field(min_length=2)]
    feature_names: Annotated[list[str], Field(min_length=1)]
    settings: dict[str, Any]
    report: dict[str, Any]
    member_temperatures: Annotated[list[_Temperature], Field(min_length=1)]
    member_columns: list[Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)]] | None = None
    temperature: _Temperature
    threshold: Annotated[float, Field(gt=0, lt=1e6)]
    correlation: Annotated[float, Field(ge=0, le=1)]
    gate_ends: list[Annotated[int, Field(gt=0)]] | None = None
    trust: dict[str, list[float]] | None = None
    together: dict[str, list[float]] | None = None


def checked_metadata(meta: dict, path: Path) -> Metadata:
    """Check metadata as JSON has them.

    Raises
    ------
    InputError
        The file is another program's or of another version, or a key is missing or holds what it may not; the text
        names the file and the key.
    """
    if meta.get("format") != FORMAT:
        raise InputError(path, "another program's file", expected="a model that `bevameter train` wrote")
    version = meta.get("format_version")
    if version is True or version != FORMAT_VERSION:
        raise InputError(path, f"format version {version}", expected=f"version {FORMAT_VERSION}")
    read = checked(Metadata, meta, path)
    check_class_names(read.classes, path, "key classes")
    for key, names in (("classes", read.classes), ("feature_names", read.feature_names)):
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(path, f"{twice!r} stands twice", expected="each name once", place=f"key {key}")
    return read


def _metadata(model: TerrainClassifier) -> str:
    return json.dumps(
        {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "modality": model.modality,
            "classes": list(model.classes),
            "feature_names": list(model.feature_names),
            "settings": model.settings,
            "report": model.report,
            "member_temperatures": list(model.fitted.member_temperatures),
            "member_columns": [list(columns) for columns in model.fitted.member_columns],
            "temperature": model.fitted.temperature,
            "threshold": model.fitted.threshold,
            "correlation": model.fitted.correlation,
            "trust": None if model.fitted.trust is None else asdict(model.fitted.trust),
        }
        | ({} if len(model.fitted.gate.ends) == 1 else {"gate_ends": list(model.fitted.gate.ends)})
        | ({} if model.fitted.together is None else {"together": asdict(model.fitted.together)}),
        sort_keys=True,
        allow_nan=False,
    )


def _dump(model: TerrainClassifier) -> bytes:
    fitted = model.fitted
    arrays = (fitted.mean, fitted.scale, fitted.gate.whitening, fitted.gate.centres)
    payload = {
        "metadata": _metadata(model),
        "arrays": dict(zip(_ARRAYS, arrays, strict=True)),
        "members": list(fitted.members),
    }
    return skops.io.dumps(payload, compression=zipfile.ZIP_DEFLATED, compresslevel=3)


def _nodes(tree: object) -> Iterator[dict]:
    """Every described object of a skops schema, in order."""
    stack = [tree]
    while stack:
        item = stack.pop()
        if isinstance(item, dict):
            if "__class__" in item or "__loader__" in item:
                yield item
            stack.extend(reversed(item.values()))
        elif isinstance(item, list):
            stack.extend(reversed(item))


def _array(data: bytes) -> np.ndarray:
    """A plain .npy from memory; its header may not state more than there is."""
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    if dtype.hasobject or int(np.prod(shape, dtype=object)) * dtype.itemsize != len(data) - stream.tell():
        raise ValueError("an array is not what its header says")
    return np.frombuffer(data, dtype=dtype, offset=stream.tell())


def _digest(archive: zipfile.ZipFile, schema: dict) -> str:
    """SHA-256 of the content: what objects were called in memory and when they were written do not matter."""
    numbers: dict[object, int] = {}

    def plain(item: object) -> object:
        if isinstance(item, dict):
            return {
                key: numbers.setdefault(value, len(numbers)) if key in ("__id__", "file") else plain(value)
                for key, value in item.items()
            }
        return [plain(value) for value in item] if isinstance(item, list) else item

    digest = hashlib.sha256(json.dumps(plain(schema)).encode())
    for node in _nodes(schema):
        if isinstance(node.get("file"), str):
            array = _array(archive.read(node["file"]))
            digest.update(f"{array.dtype}{array.size}".encode())
            # Field by field: the padding between the fields of a tree's nodes is whatever memory held.
            for name in array.dtype.names or (None,):
                digest.update(np.ascontiguousarray(array if name is None else array[name]).tobytes())
    return digest.hexdigest()


def content_digest(model: TerrainClassifier) -> str:
    """SHA-256 of everything in the model, hexadecimal."""
    with zipfile.ZipFile(io.BytesIO(_dump(model))) as archive:
        return _digest(archive, json.loads(archive.read("schema.json")))


def save(model: TerrainClassifier, path: Path) -> None:
    """Write the model whole or not at all, with the rights that any new file gets."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(path, f"cannot be written: {error.strerror or error}") from error
    with whole(path) as part:
        part.write_bytes(_dump(model))


def load(path: Path, modality: str | None) -> TerrainClassifier:
    """Read a model; see `TerrainClassifier.load`."""
    expected = "a model that `bevameter train` wrote"
    try:
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            raise InputError(path, f"{size} bytes", expected=f"a model of at most {MAX_FILE_BYTES} bytes")
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(path, "no such file", expected=expected) from None
    except OSError as error:
        raise InputError(path, error.strerror or str(error), expected=expected) from error
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            schema = _checked_schema(archive, path)
            version = _digest(archive, schema)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            payload = skops.io.loads(data, trusted=["sklearn.tree._tree.Tree"])
        model = _rebuild(payload, path, version)
    except InputError:
        raise
    except (Exception, RecursionError, MemoryError) as error:
        # Whatever a hostile or damaged archive provokes in zip, JSON, numpy, skops or scikit-learn.
        raise InputError(path, f"not a readable model: {type(error).__name__}", expected=expected) from error
    if modality is not None and model.modality != modality:
        raise InputError(path, f"a model for {model.modality}", expected=f"a model for {modality}")
    return model


def _checked_schema(archive: zipfile.ZipFile, path: Path) -> dict:
    """The schema of an archive whose sizes and types are all allowed."""
    entries = archive.infolist()
    sizes = {entry.filename: entry.file_size for entry in entries}
    if len(entries) > MAX_ENTRIES or sum(sizes.values()) > MAX_CONTENT_BYTES:
        raise InputError(path, f"{len(entries)} entries of {sum(sizes.values())} bytes", expected="a smaller model")
    if len(sizes) != len(entries) or sizes["schema.json"] > MAX_SCHEMA_BYTES:
        raise InputError(path, "a malformed archive", expected="a model that `bevameter train` wrote")
    schema = json.loads(archive.read("schema.json"))
    for node in _nodes(schema):
        kind = (node.get("__module__"), node.get("__class__"), node.get("__loader__"))
        if kind not in _ALLOWED and kind[2] is not None:
            raise InputError(
                path, f"holds the type {kind[0]}.{kind[1]} ({kind[2]})", expected="only types that a model is made of"
            )
    return schema


def _rebuild(payload: dict, path: Path, version: str) -> TerrainClassifier:
    meta = checked_metadata(json.loads(payload["metadata"]), path)
    k, d = len(meta.classes), len(meta.feature_names)
    arrays = {name: np.asarray(payload["arrays"][name], dtype=float) for name in _ARRAYS}
    gated = min(len(arrays["whitening"]), d)
    shapes = {"mean": (d,), "scale": (d,), "whitening": (gated, gated), "centres": (k, gated)}
    for name, values in arrays.items():
        if values.shape != shapes[name] or not np.isfinite(values).all():
            raise InputError(path, f"{name} of shape {values.shape}", expected=f"finite numbers, {shapes[name]}")
    if not (arrays["scale"] > 0).all():
        raise InputError(path, "scales out of range", expected="positive finite numbers")
    ends = tuple(meta.gate_ends or (gated,))  # one block, in files of before there were more
    if list(ends) != sorted(set(ends)) or ends[-1] != gated:
        raise InputError(path, f"{list(ends)}", expected=f"rising columns up to {gated}", place="key gate_ends")
    members = tuple(payload["members"])
    columns = meta.member_columns or [[0, d]] * len(members)  # all, in files of before there was a choice
    for key, values in (("member_temperatures", meta.member_temperatures), ("member_columns", columns)):
        if len(values) != len(members):
            problem = f"{len(values)} for {len(members)} members"
            raise InputError(path, problem, expected="one for each", place=f"key {key}")
    for member, (first, last) in zip(members, columns, strict=True):
        if not first < last <= d:
            raise InputError(path, f"{first} to {last}", expected=f"some of {d} columns", place="key member_columns")
        _check_member(member, k, last - first)
        if isinstance(member, Pipeline):
            fold_map(member)  # done already in files of today
    fitted = Fitted(
        arrays["mean"],
        arrays["scale"],
        members,
        tuple(meta.member_temperatures),
        tuple((first, last) for first, last in columns),
        k,
        Gate(arrays["whitening"], arrays["centres"], ends),
        meta.temperature,
        meta.threshold,
        meta.correlation,
        _trust(meta.trust, path, "trust"),
        _trust(meta.together, path, "together"),
    )
    probe = fitted.probabilities(np.zeros((1, d)))
    if probe.shape != (1, k) or not np.isfinite(probe).all():
        raise InputError(path, "the model gives no probabilities", expected="a whole model")
    return TerrainClassifier(
        meta.modality,
        tuple(meta.classes),
        tuple(meta.feature_names),
        meta.settings,
        meta.report,
        fitted,
        version,
        path,
    )


def _trust(stored: dict[str, list[float]] | None, path: Path, key: str) -> Trust | None:
    """The weights by quality; None in files of before there were any."""
    if stored is None:
        return None
    try:
        points = {name: tuple(values) for name, values in stored.items()}
        return Trust(points.pop("quality"), points.pop("weight"), tuple(int(n) for n in points.pop("groups")), **points)
    except (KeyError, TypeError, ValueError) as error:
        problem = f"damaged: {error}"
        raise InputError(path, problem, expected="a model that `bevameter train` wrote", place=f"key {key}") from None


def _check_member(member: Any, k: int, d: int) -> None:
    """Refuse what would make compiled code read outside its arrays, or start other work."""
    classes = np.asarray(member.classes_)
    if classes.ndim != 1 or classes.min() < 0 or classes.max() >= k or len(np.unique(classes)) != len(classes):
        raise ValueError("class indices out of range")
    if isinstance(member, ExtraTreesClassifier):
        if member.n_jobs is not None:
            raise ValueError("an unknown forest")
        for tree in member.estimators_:
            _check_tree(tree.tree_, d, len(classes))
        return
    linear = member
    if isinstance(member, Pipeline):
        mapping, linear = (step for _, step in member.steps)
        nystroem = isinstance(mapping, Nystroem) and mapping.kernel == "rbf" and mapping.n_jobs is None
        known = nystroem or isinstance(mapping, PCA)
        if not known or np.asarray(mapping.components_).shape[1:] != (d,):
            raise ValueError("an unknown feature map")
    if not isinstance(linear, LogisticRegression) or linear.coef_.ndim != 2:
        raise ValueError("an unknown linear model")


def _check_tree(tree, d: int, k: int) -> None:
    """A decision tree whose children come after their parents and whose features exist cannot run astray."""
    count = tree.node_count
    here = np.arange(count)
    left, right = tree.children_left, tree.children_right
    leaf = left == -1
    ahead = (left > here) & (right > here) & (left < count) & (right < count)
    if count < 1 or tree.n_features != d or tree.value.shape != (count, 1, k) or not (leaf | ahead).all():
        raise ValueError("a damaged tree")
    feature = tree.feature[~leaf]
    if len(feature) and (feature.min() < 0 or feature.max() >= d):
        raise ValueError("a tree uses a feature that does not exist")
