"""The views that the Rerun viewer opens on a drive; nothing but what the file holds has one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

WHITE = (255, 255, 255)
"""Background of the views; the class colours are chosen to be distinguishable on white."""

_NO_IMAGE = "- /world/vehicle/camera/image"
"""It would hide the ground."""

SOIL_TITLES = {"c_kPa": "cohesion c [kPa], 95 % interval", "phi_deg": "friction angle phi [deg], 95 % interval"}


def drive_world() -> Any:
    """Arrange the views of what has a place: all up to the time that is looked at, and all that the database knows."""
    rrb: Any = import_module("rerun.blueprint")
    return rrb.Tabs(
        rrb.Spatial3DView(
            origin="/world", name="drive: cells as they were last seen", time_ranges=_past(rrb), background=WHITE,
            contents=["+ /world/**", "- /world/site_map", _NO_IMAGE],
        ),
        rrb.Spatial3DView(
            origin="/world", name="site: all that the database knows", background=WHITE,
            contents=["+ /world/**", "- /world/cells/**", "- /world/soil", _NO_IMAGE],
        ),
    )  # fmt: skip


def unmapped_world() -> Any:
    """Give the view of a drive that has no cells."""
    rrb: Any = import_module("rerun.blueprint")
    return rrb.Spatial3DView(
        origin="/world", name="drive", time_ranges=_past(rrb), background=WHITE, contents=["+ /world/**", _NO_IMAGE]
    )


def live_world() -> Any:
    """Give the view of a drive that goes on."""
    rrb: Any = import_module("rerun.blueprint")
    return rrb.Spatial3DView(
        origin="/world", name="site: what is known by now", background=WHITE, contents=["+ /world/**", _NO_IMAGE]
    )


def _past(rrb: Any) -> list[Any]:
    """A cell that was written once stays: all up to the time that is looked at is shown."""
    start, end = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative(seconds=0.0)
    return [rrb.VisibleTimeRange(timeline, start=start, end=end) for timeline in ("recording", "utc")]


def layout(
    world: Any, camera: str, instruments: Sequence[str], channels: Mapping[str, str], soils: Sequence[str]
) -> Any:
    """Arrange the views: places and camera on the left, what was found in the middle, the wheels on the right.

    Parameters
    ----------
    world
        View of what has a place.
    camera
        Entity above the camera's frames; empty where there are none.
    instruments
        Those whose quality was written.
    channels
        Titles of the wheel channels, by name.
    soils
        Names of the estimates.
    """
    rrb: Any = import_module("rerun.blueprint")
    path = import_module("rerun").new_entity_path

    def plot(origin: str, title: str, **settings: Any) -> Any:
        return rrb.TimeSeriesView(origin=origin, name=title, **settings)

    below: list[Any] = [rrb.Spatial2DView(origin="/legend", name="legend")]
    if camera:
        below.insert(0, rrb.Spatial2DView(origin=f"/{camera}", name="camera"))
    shares = [4.0, 1.0] if camera else None
    left = rrb.Vertical(world, rrb.Horizontal(*below, column_shares=shares), row_shares=[3.0, 2.0])
    whole_range = rrb.ScalarAxis(range=(0.0, 1.0))
    middle = [
        rrb.Tabs(
            rrb.TextDocumentView(origin="/summary", name="summary"),
            rrb.TextLogView(origin="/log", name="findings"),
            *(
                rrb.TextLogView(origin=path(["senses", name, "log"]), name=f"{name}: why not trusted")
                for name in instruments
            ),
        ),
        *(
            plot(path(["senses", name, "quality"]), f"{name}: quality [-], 0 not trusted", axis_y=whole_range)
            for name in instruments
        ),
        *(plot(f"/soil/{name}", SOIL_TITLES[name]) for name in soils),
    ]
    columns = [left, rrb.Vertical(*middle)]
    if channels:
        columns.append(rrb.Vertical(*(plot(f"/wheels/{name}", title) for name, title in channels.items())))
    return rrb.Blueprint(
        rrb.Horizontal(*columns, column_shares=[3.0, 2.0, 2.0][: len(columns)]),
        rrb.TimePanel(timeline="recording", state="collapsed"),
        auto_views=False,
        collapse_panels=True,
    )
