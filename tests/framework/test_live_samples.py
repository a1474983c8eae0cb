"""Samples as they come in: what is taken, refused, waited for and made of them."""

from __future__ import annotations

import threading
import time
from itertools import takewhile

import numpy as np
import pytest
from bevameter import InputError, LiveTraverse, Vehicle, Wheel
from bevameter.framework.default_models import Models
from bevameter.framework.live.track import LiveTrack
from live_drive import streams
from live_drives import begun, rover


def test_wheels_and_inertial_sensor_make_the_tables_of_a_recording(tmp_path):
    names = ("left", "right")
    wheels = tuple(
        Wheel(radius_m=0.2, width_m=0.1, name=name, position_m=(0.0, y))
        for name, y in zip(names, (0.5, -0.5), strict=True)
    )
    live = LiveTraverse(tmp_path / "t.db", Vehicle(wheels=wheels), site="field")
    t = np.arange(0.0, 8.0, 0.01)
    for time_s in t.tolist():
        live.imu(time_s, wx=0.0, wy=0.1, wz=0.0, ax=np.sin(40.0 * time_s), ay=0.0, az=9.81)
        for name in names:
            live.wheel(time_s, wheel=name, load_N=500.0 + time_s, wheel_speed_rad_s=5.0, travel_speed_m_s=0.9)
    live._drive.end()
    made = live._drive._made(None)
    assert made.wheel.wheel[:4].tolist() == ["left", "right", "left", "right"]
    np.testing.assert_allclose(made.wheel["load_N"], np.repeat(500.0 + t, 2))
    np.testing.assert_allclose(made.wheel["slip"], 0.1)
    np.testing.assert_allclose(made.vibration.time_s, t, atol=1e-9)
    np.testing.assert_allclose(made.vibration.channels[:, 3], np.sin(40.0 * t), atol=1e-6)
    assert set(made.vibration.wheel_names) == {"speed_left", "speed_right"}


def test_sensors_hand_over_from_threads_of_their_own(live_recording, tmp_path):
    live = begun(live_recording, Models({}, {}), tmp_path / "t.db")
    given = [list(takewhile(lambda each: each[0] <= 20.0, stream)) for stream in streams(live_recording, 0.0)]
    began, faults = time.monotonic(), []

    def hand_over(stream):
        try:
            for time_s, sample in stream:
                time.sleep(max(began + time_s / 20.0 - time.monotonic(), 0.0))
                sample(live)
        except Exception as error:
            faults.append(error)

    threads = [threading.Thread(target=hand_over, args=(each,)) for each in given]
    for each in threads:
        each.start()
    while any(each.is_alive() for each in threads):
        live.ahead(), live.trust(), live.soil(), live.snapshot(), live.problems
    assert faults == []
    made = live.close()
    assert made.duration_s == pytest.approx(20.0, abs=0.1)


def test_nothing_is_not_stored(tmp_path):
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    with pytest.raises(InputError, match="no sample came"):
        live.close()
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="horizon_s"):
        LiveTraverse(tmp_path / "t.db", rover(), site="field", horizon_s=-1.0)


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
        (lambda live: live.sound(0.0, np.zeros(8, np.int16), 22050), "sound: samples of int16"),
        (lambda live: live.sound(0.0, np.zeros((8, 0)), 22050), "sound: shape \\(8, 0\\)"),
        (lambda live: live.ahead(float("nan")), "length_m: nan"),
        (lambda live: live.ahead(5.0, 1e6), "width_m: 1000000.0"),
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
