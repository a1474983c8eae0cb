"""What a bag holds, by its index: topics, numbers of messages and their times; and a look at a part of a large one.

In ROS 1 bags, ``.db3`` files and MCAP files with a summary, an index holds this, and no message is read. Others, as
those that were cut off, are read from front to back.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import mcap.records
from rosbags.rosbag1 import Reader as Rosbag1

from .bag_files import (
    BagFile,
    Message,
    Span,
    Topic,
    kind_of,
    mcap_records_at,
    mcap_summary,
    mcap_topics,
    open_sqlite,
    topic_of,
)

MOST_BYTES = 128 * 2**20
"""Of a bag that is larger only a stretch of about this size in its middle is looked at [bytes]."""

_FEW = 20
"""Messages of a topic that are all looked at, whenever they were recorded: those of static transforms, say."""


class TopicIndex(NamedTuple):
    """A topic of a bag, the number of its messages, and the times of recording of the first and the last [ns]."""

    topic: Topic
    n_messages: int
    first_ns: int
    last_ns: int


def index_of(bag: BagFile) -> dict[str, TopicIndex]:
    """Give the topics that have messages, by name; what is damaged is said among the bag's problems."""
    found: dict[str, TopicIndex] = {}
    for file in bag.files:
        for each in _by_index(file) or _by_reading(bag.messages_of(file)):
            before = found.get(each.topic.name, each._replace(n_messages=0))
            found[each.topic.name] = TopicIndex(
                before.topic, before.n_messages + each.n_messages, min(before.first_ns, each.first_ns),
                max(before.last_ns, each.last_ns),
            )  # fmt: skip
    return found


def _by_index(file: Path) -> list[TopicIndex]:
    """Read the index of a storage file; nothing where it has none or a damaged one."""
    if file.suffix == ".zstd":
        return []
    try:
        return _INDEXES[kind_of(file)](file)
    except Exception:  # whatever comes of damaged bytes: the messages then say it
        return []


def _by_reading(messages: Iterable[Message]) -> Iterable[TopicIndex]:
    found: dict[str, TopicIndex] = {}
    for message in messages:
        name, time_ns = message.topic.name, message.time_ns
        before = found.get(name, TopicIndex(message.topic, 0, time_ns, time_ns))
        found[name] = TopicIndex(
            before.topic, before.n_messages + 1, min(before.first_ns, time_ns), max(before.last_ns, time_ns)
        )
    return found.values()


def _of_ros1(file: Path) -> list[TopicIndex]:
    with Rosbag1(file) as bag:
        return [
            TopicIndex(topic_of(each, "ros1"), len(entries), entries[0].time, entries[-1].time)
            for each in bag.connections
            if (entries := bag.indexes[each.id])
        ]


def _of_sqlite(file: Path) -> list[TopicIndex]:
    bag = open_sqlite(file)
    try:
        assert bag.dbconn is not None
        rows = bag.dbconn.execute(
            "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY topic_id"
        )
        counted = {int(row[0]): tuple(map(int, row[1:])) for row in rows}  # pyright: ignore[reportArgumentType]
        return [TopicIndex(topic_of(each, ""), *counted[each.id]) for each in bag.connections if each.id in counted]
    finally:
        bag.close()


def _of_mcap(file: Path) -> list[TopicIndex]:
    summary = mcap_summary(file)
    if summary is None or summary.statistics is None:
        return []
    found: list[TopicIndex] = []
    with file.open("rb") as raw:
        for each, topic in mcap_topics(summary).items():
            chunks = [chunk for chunk in summary.chunk_indexes if each in chunk.message_index_offsets]
            if not chunks:
                continue
            ends = {
                min(chunks, key=lambda chunk: chunk.message_start_time).message_index_offsets[each],
                max(chunks, key=lambda chunk: chunk.message_end_time).message_index_offsets[each],
            }
            times = [
                time_ns
                for record in mcap_records_at(raw, sorted(ends))
                if isinstance(record, mcap.records.MessageIndex)
                for time_ns, _ in record.records
            ]
            found.append(TopicIndex(topic, summary.statistics.channel_message_counts[each], min(times), max(times)))
    return found


_INDEXES = {b"#ROSBAG V2.0": _of_ros1, b"\x89MCAP": _of_mcap, b"SQLite format 3": _of_sqlite}
"""How files begin, and what reads their index."""


class BagExcerpt(BagFile):
    """A bag of which, where it is large, only a stretch in its middle is read, and what comes in few messages.

    Parameters
    ----------
    path
        As of `BagFile`.
    most_bytes
        About as much is read of it [bytes]; `MOST_BYTES` where None.

    Attributes
    ----------
    index
        What is in all of it.
    span
        The stretch that is read; None where it is all.
    """

    def __init__(self, path: Path, most_bytes: int | None = None):
        super().__init__(path)
        most_bytes = MOST_BYTES if most_bytes is None else most_bytes
        self.index = index_of(self)
        self.span: Span | None = None
        size = sum(file.stat().st_size for file in self.files)
        if self.index and size > most_bytes:
            start = min(each.first_ns for each in self.index.values())
            length = max(each.last_ns for each in self.index.values()) - start + 1
            part = int(length * most_bytes / size)
            self.span = (start + (length - part) // 2, start + (length + part) // 2)

    def messages(self, wanted: Container[str] | None = None, span: Span | None = None) -> Iterator[Message]:
        """Yield the messages of the stretch; before them all of topics that have few."""
        if self.span is None or span is not None:
            yield from super().messages(wanted, span)
            return
        few = {
            name for name, each in self.index.items() if each.n_messages <= _FEW and (wanted is None or name in wanted)
        }
        others = {name for name in self.index if name not in few and (wanted is None or name in wanted)}
        for name in few:
            yield from super().messages({name}, (self.index[name].first_ns, self.index[name].last_ns + 1))
        yield from super().messages(others, self.span)

    def first_messages(self) -> dict[str, Message]:
        """Give the first message of each topic, by its name; of the stretch where it has any there."""
        found: dict[str, Message] = {}
        for message in self.messages():
            found.setdefault(message.topic.name, message)
            if len(found) == len(self.index):
                break
        for name in self.index.keys() - found.keys():
            first_ns = self.index[name].first_ns
            found.update((each.topic.name, each) for each in super().messages({name}, (first_ns, first_ns + 1)))
        return {name: found[name] for name in self.index if name in found}
