"""The main job while driving: what a drive that is handed over sample by sample gives, against `run_traverse`."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import InputError, LiveTraverse, TerrainDatabase, Vehicle, Wheel, read_recording, run_traverse
from bevameter.framework.live.track import LiveTrack
from live_drive import out_of_order, samples


@pytest.fixture(scope="module")
def recording(short_drive):
    return read_recording(short_drive)


@pytest.fixture(scope="module")
def stored(recording, small_models, tmp_path_factory):
    """The drive that `run_traverse` stores, and its summary."""
    path = tmp_path_factory.mktemp("run") / "t.db"
    summary = run_traverse(recording, path, models=small_models)
    with TerrainDatabase(path) as database:
        return database.drives()[0], summary


def begun(recording, models, path, **options) -> LiveTraverse:
    return LiveTraverse(
        path, recording.vehicle, models=models, site=recording.site, name=recording.name,
        start_time=recording.start_time, lossless=True, **options,
    )  # fmt: skip


@pytest.fixture(scope="module")
def replayed(recording, small_models, tmp_path_factory):
    """The drive that `LiveTraverse` stores, and its summary; samples come up to 40 ms late."""
    path = tmp_path_factory.mktemp("live") / "t.db"
    live = begun(recording, small_models, path)
    for hand_over in out_of_order(samples(recording), 0.04):
        hand_over(live)
    assert live.problems == ()
    summary = live.close(recording.digest)
    with TerrainDatabase(path) as database:
        return database.drives()[0], summary


def assert_same(one, other):
    """All that two drives observed, but for the rounding of sums."""
    assert len(one.terrain) == len(other.terrain)
    rows = [np.lexsort((each.terrain.cell_y, each.terrain.cell_x)) for each in (one, other)]
    for name in ("cell_x", "cell_y", "time_s"):
        a, b = (getattr(each.terrain, name)[row] for each, row in zip((one, other), rows, strict=True))
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9)
    for name in ("probabilities", "quality", "unknown"):
        a, b = (getattr(each.terrain.evidence, name)[row] for each, row in zip((one, other), rows, strict=True))
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9)
    assert len(one.soils) == len(other.soils)
    for a, b in zip(one.soils, other.soils, strict=True):
        assert (a.start_s, a.end_s, a.gate_reason) == (b.start_s, b.end_s, b.gate_reason)
        assert a.class_probabilities == pytest.approx(b.class_probabilities, abs=1e-9)
        assert (a.estimate is None) == (b.estimate is None)
        if a.estimate is not None:
            np.testing.assert_allclose(a.estimate.mean_c_tan_phi, b.estimate.mean_c_tan_phi, rtol=1e-9)
            np.testing.assert_allclose(a.estimate.covariance_c_tan_phi, b.estimate.covariance_c_tan_phi, rtol=1e-9)


def test_a_replay_gives_the_observations_of_a_run(stored, replayed):
    (one, summary), (other, again) = stored, replayed
    assert len(one.terrain) > 300
    assert other.id == one.id
    assert_same(one, other)
    for a, b in zip(summary.senses, again.senses, strict=True):
        assert (a.absent, a.items, dict(a.said), dict(a.closed)) == (b.absent, b.items, dict(b.said), dict(b.closed))
    assert again.problems == summary.problems
    assert again.track_m == pytest.approx(summary.track_m)


def rover(**parts) -> Vehicle:
    return Vehicle(wheels=(Wheel(radius_m=0.2, width_m=0.1),), **parts)


def test_samples_that_come_too_late_are_left_out_and_counted(tmp_path):
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field", horizon_s=0.5)
    for time_s in (0.0, 0.2, 0.1, 2.0, 1.6, 3.0, 1.2, 4.0):
        live.pose(time_s, time_s, 0.0, 0.0)
    assert live.problems == ("1 samples of pose came more than 0.5 s late and were left out",)
    summary = live.close()
    assert summary.distance_m == pytest.approx(4.0)
    assert "1 samples of pose" in summary.problems[0]


@pytest.mark.parametrize(
    ("hand_over", "said"),
    [
        (lambda live: live.pose(0.0, float("nan"), 0.0, 0.0), "pose, x: nan"),
        (lambda live: live.image(0.0, np.zeros((4, 4))), "image: float64 of shape \\(4, 4\\)"),
        (lambda live: live.sound(0.0, np.zeros(8), 8.5), "sound: 8.5 Hz"),
        (lambda live: live.wheel(0.0, weight_N=1.0), "wheel: channel weight_N"),
        (lambda live: live.wheel(0.0, load_N="much"), "wheel, load_N: 'much'"),
        (lambda live: live.wheel(0.0, wheel="fifth", load_N=1.0), "wheel: 'fifth' .expected one of wheel"),
    ],
)
def test_what_is_no_sample_is_refused(tmp_path, hand_over, said):
    with LiveTraverse(tmp_path / "t.db", rover(), site="field") as live:
        with pytest.raises(InputError, match=said):
            hand_over(live)
        live.pose(0.0, 0.0, 0.0, 0.0)
        live.pose(1.0, 1.0, 0.0, 0.0)
    with pytest.raises(InputError, match="closed"):
        live.pose(2.0, 0.0, 0.0, 0.0)


def test_places_wait_for_the_pose_that_follows_but_not_for_ever():
    track = LiveTrack()
    for time_s in np.arange(11) / 10:
        track.go_on(time_s)
        track.add_pose(time_s, 2 * time_s, 0.0, 0.0)
    track.add_speed(0.0, 2.0)
    track.add_speed(1.2, 2.0)
    assert track.covers(0.65)
    assert not track.covers(1.1)
    assert np.isnan(track.place_at(np.array([1.1]))[0]).all()
    track.go_on(2.5)  # no pose for more than a second: a hole
    assert track.covers(1.1)
    assert np.isnan(track.place_at(np.array([1.1]))[0]).all()
    track.add_pose(2.6, 5.2, 0.0, 0.0)
    assert track.place_at(np.array([0.65, 1.1]))[0] == pytest.approx([1.3, np.nan], nan_ok=True)
