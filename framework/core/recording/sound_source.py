"""How a bag's sound is written: by the topic map, by what messages say of it, or by its first bytes."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from .bag_files import BagFile, Message
from .bag_images import bytes_of
from .bag_messages import DecodeError, decode, field, fields_of, number
from .mp3 import mp3_share
from .recognition import short_type
from .sound import MAX_CHANNELS, SAMPLE_RATES
from .sound_messages import PCM, Coding, SoundSource, begins_file
from .topic_map import SoundTopic

_BY_MAP = {"pcm8": "U8", "pcm16": "S16LE", "pcm24": "S24LE", "pcm32": "S32LE", "float32": "F32LE"}
_BY_FOXGLOVE = {"pcm-s16": "S16LE", "pcm-u8": "U8", "pcm-s32": "S32LE", "pcm-f32": "F32LE"}
_BY_TYPE = {"int8": "S8", "int16": "S16LE", "int32": "S32LE", "float32": "F32LE", "float64": "F64LE"}
_PLAIN = ("", "wave", "wav", "pcm", "raw")
"""What AudioInfo states as coding of samples that are not coded; a wave file's header may come first all the same."""

_SNIFFED_MESSAGES, _SNIFFED_BYTES = 64, 2**16
_MP3_SHARE = 0.5


class SoundError(ValueError):
    """Sound that is not read; the text says why."""


def find_source(
    sound: SoundTopic,
    given: SoundTopic | None,
    first: Mapping[str, Message],
    samples: Mapping[str, Any],
    bag: BagFile,
) -> SoundSource:
    """Find out how a topic's sound is written.

    Parameters
    ----------
    sound
        The topic, with what its type says.
    given
        What the topic map says of it, if there is one.
    first, samples
        First message of each topic of the bag, and decoded where it can be.
    bag
        The bag, whose first messages of the topic are looked at where nobody says.

    Raises
    ------
    SoundError
        It is of a kind that is not read.
    """
    info = next((samples[n] for n, m in first.items() if short_type(m.topic) == "AudioInfo" and n in samples), None)
    content = samples.get(sound.topic)
    source = SoundSource(sound.topic, sound.field or "data", "pcm", _BY_MAP.get(sound.format or "", "S16LE"), None, 1)
    coding = ""
    if info is not None:
        source, coding = _by_info(source, info), str(_known(info, "coding_format") or "").casefold()
    source = _by_itself(source, content, fixed=given is not None and given.field is not None)
    if given is not None:
        source = replace(
            source,
            sample_rate=given.sample_rate_Hz or source.sample_rate,
            channels=given.channels or source.channels,
            pcm=_BY_MAP.get(given.format or "", source.pcm),
        )
        if given.format is not None and given.format != "mp3":
            return source
    found = "mp3" if given is not None and given.format == "mp3" else _sniffed(source, bag)
    if found == "pcm" and coding not in _PLAIN:
        raise SoundError(f"coded as {coding!r}, of which nothing is found in it that can be read")
    return replace(source, coding=found)


def _known(content: Any, path: str) -> Any:
    with suppress(DecodeError):
        return field(content, path)
    return None


def _by_info(source: SoundSource, info: Any, rate: str = "sample_rate", channels: str = "channels") -> SoundSource:
    """Take over what a message says of sample rate, channels and format, as far as that can be."""
    try:
        stated, count = int(number(info, rate)), int(number(info, channels))
    except (DecodeError, ValueError, OverflowError):
        return source
    low, high = SAMPLE_RATES
    named = str(_known(info, "sample_format") or "").upper()
    return replace(
        source,
        sample_rate=stated if low <= stated <= high else None,
        channels=count if 1 <= count <= MAX_CHANNELS else 1,
        pcm=named if named in PCM else source.pcm,
    )


def _by_itself(source: SoundSource, content: Any, *, fixed: bool) -> SoundSource:
    """Take over what the sound's own messages say: those of Foxglove, and those that have a list for each type."""
    names = fields_of(content)
    if {"format", "sample_rate", "number_of_channels"} <= set(names):
        source = _by_info(source, content, "sample_rate", "number_of_channels")
        stated = str(_known(content, "format")).casefold()
        if stated not in _BY_FOXGLOVE:
            raise SoundError(f"format {stated!r}; {', '.join(_BY_FOXGLOVE)} are read")
        return replace(source, pcm=_BY_FOXGLOVE[stated])
    stem = "audio." if "audio" in names else ""
    lists = _known(content, stem + "audio_data")
    if lists is None or fixed:
        return _by_type(source, content)
    source = _by_info(source, _known(content, stem + "info"), "rate", "channels")
    for name in fields_of(lists):
        if len(np.atleast_1d(np.asarray(_known(lists, name)))):
            return _by_type(replace(source, field=f"{stem}audio_data.{name}", pcm="U8"), content)
    raise SoundError("no samples in its first message")


def _by_type(source: SoundSource, content: Any) -> SoundSource:
    """Of numbers that have a type, unless they are bytes, that says how they are written."""
    values = _known(content, source.field)
    kind = values.dtype.name if isinstance(values, np.ndarray) else ""
    return replace(source, pcm=_BY_TYPE[kind]) if kind in _BY_TYPE else source


def _sniffed(source: SoundSource, bag: BagFile) -> Coding:
    """Look at the first bytes: a coded file begins with its mark, and MP3 is frame after frame."""
    chunks: list[bytes] = []
    for message in bag.messages({source.topic}):
        with suppress(DecodeError):
            content = decode(message)
            values = field(content, source.field)
            if not isinstance(values, str | bytes) and getattr(values, "dtype", None) != np.uint8:
                return "pcm"
            chunks.append(bytes_of(content, source.field).tobytes())
        if len(chunks) >= _SNIFFED_MESSAGES or sum(map(len, chunks)) >= _SNIFFED_BYTES:
            break
    if begins_file(b"".join(chunks)[:8]):
        return "file"
    return "mp3" if mp3_share(chunks) > _MP3_SHARE else "pcm"
