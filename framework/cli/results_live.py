"""What `bevameter live` prints on the way: events line by line, and where the drive is."""

from __future__ import annotations

import math
import shlex
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from ..live.events import Event
    from ..live.following import Following
    from ..live.live import LiveTraverse
    from ..live.soil import SoilByNow

_UNREAD_BYTES = 2**20


def print_beginning(following: Following) -> None:
    """Print what was recognised, and what is not usable."""
    own = following.recording
    streams = {"places": own.pose, "wheels": own.wheel, "camera": own.camera, "sound": own.sound}
    streams["inertial sensor"] = own.vibration
    there = [name for name, stream in streams.items() if stream is not None]
    print(f"{own.source}: {', '.join(there)}", flush=True)
    for note in own.notes:
        print(f"note: {note}")
    for problem in own.problems:
        print(f"not usable: {problem}", flush=True)


def print_event(event: Event, file: TextIO | None) -> None:
    """Print an event in one line, with the drive's time [s]; on standard output where `file` is None."""
    from ..live.events import GroundChanged, SensesContradict, SoilDeparts

    if isinstance(event, GroundChanged):
        before = f", before {event.before}" if event.before else ""
        text = f"ground: {event.after} ({event.probability:.0%}){before}" if event.after else "ground: unknown"
    elif isinstance(event, SensesContradict):
        text = f"senses contradict each other: {event.said}"
    elif isinstance(event, SoilDeparts):
        share = event.strength_share
        text = f"soil departs from {event.class_name}: {share:.0%} of its strength"
        text += "; drive slowly" if share < 1.0 else ""
    else:
        text = f"trouble: {event.text}"
    print(f"{event.time_s:.1f} s: {text}", file=file, flush=True)


def status_line(live: LiveTraverse, following: Following) -> str:
    """Say in one line how late it is in the drive, what is under the wheels, and what of the senses is not trusted."""
    ground, soil = live.under_wheels(), live.soil()
    parts = [f"{live.clock_s:.0f} s" if math.isfinite(live.clock_s) else "no sample yet"]
    if ground is not None:
        probable = ground.probabilities.get(ground.class_name, math.nan)
        parts.append(f"{ground.class_name} ({probable:.0%})" if ground.class_name else "unknown ground")
    parts += [_soil(soil)] if soil is not None else []
    parts += [f"{each.sense}: {each.reasons[0]}" for each in live.trust().values() if each.reasons]
    unread = following.source.unread_bytes
    parts += [f"{unread / 1e6:.0f} MB behind"] if unread > _UNREAD_BYTES else []
    return "; ".join(parts)


def _soil(soil: SoilByNow) -> str:
    phi = soil.parameters.get("phi_rad")
    if phi is None:
        return f"no soil yet{f', {soil.advice}' if soil.advice else ''}"
    said = f"phi {math.degrees(phi.low):.0f} to {math.degrees(phi.high):.0f} deg"
    return f"{said}{f', {soil.advice}' if soil.advice else ''}"


def print_unstored(live: LiveTraverse, following: Following) -> None:
    """Say where a drive is kept that was not stored, and what stores it."""
    if not live.journal.exists():
        return
    print(f"the drive is kept in {live.journal}", file=sys.stderr)
    if following.source.can_be_read_again:
        again = shlex.join(["--mcap", str(following.source.path), "--resume", str(live.journal)])
        print(f"the same command with {again} goes on with it", file=sys.stderr)
