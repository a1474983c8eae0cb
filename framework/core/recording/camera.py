"""Images, from files that somebody else made: checked before they are decoded, and decoded within limits.

Images are JPEG or PNG. Neither decoder that OpenCV brings reports a file that ends early (a JPEG then has its lower
part filled with grey), so it is checked here: JPEG by the module `jpeg`, PNG by its chunks and their check sums
(ISO/IEC 15948, 5.3).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from ..errors import InputError, reading
from ..files import file_size, inside
from .jpeg import jpeg_layout, refuse_damage
from .tables import read_table
from .types import Frame, Wanted, always

MAX_IMAGE_BYTES = 64 * 2**20
"""No image file is read that is larger [bytes]."""

MAX_IMAGE_PIXELS = 64_000_000
"""No image is decoded that has more pixels by its header [-]."""


def read_image(path: str | Path) -> np.ndarray:
    """Read an image file as `decode_image` does.

    Raises
    ------
    InputError
        The file is missing, too large, or no whole JPEG or PNG.
    """
    path = Path(path)
    size = file_size(path, "a JPEG or PNG image")
    if size > MAX_IMAGE_BYTES:
        raise InputError(path, f"{size} bytes", expected=f"an image of no more than {MAX_IMAGE_BYTES} bytes")
    with reading(path, "a readable file"):
        data = path.read_bytes()
    return decode_image(data, path)


def decode_image(data: bytes, source: str | Path) -> np.ndarray:
    """Decode a JPEG or PNG image; its pixels stay where the sensor had them, whatever rotation the file states.

    Parameters
    ----------
    data
        The file's content.
    source
        Its name, for errors.

    Returns
    -------
    np.ndarray
        (h, w, 3) uint8, blue, green, red.

    Raises
    ------
    InputError
        The data are empty, of another kind, cut off, damaged, or have more than `MAX_IMAGE_PIXELS` pixels.
    """
    if not data:
        raise InputError(source, "an empty file", expected="a JPEG or PNG image")
    if len(data) > MAX_IMAGE_BYTES:
        raise InputError(source, f"{len(data)} bytes", expected=f"an image of no more than {MAX_IMAGE_BYTES} bytes")
    jpeg = None
    if data.startswith(b"\xff\xd8"):
        jpeg = jpeg_layout(data, source)
        width, height = jpeg.width, jpeg.height
    elif data.startswith(b"\x89PNG\r\n\x1a\n"):
        width, height = _png_size(data, source)
    else:
        raise InputError(source, f"begins with {data[:8]!r}", expected="a JPEG or PNG image")
    if not 0 < width * height <= MAX_IMAGE_PIXELS:
        raise InputError(source, f"{width} x {height} pixels", expected=f"1 to {MAX_IMAGE_PIXELS} pixels")
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise InputError(source, f"cannot be decoded: {error.err}", expected="a whole JPEG or PNG image") from error
    if image is None or image.shape[:2] != (height, width):
        raise InputError(source, "cannot be decoded", expected="a whole JPEG or PNG image")
    if jpeg is not None:
        refuse_damage(jpeg, source)
    return np.asarray(image, dtype=np.uint8)


def _png_size(data: bytes, source: str | Path) -> tuple[int, int]:
    """Walk a PNG's chunks to its end, their check sums included; give width and height."""
    place, size = 8, None
    view = memoryview(data)
    while place + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, place)
        end = place + 12 + length
        if end > len(data):
            break
        if zlib.crc32(view[place + 4 : end - 4]) != struct.unpack_from(">I", data, end - 4)[0]:
            raise InputError(source, f"damaged PNG: check sum of chunk {kind!r}", expected="a whole PNG image")
        if kind == b"IHDR" and length >= 8:
            size = struct.unpack_from(">II", data, place + 8)
        if kind == b"IEND" and size is not None:
            return size
        place = end
    raise InputError(source, f"a PNG cut off after {len(data)} bytes", expected="a whole PNG image")


class FolderCamera:
    """Images of a folder, decoded one at a time (a `CameraStream`)."""

    def __init__(self, time_s: np.ndarray, files: list[Path]):
        self.time_s = time_s
        self.files = files

    def __len__(self) -> int:
        return len(self.files)

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        """Yield every image that is wanted; one that cannot be read comes as None with its problem."""
        for time, file in zip(self.time_s.tolist(), self.files, strict=True):
            if not wanted(time):
                continue
            try:
                image = read_image(file)
            except InputError as error:
                yield Frame(time, None, str(error))
            else:
                yield Frame(time, image)


def read_camera(folder: Path) -> tuple[FolderCamera, tuple[str, ...]]:
    """Open a folder of images by its `camera.csv`: time_s, file.

    Returns
    -------
    FolderCamera, problems
        Images that are missing are named in the problems, and come as frames without an image.

    Raises
    ------
    InputError
        `camera.csv` or a column of it is missing, time runs backwards, a name leads out of the folder, or not one of
        the images is there.
    """
    if not folder.is_dir():
        raise InputError(folder, "a file", expected="a folder of images with camera.csv")
    index = folder / "camera.csv"
    table = read_table(index, numbers=frozenset({"time_s"}), text=frozenset({"file"}))
    time, names = table.need("time_s", "file")
    table.check_time("time_s")
    files = [inside(folder, name, index, table.place(row, "file")) for row, name in enumerate(names)]
    missing = [name for name, file in zip(names, files, strict=True) if not file.is_file()]
    if len(missing) == len(files):
        raise InputError(folder / missing[0], "no such file, nor any other that camera.csv names", expected="images")
    problems = table.problems
    if missing:
        problems += (f"{index.parent.name}: {len(missing)} of {len(files)} images are missing, first {missing[0]}",)
    return FolderCamera(time, files), problems
