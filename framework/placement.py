"""The frame of a drive's places: that of its site, by name, by origins on Earth or by a stated offset, or its own.

Two recordings share a frame where something says so: both name one site, and their poses are in a frame that is the
same in each recording; or it is known where on Earth both frames lie; or the offset of one in the other is stated. Else
a recording is kept apart, at a site of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from ..database.frames import SiteFrame
from ..database.store import TerrainDatabase
from .core.origin import Offset, Origin
from .core.recording.bag_places import stays
from .core.recording.types import Pose, Recording, WheelTable

FARTHEST_M = 10_000.0
"""Frames whose origins are farther from one another are not joined: a plane is off by centimetres there [m]."""


@dataclass(frozen=True)
class Claim:
    """What a recording says of the frame of its places.

    Parameters
    ----------
    name, digest, site
        Of the recording.
    origin
        Where on Earth the frame lies, as far as that is known.
    offset
        Where it is stated to lie in the site's frame.
    stays
        Whether the frame is the same in each recording.
    """

    name: str
    digest: str
    site: str
    origin: Origin | None
    offset: Offset | None
    stays: bool

    @staticmethod
    def of(recording: Recording) -> Claim | None:
        """Give that of a recording; None where it holds no places."""
        wheel = recording.wheel
        if recording.pose is None and (wheel is None or wheel.run is not None or not _has_places(wheel)):
            return None
        stated = recording.name, recording.digest, recording.site, recording.origin, recording.offset
        return Claim(*stated, stays(recording.frame))

    @property
    def apart(self) -> str:
        """Name of a site of its own."""
        return f"{self.site}/{self.name:.80}-{self.digest[:8]}".lstrip("/")


@dataclass(frozen=True)
class Placement:
    """Where a recording's places are put.

    Parameters
    ----------
    site
        The site.
    origin
        Where on Earth the site's frame lies; None where nobody knows.
    offset
        Where the recording's frame lies in the site's; None where they are one.
    note
        What was decided, in words; empty where the recording's own site and frame stand.
    apart
        Whether nothing ties it to its site, and it has one of its own.
    """

    site: str
    origin: Origin | None = None
    offset: Offset | None = None
    note: str = ""
    apart: bool = False


class Frames:
    """The frames of the sites that are known, to which each recording adds its own.

    Parameters
    ----------
    known
        By site.
    """

    def __init__(self, known: Mapping[str, SiteFrame]):
        self._known = dict(known)

    def is_settled(self, claim: Claim) -> bool:
        """Say whether a placement does not depend on other recordings that are new, or processed again."""
        known = self._known.get(claim.site)
        free = claim.origin is None and claim.offset is None and not (claim.stays and claim.site)
        return free or (known is not None and known.origin is not None and len(known.recordings) > 1)

    def place(self, claim: Claim) -> Placement:
        """Decide where a recording's places are put, and remember the frame."""
        placed = self._placed(claim)
        before = self._known.get(placed.site)
        digests = frozenset({claim.digest}) | (before.recordings if before else frozenset())
        self._known[placed.site] = SiteFrame(placed.origin, digests)
        return placed

    def _of(self, claim: Claim) -> SiteFrame | None:
        """Frame of the recording's site, by others' recordings: its own earlier processing is replaced."""
        known = self._known.get(claim.site)
        return None if known is None or known.recordings <= {claim.digest} else known

    def _placed(self, claim: Claim) -> Placement:
        known = self._of(claim)
        there = None if known is None else known.origin
        if claim.offset is not None:
            return _by_offset(claim, there)
        if claim.origin is not None and there is not None:
            return _by_origins(claim, claim.origin, there)
        if claim.origin is not None and known is None:
            return Placement(
                claim.site,
                claim.origin,
                None,
                f"the origin of the site{claim.site and f' {claim.site!r}'} is {claim.origin}",
            )
        if not claim.site:
            return _apart(claim, "it names no site", "`--site NAME` puts it on the map of a site")
        if not claim.stays and claim.origin is not None:
            return _apart(
                claim, f"where on Earth the site {claim.site!r} lies is not known",
                "`--offset X Y YAW` states where it lies at the site; or run an earlier recording of the site with "
                "`--origin LAT LON`",
            )  # fmt: skip
        if not claim.stays:
            return _apart(
                claim, "the frame of its places starts with the recording",
                "`--offset X Y YAW` states where it lies at the site, or `--origin LAT LON` where on Earth",
            )  # fmt: skip
        origin = there if claim.origin is None else claim.origin
        joined = f"taken to be in the frame of the site {claim.site!r}, as it names it" if known is not None else ""
        return Placement(claim.site, origin, None, joined)


def _by_offset(claim: Claim, there: Origin | None) -> Placement:
    assert claim.offset is not None
    moved = None if claim.offset == Offset(0.0, 0.0) else claim.offset
    text = f"placed at the site {claim.site!r} by the stated offset"
    if claim.origin is not None and there is not None:
        text += f"; by the origins of both it would lie at {_where(claim.origin.offset_in(there))}"
    return Placement(claim.site, there if there is not None or moved is not None else claim.origin, moved, text)


def _by_origins(claim: Claim, here: Origin, there: Origin) -> Placement:
    if here == there:
        return Placement(claim.site, there)
    offset = here.offset_in(there)
    if (far := math.hypot(offset.x_m, offset.y_m)) > FARTHEST_M:
        why = f"it lies {far / 1e3:.0f} km from the origin of the site {claim.site!r}"
        return _apart(claim, why, "give it a site of another name")
    text = (
        f"joined to the site {claim.site!r} by the origins of both: its x = y = 0 lies at {_where(offset)}; an origin "
        "by satellite is as exact as the receiver"
    )
    return Placement(claim.site, there, offset, text)


def _where(offset: Offset) -> str:
    return f"{offset.x_m:.2f} m, {offset.y_m:.2f} m, turned by {math.degrees(offset.yaw_rad):.2f} deg"


def _apart(claim: Claim, why: str, mend: str) -> Placement:
    return Placement(
        claim.apart, claim.origin, None, f"kept apart, as the site {claim.apart!r}: {why}. {mend}", apart=True
    )


def placement_of(recording: Recording, placed: Callable[[Claim], Placement]) -> Placement:
    """Say where a recording's places are put; one without places stays at its site, without an origin.

    Parameters
    ----------
    recording
        As it was read.
    placed
        Called with what it says of its frame: `Frames.place`.
    """
    claim = Claim.of(recording)
    return Placement(recording.site) if claim is None else placed(claim)


def place_as_stored(recording: Recording, database: TerrainDatabase) -> Recording:
    """Put a recording where a database that holds it has it, else where a run would put it."""
    stored = database.recorded(recording.digest)
    if stored is None or Claim.of(recording) is None:
        return moved(recording, placement_of(recording, Frames(database.frames()).place))
    return moved(recording, Placement(stored.site, stored.origin, stored.offset))


def moved(recording: Recording, placed: Placement) -> Recording:
    """Put a recording's places in another frame: poses, and the places of wheel rows."""
    wheel, pose = recording.wheel, recording.pose
    if (offset := placed.offset) is not None:
        if wheel is not None and _has_places(wheel):
            x_m, y_m = offset.moved(wheel["x_m"], wheel["y_m"])
            yaw = {} if "yaw_rad" not in wheel else {"yaw_rad": wheel["yaw_rad"] + offset.yaw_rad}
            wheel = wheel.adding({"x_m": x_m, "y_m": y_m, **yaw})
        if pose is not None:
            pose = Pose(pose.time_s, *offset.moved(pose.x_m, pose.y_m), pose.yaw_rad + offset.yaw_rad)
    return replace(recording, site=placed.site, origin=placed.origin, offset=offset, wheel=wheel, pose=pose)


def _has_places(wheel: WheelTable) -> bool:
    return "x_m" in wheel and "y_m" in wheel
