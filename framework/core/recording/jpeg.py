"""JPEG files looked at before and after they are decoded: how large is the image, and is all of it there?

libjpeg, which every decoder here is made of, fills up with grey what is missing before an end marker, and passes over
what is left once the image is full; it warns of both on standard error only. But where there is no marker either, it
reads on: so an image is whole that can be decoded without its end marker, and cannot without the end of its
data. That holds for images of one scan, as cameras write them. In those of several (progressive ones, ITU-T T.81, G)
each scan refines all of the image, and an early end is not seen.
"""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from pathlib import Path

from PIL import ImageFile
from PIL.JpegImagePlugin import JpegImageFile

from ..errors import InputError

_AHEAD = bytes(8)
"""libjpeg reads so far ahead of what it decodes."""

_LEFT_OVER = 64
"""Bytes that may be left once the image is full: some cameras fill up their data before the end marker."""


@dataclass(frozen=True)
class JpegLayout:
    """What a JPEG's segments say.

    Parameters
    ----------
    width, height
        Size of the image [px].
    head
        All that decoding needs before the coded data of the first scan.
    scan
        The coded data, from the first scan to the end marker.
    one_scan
        Is that a single scan of Huffman codes?
    """

    width: int
    height: int
    head: bytes
    scan: bytes
    one_scan: bool


def jpeg_layout(data: bytes, source: str | Path) -> JpegLayout:
    """Walk a JPEG's segments to its first scan; refuse a file without an end (ITU-T T.81, B.1.1.3)."""
    place, frame, kept = 2, None, [data[:2]]
    while place + 4 <= len(data):
        if data[place] != 0xFF:
            raise InputError(source, f"damaged JPEG: no marker at byte {place}", expected="a whole JPEG image")
        marker = data[place + 1]
        if marker == 0xFF:  # a fill byte
            place += 1
            continue
        if marker == 0x01 or 0xD0 <= marker <= 0xD7:  # markers without a segment
            place += 2
            continue
        end = place + 2 + struct.unpack_from(">H", data, place + 2)[0]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC) and place + 9 <= len(data):
            height, width = struct.unpack_from(">HH", data, place + 5)
            frame = (width, height, marker)
        if not (0xE0 <= marker <= 0xEF or marker == 0xFE):  # what applications add, and comments
            kept.append(data[place:end])
        if marker == 0xDA:
            if frame is None:
                raise InputError(source, "damaged JPEG: a scan before its frame", expected="a whole JPEG image")
            return JpegLayout(*frame[:2], b"".join(kept), *_scan(data, end, frame[2], source))
        if marker == 0xD9:
            break
        place = end
    raise InputError(
        source, f"a JPEG cut off after {len(data)} bytes, within its header", expected="a whole JPEG image"
    )


def _scan(data: bytes, start: int, frame: int, source: str | Path) -> tuple[bytes, bool]:
    """Give the coded data up to the end marker, in which no marker can occur, and whether they are one scan."""
    end = data.find(b"\xff\xd9", start)
    if end < 0:
        raise InputError(
            source, f"a JPEG cut off after {len(data)} bytes: no end marker", expected="a whole JPEG image"
        )
    scan = data[start:end]
    return scan, frame in (0xC0, 0xC1) and b"\xff\xda" not in scan


def refuse_damage(layout: JpegLayout, source: str | Path) -> None:
    """Raise `InputError` where the coded data end before the image does, or hold more than the image."""
    if not layout.one_scan or ImageFile.LOAD_TRUNCATED_IMAGES:  # the latter is for all of a program to set
        return
    if not _fills(layout.head + layout.scan + _AHEAD):
        problem = f"a JPEG cut off: its {len(layout.scan)} bytes of coded data are less than the image"
        raise InputError(source, problem, expected="a whole JPEG image")
    if len(layout.scan) > _LEFT_OVER and _fills(layout.head + layout.scan[:-_LEFT_OVER]):
        problem = f"damaged JPEG: its {len(layout.scan)} bytes of coded data are more than the image"
        raise InputError(source, problem, expected="a whole JPEG image")


def _fills(data: bytes) -> bool:
    """Say whether data without an end marker make a whole image."""
    try:
        with JpegImageFile(io.BytesIO(data)) as image:
            image.draft("L", (1, 1))  # an eighth of the size: the codes are what is looked at
            image.load()
    except (OSError, SyntaxError):  # the latter where Pillow knows no such components
        return False
    return True
