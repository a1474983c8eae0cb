"""A drive in the Rerun viewer while it goes on (the extra `rerun`).

Entities are those of `rerun_log`, but for the cells: they are tiles of a raster, of which those that changed are
written anew. So what is written in a second does not grow with the drive.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

import numpy as np

from ..database.snapshot import Snapshot
from ..identification.estimate.tables import learnt
from .colours import cell_colours, class_colours
from .core.pooling import cells_from_keys
from .live.events import Event, GroundChanged, SensesContradict, Trouble
from .live.live import LiveTraverse
from .rerun_layout import layout, live_world
from .rerun_parts import (
    FRAME_PERIOD_S,
    SOIL,
    SenseLog,
    camera_entity,
    ends_of,
    write_frame,
    write_legend,
    write_lens,
    write_vehicle,
)  # fmt: skip
from .rerun_stream import Log, check_rerun, opened

PERIOD_S = 0.5
"""What is known is written so often [s]."""

TAKES_S = 0.2
"""A viewer that takes longer for it misses what comes until it has caught up [s]: else memory would fill."""

TILE = 64
"""Cells on a side of a tile [-]."""

_MOST_EVENTS = 1000

_STRIP = 200
"""Places in a piece of the track [-]."""


class RerunLive:
    """Shows a drive while it goes on: where it is, its cells, how far senses are trusted, its soil and its events.

    Showing never stops the drive. What cannot be written is left out, and `fault` says why.

    Parameters
    ----------
    live
        The drive.
    to
        A file that ends with ``.rrd``, or the address of a viewer, as ``rerun+http://127.0.0.1:9876/proxy``.

    Raises
    ------
    InputError
        Rerun is not installed, the file cannot be written, or no viewer answers at the address.
    """

    def __init__(self, live: LiveTraverse, to: str | Path):
        check_rerun(to)
        self._live, self.fault = live, ""
        self._open = ExitStack()
        self._log = self._open.enter_context(opened(to, None))
        self._writing, self._ended = threading.Lock(), threading.Event()
        self._events: deque[Event] = deque(maxlen=_MOST_EVENTS)
        self._is_behind, self._last_image_s, self._camera = False, -math.inf, ""
        self._cells = _Tiles(self._log)
        self._track = _Strips(self._log)
        self._senses: dict[str, SenseLog] = {}
        self._log.static("world", self._log.rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        write_vehicle(self._log)
        self._arrange()
        live.subscribe(self._events.append)
        self._thread = threading.Thread(target=self._work, name="bevameter rerun", daemon=True)
        self._thread.start()

    def __enter__(self) -> RerunLive:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def image(self, t: float, frame: np.ndarray) -> None:
        """Show an image, as it is handed to the drive; of those within half a second only the first is shown.

        Parameters
        ----------
        t
            When it was taken [s].
        frame : (h, w, 3) or (h, w) uint8
            In the order blue, green, red, or grey.
        """
        if (t < self._last_image_s + FRAME_PERIOD_S and t >= self._last_image_s) or self._is_behind:
            return
        with self._writing:
            self._last_image_s = t
            try:
                self._write_image(t, frame)
            except (RuntimeError, OSError) as error:
                self.fault = str(error)

    def close(self) -> None:
        """Write what is known at the end, and end; call it before the drive is closed."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._thread.join()
        self._tick()
        try:
            self._open.close()
        except OSError as error:
            self.fault = str(error)

    def _work(self) -> None:
        while not self._ended.wait(PERIOD_S):
            self._tick()

    def _tick(self) -> None:
        with self._writing:
            try:
                if not self._is_behind:
                    self._write()
                self._log.stream.flush(timeout_sec=TAKES_S)
                self._is_behind = False
            except (RuntimeError, OSError) as error:
                self._is_behind, self.fault = True, str(error)

    def _write(self) -> None:
        place = self._live.place()
        if place is None:
            return
        time_s, x_m, y_m, yaw_rad = place
        rr = self._log.rr
        turned = rr.Quaternion(xyzw=[0.0, 0.0, math.sin(0.5 * yaw_rad), math.cos(0.5 * yaw_rad)])
        self._log.at(time_s, "world/vehicle", rr.Transform3D(translation=[x_m, y_m, 0.0], quaternion=turned))
        self._track.add(time_s, x_m, y_m)
        self._cells.write(time_s, self._live.snapshot())
        self._write_senses(time_s)
        self._write_soil(time_s)
        self._write_events()

    def _write_image(self, time_s: float, frame: np.ndarray) -> None:
        camera = self._live.vehicle.camera
        known = self._camera or camera_entity(camera, frame)
        shrunk = write_frame(self._log, f"{known}/image", time_s, frame)
        if self._camera:
            return
        self._camera = known
        if camera is not None and known != "camera":
            write_lens(self._log, camera, *shrunk)
        self._arrange()

    def _write_senses(self, time_s: float) -> None:
        for each in self._live.trust().values():
            if math.isinf(each.age_s):
                continue
            if each.sense not in self._senses:
                self._senses[each.sense] = SenseLog(self._log, each.sense)
                self._arrange()
            path = self._log.path("senses", each.sense, "quality")
            self._log.at(time_s, path, self._log.rr.Scalars(each.quality))
            self._senses[each.sense].write(time_s, each.quality, each.reasons)

    def _write_soil(self, time_s: float) -> None:
        soil, ground = self._live.soil(), self._live.under_wheels()
        lines = []
        if ground is not None:
            lines.append(f"Under the wheels: {ground.class_name or 'no class is probable enough'}.")
        if soil is not None:
            for name, (entity, scale) in SOIL.items():
                for end, value in ends_of(soil.parameters, {}, name).items():
                    known = [scale * value] if math.isfinite(value) else []
                    self._log.at(time_s, f"soil/{entity}/{end}", self._log.rr.Scalars(known))
            c, phi = learnt(soil.parameters, {}, with_unit=True)
            found = f"c {c}, phi {phi}" if soil.parameters else "not estimated yet"
            lines.append(f"Soil from {soil.n} samples since {soil.since_s:.1f} s, with 95 % intervals: {found}.")
            lines += [f"The newest sample does not count: {soil.reason}."] if soil.reason else []
            lines += [f"To determine it better: {soil.advice}."] if soil.advice else []
        page = self._log.rr.TextDocument("\n\n".join(lines), media_type="text/markdown")
        self._log.at(time_s, "summary", page)

    def _write_events(self) -> None:
        while self._events:
            event = self._events.popleft()
            text, level = _in_words(event)
            self._log.at(event.time_s, "log", self._log.rr.TextLog(text, level=level))

    def _arrange(self) -> None:
        instruments, soils = list(self._senses), [entity for entity, _ in SOIL.values()]
        self._log.stream.send_blueprint(layout(live_world(), self._camera, instruments, {}, soils))


def _in_words(event: Event) -> tuple[str, str]:
    """Put an event into words, and say how grave it is."""
    if isinstance(event, GroundChanged):
        return f"the ground changes from {event.before or 'no class'} to {event.after or 'no class'}", "INFO"
    if isinstance(event, SensesContradict):
        return f"the senses contradict each other: {event.said}", "WARN"
    if isinstance(event, Trouble):
        return event.text, "WARN"
    return f"the soil is not that of {event.class_name}: strength {event.strength_share:.2f} of it", "WARN"


class _Strips:
    """The track in pieces, of which the last one grows."""

    def __init__(self, log: Log):
        self._log, self._piece = log, 0
        self._places: list[tuple[float, float, float]] = []

    def add(self, time_s: float, x_m: float, y_m: float) -> None:
        if len(self._places) == _STRIP:
            self._places, self._piece = self._places[-1:], self._piece + 1
        self._places.append((x_m, y_m, 0.0))
        rr = self._log.rr
        strip = rr.LineStrips3D([self._places], colors=[0x202020FF], radii=[rr.Radius.ui_points(1.5)])
        self._log.at(time_s, f"world/track/{self._piece}", strip)


class _Tiles:
    """The site's cells as tiles of a raster."""

    def __init__(self, log: Log):
        self._log = log
        self._before: tuple[np.ndarray, np.ndarray] | None = None
        self._names: tuple[str, ...] = ()

    def write(self, time_s: float, snapshot: Snapshot) -> None:
        """Write the tiles that changed since the last time."""
        names, keys = tuple(snapshot.class_names), snapshot.cells.key
        colours = class_colours(names)
        if names != self._names:
            write_legend(self._log, colours)
            self._names, self._before = names, None
        probability = snapshot.cells.probability
        known = np.isfinite(probability).all(axis=1) & (snapshot.cells.looks > 0)
        rgba = cell_colours(names, np.where(known[:, None], probability, 0.0), known, colours)
        pixels = np.round(255.0 * rgba).astype(np.uint8)
        changed = self._changed(keys, pixels)
        self._before = keys, pixels
        cells = cells_from_keys(keys)
        tiles, of = np.unique(cells // TILE, axis=0, return_inverse=True)
        of = of.ravel()
        for tile in np.unique(of[changed]).tolist():
            rows = of == tile
            self._write_tile(time_s, tiles[tile], cells[rows] - TILE * tiles[tile], pixels[rows], snapshot.cell_size_m)

    def _changed(self, keys: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """Say of cells (n,) whether they are new or of another colour."""
        if self._before is None or not len(self._before[0]):
            return np.ones(len(keys), dtype=bool)
        before, drawn = self._before
        at = np.minimum(np.searchsorted(before, keys), len(before) - 1)
        return (before[at] != keys) | (drawn[at] != pixels).any(axis=1)

    def _write_tile(
        self, time_s: float, tile: np.ndarray, cells: np.ndarray, pixels: np.ndarray, size_m: float
    ) -> None:  # fmt: skip
        picture = np.zeros((TILE, TILE, 4), dtype=np.uint8)
        picture[TILE - 1 - cells[:, 1], cells[:, 0]] = pixels  # the first row of an image is the upper one
        rr, corner = self._log.rr, TILE * size_m * tile
        form = rr.components.ImageFormat(
            width=TILE, height=TILE, color_model=rr.ColorModel.RGBA, channel_datatype=rr.ChannelDatatype.U8
        )
        grid = rr.GridMap(data=picture.tobytes(), format=form, cell_size=size_m, translation=[*corner.tolist(), -0.02])
        self._log.at(time_s, f"world/cells/{tile[0]}_{tile[1]}".replace("-", "m"), grid)
