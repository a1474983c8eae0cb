"""The robots whose topics a bag has, told apart by namespaces: /r1/joint_states and /r2/joint_states."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from fnmatch import fnmatchcase

from .topic_map import TopicMap
from .wheel_names import place_of

_OF_ITS_WHEELS = {"JointState"}
_OF_ITS_MOTION = {"Odometry", "PoseStamped", "PoseWithCovarianceStamped", "PoseInFrame", "NavSatFix", "LocationFix"}


def of_one_robot(stated: TopicMap, types: Mapping[str, str]) -> tuple[TopicMap, tuple[str, ...]]:
    """Ignore the topics of all robots but one: the one whose topics the map names, else the first by name.

    Parameters
    ----------
    stated
        The topic map.
    types
        Type of each topic, without its package, by the topic's name.

    Returns
    -------
    TopicMap, tuple of str
        The map, and what was chosen, in words.
    """
    robots = _robots({name: kind for name, kind in types.items() if not matches(name, stated.ignore)})
    mapped = [robot for robot in robots if any(matches(part.topic, [_all_of(robot)]) for part in stated.parts)]
    if not robots or len(mapped) > 1:
        return stated, ()
    chosen = (mapped or robots)[0]
    others = [robot for robot in robots if robot != chosen]
    wanted = ", ".join(f'"{_all_of(robot)}"' for robot in robots if robot != others[0])
    said = (
        f"topics of {len(robots)} robots, {', '.join(robots)}: those of {chosen} are read; for {others[0]} state "
        f"ignore = [{wanted}] in a topic map"
    )
    return stated.model_copy(update={"ignore": (*stated.ignore, *map(_all_of, others))}), (said,)


def _robots(types: Mapping[str, str]) -> list[str]:
    """Name the namespaces that have joints and a pose each, if there are several."""
    has: dict[str, set[str]] = {}
    for topic, kind in types.items():
        _, *parts = topic.split("/")
        if len(parts) > 1 and not ("wheel" in parts[0] or all(place_of(parts[0]))):
            has.setdefault(parts[0], set()).add(kind)
    found = [name for name, kinds in has.items() if kinds & _OF_ITS_WHEELS and kinds & _OF_ITS_MOTION]
    return sorted(found) if len(found) > 1 else []


def _all_of(robot: str) -> str:
    return f"/{robot}/*"


def matches(topic: str, patterns: Collection[str]) -> bool:
    """Say whether a topic is one of some names, in which ``*`` stands for anything."""
    return any(fnmatchcase(topic, pattern) for pattern in patterns)
