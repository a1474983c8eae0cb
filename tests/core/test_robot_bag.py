"""What is recognised of a common robot's bag: wheels, attitude, camera, places on Earth, travel speed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.origin import Origin
from bevameter.framework.core.recording.bag_camera import with_camera
from bevameter.framework.core.recording.bag_files import Topic
from bevameter.framework.core.recording.bag_frames import Frames
from bevameter.framework.core.recording.bag_wheel import follows_the_wheels
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.recording.wheel_names import wheel_called
from bevameter.framework.core.vehicle import load_vehicle
from bevameter.framework.inspection import inspect_recording
from robot_bag import NAMES, RADIUS_M, VEHICLE_TOML, RobotBag, drive
from scipy.signal import lfilter


@pytest.fixture(scope="module")
def driven():
    return drive(12.0)


@pytest.fixture
def vehicle(tmp_path):
    path = tmp_path / "vehicle.toml"
    path.write_text(VEHICLE_TOML, encoding="utf-8")
    return path


def png(rng) -> bytes:
    import cv2

    return cv2.imencode(".jpg", rng.integers(0, 255, (480, 640, 3)).astype(np.uint8))[1].tobytes()


def test_wheels_attitude_camera_and_origin_are_found_without_a_map(driven, vehicle, tmp_path, rng):
    bag = RobotBag(driven, images=[png(rng)], sinkage=True)
    recording = read_recording(bag.write(tmp_path / "bag"), vehicle=vehicle)
    table = recording.wheel
    assert set(table.wheel) == set(NAMES)
    assert recording.problems == ()
    rear = table.select(table.wheel == "rear_right")
    np.testing.assert_allclose(rear["wheel_speed_rad_s"] * RADIUS_M, driven.rim_m_s, atol=0.01)
    assert np.abs(rear["torque_Nm"] - driven.torque_Nm[:, 3]).mean() < 0.3
    assert np.nanmax(np.abs(rear["pitch_rad"] - driven.pitch_rad)) < 0.02  # nose up, though ROS's pitch is nose down
    assert np.nanmax(np.abs(rear["slip"] - driven.slip)) < 0.15
    assert np.nanmean(rear["slip"] - driven.slip) == pytest.approx(0.0, abs=0.01)
    forward, height, down = bag.optical
    camera = recording.vehicle.camera
    assert (camera.forward_m, camera.height_m, camera.pitch_rad) == pytest.approx((forward, height, down))
    assert camera.matrix[0] == (420.0, 0.0, 319.5)


def test_the_inertial_sensor_is_heard_with_the_wheels_current_and_speed(driven, vehicle, tmp_path):
    bag = RobotBag(driven, effort=False, gps=False)
    run = read_recording(bag.write(tmp_path / "bag"), vehicle=vehicle).vibration
    assert run.names == ("wx", "wy", "wz", "ax", "ay", "az")
    assert run.wheel_names == tuple(f"{what}_{name}" for what in ("current", "speed") for name in sorted(NAMES))
    assert run.sample_rate_Hz == 100.0  # recorded at 25 Hz
    assert run.time_s[-1] - run.time_s[0] == pytest.approx(driven.time_s[-1], abs=0.05)
    speed = run.wheel[:, run.wheel_names.index("speed_rear_left")] * RADIUS_M
    np.testing.assert_allclose(speed, np.interp(run.time_s, driven.time_s, driven.rim_m_s), atol=0.01)
    (tmp_path / "t.toml").write_text('ignore = ["/imu/data"]\n')
    assert read_recording(tmp_path / "bag", vehicle=vehicle, topics=tmp_path / "t.toml").vibration is None


@pytest.mark.parametrize(
    ("robots", "said", "ignore"),
    [(("/r1", "/r2"), "topics of 2 robots, /r1, /r2: those of /r1 are read; for /r2 state", '"/r1/*"'),
     (("/fleet/r1", "/fleet/r2"), "topics of 2 robots, /fleet/r1, /fleet/r2", '"/fleet/r1/*"'),
     (("", "/r2"), "topics of 2 robots, /, /r2", '"/joint_states", "/odom", "/imu/data"')],
)  # fmt: skip
def test_of_several_robots_one_is_read_and_the_map_chooses(robots, said, ignore, driven, vehicle, tmp_path):
    one = read_recording(RobotBag(driven).write(tmp_path / "one"), vehicle=vehicle)
    path = RobotBag(driven, robots=robots).write(tmp_path / "two")
    found = read_recording(path, vehicle=vehicle)
    assert len(found.wheel) == len(one.wheel)
    assert found.pose is not None
    note = next(note for note in found.notes if said in note)
    assert note.endswith(" in a topic map")
    topics = tmp_path / "topics.toml"
    topics.write_text(f"ignore = [{ignore}]\n")
    other = read_recording(path, vehicle=vehicle, topics=topics)
    assert len(other.wheel) == len(one.wheel)
    assert not any("robots" in note for note in other.notes)
    written = inspect_recording(path, vehicle=vehicle).contents.files["topics.toml"]
    topics.write_text(written)
    again = read_recording(path, vehicle=vehicle, topics=topics)
    np.testing.assert_array_equal(again.wheel["torque_Nm"], found.wheel["torque_Nm"])
    topics.write_text('ignore = ["/r3/*"]\n')
    with pytest.raises(InputError, match=r"no topic /r3/\*"):
        read_recording(path, vehicle=vehicle, topics=topics)


def test_a_robot_without_joints_is_another_one(driven, vehicle, tmp_path):
    """A drone above the rover has an inertial sensor and an odometry, too."""
    bag = RobotBag(driven, robots=("/rover", "/drone"))
    messages = [each for each in bag.messages() if each[1] != "nav_msgs/msg/Odometry"]
    of_rover = [each for each in messages if each[1] == "sensor_msgs/msg/JointState"]
    of_drone = [each for each in bag.messages() if each[1] in ("sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry")]
    path = bag.write(tmp_path / "bag", {"/rover": of_rover, "/drone": of_drone})
    found = read_recording(path, vehicle=vehicle)
    assert found.pose is None
    assert "pitch_rad" not in found.wheel
    assert "travel_speed_m_s" not in found.wheel
    assert any("topics of /drone may be of another robot than that of /rover" in text for text in found.problems)


def test_joints_of_unknown_names_are_listed_with_what_to_write(driven, vehicle, tmp_path):
    joints = ("motor_a", "motor_b", "motor_c", "motor_d")
    path = RobotBag(driven, joints=joints).write(tmp_path / "bag")
    recording = read_recording(path, vehicle=vehicle)
    said = next(problem for problem in recording.problems if "motor_c" in problem)
    assert 'wheel = "front_left"' in said
    assert 'wheel_speed_rad_s = "velocity[motor_a]"' in said
    topics = tmp_path / "topics.toml"
    topics.write_text(
        "".join(
            f'[[wheel]]\ntopic = "/joint_states"\nwheel = "{name}"\n'
            f'fields = {{ wheel_speed_rad_s = "velocity[{joint}]", torque_Nm = "effort[{joint}]" }}\n'
            for name, joint in zip(NAMES, joints, strict=True)
        )
    )
    mapped = read_recording(path, vehicle=vehicle, topics=topics)
    # What the map does not mention is recognised: speed, places and attitude.
    assert {"slip", "torque_Nm", "pitch_rad"} <= set(mapped.wheel.columns)
    assert mapped.pose is not None


def test_wheels_of_mirrored_joints_are_turned_said_and_written_down(driven, vehicle, tmp_path):
    mirrored = RobotBag(driven, gps=False, mirrored=(1.0, -1.0, 1.0, -1.0)).write(tmp_path / "mirrored")
    recording = read_recording(mirrored, vehicle=vehicle)
    plain = read_recording(RobotBag(driven, gps=False).write(tmp_path / "plain"), vehicle=vehicle)
    for name in ("wheel_speed_rad_s", "wheel_angle_rad", "torque_Nm", "slip"):
        np.testing.assert_array_equal(recording.wheel[name], plain.wheel[name])
    assert recording.problems == ()
    assert any(
        each.startswith("wheels front_right, rear_right turn backwards while the vehicle drives forwards")
        for each in recording.notes
    )
    inspect_recording(mirrored, vehicle=vehicle).write(tmp_path)
    text = (tmp_path / "topics.toml").read_text(encoding="utf-8")
    assert text.count('{ field = "effort[front_right_wheel_joint]", scale = -1.0') == 1
    assert 'torque_Nm = "effort[front_left_wheel_joint]"' in text
    mapped = read_recording(mirrored, vehicle=vehicle, topics=tmp_path / "topics.toml")
    np.testing.assert_array_equal(mapped.wheel["torque_Nm"], plain.wheel["torque_Nm"])
    assert mapped.problems == ()


def test_wheels_that_all_turn_against_the_travel_are_left_and_said(driven, vehicle, tmp_path):
    path = RobotBag(driven, gps=False, mirrored=(-1.0, -1.0, -1.0, -1.0)).write(tmp_path / "bag")
    recording = read_recording(path, vehicle=vehicle)
    assert np.nanmedian(recording.wheel["wheel_speed_rad_s"]) < 0.0
    assert any("every wheel turns against the vehicle's travel" in text and "scale = -1.0" in text
               for text in recording.problems)  # fmt: skip


def test_a_speed_made_from_the_wheels_gives_no_slip(driven, vehicle, tmp_path):
    path = RobotBag(driven, odometry="wheels").write(tmp_path / "bag")
    recording = read_recording(path, vehicle=vehicle)
    assert "slip" not in recording.wheel
    assert any("/odom: not used as travel speed" in problem for problem in recording.problems)
    assert recording.pose is not None


def test_a_camera_alone_needs_no_vehicle(driven, tmp_path, rng):
    recording = read_recording(RobotBag(driven, images=[png(rng)], wheels=False).write(tmp_path / "bag"))
    assert recording.vehicle.wheels == ()
    assert recording.vehicle.camera.pitch_rad == pytest.approx(math.radians(25.0))
    with pytest.raises(InputError, match="no wheels"):
        recording.vehicle.wheel()


def test_the_frame_of_foxglove_images_is_their_own(driven):
    bag, frames = RobotBag(driven), Frames()
    frames.add(bag.transforms())
    topics = {"/camera/camera_info": Topic("/camera/camera_info", "sensor_msgs/msg/CameraInfo", "cdr", "")}
    samples = {"/camera/camera_info": bag.camera_info(0.0), "/camera/video": {"frame_id": "camera_optical"}}
    vehicle, _ = with_camera(None, "/camera/video", topics, samples, frames)
    assert vehicle.camera.pitch_rad == pytest.approx(bag.optical[2])


def test_an_intrinsic_matrix_that_nobody_filled_in_is_not_used(driven):
    bag, frames = RobotBag(driven), Frames()
    frames.add(bag.transforms())
    info = "/camera/image_rect/camera_info"
    topics = {info: Topic(info, "sensor_msgs/msg/CameraInfo", "cdr", "")}
    samples = {info: bag.camera_info(0.0), "/camera/image_rect": {"frame_id": "camera_optical"}}
    vehicle, (said,) = with_camera(None, "/camera/image_rect", topics, samples, frames)  # its P is the unit matrix
    assert vehicle is None
    assert "a focal length of 1 px for 640 px" in said


def test_fixes_are_places_where_nothing_else_is(driven, tmp_path):
    topics = tmp_path / "topics.toml"
    topics.write_text('[pose]\ntopic = "/fix"\norigin = [47.0707, 15.4395]\n')
    recording = read_recording(RobotBag(driven).write(tmp_path / "bag"), topics=topics)
    way = np.interp(recording.pose.time_s, driven.time_s, driven.way_m)
    np.testing.assert_allclose(recording.pose.x_m, way, atol=0.1)
    np.testing.assert_allclose(recording.pose.y_m, 0.0, atol=0.01)
    assert recording.origin == Origin(47.0707, 15.4395)


def test_metres_east_and_north_are_those_of_a_map_projection():
    """Against PROJ's transverse Mercator (+proj=tmerc +lat_0=60 +lon_0=10 +k=1) 2 to 4 km from the origin."""
    latitude, longitude = np.array([60.02, 59.98]), np.array([10.05, 9.95])
    pyproj = pytest.importorskip("pyproj")
    origin = Origin(60.0, 10.0)
    expected = pyproj.Transformer.from_crs(4326, origin.crs, always_xy=True).transform(longitude, latitude)
    np.testing.assert_allclose(origin.east_north(latitude, longitude), expected, atol=0.02)


@pytest.mark.parametrize(
    ("name", "wheel"),
    [
        ("front_left_wheel_joint", "front_left"), ("fl", "front_left"), ("wheel_rr", "rear_right"),
        ("rightRearWheel", "rear_right"), ("robot_back_left_wheel", "rear_left"), ("lf_motor", "front_left"),
        ("front_left_steer_joint", None), ("left_wheel", None), ("arm_front_left", None), ("motor_a", None),
    ],
)  # fmt: skip
@pytest.mark.parametrize("named", [True, False])
def test_joints_are_matched_by_name_or_by_the_place_of_the_wheel(name, wheel, named, vehicle):
    wheels = load_vehicle(vehicle).wheels
    called = dict(zip(NAMES, NAMES if named else "wxyz", strict=True))
    wheels = [each.model_copy(update={"name": called[each.name]}) for each in wheels]
    assert wheel_called(name, wheels) == (called[wheel] if wheel else None)


def test_a_speed_that_a_filter_makes_of_the_wheels_own_is_found_out(rng):
    time = np.arange(0.0, 60.0, 0.05)
    turned = 1.8 + 0.4 * np.sin(time / 3.0) + 0.02 * rng.standard_normal(len(time))
    smooth = lfilter([0.2], [1.0, -0.8], turned, zi=[0.8 * turned[0]])[0]

    def followed(speed):
        columns = {"time_s": time, "wheel_speed_rad_s": turned, "travel_speed_m_s": speed}
        return follows_the_wheels(WheelTable(columns, None, None, Path("drive")), None)

    assert followed(0.15 * smooth)
    assert followed(0.15 * np.concatenate([turned[:2], turned[:-2]]))
    slip = 0.15 + 0.1 * np.sin(time / 7.0)
    assert not followed(0.15 * turned * (1.0 - slip))
    assert not followed(0.13 * turned + 0.002 * rng.standard_normal(len(time)))
