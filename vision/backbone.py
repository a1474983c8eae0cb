"""An image network of the user's own as a source of features: an ONNX file and what its images have to look like.

ONNX Runtime (extra ``onnx``) runs it, or OpenCV's ``dnn`` where that is absent. Which of the two does not matter as
long as they agree; OpenCV 5.0 gives wrong features of some files without a word. A model therefore holds the features
of one test image, and a file or a runtime that does not reproduce them is refused.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal

import cv2
import numpy as np
from pydantic import Field

from ..framework.core.errors import InputError, reading
from ..framework.core.files import file_size, load_toml
from ..framework.core.models import FileModel, Finite, Positive, Whole, checked
from .onnx_inputs import FLOAT, inputs

MAX_BYTES = 2**30
MAX_FEATURES = 8192
USUAL_PX = 224
"""Side of the network's images where neither the file nor anybody says [px]."""
IMAGENET_MEAN, IMAGENET_SD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of red, green and blue in [0, 1], as torchvision's and most of timm's networks want them."""
TOLERANCE = 1e-3
"""Difference from the expected features of the test image, over their norm [-]: two runtimes agree to 1e-5."""
_EXPECTED = "an ONNX image network: images (n, 3, h, w) in, features (n, d) or (n, d, h, w) out"
_BATCH = 32


class Preprocessing(FileModel):
    """How pixels become what the network wants: (value / 255 - mean) / sd, by channel in its order of colours."""

    size_px: Annotated[Whole, Field(ge=16, le=1024)]
    colour_order: Literal["rgb", "bgr"] = "rgb"
    mean: tuple[Finite, Finite, Finite] = IMAGENET_MEAN
    sd: tuple[Positive, Positive, Positive] = IMAGENET_SD


class Record(FileModel):
    """What a classifier keeps of the backbone that it was trained with."""

    file: str
    sha256: str
    preprocessing: Preprocessing
    test_features: Annotated[list[Finite], Field(min_length=1, max_length=MAX_FEATURES)]


@dataclass(frozen=True)
class Backbone:
    """A network that is ready to run.

    Parameters
    ----------
    file
        The ONNX file.
    sha256
        Of its content, hexadecimal.
    preprocessing
        What its images have to look like.
    runtime
        ``"ONNX Runtime"`` or ``"OpenCV"``, with its version.
    run
        Takes (n, 3, s, s) float32 and gives what the network gives.
    assumed
        What nobody stated of the preprocessing, for people to read.
    """

    file: Path
    sha256: str
    preprocessing: Preprocessing
    runtime: str
    run: Callable[[np.ndarray], np.ndarray]
    assumed: str = ""

    def features(self, patches: np.ndarray) -> np.ndarray:
        """Measure patches.

        Parameters
        ----------
        patches : (n, s, s, 3)
            uint8, blue, green, red; s is `preprocessing.size_px`.

        Returns
        -------
        (n, d)
            The network's features, averaged over the image where it keeps places; their signed square roots, which
            lessens how much the few strong ones count.

        Raises
        ------
        InputError
            The network cannot be run on them.
        """
        said = self.preprocessing
        ordered = patches[..., ::-1] if said.colour_order == "rgb" else patches
        parts = []
        for start in range(0, len(patches), _BATCH):
            pixels = ordered[start : start + _BATCH].astype(np.float32) / np.float32(255)
            pixels = (pixels - np.asarray(said.mean, np.float32)) / np.asarray(said.sd, np.float32)
            parts.append(self._pooled(np.ascontiguousarray(pixels.transpose(0, 3, 1, 2))))
        features = np.concatenate(parts)
        return np.sign(features) * np.sqrt(np.abs(features))

    def _pooled(self, images: np.ndarray) -> np.ndarray:
        try:
            answer = np.asarray(self.run(images), dtype=np.float32)
        except Exception as error:  # whatever a runtime raises on a network that is not what it seemed
            raise InputError(self.file, f"cannot be run: {_line(error)}", expected=_EXPECTED) from error
        if answer.ndim == 4:
            answer = answer.mean(axis=(2, 3))
        if answer.ndim != 2 or len(answer) != len(images) or not 1 <= answer.shape[1] <= MAX_FEATURES:
            shape = f"{answer.shape} for {len(images)} images"
            raise InputError(self.file, f"gives an array of shape {shape}", expected=_EXPECTED)
        return answer

    def record(self) -> dict:
        """Give what a classifier has to keep (JSON-able)."""
        test = self.features(_test_image(self.preprocessing.size_px))[0]
        kept = [float(f"{value:.7g}") for value in test]
        return Record(
            file=str(self.file.absolute()), sha256=self.sha256, preprocessing=self.preprocessing, test_features=kept
        ).model_dump(mode="json")

    def cost(self) -> str:
        """Say what it costs here, by running it twice on a batch."""
        images = np.repeat(_test_image(self.preprocessing.size_px), 9, axis=0)
        self.features(images)
        start = perf_counter()
        self.features(images)
        each_ms = 1e3 * (perf_counter() - start) / len(images)
        return f"backbone {self.file.name} ({self.runtime}): {each_ms:.3g} ms a patch, {9 * each_ms:.3g} ms for 9"


def open_backbone(file: str | Path) -> Backbone:
    """Open a network to train with; `NAME.toml` next to `NAME.onnx` may state its preprocessing.

    Raises
    ------
    InputError
        The file is no image network, its features do not depend on the image, or the TOML file is at fault.
    """
    file = Path(file)
    content = _content(file)
    run, runtime, size_px = _runner(content, file)
    beside = file.with_suffix(".toml")
    stated = load_toml(beside) if beside.is_file() else {}
    said = checked(Preprocessing, {"size_px": size_px or USUAL_PX} | stated, beside)
    if size_px and said.size_px != size_px:
        raise InputError(beside, f"{said.size_px} px", expected=f"{size_px} px as the network", place="key size_px")
    known = {*stated, "size_px"} if size_px else set(stated)
    values = ", ".join(f"{name} = {getattr(said, name)}" for name in Preprocessing.model_fields if name not in known)
    assumed = f"Assumed of the backbone, as {beside.name} does not say: {values}." if values else ""
    backbone = Backbone(file, hashlib.sha256(content).hexdigest(), said, runtime, run, assumed)
    image = _test_image(said.size_px)
    both = backbone.features(np.concatenate([image, 255 - image]))
    if not np.isfinite(both).all() or np.allclose(both[0], both[1]):
        raise InputError(file, "its features are not finite or do not depend on the image", expected=_EXPECTED)
    return backbone


def recorded_backbone(data: object, model: str | Path) -> Backbone:
    """Open the network that a classifier was trained with: next to the classifier's file, else where it was then.

    Parameters
    ----------
    data
        Of `Backbone.record`.
    model
        The classifier's file, or what to name in an error.

    Raises
    ------
    InputError
        The network is missing, is another, or does not give the features here that it gave at training.
    """
    said = checked(Record, data, model)
    own = Path(model).parent / Path(said.file).name
    file = own if own.is_file() else Path(said.file)
    if not file.is_file():
        raise InputError(file, "no such file", expected=f"the backbone of {model}, there or next to it")
    return _reproducing(file, said.model_dump_json(), str(model))


@lru_cache(maxsize=4)
def _reproducing(file: Path, record: str, model: str) -> Backbone:
    """Open a network that gives the features on record; opening it again costs nothing."""
    said = Record.model_validate_json(record)
    content = _content(file)
    if (found := hashlib.sha256(content).hexdigest()) != said.sha256:
        raise InputError(file, f"SHA-256 {found[:12]}...", expected=f"{said.sha256[:12]}..., the backbone of {model}")
    run, runtime, _ = _runner(content, file)
    backbone = Backbone(file, said.sha256, said.preprocessing, runtime, run)
    test, known = backbone.features(_test_image(said.preprocessing.size_px))[0], np.array(said.test_features)
    if test.shape != known.shape or not np.linalg.norm(test - known) <= TOLERANCE * np.linalg.norm(known):
        problem = f"{runtime} does not give the features that {model} was trained with"
        raise InputError(file, problem, expected="the same features of the test image; try the other runtime")
    return backbone


def _content(file: Path) -> bytes:
    size = file_size(file, _EXPECTED)
    if size > MAX_BYTES:
        raise InputError(file, f"{size} bytes", expected=f"a network of at most {MAX_BYTES} bytes")
    with reading(file, _EXPECTED):
        return file.read_bytes()


def _runner(content: bytes, file: Path) -> tuple[Callable[[np.ndarray], np.ndarray], str, int | None]:
    """Give what runs a network, its name, and the side of its images where the file states it [px]."""
    try:
        found = inputs(content)
    except ValueError as error:
        raise InputError(file, str(error), expected=_EXPECTED) from error
    kind, shape = next(iter(found.values())) if len(found) == 1 else (0, ())
    if kind != FLOAT or len(shape) != 4 or shape[1] != 3:
        said = "; ".join(f"{name}, element type {each}, shape {dims}" for name, (each, dims) in found.items())
        raise InputError(file, f"inputs: {said or 'none'}", expected=_EXPECTED)
    if shape[0] is not None:
        raise InputError(file, f"a fixed batch of {shape[0]} images", expected="a network for any number of images")
    if shape[2] != shape[3]:
        raise InputError(file, f"images of {shape[2]} x {shape[3]} px", expected="square images")
    try:
        onnxruntime = import_module("onnxruntime")
    except ImportError:
        onnxruntime = None
    runtime = f"OpenCV {cv2.__version__}" if onnxruntime is None else f"ONNX Runtime {onnxruntime.__version__}"
    try:
        run = opencv(content) if onnxruntime is None else _onnx_runtime(content, onnxruntime)
    except Exception as error:  # the runtimes have no common base of their errors, and hostile files provoke others
        raise InputError(file, f"not a network that {runtime} reads: {_line(error)}", expected=_EXPECTED) from error
    return run, runtime, shape[2]


def _onnx_runtime(content: bytes, onnxruntime: Any) -> Callable[[np.ndarray], np.ndarray]:
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    images, features = session.get_inputs()[0].name, session.get_outputs()[0].name
    return lambda pixels: session.run([features], {images: pixels})[0]


def opencv(content: bytes) -> Callable[[np.ndarray], np.ndarray]:
    """Give what runs a network by OpenCV's ``dnn``."""
    network: Any = cv2.dnn.readNetFromONNX(np.frombuffer(content, dtype=np.uint8))

    def run(pixels: np.ndarray) -> np.ndarray:
        network.setInput(pixels)
        return network.forward()

    return run


def _line(error: Exception) -> str:
    """The first line of what a runtime says, shortened."""
    return next((line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__)[:200]


def _test_image(side: int) -> np.ndarray:
    """One image (1, side, side, 3) uint8 of gradients and fine patterns, the same everywhere."""
    y, x, channel = np.indices((side, side, 3), dtype=np.int64)
    return ((y * y * 7 // side + x * (13 + 5 * channel) + x * y // 8) % 256).astype(np.uint8)[None]
