"""The robots whose topics a bag has, told apart by namespaces: /r1/joint_states and /r2/joint_states."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from fnmatch import fnmatchcase

from ..files import toml_string
from .topic_map import TopicMap

_POSES = {"Odometry", "PoseStamped", "PoseWithCovarianceStamped", "PoseInFrame", "NavSatFix", "LocationFix"}

_MOST_NAMED = 6
"""Topics that are named where no pattern stands for them."""


def of_one_robot(
    stated: TopicMap, types: Mapping[str, str], wheels: Iterable[str]
) -> tuple[TopicMap, tuple[str, ...], tuple[str, ...]]:
    """Ignore the topics of all robots but one: that whose topics the map names, else the first by name.

    Parameters
    ----------
    stated
        The topic map.
    types
        Type of each topic, without its package, by the topic's name.
    wheels
        Topics with the joints of wheels.

    Returns
    -------
    TopicMap
        The map.
    chosen, doubts : tuple of str
        In words, which robot was chosen; and topics that may be of another one.
    """
    kept = {name: kind for name, kind in types.items() if not matches(name, stated.ignore)}
    robots = _told_apart(sorted({_parts(name)[:-1] for name in wheels if name in kept}))
    topics = {robot: [name for name in kept if _owner(name, robots) == robot] for robot in robots}
    mapped = [robot for robot in robots if any(part.topic in topics[robot] for part in stated.parts)]
    if not robots or len(mapped) > 1:
        return stated, (), ()
    chosen = (mapped or robots)[0]
    others = [robot for robot in robots if robot != chosen]
    said = ()
    if others:
        names = ", ".join(map(_named, robots))
        wanted = ", ".join(
            toml_string(pattern) for robot in robots if robot != others[0] for pattern in _patterns(robot, topics)
        )
        said = (
            f"topics of {len(robots)} robots, {names}: those of {_named(chosen)} are read; for {_named(others[0])} "
            f"state ignore = [{wanted}] in a topic map",
        )
    ignored = [pattern for robot in others for pattern in _patterns(robot, topics)]
    strange = _strangers(chosen, kept, [*others, *(_parts(part.topic)[:1] for part in stated.parts)])
    doubts = tuple(
        f"topics of /{name} may be of another robot than that of {_named(chosen)}: they are left out; name those that "
        "are not in a topic map"
        for name in strange
    )
    ignored += [f"/{name}/*" for name in strange]
    return stated.model_copy(update={"ignore": (*stated.ignore, *ignored)}), said, doubts


def matches(topic: str, patterns: Collection[str]) -> bool:
    """Say whether a topic is one of some names, in which ``*`` stands for anything."""
    return any(fnmatchcase(topic, pattern) for pattern in patterns)


def _parts(topic: str) -> tuple[str, ...]:
    return tuple(topic.strip("/").split("/"))


def _told_apart(spaces: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Cut each namespace to where it differs from the others: fleet/r1 and fleet/r2, r1 of r1/base and r2/base."""
    cut = []
    for space in spaces:
        rest = [other for other in spaces if other != space]
        ends = (length for length in range(min(len(space), 1), len(space)) if space[:length] not in
                {other[:length] for other in rest})  # fmt: skip
        cut.append(space[: next(ends, len(space))])
    return cut


def _owner(topic: str, robots: list[tuple[str, ...]]) -> tuple[str, ...]:
    """Give the robot that a topic is of: the one without a namespace has all that no other has."""
    parts = _parts(topic)
    owners = [robot for robot in robots if parts[: len(robot)] == robot]
    return max(owners, key=len, default=())


def _patterns(robot: tuple[str, ...], topics: Mapping[tuple[str, ...], list[str]]) -> list[str]:
    return [f"/{'/'.join(robot)}/*"] if robot else topics[robot][:_MOST_NAMED]


def _named(robot: tuple[str, ...]) -> str:
    return f"/{'/'.join(robot)}"


def _strangers(
    robot: tuple[str, ...], types: Mapping[str, str], known: Iterable[tuple[str, ...]]
) -> list[str]:  # fmt: skip
    """Name the namespaces beside a robot's own that have an inertial sensor and a pose, as another robot's would."""
    if not robot:
        return []
    has: dict[str, set[str]] = {}
    for topic, kind in types.items():
        first, *rest = _parts(topic)
        if rest and first != robot[0] and (first,) not in {each[:1] for each in known}:
            has.setdefault(first, set()).add(kind)
    return sorted(name for name, kinds in has.items() if "Imu" in kinds and kinds & _POSES)
