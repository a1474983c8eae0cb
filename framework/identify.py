"""`identify` on a recording or a part of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ..identification.estimate.identify import Identification, Method, open_recording
from ..identification.estimate.identify import identify as identify_soil
from .core.recording.types import Recording
from .core.soil import SoilKnowledge
from .core.vehicle import Vehicle
from .part import part_of


def identify(
    recording: Recording | str | Path,
    *,
    vehicle: Vehicle | str | Path | None = None,
    soil: SoilKnowledge | str | Path | None = None,
    method: Method = "ml",
    from_s: float | None = None,
    to_s: float | None = None,
    on: str | None = None,
    wheels: str | Sequence[str] = (),
    database: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Identify the soil from the wheel channels of a recording, or of a part of it.

    Parameters
    ----------
    recording
        A recording, or the path of one, or of a single wheel file.
    vehicle
        The vehicle, or its TOML file; the recording's own where absent.
    soil
        What is known of the soil already, or its TOML file.
    method
        ``"ml"``: maximum likelihood with errors in all channels. ``"linear"``: the paper's Eq. 22.
    from_s, to_s, on, wheels
        The part: a span of time [s], a class of ground, wheels; see `part_of`.
    database
        Path or URL of a terrain database whose map says where the ground is of the class `on`, if the recording's
        labels do not.
    progress
        Called with what is being done, in words.

    Returns
    -------
    Identification
        With `overall` None, and the reasons in `segments`, where no row could be used.

    Raises
    ------
    InputError
        The recording has no wheel channels, no geometry, no such part, or lacks channels that the method needs.
    """
    opened = open_recording(recording, vehicle)
    opened = part_of(opened, from_s=from_s, to_s=to_s, on=on, wheels=wheels, database=database)
    return identify_soil(opened, soil=soil, method=method, progress=progress)
