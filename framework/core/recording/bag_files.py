"""The messages of bags: ROS 1 bags, ROS 2 bags (SQLite and MCAP storage), MCAP files.

The containers are read by rosbags and mcap. MCAP is read from front to back without its index, so that a file that was
cut off is read as far as it goes; the other two need their index, and whatever is wrong is named together with the
tool that repairs it. All compressed data are unpacked here, within limits: neither library has any.
"""

from __future__ import annotations

import bz2
import dataclasses
import re
import shutil
import tempfile
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, BinaryIO
from urllib.parse import quote

import lz4.frame
import mcap.records
import zstandard
from mcap.reader import SeekingReader
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.summary import Summary
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Rosbag1
from rosbags.rosbag1.reader import Compression, decompressors
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
from rosbags.typesys.msg import normalize_msgtype

from ..errors import InputError, reading

MAX_CHUNK_BYTES = 512 * 2**20
"""No chunk or message is unpacked that is larger: a bomb ends here [bytes]."""

MAX_STORAGE_BYTES = 2**40
"""No storage file is unpacked beyond this [bytes]."""

MCAP_REPAIR = "mcap recover"
"""What repairs an MCAP file."""

Span = tuple[int, int]
"""A stretch of time by the recorder's clock: from when, and before when [ns]."""

_ZSTD = b"\x28\xb5\x2f\xfd"
_PIECE = 2**20
_LAST_NS = 2**62  # the year 2116; what lies beyond is damage


@dataclass(frozen=True)
class Topic:
    """A topic of a bag: its name, the type of its messages, how they are encoded, and the type's definition.

    `encoding` is ``"ros1"``, ``"cdr"`` (ROS 2) or ``"json"``; `definition` is ROS message text, or empty.
    """

    name: str
    message_type: str
    encoding: str
    definition: str


@dataclass(frozen=True)
class Message:
    """One message as it stands in the file: topic, time of recording [ns], content."""

    topic: Topic
    time_ns: int
    data: bytes


class BagFile:
    """A bag, which can be read several times.

    Parameters
    ----------
    path
        A ``.bag``, ``.mcap`` or ``.db3`` file, or a ROS 2 bag's folder.

    Raises
    ------
    InputError
        The folder holds no storage file, or the file is of another kind.
    """

    def __init__(self, path: Path):
        self.path = path
        self.problems: list[str] = []
        self.files = self._storage_files()

    def _storage_files(self) -> list[Path]:
        if not self.path.is_dir():
            kind_of(self.path)
            return [self.path]
        kinds = (".db3", ".mcap", ".db3.zstd", ".mcap.zstd")
        files = [file for file in self.path.iterdir() if file.name.endswith(kinds)]
        if not files:
            raise InputError(self.path, "no .db3 or .mcap file in it", expected="a ROS 2 bag")
        about = self.path / "metadata.yaml"
        if not about.is_file():
            self._say(f"{self.path.name}: no metadata.yaml, the recorder was stopped before its end")
        else:
            text = about.read_text(encoding="utf-8", errors="replace")
            listed = re.findall(r"""^\s*-\s*["']?([^\s"']+\.(?:db3|mcap)(?:\.zstd)?)["']?\s*$""", text, re.MULTILINE)
            there = {file.name for file in files}
            for name in dict.fromkeys(Path(item).name for item in listed):
                if name not in there:
                    self._say(f"{self.path.name}: {name} is missing, which metadata.yaml lists")
        return sorted(files, key=lambda file: [int(p) if p.isdigit() else p for p in re.split(r"(\d+)", file.name)])

    def messages(self, wanted: Container[str] | None = None, span: Span | None = None) -> Iterator[Message]:
        """Yield the messages of the topics wanted and of the span (all where None), storage file by storage file."""
        for file in self.files:
            yield from self.messages_of(file, wanted, span)

    def messages_of(
        self, file: Path, wanted: Container[str] | None = None, span: Span | None = None
    ) -> Iterator[Message]:
        """Yield the messages of one of the storage files, up to where it is damaged if it is."""
        return (self._of_packed if file.suffix == ".zstd" else self._of_file)(file, wanted, span)

    def _of_packed(self, file: Path, wanted: Container[str] | None, span: Span | None) -> Iterator[Message]:
        with tempfile.TemporaryDirectory() as folder:
            plain = Path(folder) / file.stem
            try:
                _unpack_file(file, plain)
            except (zstandard.ZstdError, ValueError) as error:
                self._say(f"{file.name}: damaged ({error})")
            else:
                yield from self._of_file(plain, wanted, span)

    def _of_file(self, file: Path, wanted: Container[str] | None, span: Span | None) -> Iterator[Message]:
        read, repair = _KINDS[kind_of(file)]
        yield from self._as_far_as_it_goes(read(file, wanted, span), file, repair)

    def _as_far_as_it_goes(self, messages: Iterator[Message], file: Path, repair: str) -> Iterator[Message]:
        """Yield messages up to where they are damaged, which is said, with what repairs them."""
        count = 0
        try:
            for message in messages:
                if abs(message.time_ns) >= _LAST_NS:
                    raise ValueError(f"a time of {message.time_ns} ns")
                count += 1
                yield message
        except InputError:
            raise
        except Exception as error:  # on damaged bytes the readers raise whatever comes of them
            reason = " ".join(str(error).split()) or type(error).__name__
            until = f"read up to {count} messages" if count else "nothing of it could be read"
            self._say(f"{file.name}: cut off or damaged ({reason}); {until}; try `{repair}`")

    def first_messages(self) -> dict[str, Message]:
        """Give the first message of each topic that has any, by the topic's name."""
        found: dict[str, Message] = {}
        for message in self.messages():
            found.setdefault(message.topic.name, message)
        return found

    def _say(self, problem: str) -> None:
        if problem not in self.problems:
            self.problems.append(problem)


def kind_of(file: Path) -> bytes:
    """Kind of a file by its first bytes, which are a key of `_KINDS`."""
    with reading(file, "a readable file"), file.open("rb") as raw:
        start = raw.read(16)
    kind = next((kind for kind in _KINDS if start.startswith(kind)), None)
    if kind is None:
        problem = f"begins with {start[:12]!r}" if start else "an empty file"
        raise InputError(file, problem, expected="a ROS 1 bag (version 2.0), a ROS 2 .db3 or an MCAP file")
    return kind


def _read_ros1(file: Path, wanted: Container[str] | None, span: Span | None) -> Iterator[Message]:
    limited = {decompressors[kind.value]: partial(unpack, kind.value) for kind in Compression}
    with Rosbag1(file) as bag:
        bag.chunks = {
            place: chunk._replace(decompressor=limited[chunk.decompressor]) for place, chunk in bag.chunks.items()
        }
        yield from _of_connections(bag, "ros1", wanted, span)


def open_sqlite(file: Path) -> Sqlite3Reader:
    """Open a ``.db3`` file; whoever does closes it."""
    bag = Sqlite3Reader(Path(quote(str(file.resolve()))))  # it is made part of an URI
    bag.open()
    return bag


def _read_sqlite(file: Path, wanted: Container[str] | None, span: Span | None) -> Iterator[Message]:
    bag = open_sqlite(file)
    try:
        yield from _of_connections(bag, "", wanted, span)
    finally:
        bag.close()


def _of_connections(
    bag: Rosbag1 | Sqlite3Reader, encoding: str, wanted: Container[str] | None, span: Span | None
) -> Iterator[Message]:
    chosen = [each for each in bag.connections if wanted is None or each.topic in wanted]
    topics = {each.id: topic_of(each, encoding) for each in chosen}
    if chosen:
        for each, time_ns, data in bag.messages(chosen, *(span or ())):
            yield Message(topics[each.id], time_ns, plain_message(data))


def topic_of(connection: Connection, encoding: str) -> Topic:
    """Give the topic of a connection; where `encoding` is empty the connection says how its messages are encoded."""
    written = connection.msgdef.data if connection.msgdef.format == MessageDefinitionFormat.MSG else ""
    known = encoding or connection.ext.serialization_format  # pyright: ignore[reportAttributeAccessIssue]
    return Topic(connection.topic, connection.msgtype, known, written)


def _read_mcap(file: Path, wanted: Container[str] | None, span: Span | None) -> Iterator[Message]:
    topics: dict[int, Topic] = {}
    chunks: list[mcap.records.ChunkIndex] | None = None
    if span is not None and (summary := mcap_summary(file)) is not None:
        topics = mcap_topics(summary)
        ids = {each for each, topic in topics.items() if wanted is None or topic.name in wanted}
        chunks = [
            each
            for each in summary.chunk_indexes
            if each.message_start_time < span[1] and each.message_end_time >= span[0]
            and not ids.isdisjoint(each.message_index_offsets)
        ]  # fmt: skip
    with file.open("rb") as raw:
        records = mcap_records_at(raw, [each.chunk_start_offset for each in chunks]) if chunks is not None else (
            mcap_records(raw)
        )  # fmt: skip
        for message in mcap_messages(records, topics):
            wants = wanted is None or message.topic.name in wanted
            if wants and (span is None or span[0] <= message.time_ns < span[1]):
                yield dataclasses.replace(message, data=plain_message(message.data))


def mcap_records(raw: IO[bytes]) -> Iterator[mcap.records.McapRecord]:
    """Yield the records of an MCAP file from its beginning to its end, chunks as they are."""
    return StreamReader(raw, emit_chunks=True, record_size_limit=MAX_CHUNK_BYTES).records


def mcap_messages(records: Iterator[mcap.records.McapRecord], topics: dict[int, Topic]) -> Iterator[Message]:
    """Yield the messages of a data section as they stand there, those in chunks one by one.

    Parameters
    ----------
    records
        Of the file, in order.
    topics
        What is known of the channels by their identities; completed on the way.
    """
    schemas: dict[int, mcap.records.Schema] = {}
    for record in _data_records(records):
        if isinstance(record, mcap.records.Schema):
            schemas[record.id] = record
        elif isinstance(record, mcap.records.Channel) and record.id not in topics:
            topics[record.id] = _mcap_topic(record, schemas.get(record.schema_id))
        elif isinstance(record, mcap.records.Message):
            yield Message(topics[record.channel_id], record.log_time, record.data)


def _data_records(records: Iterator[mcap.records.McapRecord]) -> Iterator[mcap.records.McapRecord]:
    """Yield the records of the data section, those in chunks one by one."""
    for record in records:
        if isinstance(record, mcap.records.DataEnd | mcap.records.Footer):
            return  # what follows repeats schemas and channels
        if isinstance(record, mcap.records.Chunk):
            plain = dataclasses.replace(record, compression="", data=unpack(record.compression, record.data))
            yield from breakup_chunk(plain, validate_crc=True)
        else:
            yield record


def mcap_records_at(raw: BinaryIO, offsets: Sequence[int]) -> Iterator[mcap.records.McapRecord]:
    """Yield the records of an MCAP file that begin at offsets [bytes]."""
    for offset in offsets:
        raw.seek(offset)
        yield next(StreamReader(raw, skip_magic=True, emit_chunks=True, record_size_limit=MAX_CHUNK_BYTES).records)


def mcap_summary(file: Path) -> Summary | None:
    """Give the summary at the end of an MCAP file, by which messages are found; None where it does not say all."""
    try:
        with file.open("rb") as raw:
            summary = SeekingReader(raw, record_size_limit=MAX_CHUNK_BYTES).get_summary()
    except Exception:  # whatever comes of damaged bytes: the file is then read from front to back
        return None
    if summary is None or summary.statistics is None or len(summary.channels) != summary.statistics.channel_count:
        return None
    listed = sum(len(each.message_index_offsets) for each in summary.chunk_indexes)
    return summary if listed and len(summary.chunk_indexes) == summary.statistics.chunk_count else None


def mcap_topics(summary: Summary) -> dict[int, Topic]:
    """Give the topics of an MCAP file by their channels' identities."""
    return {
        each: _mcap_topic(channel, summary.schemas.get(channel.schema_id)) for each, channel in summary.channels.items()
    }


def _mcap_topic(channel: mcap.records.Channel, schema: mcap.records.Schema | None) -> Topic:
    kind = "" if schema is None else schema.name
    text = "" if schema is None else schema.data.decode("utf-8", errors="replace")
    definition = text if schema is not None and schema.encoding in ("ros2msg", "ros1msg") else ""
    return Topic(
        channel.topic, normalize_msgtype(kind) if kind.count("/") == 1 else kind, channel.message_encoding, definition
    )


_KINDS = {
    b"#ROSBAG V2.0": (_read_ros1, "rosbag reindex"),
    b"\x89MCAP": (_read_mcap, MCAP_REPAIR),
    b"SQLite format 3": (_read_sqlite, "sqlite3 FILE .recover"),
}
"""How files begin, what reads them, and what repairs them."""


def plain_message(data: bytes) -> bytes:
    """Unpack a message that rosbag2 compressed by itself; a message in CDR begins with 0x00."""
    return unpack("zstd", data) if data.startswith(_ZSTD) else data


def unpack(kind: str, data: bytes) -> bytes:
    """Unpack bytes (``none``, ``bz2``, ``lz4``, ``zstd``); raises `ValueError` beyond `MAX_CHUNK_BYTES`."""
    limit = MAX_CHUNK_BYTES
    if kind in ("", "none"):
        return data
    if kind == "bz2":
        answer = bz2.BZ2Decompressor().decompress(data, max_length=limit + 1)
    elif kind == "lz4":
        answer = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=limit + 1)
    elif kind == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(data) as reader:
            answer = reader.read(limit + 1)
    else:
        raise ValueError(f"compression {kind!r} is not known")
    if len(answer) > limit:
        raise ValueError(f"unpacks to more than {limit} bytes")
    return answer


def _unpack_file(packed: Path, plain: Path) -> None:
    """Unpack a storage file that rosbag2 compressed as a whole."""
    room = min(MAX_STORAGE_BYTES, int(shutil.disk_usage(plain.parent).free * 0.9))
    with packed.open("rb") as source, plain.open("wb") as target:
        for piece in zstandard.ZstdDecompressor().read_to_iter(source, write_size=_PIECE):
            room -= len(piece)
            if room < 0:
                raise ValueError("unpacks to more than this computer has room for")
            target.write(piece)
