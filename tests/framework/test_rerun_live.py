"""A drive in the Rerun viewer while it goes on: what is written is what the drive says of itself."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import InputError, LiveTraverse, read_recording
from bevameter.framework import rerun_live
from bevameter.framework.colours import cell_colours, class_colours
from bevameter.framework.core.pooling import cells_from_keys
from bevameter.framework.rerun_live import TILE, RerunLive
from live_drive import samples
from rrd_file import WITHOUT, File


@pytest.fixture(scope="module")
def shown(short_drive, small_models, tmp_path_factory):
    """Half a minute of a drive that was shown, as it was when it ended, and the file."""
    pytest.importorskip("rerun.chunk", reason=WITHOUT)
    folder, recording = tmp_path_factory.mktemp("rerun"), read_recording(short_drive)
    live = LiveTraverse(folder / "t.db", recording.vehicle, models=small_models, site="s", lossless=True)
    with RerunLive(live, folder / "live.rrd") as view:
        for time_s, hand_over in samples(recording):
            if time_s > 30.0:
                break
            hand_over(live)
        for frame in recording.camera.frames(lambda time_s: time_s <= 5.0):
            if frame.image is not None and frame.time_s <= 5.0:
                view.image(frame.time_s, frame.image)
    assert view.fault == ""
    seen = live.snapshot(), live.place(), live.trust()
    live.close()
    return recording, *seen, File(folder / "live.rrd")


def test_the_tiles_hold_the_cells_of_the_snapshot(shown):
    _, snapshot, *_, file = shown
    cells, names = cells_from_keys(snapshot.cells.key), snapshot.class_names
    assert len(cells) > 100
    known = np.isfinite(snapshot.cells.probability).all(axis=1) & (snapshot.cells.looks > 0)
    probability = np.where(known[:, None], snapshot.cells.probability, 0.0)
    expected = np.round(255.0 * cell_colours(names, probability, known, class_colours(names)))
    drawn = {}
    for entity, rows in file.rows.items():
        if entity.startswith("/world/cells/"):
            _, last = max(rows, key=lambda row: row[0])
            picture = np.array(last["data"][0], dtype=np.uint8).reshape(TILE, TILE, 4)[::-1]
            corner = np.round(np.array(last["translation"][0][:2]) / snapshot.cell_size_m).astype(int)
            for y, x in np.argwhere(picture[..., 3] > 0):
                drawn[corner[0] + x, corner[1] + y] = picture[y, x]
    assert drawn.keys() == {tuple(cell) for cell in cells.tolist()}
    for cell, colour in zip(cells.tolist(), expected, strict=True):
        np.testing.assert_array_equal(drawn[tuple(cell)], colour)


def test_place_senses_and_soil_are_those_of_the_drive(shown):
    _, _, place, trust, file = shown
    time_s, last = max(file.rows["/world/vehicle"], key=lambda row: -1.0 if row[0] is None else row[0])
    assert (time_s, *last["translation"][0][:2]) == pytest.approx(place[:3], abs=1e-5)
    for each in trust.values():
        times, qualities = file.series(f"/senses/{each.sense}/quality")
        assert (times[-1], qualities[-1]) == pytest.approx((place[0], each.quality))
    words = [row["text"][0] for _, row in file.rows["/log"]]
    assert any("the ground changes from" in each for each in words)
    frames = file.rows["/world/vehicle/camera/image"]
    assert np.diff([time for time, _ in frames]).min() >= 0.5
    assert {"/world", "/summary", "/log", "/legend", "/world/vehicle/camera"} <= set(file.views)


def test_what_is_written_does_not_grow_with_the_drive(shown, monkeypatch):
    """A tile is written again only where one of its cells changed."""
    _, snapshot, *_ = shown
    monkeypatch.setattr(rerun_live, "TILE", 8)
    written = []
    tiles = rerun_live._Tiles(None)
    monkeypatch.setattr(rerun_live, "write_legend", lambda *_: None)
    monkeypatch.setattr(tiles, "_write_tile", lambda time_s, tile, *_: written.append(tuple(tile.tolist())))
    tiles.write(0.0, snapshot)
    all_of_them, written[:] = list(written), []
    tiles.write(1.0, snapshot)
    assert written == []
    assert len(set(all_of_them)) == len(all_of_them) > 1


def test_no_viewer_or_no_file_is_said_at_once(tmp_path, short_drive):
    pytest.importorskip("rerun.chunk", reason=WITHOUT)
    live = LiveTraverse(tmp_path / "t.db", short_drive / "vehicle.toml")
    for to, said in (("rerun+http://127.0.0.1:9/proxy", "no viewer answers"), ("http://x", "no viewer answers"),
                     (tmp_path / "d.txt", "a name that ends with .rrd")):  # fmt: skip
        with pytest.raises(InputError, match=said):
            RerunLive(live, to)


def test_a_viewer_that_is_too_slow_misses_something_and_the_drive_goes_on(shown, tmp_path, monkeypatch):
    recording, *_ = shown
    live = LiveTraverse(tmp_path / "t.db", recording.vehicle, models=(), lossless=True)
    view = RerunLive(live, tmp_path / "d.rrd")

    def slow(timeout_sec):
        raise RuntimeError("timed out")

    monkeypatch.setattr(type(view._log.stream), "flush", lambda _, timeout_sec=1.0: slow(timeout_sec))
    for k in range(100):
        live.pose(0.1 * k, 0.1 * k, 0.0, 0.0)
    view._tick()
    before = view._track._places
    live.pose(11.0, 11.0, 0.0, 0.0)
    live.pose(11.1, 11.1, 0.0, 0.0)  # those before wait no longer
    view._tick()
    assert view.fault == "timed out"
    assert view._track._places == before  # nothing was written while it was behind
    monkeypatch.undo()
    view._tick()
    view.close()
    assert max(time for time, _ in File(tmp_path / "d.rrd").rows["/world/vehicle"] if time is not None) == 11.0
