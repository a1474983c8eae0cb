"""ONNX files of small image networks, written byte by byte: no writer of ONNX is a dependency."""

from __future__ import annotations

import numpy as np


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _bytes(field: int, value: bytes | str) -> bytes:
    value = value.encode() if isinstance(value, str) else value
    return _varint(field << 3 | 2) + _varint(len(value)) + value


def _varint(value: int) -> bytes:
    parts = bytearray()
    while True:
        value, low = value >> 7, value & 127
        parts.append(low | (128 if value else 0))
        if not value:
            return bytes(parts)


def _tensor(name: str, values: np.ndarray) -> bytes:
    dims = b"".join(_number(1, size) for size in values.shape)
    return dims + _number(2, 1) + _bytes(8, name) + _bytes(9, values.astype("<f4").tobytes())


def _value(name: str, shape: tuple[int | str, ...]) -> bytes:
    dims = b"".join(_bytes(1, _bytes(2, size) if isinstance(size, str) else _number(1, size)) for size in shape)
    return _bytes(1, name) + _bytes(2, _bytes(1, _number(1, 1) + _bytes(2, dims)))


def convolution(
    rng: np.random.Generator, *, side: int = 32, batch: int | str = "n", filters: int = 6, channels: int = 3
) -> bytes:
    """One convolution of 3 x 3 px and what is positive of it, (n, filters, side - 2, side - 2)."""
    weights = rng.normal(size=(filters, channels, 3, 3)) / 3
    nodes = [
        _bytes(1, "image") + _bytes(1, "weights") + _bytes(2, "sums") + _bytes(3, "conv") + _bytes(4, "Conv"),
        _bytes(1, "sums") + _bytes(2, "features") + _bytes(3, "relu") + _bytes(4, "Relu"),
    ]
    graph = b"".join(_bytes(1, node) for node in nodes) + _bytes(2, "small") + _bytes(5, _tensor("weights", weights))
    graph += _bytes(11, _value("image", (batch, channels, side, side)))
    graph += _bytes(12, _value("features", (batch, filters, side - 2, side - 2)))
    return _number(1, 8) + _bytes(7, graph) + _bytes(8, _number(2, 13))
