"""A bag whose topics were recognised by a message of each, and of which no more was read."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..vehicle import Vehicle
from .bag_files import BagFile, Message, Topic
from .bag_messages import DecodeError, decode
from .recognition import Recognised, recognise
from .robots import matches
from .topic_map import TopicMap, load_topic_map


@dataclass(frozen=True)
class Samples:
    """The first message of each topic of a bag, and those that can be decoded, decoded."""

    first: dict[str, Message]
    content: dict[str, Any]

    @property
    def topics(self) -> dict[str, Topic]:
        """The topics, by name."""
        return {name: message.topic for name, message in self.first.items()}

    def without(self, ignored: tuple[str, ...]) -> Samples:
        """Leave topics out, by names in which ``*`` stands for anything."""
        return Samples(
            *({n: each for n, each in part.items() if not matches(n, ignored)} for part in vars(self).values())
        )


@dataclass(frozen=True)
class OpenedBag:
    """A bag, samples of the topics that are not ignored, the topic map if one is given, and what it is completed to."""

    bag: BagFile
    samples: Samples
    given: TopicMap | None
    known: Recognised


def take_samples(bag: BagFile) -> Samples:
    """Take a message of each topic; raises `InputError` where there is none at all."""
    first = bag.first_messages()
    if not first:
        said = "; ".join(problem.removeprefix(f"{bag.path.name}: ") for problem in bag.problems)
        raise InputError(bag.path, said or "no message in it", expected="a bag with messages")
    content: dict[str, Any] = {}
    for name, message in first.items():
        with suppress(DecodeError):
            content[name] = decode(message)
    return Samples(first, content)


def open_bag(bag: BagFile, samples: Samples, vehicle: Vehicle | None, topics: Path | None) -> OpenedBag:
    """Recognise a bag's streams.

    Parameters
    ----------
    bag, samples
        The bag, and a message of each topic.
    vehicle
        The vehicle, after whose wheels joints are named; None where nobody described it.
    topics
        The topic map, where there is one.

    Raises
    ------
    InputError
        No topic is recognised, or the map is at fault or does not fit the bag.
    """
    given = None if topics is None else load_topic_map(topics)
    wheels = () if vehicle is None else vehicle.wheels
    known = recognise(given, samples.topics, samples.content, bag.path, wheels)
    return OpenedBag(bag, samples.without(known.topics.ignore), given, known)
