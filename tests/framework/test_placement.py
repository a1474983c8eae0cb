"""Drives share a frame only where something ties them together, and then each place lies where it is."""

from __future__ import annotations

import math
import shutil
import sqlite3
import uuid
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase, read_recording, run_traverse, run_traverses
from bevameter.database.frames import SiteFrame
from bevameter.framework.batch import FailedRecording
from bevameter.framework.core.origin import Offset, Origin
from bevameter.framework.core.recording.bag_places import stays
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.placement import Claim, Frames, Placement, moved, place_as_stored, placement_of
from bevameter.framework.scenario.write import write_scenario
from robot_bag import RobotBag, drive

GRAZ = Origin(47.0707, 15.4395)


def claim(name="a", site="farm", origin=None, offset=None, stays=False) -> Claim:
    return Claim(name, uuid.uuid5(uuid.NAMESPACE_DNS, name).hex, site, origin, offset, stays)


def test_wheel_rows_that_are_moved_keep_their_soils_and_the_names_of_their_columns(tmp_path):
    place = np.array([1.0, 2.0])
    channels, soil = {"x_m": place, "y_m": place, "slip": place}, np.array(["sand", None], dtype=object)
    wheel = WheelTable(channels, None, None, tmp_path, soil, {"slip": "s"})
    recording = Recording("a", tmp_path, None, None, "", "0", wheel=wheel)
    found = moved(recording, Placement("farm", None, Offset(1.0, 0.0, 0.0))).wheel
    assert found["x_m"].tolist() == [2.0, 3.0]
    assert found.soil is wheel.soil
    assert found.column_names == {"slip": "s"}


@pytest.mark.parametrize(("heading", "other"), [(0.0, 0.0), (35.0, -120.0)])
def test_a_frame_lies_in_another_as_a_map_projection_has_it(heading, other):
    pyproj = pytest.importorskip("pyproj")
    here, there = Origin(60.02, 10.05, heading), Origin(60.0, 10.0, other)
    places = np.array([[0.0, 0.0], [300.0, 0.0], [-50.0, 200.0]])
    to_earth = pyproj.Transformer.from_crs(here.crs, 4326, always_xy=True)
    from_earth = pyproj.Transformer.from_crs(4326, there.crs, always_xy=True)
    east, north = from_earth.transform(*to_earth.transform(*here.to_local(places).T))
    expected = np.column_stack(there.from_local(np.array(east), np.array(north)))
    moved = np.column_stack(here.offset_in(there).moved(*places.T))
    np.testing.assert_allclose(moved, expected, atol=0.02)


def test_nothing_ties_two_drives_of_odometry_together():
    frames = Frames({})
    placed = [frames.place(claim(name, site)) for name in "ab" for site in ("", "farm")]
    assert len({each.site for each in placed}) == 4
    assert all(each.apart and "kept apart" in each.note for each in placed)


@pytest.mark.parametrize("frame", ["odom", "robot1/odom", "odom_combined", "world", "camera_init", "unnamed", "fixes"])
def test_only_frames_of_localisation_are_the_same_in_each_recording(frame):
    assert not stays(frame)
    assert all(map(stays, ("", "map", "/utm")))


def test_a_name_ties_frames_that_are_the_same_in_each_recording():
    frames = Frames({})
    first, second = (frames.place(claim(name, stays=True)) for name in "ab")
    for each in (first, second):
        assert (each.site, each.offset, each.apart) == ("farm", None, False)
    assert "taken to be in the frame of the site 'farm'" in second.note
    assert frames.place(claim("c", site="", stays=True)).apart


def test_origins_tie_drives_together_and_the_first_one_is_the_sites():
    frames = Frames({})
    east = Origin(GRAZ.latitude_deg, GRAZ.longitude_deg + 0.001, 90.0)
    first, second = frames.place(claim("a", origin=GRAZ)), frames.place(claim("b", origin=east))
    assert (first.site, first.origin, first.offset) == ("farm", GRAZ, None)
    assert (second.site, second.origin) == ("farm", GRAZ)
    assert (second.offset.x_m, second.offset.y_m) == pytest.approx((75.9, 0.0), abs=0.1)
    assert second.offset.yaw_rad == pytest.approx(-math.pi / 2, abs=1e-4)  # its y points east, its x south
    again = frames.place(claim("a", origin=GRAZ))
    assert (again.site, again.origin, again.offset) == ("farm", GRAZ, None)
    far = frames.place(claim("far", origin=Origin(48.2, 16.4)))
    assert far.apart
    assert far.site != "farm"


def test_the_frame_of_a_recording_itself_binds_nobody():
    """One that was processed without its origin can be processed again with it."""
    frames = Frames({"farm": SiteFrame(None, frozenset({claim("a").digest}))})
    assert frames.place(claim("a", origin=GRAZ)).origin == GRAZ
    others = Frames({"farm": SiteFrame(None, frozenset({claim("b").digest}))})
    assert others.place(claim("a", origin=GRAZ)).apart


def test_a_stated_offset_moves_a_drive_to_its_site():
    frames = Frames({"farm": SiteFrame(GRAZ, frozenset("xy"))})
    placed = frames.place(claim(offset=Offset(3.0, 4.0, 0.5), origin=Origin(0.0, 0.0)))
    assert (placed.site, placed.origin, placed.offset) == ("farm", GRAZ, Offset(3.0, 4.0, 0.5))
    assert frames.place(claim(offset=Offset(0.0, 0.0))).offset is None


@pytest.mark.parametrize("gps", [True, False])
def test_a_bag_says_in_which_frame_its_poses_are(tmp_path, gps):
    driven = drive(8.0)
    driven = replace(driven, way_m=10.0 * driven.way_m)  # far enough for fixes to say how the way lies
    starts = {"one": (47.0707, 15.4395, 90.0), "two": (47.0707 + 40.0 / 111_170.0, 15.4395, 0.0)}
    frames, placed = Frames({}), []
    for seed, (name, start) in enumerate(starts.items()):
        bag = RobotBag(driven, gps=gps, wheels=False, start_deg=start, seed=seed)
        recording = read_recording(bag.write(tmp_path / name))
        assert not Claim.of(recording).stays
        placed.append(moved(recording, placement_of(recording, frames.place)))
    one, two = placed
    if not gps:
        assert (one.origin, two.origin) == (None, None)
        assert one.site != two.site
        return
    # The second starts 40 m to the north and drives north where the first one drives east.
    assert one.site == two.site
    assert one.origin == two.origin
    np.testing.assert_allclose(one.pose.y_m, 0.0, atol=0.2)
    np.testing.assert_allclose(two.pose.x_m, 0.0, atol=0.2)
    np.testing.assert_allclose(two.pose.y_m, 40.0 + one.pose.x_m, atol=0.2)


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Two drives that start at (0, 0) of frames of their own, 40 m apart, along x, of the second one northwards."""
    folder = tmp_path_factory.mktemp("drives")
    origins = {"one": "[47.0707, 15.4395]", "two": f"[{47.0707 + 40.0 / 111_170.0}, 15.4395, -90.0]"}
    for seed, name in enumerate(("one", "two", "one_alone", "two_alone")):
        write_scenario("testbed", folder / name, seed=seed, duration_s=5.0)
        (folder / name / "pose.csv").write_text("time_s,x_m,y_m,yaw_rad\n0,0,0,0\n2.5,1,0,0\n5,2,0,0\n")
        stated = f'site = "farm"\norigin = {origins[name]}\n' if name in origins else ""
        (folder / name / "recording.toml").write_text(stated)
    return folder


def run(drives, database, *names, **options):
    return run_traverses([drives / name for name in names], database, **options)


def places_of(database, site):
    drives = sorted(database.drives(site, newest=True), key=lambda each: each.name)
    return [np.array([(soil.x_m, soil.y_m) for soil in each.soils]).mean(axis=0) for each in drives]


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_two_drives_meet_by_their_origins_and_not_without(drives, tmp_path, workers):
    names = ("one_alone", "one", "two_alone", "two")
    outcomes = run(drives, tmp_path / "t.db", *names, workers=workers)
    with TerrainDatabase(tmp_path / "t.db") as database:
        apart = [each for each in database.sites() if each != "farm"]
        assert len(apart) == 2
        assert [each.site for each in outcomes] == [apart[0], "farm", apart[1], "farm"]
        one, two = places_of(database, "farm")
        assert database.snapshot("farm").origin == outcomes[1].origin == outcomes[3].origin == GRAZ
    assert any("kept apart" in warning for warning in outcomes[0].warnings)
    assert any("joined to the site 'farm' by the origins of both" in note for note in outcomes[3].notes)
    np.testing.assert_allclose(one, [1.0, 0.0], atol=0.3)
    np.testing.assert_allclose(two, [0.0, 40.0 + one[0]], atol=0.3)
    again = run(drives, tmp_path / "t.db", *names, workers=workers)
    assert all(each.known for each in again)


def test_what_is_stated_comes_first_and_the_map_is_found_again(drives, tmp_path):
    path = tmp_path / "t.db"
    run(drives, path, "one_alone", site="farm", origin=GRAZ)
    (outcome,) = run(drives, path, "two_alone", site="farm", offset=Offset(0.0, 40.0, math.pi / 2))
    recording = read_recording(drives / "two_alone")
    with TerrainDatabase(path) as database:
        one, two = places_of(database, "farm")
        np.testing.assert_allclose(two, [0.0, 40.0 + one[0]], atol=0.3)
        assert database.frames()["farm"].origin == outcome.origin == GRAZ
        there = place_as_stored(recording, database)
    assert there.site == "farm"
    np.testing.assert_allclose(there.pose.y_m, 40.0 + recording.pose.x_m, atol=1e-6)


def test_sites_with_other_origins_are_not_merged(drives, tmp_path):
    for name in ("one", "two"):
        run(drives, tmp_path / f"{name}.db", name)
    with TerrainDatabase(tmp_path / "one.db") as one, TerrainDatabase(tmp_path / "two.db") as two:
        before = one.drive_ids()
        with pytest.raises(InputError, match=r"the origin of the site 'farm' is latitude 47\.07.*one origin"):
            one.merge(two)
        assert one.drive_ids() == before
        one.merge(one)
        with pytest.raises(InputError, match="the origin of the site 'farm'"):
            one.add_drive(two.drives("farm")[0])
        assert one.drive_ids() == before
    # As it is meant to be: the one knows the other's site before it drives.
    run(drives, tmp_path / "one.db", "two")
    with TerrainDatabase(tmp_path / "one.db") as one, TerrainDatabase(tmp_path / "new.db") as new:
        new.merge(one)
        assert len(new.drives("farm", newest=True)) == 2


def test_a_correction_of_the_same_recording_is_merged(drives, tmp_path):
    run(drives, tmp_path / "one.db", "one_alone", site="farm", origin=Origin(47.0, 15.0))
    with TerrainDatabase(tmp_path / "one.db") as one, TerrainDatabase(tmp_path / "fleet.db") as fleet:
        fleet.merge(one)
        run(drives, tmp_path / "one.db", "one_alone", site="farm", origin=GRAZ)
        fleet.merge(one)
        assert fleet.snapshot("farm").origin == GRAZ


def test_the_frame_of_a_site_outlives_the_recording_that_gave_it(drives, tmp_path):
    path = tmp_path / "t.db"
    run(drives, path, "one", "two")
    run(drives, path, "one", site="other")
    (again,) = run(drives, path, "two")
    assert again.known
    assert again.origin == GRAZ


def test_one_statement_is_not_that_of_several_frames(drives, tmp_path):
    for name in ("one", "two"):
        shutil.copytree(drives / f"{name}_alone", tmp_path / name)
        (tmp_path / name / "recording.toml").write_text('frame = "odom"\n')
    given = [tmp_path / "one", tmp_path / "two"]
    for stated in ({"offset": Offset(1.0, 2.0)}, {"origin": GRAZ}):
        for failed in run_traverses(given, tmp_path / "t.db", site="farm", **stated):
            assert "stated for several recordings" in failed.problem
    assert run_traverses(given[:1], tmp_path / "t.db", site="farm", origin=GRAZ)[0].site == "farm"


@pytest.mark.parametrize("frame", ['{"origin": 5}', '{"offset": [1, 2]}', "[1]", '"x"', '{"origin": [99, 0, 0]}'])
def test_a_damaged_frame_is_one_line(drives, tmp_path, frame):
    path = tmp_path / "t.db"
    run(drives, path, "one")
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE drive SET frame = ?", (frame,))
    with pytest.raises(InputError, match="frame"), TerrainDatabase(path) as database:
        database.frames()


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"site": " "}, "site"), ({"origin": (47.0, 15.0)}, "expected an Origin"),
        ({"offset": Offset(0.0, 0.0), "origin": GRAZ}, "expected one of them"), ({"offset": 3.0}, "expected an Offset"),
    ],
)  # fmt: skip
def test_frames_that_are_none_are_refused(drives, tmp_path, stated, said):
    with pytest.raises(InputError, match=said):
        run_traverse(drives / "one_alone", tmp_path / "t.db", **stated)
    assert not (tmp_path / "t.db").exists()


def test_an_offset_needs_a_site(drives, tmp_path):
    (failed,) = run_traverses([drives / "one_alone"], tmp_path / "t.db", offset=Offset(0.0, 0.0))
    assert isinstance(failed, FailedRecording)
    assert "no site" in failed.problem
