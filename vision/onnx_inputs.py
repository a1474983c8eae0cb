"""What an ONNX file says its inputs are: read from the file itself, as OpenCV does not tell and does not check them.

The wire format is that of Protocol Buffers, the fields those of onnx.proto: ModelProto.graph 7; GraphProto.initializer
5, input 11; ValueInfoProto.name 1, type 2; TypeProto.tensor_type 1; its elem_type 1, shape 2; dim 1, dim_value 1.
"""

from __future__ import annotations

from collections.abc import Iterator

FLOAT = 1
"""Element type of 32-bit numbers."""
_INITIALISER_NAME = 8


def inputs(content: bytes) -> dict[str, tuple[int, tuple[int | None, ...]]]:
    """Give element type and shape of each input by name, None where a dimension is free.

    Raises
    ------
    ValueError
        The bytes are no ONNX file.
    """
    graph = _message(memoryview(content), 7)
    given = {_text(_first(tensor, _INITIALISER_NAME)) for tensor in _all(graph, 5)}
    found = {}
    for value in _all(graph, 11):
        name = _text(_first(value, 1))
        tensor = _message(_message(value, 2), 1)
        kind = _first(tensor, 1)
        dims = tuple(_size(dim) for dim in _all(_message(tensor, 2), 1))
        if name not in given:  # files of before 2019 name their weights among the inputs
            found[name] = kind if isinstance(kind, int) else 0, dims
    return found


def _size(dim: memoryview) -> int | None:
    size = _first(dim, 1)
    return size if isinstance(size, int) and size > 0 else None


def _fields(message: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Number and value of each field, in order."""
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        kind = key & 7
        if kind == 0:
            value, at = _varint(message, at)
            yield key >> 3, value
            continue
        length, at = _varint(message, at) if kind == 2 else ({1: 8, 5: 4}.get(kind, -1), at)
        if length < 0 or at + length > len(message):
            raise ValueError("no ONNX file, or one that is cut off")
        yield key >> 3, message[at : at + length]
        at += length


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for place in range(10):
        if at >= len(message):
            break
        byte = message[at]
        value, at = value | (byte & 127) << 7 * place, at + 1
        if byte < 128:
            return value, at
    raise ValueError("no ONNX file, or one that is cut off")


def _first(message: memoryview, field: int) -> int | memoryview | None:
    return next((value for number, value in _fields(message) if number == field), None)


def _all(message: memoryview, field: int) -> Iterator[memoryview]:
    return (value for number, value in _fields(message) if number == field and isinstance(value, memoryview))


def _message(message: memoryview, field: int) -> memoryview:
    value = _first(message, field)
    if not isinstance(value, memoryview):
        raise ValueError("no ONNX file of a network")
    return value


def _text(value: int | memoryview | None) -> str:
    return bytes(value).decode("utf-8", "replace") if isinstance(value, memoryview) else ""
