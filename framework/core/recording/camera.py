"""Images, from files that somebody else made: checked before they are decoded, and decoded within limits.

Images are JPEG or PNG. Neither decoder that OpenCV brings reports a file that ends early (a JPEG then has its lower
part filled with grey), so it is checked here: JPEG by the module `jpeg`, PNG by its chunks and their check sums
(ISO/IEC 15948, 5.3).
"""

from __future__ import annotations

import struct
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from PIL import ExifTags, Image
from pydantic import Field

from ..errors import InputError, reading
from ..files import file_size, inside
from ..models import Whole
from ..vehicle import Camera
from .jpeg import jpeg_layout, refuse_damage
from .pixels import MAX_IMAGE_PIXELS, to_8_bits
from .tables import read_table
from .types import Frame, Wanted, always

MAX_IMAGE_BYTES = 64 * 2**20
"""No image file is read that is larger [bytes]."""

BitDepth = Annotated[Whole, Field(ge=9, le=16)]
"""Bits of samples that come as 16 [-]."""

UPRIGHT = 1

_TURNS: dict[int, Callable[[np.ndarray], np.ndarray]] = {
    UPRIGHT: lambda image: image,
    2: lambda image: cv2.flip(image, 1),
    3: lambda image: cv2.rotate(image, cv2.ROTATE_180),
    4: lambda image: cv2.flip(image, 0),
    5: cv2.transpose,
    6: lambda image: cv2.rotate(image, cv2.ROTATE_90_CLOCKWISE),
    7: lambda image: cv2.rotate(cv2.transpose(image), cv2.ROTATE_180),
    8: lambda image: cv2.rotate(image, cv2.ROTATE_90_COUNTERCLOCKWISE),
}
"""What sets an image upright by its orientation (Exif 2.32, tag 0x0112); those from 5 on swap width and height."""

_NEEDED_CHUNKS = (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND")
"""What a PNG's picture is made of: no other chunk gets to the decoder."""


def read_image(path: str | Path, *, bit_depth: int | None = None) -> np.ndarray:
    """Read an image file as `decode_image` does.

    Raises
    ------
    InputError
        The file is missing, too large, or no whole JPEG or PNG.
    """
    return decode_image(_bytes_of(Path(path)), path, bit_depth=bit_depth)


def _bytes_of(path: Path) -> bytes:
    size = file_size(path, "a JPEG or PNG image")
    if size > MAX_IMAGE_BYTES:
        raise InputError(path, f"{size} bytes", expected=f"an image of no more than {MAX_IMAGE_BYTES} bytes")
    with reading(path, "a readable file"):
        return path.read_bytes()


def decode_image(data: bytes, source: str | Path, *, bit_depth: int | None = None) -> np.ndarray:
    """Decode a JPEG or PNG image; its pixels stay where the sensor had them, whatever rotation the file states.

    Parameters
    ----------
    data
        The file's content.
    source
        Its name, for errors.
    bit_depth
        Bits that the samples of a PNG of 16 bits make use of; all where None.

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
    jpeg, deep = None, False
    if data.startswith(b"\xff\xd8"):
        jpeg = jpeg_layout(data, source)
        width, height = jpeg.width, jpeg.height
    elif data.startswith(b"\x89PNG\r\n\x1a\n"):
        width, height, deep, data = _png_picture(data, source)
    else:
        raise InputError(source, f"begins with {data[:8]!r}", expected="a JPEG or PNG image")
    if not 0 < width * height <= MAX_IMAGE_PIXELS:
        raise InputError(source, f"{width} x {height} pixels", expected=f"1 to {MAX_IMAGE_PIXELS} pixels")
    how = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION | (cv2.IMREAD_ANYDEPTH if deep else 0)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), how)
    except cv2.error as error:
        raise InputError(source, f"cannot be decoded: {error.err}", expected="a whole JPEG or PNG image") from error
    if image is None or image.shape[:2] != (height, width):
        raise InputError(source, "cannot be decoded", expected="a whole JPEG or PNG image")
    if jpeg is not None:
        refuse_damage(jpeg, source)
    return to_8_bits(image, bit_depth or 16) if deep else np.asarray(image, dtype=np.uint8)


def _png_picture(data: bytes, source: str | Path) -> tuple[int, int, bool, bytes]:
    """Walk a PNG's chunks to its end, their check sums included.

    Returns
    -------
    width, height, deep, data
        `deep` where samples have 16 bits; `data` without the chunks that a picture does not need.
    """
    place, size, deep = 8, None, False
    kept: list[bytes | memoryview] = [data[:8]]
    view = memoryview(data)
    while place + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, place)
        end = place + 12 + length
        if end > len(data):
            break
        if zlib.crc32(view[place + 4 : end - 4]) != struct.unpack_from(">I", data, end - 4)[0]:
            raise InputError(source, f"damaged PNG: check sum of chunk {kind!r}", expected="a whole PNG image")
        if (kind == b"IHDR") != (size is None) or (size is None and length != 13):
            raise InputError(source, f"damaged PNG: chunk {kind!r} in the header's place", expected="a whole PNG image")
        if size is None:
            width, height, bits = struct.unpack_from(">IIB", data, place + 8)
            size, deep = (width, height), bits == 16
        if kind in _NEEDED_CHUNKS:
            kept.append(view[place:end])
        if kind == b"IEND":
            return *size, deep, b"".join(kept)
        place = end
    raise InputError(source, f"a PNG cut off after {len(data)} bytes", expected="a whole PNG image")


class FolderCamera:
    """Images of a folder, decoded one at a time (a `CameraStream`).

    Parameters
    ----------
    time_s : (n,)
        When they were taken [s].
    files
        n files.
    orientation
        As of `_TURNS`: how the camera was held, which goes for all of them.
    bit_depth
        Bits that 16-bit samples make use of; all where None.
    """

    def __init__(self, time_s: np.ndarray, files: list[Path], orientation: int = UPRIGHT, bit_depth: int | None = None):
        self.time_s = time_s
        self.files = files
        self._orientation, self._bit_depth = orientation, bit_depth

    def __len__(self) -> int:
        return len(self.files)

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        """Yield every image that is wanted; one that cannot be read comes as None with its problem."""
        for time, file in zip(self.time_s.tolist(), self.files, strict=True):
            if not wanted(time):
                continue
            try:
                image = read_image(file, bit_depth=self._bit_depth)
            except InputError as error:
                yield Frame(time, None, str(error))
            else:
                yield Frame(time, _TURNS[self._orientation](image))


def read_camera(
    folder: Path, camera: Camera | None = None, bit_depth: int | None = None
) -> tuple[FolderCamera, tuple[str, ...]]:
    """Open a folder of images by its `camera.csv`: time_s, file.

    Parameters
    ----------
    folder
        The folder.
    camera
        The vehicle's camera, if known. Images that state how the camera was held are set upright, as OpenCV's
        `imread` does, on which calibrations are made; but where the size of its calibration fits them only as they are
        stored, they stay as they are.
    bit_depth
        Bits that 16-bit samples make use of; all where None.

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
    orientation, said = _orientation(files, camera)
    problems += tuple(f"{index.parent.name}: {problem}" for problem in said)
    return FolderCamera(time, files, orientation, bit_depth), problems


def _orientation(files: list[Path], camera: Camera | None) -> tuple[int, list[str]]:
    """Find out how the camera was held, and say what is remarkable about it.

    A camera is fixed to its vehicle, but what it states comes of a sensor of its own, which on a slope or looking
    straight down may say now this and now that: that of most images is taken.
    """
    held: Counter[int] = Counter()
    sizes: Counter[tuple[int, int]] = Counter()
    for file in files:
        with suppress(Exception):  # what is no image is said when it is decoded
            orientation, size = _stated_layout(file)
            held[orientation] += 1
            sizes[size] += 1
    if not held or set(held) == {UPRIGHT}:
        return UPRIGHT, []
    orientation, said = held.most_common(1)[0][0], []
    if len(held) > 1:
        counts = ", ".join(f"{each} ({count} images)" for each, count in held.most_common())
        said.append(f"different orientations are stated (Exif): {counts}; {orientation} is taken for all of them")
    stored = sizes.most_common(1)[0][0]
    if camera is not None and orientation > 4 and (camera.width_px, camera.height_px) == stored != stored[::-1]:
        said.append(
            f"images are not set upright, as their orientation {orientation} (Exif) asks for: vehicle.toml's camera "
            f"has {stored[0]} x {stored[1]} px, as they are stored"
        )
        return UPRIGHT, said
    return orientation, said


def _stated_layout(file: Path) -> tuple[int, tuple[int, int]]:
    """Read from an image's header its orientation and the size of what is stored; raises what Pillow raises."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        with Image.open(file, formats=("JPEG", "PNG")) as image:
            orientation = image.getexif().get(ExifTags.Base.Orientation, UPRIGHT)
            return (orientation if orientation in _TURNS else UPRIGHT), image.size
