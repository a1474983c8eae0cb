"""`bevameter photographs`: what the camera saw of a stretch of known ground, as photographs to train from."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated

import typer

from .options import TOPICS, VehicleFile


def command(
    recording: Annotated[Path, typer.Argument(metavar="DRIVE", help="A folder, a ROS bag or an MCAP file.")],
    class_name: Annotated[str, typer.Option("--class", metavar="NAME", help="The class of the ground.")],
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Labelled folder to add to; made if missing.")],
    from_s: Annotated[float | None, typer.Option("--from", metavar="S", help="From this time on [s].")] = None,
    to_s: Annotated[float | None, typer.Option("--to", metavar="S", help="Up to this time [s].")] = None,
    vehicle: VehicleFile = None,
    topics: Annotated[Path | None, typer.Option("--topics", help=TOPICS)] = None,
) -> None:
    """Write photographs of ground whose class is known, one a metre of the way, for `bevameter train vision`."""
    import cv2

    from ...vision.photographs import photographs
    from ..core.class_names import check_class_name
    from ..core.classifier.labelled_index import add_to_index, check_index
    from ..core.errors import InputError
    from ..core.recording.readers import read_recording
    from .printing import status

    check_class_name(class_name, "--class", "")
    check_index(out)
    begin, end = -math.inf if from_s is None else from_s, math.inf if to_s is None else to_s
    if not begin < end:
        raise InputError("--from", f"{begin:g} s, --to {end:g} s", expected="--from before --to")
    drive = read_recording(recording, vehicle=vehicle, topics=topics)
    ends = (f" from {begin:g} s" if from_s is not None else "", f" to {end:g} s" if to_s is not None else "")
    stretch = "".join(ends)
    folder = out / re.sub(r"[^\w.-]+", "_", class_name)
    stem = re.sub(r"[^\w.-]+", "_", drive.name)
    rows, unused = [], []
    with status(f"looking at {recording}"):
        for each in photographs(drive, begin, end):
            if each.image is None:
                unused.append(each.problem)
                continue
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / f"{stem}-{each.time_s:.2f}s.png"
            path.write_bytes(cv2.imencode(".png", each.image)[1].tobytes())
            rows.append((path.relative_to(out).as_posix(), class_name, f"{drive.name}{stretch}"))
    if not rows:
        what = f"no frame of {len(unused)} can be used: {unused[0]}" if unused else "no frame with a known place"
        raise InputError(recording, what + stretch, expected="frames of ground, while the vehicle drives")
    add_to_index(out, rows)
    print(f"{len(rows)} photographs of {class_name} added to {out}, one group: {drive.name}{stretch}")
    if unused:
        print(f"left out: {len(unused)} frames, such as: {unused[0]}")
    print(f"next, with two groups of each class or more: bevameter train vision {out} --out models/vision.skops")
