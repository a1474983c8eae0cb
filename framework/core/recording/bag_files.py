"""The messages of bags in the order of the file: ROS 1 bags, ROS 2 bags (SQLite and MCAP storage), MCAP files.

All are read from front to back and without their index, which is written last and so is what a recorder that was
stopped did not write: a file that was cut off is read as far as it goes, and `BagFile.problems` says so. Formats: ROS
bag format 2.0 (wiki.ros.org/Bags/Format/2.0), rosbag2 storage (github.com/ros2/rosbag2), MCAP (mcap.dev/spec).
"""

from __future__ import annotations

import bz2
import dataclasses
import io
import re
import shutil
import sqlite3
import struct
import tempfile
from collections.abc import Callable, Container, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import lz4.frame
import mcap.exceptions
import mcap.opcode
import mcap.records
import zstandard
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.rosbag1.reader import Header, ReaderError, RecordType, read_bytes, read_uint32
from rosbags.typesys.msg import normalize_msgtype

from ..errors import InputError

MAX_CHUNK_BYTES = 512 * 2**20
"""No chunk or message is unpacked that is larger: a bomb ends here [bytes]."""

MAX_STORAGE_BYTES = 2**40
"""No storage file is unpacked or filled up beyond this [bytes]."""

_ZSTD = b"\x28\xb5\x2f\xfd"
_PIECE = 2**20
_LAST_NS = 2**62  # the year 2116; what lies beyond is damage
_DAMAGE = (
    ReaderError, mcap.exceptions.McapError, sqlite3.Error, zstandard.ZstdError, RuntimeError, OSError, EOFError,
    ValueError, LookupError, MemoryError, struct.error,
)  # fmt: skip
"""What the readers raise on a file that was cut off; lz4 raises RuntimeError, and mcap believes lengths."""


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
    """A bag, read as often as asked for.

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
        self._files = self._storage_files()

    def _storage_files(self) -> list[Path]:
        if not self.path.is_dir():
            _reader_of(self.path)
            return [self.path]
        files = [
            file for file in self.path.iterdir() if file.name.endswith((".db3", ".mcap", ".db3.zstd", ".mcap.zstd"))
        ]
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

    def messages(self, wanted: Container[str] | None = None) -> Iterator[Message]:
        """Yield the messages of the topics wanted (of all, where None) in the order of the file."""
        for file in self._files:
            yield from self._whole_part(file, wanted)

    def _whole_part(self, file: Path, wanted: Container[str] | None) -> Iterator[Message]:
        """Yield the messages of one file up to where it is damaged, if it is."""
        count, last = 0, None
        try:
            if file.suffix == ".zstd":
                with tempfile.TemporaryDirectory() as folder:
                    plain = Path(folder) / file.stem
                    _unpack_file(file, plain)
                    yield from self._whole_part(plain, wanted)
                return
            for message in _reader_of(file)(file, wanted):
                if abs(message.time_ns) >= _LAST_NS:
                    raise ValueError(f"a time of {message.time_ns} ns")
                count, last = count + 1, message.time_ns
                yield message
        except _DAMAGE as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            until = "nothing of it could be read" if last is None else f"read up to {count} messages"
            self._say(f"{file.name}: cut off or damaged ({reason}); {until}")

    def first_messages(self) -> dict[str, Message]:
        """Give the first message of each topic that has any, by the topic's name."""
        found: dict[str, Message] = {}
        for message in self.messages():
            found.setdefault(message.topic.name, message)
        return found

    def _say(self, problem: str) -> None:
        if problem not in self.problems:
            self.problems.append(problem)


def _reader_of(file: Path) -> Callable[[Path, Container[str] | None], Iterator[Message]]:
    """Pick the reader by the file's first bytes."""
    if file.suffix == ".zstd":
        return _read_mcap  # decided again once it is unpacked
    try:
        with file.open("rb") as raw:
            start = raw.read(16)
    except OSError as error:
        raise InputError(file, error.strerror or str(error), expected="a readable file") from error
    if start.startswith(b"#ROSBAG V2.0"):
        return _read_ros1
    if start.startswith(b"\x89MCAP"):
        return _read_mcap
    if start.startswith(b"SQLite format 3"):
        return _read_sqlite
    problem = "an empty file" if not start else f"begins with {start[:12]!r}"
    raise InputError(file, problem, expected="a ROS 1 bag (version 2.0), a ROS 2 .db3 or an MCAP file")


def _read_ros1(file: Path, wanted: Container[str] | None) -> Iterator[Message]:
    topics: dict[int, Topic] = {}
    size = file.stat().st_size
    with file.open("rb") as raw:
        raw.readline()
        indexed = False
        while raw.tell() < size:
            header = Header.read(raw)
            kind = header.get_uint8("op")
            length = read_uint32(raw)
            if kind == RecordType.BAGHEADER:
                indexed = header.get_uint64("index_pos") > 0
            if kind == RecordType.CHUNK:
                _check_size(max(length, header.get_uint32("size")))
                packed = raw.read(length)
                data = unpack(header.get_string("compression"), packed, header.get_uint32("size"))
                yield from _ros1_records(io.BytesIO(data), len(data), topics, wanted)
                if len(packed) < length:
                    raise EOFError("the file ends within a chunk")
            elif kind in (RecordType.CONNECTION, RecordType.MSGDATA):  # a bag without chunks
                yield from _ros1_record(header, _exactly(raw, length), topics, wanted)
            else:
                raw.seek(length, io.SEEK_CUR)
                if raw.tell() > size:
                    raise EOFError("the file ends within a record")
    if not indexed:
        raise EOFError("no index: the recorder was stopped before its end")


def _ros1_records(
    chunk: BinaryIO, size: int, topics: dict[int, Topic], wanted: Container[str] | None
) -> Iterator[Message]:
    while chunk.tell() < size:
        header = Header.read(chunk)
        yield from _ros1_record(header, _exactly(chunk, read_uint32(chunk)), topics, wanted)


def _ros1_record(
    header: Header, data: bytes, topics: dict[int, Topic], wanted: Container[str] | None
) -> Iterator[Message]:
    kind = header.get_uint8("op")
    if kind == RecordType.CONNECTION:
        about = Header.read(io.BytesIO(struct.pack("<L", len(data)) + data))
        name = header.get_string("topic")
        kind_of_message = normalize_msgtype(about.get_string("type"))
        topics[header.get_uint32("conn")] = Topic(name, kind_of_message, "ros1", about.get_string("message_definition"))
    elif kind == RecordType.MSGDATA:
        topic = topics[header.get_uint32("conn")]
        if wanted is None or topic.name in wanted:
            yield Message(topic, header.get_time("time"), data)


def _exactly(raw: BinaryIO, length: int) -> bytes:
    _check_size(length)
    return read_bytes(raw, length)


def _read_mcap(file: Path, wanted: Container[str] | None) -> Iterator[Message]:
    schemas: dict[int, mcap.records.Schema] = {}
    topics: dict[int, Topic] = {}
    with file.open("rb") as raw:
        for record in _mcap_records(raw):
            if isinstance(record, mcap.records.Schema):
                schemas[record.id] = record
            elif isinstance(record, mcap.records.Channel):
                topics[record.id] = _mcap_topic(record, schemas.get(record.schema_id))
            elif isinstance(record, mcap.records.Message):
                topic = topics[record.channel_id]
                if wanted is None or topic.name in wanted:
                    yield Message(topic, record.log_time, _plain_message(record.data))


def _mcap_records(raw: BinaryIO) -> Iterator[mcap.records.McapRecord]:
    """Yield the records of the data section, those in chunks one by one; of a last chunk that is cut off, the first."""
    place = 0
    try:
        for record in StreamReader(raw, emit_chunks=True, record_size_limit=MAX_CHUNK_BYTES).records:
            place = raw.tell()
            if isinstance(record, mcap.records.DataEnd | mcap.records.Footer):
                return  # what follows repeats schemas and channels
            if isinstance(record, mcap.records.Chunk):
                _check_size(record.uncompressed_size)
                data = unpack(record.compression, record.data, record.uncompressed_size)
                yield from breakup_chunk(dataclasses.replace(record, compression="", data=data), validate_crc=True)
            else:
                yield record
    except mcap.exceptions.EndOfFile:
        raw.seek(place)
        kind, size, compression, data = _chunk_cut_off(raw)
        if kind == mcap.opcode.Opcode.CHUNK:
            _check_size(size)
            yield from StreamReader(io.BytesIO(unpack(compression, data, size)), skip_magic=True).records
        raise


def _chunk_cut_off(raw: BinaryIO) -> tuple[int, int, str, bytes]:
    """Read the head of a record that is cut off, as of a chunk: opcode, unpacked size, compression, what is left."""
    head = raw.read(41)  # opcode, length, start and end time, size, check sum, length of the compression's name
    if len(head) < 41:
        raise EOFError("the file ends within a record")
    kind, _, _, _, size, _, named = struct.unpack("<BQQQQII", head)
    compression = raw.read(min(named, 16)).decode("ascii", errors="replace")
    raw.read(8)
    return kind, size, compression, raw.read(MAX_CHUNK_BYTES)


def _mcap_topic(channel: mcap.records.Channel, schema: mcap.records.Schema | None) -> Topic:
    kind = "" if schema is None else schema.name
    text = "" if schema is None else schema.data.decode("utf-8", errors="replace")
    definition = text if schema is not None and schema.encoding in ("ros2msg", "ros1msg") else ""
    return Topic(
        channel.topic, normalize_msgtype(kind) if kind.count("/") == 1 else kind, channel.message_encoding, definition
    )


def _read_sqlite(file: Path, wanted: Container[str] | None) -> Iterator[Message]:
    with file.open("rb") as raw:
        head = raw.read(100)
    page, pages = struct.unpack_from(">H", head, 16)[0], struct.unpack_from(">I", head, 28)[0]
    promised = (65536 if page == 1 else page) * pages
    if file.stat().st_size >= promised:
        yield from _read_database(file, wanted)
        return
    if promised > MAX_STORAGE_BYTES:
        raise ValueError(f"a database of {promised} bytes by its header")
    _check_room(file, file.stat().st_size)
    with tempfile.TemporaryDirectory() as folder:  # SQLite opens no file that is shorter than it promises to be
        whole = Path(folder) / file.name
        shutil.copyfile(file, whole)
        with whole.open("r+b") as raw:
            raw.truncate(promised)
        yield from _read_database(whole, wanted)
    raise EOFError(f"{file.stat().st_size} of {promised} bytes")


def _read_database(file: Path, wanted: Container[str] | None) -> Iterator[Message]:
    address = file.resolve().as_uri() + "?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_CHUNK_BYTES)
        tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            raise InputError(file, "a database of another program", expected="a ROS 2 bag: tables topics and messages")
        definitions: dict[str, str] = {}
        if "message_definitions" in tables:
            rows = database.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
            definitions = {kind: text for kind, encoding, text in rows if encoding == "ros2msg"}
        topics = {
            number: Topic(str(name), str(kind), str(encoding), definitions.get(kind, ""))
            for number, name, kind, encoding in database.execute(
                "SELECT id, name, type, serialization_format FROM topics"
            )
        }
        # by row, not by time: the index on time lies at the end, and is what a damaged file has lost
        for number, time_ns, data in database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
            topic = topics[number]
            if wanted is None or topic.name in wanted:
                yield Message(topic, int(time_ns), _plain_message(bytes(data)))


def _plain_message(data: bytes) -> bytes:
    """Unpack a message that rosbag2 compressed by itself; a message in CDR begins with 0x00."""
    return unpack("zstd", data, MAX_CHUNK_BYTES) if data.startswith(_ZSTD) else data


def _check_room(file: Path, size: int) -> None:
    """Refuse a copy that this computer has no room for."""
    if size > 0.9 * shutil.disk_usage(tempfile.gettempdir()).free:
        raise InputError(file, f"needs {size} bytes of room to be read", expected="room for temporary files")


def _check_size(size: int) -> None:
    if size > MAX_CHUNK_BYTES:
        raise ValueError(f"a record of {size} bytes, more than {MAX_CHUNK_BYTES}")


def unpack(kind: str, data: bytes, limit: int) -> bytes:
    """Unpack bytes (``none``, ``bz2``, ``lz4``, ``zstd``); raises `ValueError` beyond the limit [bytes]."""
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
    """Unpack a storage file that rosbag2 compressed as a whole; what a cut-off file still gives is kept."""
    room = min(MAX_STORAGE_BYTES, int(shutil.disk_usage(plain.parent).free * 0.9))
    with packed.open("rb") as source, plain.open("wb") as target:
        reader = zstandard.ZstdDecompressor().stream_reader(source)
        try:
            while piece := reader.read(_PIECE):
                room -= len(piece)
                if room < 0:
                    raise ValueError("unpacks to more than this computer has room for")
                target.write(piece)
        except zstandard.ZstdError:
            if not target.tell():
                raise
