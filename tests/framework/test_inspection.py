"""`inspect_recording`: what is there, what lacks, and files that read as the recording does without them."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest
from bevameter import identify, inspect_recording
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording import bag_index
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.vehicle import load_vehicle
from robot_bag import NAMES, PLACES, RADIUS_M, VEHICLE_TOML, RobotBag, drive


@pytest.fixture(scope="module")
def driven():
    return drive(12.0)


@pytest.fixture(scope="module")
def image():
    noise = np.random.default_rng(0).integers(0, 255, (48, 64, 3)).astype(np.uint8)
    return cv2.imencode(".jpg", noise)[1].tobytes()


@pytest.fixture
def vehicle(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text(VEHICLE_TOML, encoding="utf-8")
    return path


def lacking(answer):
    return [each.what for each in answer.missing]


def uses(found):
    return {each.name: each.feeds for each in found.contents.sources}


def test_a_robots_bag_lacks_its_vehicle_and_nothing_else(driven, image, vehicle, tmp_path):
    path = RobotBag(driven, images=[image]).write(tmp_path / "bag")
    found = inspect_recording(path)
    assert found.class_map.possible
    assert not found.soil.possible
    assert lacking(found.soil) == lacking(found.explain) == ["the wheel's geometry", "load"]
    assert f"`bevameter inspect {path} --write`" in found.soil.missing[0].mend
    assert uses(found) == {
        "/camera/camera_info": "camera's intrinsics",
        "/camera/image/compressed": "camera",
        "/fix": "origin on Earth",
        "/imu/data": "pitch_rad, roll_rad; vibration",
        "/joint_states": f"wheel_speed_rad_s, wheel_angle_rad, torque_Nm of {', '.join(NAMES)}",
        "/odom": "travel_speed_m_s; pose",
        "/tf_static": "mounting of sensors",
    }
    joints = next(each for each in found.contents.sources if each.name == "/joint_states")
    assert (joints.n, joints.rate_Hz) == (600, pytest.approx(50.0))
    assert "N m at the wheel's axle" in joints.remark
    described = inspect_recording(path, vehicle=vehicle)
    assert described.soil.possible
    assert described.explain.possible
    assert described.soil.missing == ()


def trials(folder, columns):
    """A slow drive on one soil, with some of its channels."""
    rng, n = np.random.default_rng(0), 80
    slip = np.linspace(0.1, 0.5, n)
    channels = {
        "time_s": 0.1 * np.arange(n),
        "load_N": 100.0 + rng.normal(0, 1, n),
        "slip": slip,
        "torque_Nm": 4.0 + 3.0 * slip + rng.normal(0, 0.1, n),
        "sinkage_m": 0.01 + 0.01 * slip + rng.normal(0, 2e-4, n),
    }
    lines = [",".join(columns)] + [",".join(f"{channels[name][i]:.6f}" for name in columns) for i in range(n)]
    path = folder / "drive.csv"
    path.write_text("\n".join(lines) + "\n")
    (folder / "vehicle.toml").write_text("[wheel]\nradius_m = 0.15\nwidth_m = 0.12\n")
    return path


@pytest.mark.parametrize("without", ["", "load_N", "slip"])
def test_identify_agrees_with_what_is_said(without, tmp_path):
    """It gives a soil where inspection says that it can, and refuses where something lacks."""
    every = ("time_s", "load_N", "slip", "torque_Nm", "sinkage_m")
    path = trials(tmp_path, [name for name in every if name != without])
    found = inspect_recording(path)
    if without:
        assert not found.soil.possible
        with pytest.raises(InputError, match=without):
            identify(path)
    else:
        assert found.soil.possible, found.soil
        assert identify(path, method="linear").overall is not None  # of the two methods the quick one


@pytest.mark.parametrize(
    ("bag", "ignored", "soil", "ground"),
    [
        ({"gps": False}, ["/odom"], ["a travel speed of its own, for slip"], ["places of the vehicle"]),
        ({"wheels": False}, [], ["wheel channels"], []),
        ({"effort": False}, [], ["torque, though the motors' current is there"], []),
    ],
)
def test_each_thing_that_lacks_is_named(bag, ignored, soil, ground, driven, vehicle, tmp_path):
    topics = tmp_path / "topics.toml"
    topics.write_text(f"ignore = {ignored}\n")
    path = RobotBag(driven, **bag).write(tmp_path / "bag")
    found = inspect_recording(path, vehicle=vehicle, topics=topics)
    assert lacking(found.soil) == soil
    without = ["images of the ground ahead", "a model of your own for the vibration sensor"]
    assert lacking(found.class_map) == [*without, *ground]
    assert all(each.mend for each in (*found.soil.missing, *found.class_map.missing))


@pytest.mark.parametrize("frames", [True, False])
def test_the_files_written_read_as_the_bag_does_without_them(frames, driven, image, vehicle, tmp_path):
    """As written the vehicle file names the number to be measured; with the numbers the recording is the same."""
    path = RobotBag(driven, images=[image], sinkage=True, wheel_frames=frames).write(tmp_path / "bag")
    (tmp_path / "files").mkdir()
    topics, written = inspect_recording(path).write(tmp_path / "files")
    assert (topics.name, written.name) == ("topics.toml", "vehicle.toml")
    first = "width_m" if frames else "radius_m"
    with pytest.raises(InputError, match=rf"vehicle\.toml, key wheels\.0\.{first}: Field required"):
        load_vehicle(written)
    text = written.read_text(encoding="utf-8")
    measured = {"mass_kg": "60.0", "centre_of_mass_m": "[0.03, 0.0, 0.3]", "radius_m": "0.15", "width_m": "0.12"}
    for name, value in measured.items():
        text = re.sub(rf"^# {name} = .*?(  #.*)$", rf"{name} = {value}\1", text, flags=re.MULTILINE)
    if frames:
        assert text.count(f"radius_m = {RADIUS_M}    # height of ") == 4
    else:
        places = iter(PLACES.tolist())
        text = re.sub(r"^# position_m = .*$", lambda _: f"position_m = {next(places)}", text, flags=re.MULTILINE)
    written.write_text(text, encoding="utf-8")
    stated = load_vehicle(written)
    np.testing.assert_allclose([wheel.position_m for wheel in stated.wheels], PLACES, atol=1e-6)
    expected, found = read_recording(path, vehicle=vehicle), read_recording(path, vehicle=written, topics=topics)
    assert found.problems == expected.problems == ()
    assert set(found.wheel.columns) == set(expected.wheel.columns)
    for name in expected.wheel.columns:
        np.testing.assert_allclose(found.wheel[name], expected.wheel[name], equal_nan=True)
    np.testing.assert_array_equal(found.pose.x_m, expected.pose.x_m)
    assert found.vehicle.camera.pitch_rad == pytest.approx(expected.vehicle.camera.pitch_rad, abs=1e-6)
    assert len(found.camera) == len(expected.camera)
    with pytest.raises(InputError, match=r"topics\.toml: is there already"):
        inspect_recording(path).write(tmp_path / "files")


def test_a_castor_among_the_frames_is_part_of_the_vehicle_file(driven, tmp_path):
    text = inspect_recording(RobotBag(driven, castor=True).write(tmp_path / "bag")).contents.files["vehicle.toml"]
    castor = text.partition('name = "rear_caster"')[2]
    assert castor.splitlines()[1:2] == ["driven = false"]
    assert 'radius_m = 0.05    # height of "rear_caster_wheel_link" over the ground' in castor
    assert "position_m = [-0.45, 0.0]" in castor
    assert text.count("driven = false") == 1


def test_joints_of_unknown_names_are_offered_and_named_wheels_get_a_vehicle(driven, tmp_path):
    path = RobotBag(driven, joints=("motor_a", "motor_b", "motor_c", "motor_d")).write(tmp_path / "bag")
    found = inspect_recording(path)
    assert lacking(found.soil) == ["wheel channels"]
    offered = found.contents.files["topics.toml"].split("\n\n")
    names = dict(zip(("motor_a", "motor_b", "motor_c", "motor_d"), NAMES, strict=True))
    for number, block in enumerate(offered):
        if (match := re.search(r'^# wheel = "(motor_.)"$', block, re.MULTILINE)) is not None:
            offered[number] = re.sub("^# ", "", block, flags=re.MULTILINE).replace(
                f'"{match[1]}"', f'"{names[match[1]]}"'
            )
    topics = tmp_path / "topics.toml"
    topics.write_text("\n\n".join(offered))
    named = inspect_recording(path, topics=topics)
    assert lacking(named.soil) == ["the wheel's geometry", "load"]
    assert list(named.contents.files) == ["vehicle.toml"]
    assert re.findall(r'^name = "(.*)"', named.contents.files["vehicle.toml"], re.MULTILINE) == list(NAMES)


def test_a_camera_alone_gets_a_vehicle_that_is_read_as_it_is(driven, image, tmp_path):
    path = RobotBag(driven, images=[image], wheels=False).write(tmp_path / "bag")
    inspect_recording(path).write()  # beside the bag
    vehicle = load_vehicle(tmp_path / "vehicle.toml")
    assert vehicle.wheels == ()
    assert vehicle.camera.height_m == pytest.approx(0.9)
    assert inspect_recording(path, topics=tmp_path / "topics.toml").class_map.possible


def test_of_a_large_bag_a_part_is_read_and_all_is_counted(driven, vehicle, tmp_path, monkeypatch):
    path = RobotBag(driven).write(tmp_path / "bag")
    monkeypatch.setattr(bag_index, "MOST_BYTES", 500_000)
    found = inspect_recording(path, vehicle=vehicle)
    assert found.soil.possible
    assert "a large bag" in found.notes[0]
    assert next(each.n for each in found.contents.sources if each.name == "/joint_states") == 600
    assert len(found.contents.recording.wheel) < 4 * 600


def test_what_a_topic_map_ignores_says_nothing_of_the_camera(driven, image, tmp_path):
    path = RobotBag(driven, images=[image]).write(tmp_path / "bag")
    topics = tmp_path / "topics.toml"
    topics.write_text('ignore = ["/camera/camera_info"]\n')
    assert read_recording(path, topics=topics).vehicle is None
    found = inspect_recording(path, topics=topics)
    assert (
        next(each.remark for each in found.contents.sources if each.name.endswith("info")) == "the topic map ignores it"
    )


LAB = """\
Test rig 3;;;;
Zeit [s];Radlast [kN];Zugkraft [N];Schlupf [%];Einsinkung [mm];Kraft "oben"
"""


def laboratory(tmp_path):
    rows = (f"{0.1 * i:.2f};{0.12 + 1e-4 * i};{12.0 + 0.1 * i};{10.0 + 0.2 * i};12.5;3" for i in range(60))
    path = tmp_path / "lab.csv"
    path.write_text(LAB + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_the_column_map_written_reads_as_the_table_does_without_it(tmp_path):
    path = laboratory(tmp_path)
    found = inspect_recording(path)
    assert uses(found)["Radlast [kN]"] == "load_N"
    assert uses(found)['Kraft "oben"'] == ""
    assert lacking(found.soil) == ["the wheel's geometry"]
    columns, vehicle = found.write()
    vehicle.write_text("[wheel]\nradius_m = 0.15\nwidth_m = 0.12\n")
    mapped, plain = (read_recording(path, topics=each).wheel for each in (columns, None))
    assert set(mapped.columns) == set(plain.columns)
    for name in plain.columns:
        np.testing.assert_array_equal(mapped[name], plain[name])
    assert inspect_recording(path, topics=columns).contents.files == {}


def wide_table(tmp_path):
    """Joints at 50 Hz and odometry at 25 Hz, as PlotJuggler writes them: each topic's rows empty for the other."""
    parts = [f"/joint_states/{name}_wheel_joint/{part}" for name in NAMES for part in ("velocity", "effort")]
    header = ["__time", *parts, "/odom/twist/twist/linear/x"]
    lines = [",".join(header)]
    for i in range(400):
        time_s = 1_700_000_000 + 0.02 * i
        lines.append(f"{time_s:.6f}," + ",".join(f"{1.0 + 0.1 * k},{2.0 + k + 1e-3 * i}" for k in range(4)) + ",")
        if i % 2 == 0:
            lines.append(f"{time_s + 0.004:.6f}" + 8 * "," + f",{0.13 + 1e-4 * i:.5f}")
    path = tmp_path / "wide.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_table_with_columns_for_each_wheel_is_read_by_the_map_that_is_written(tmp_path):
    path = wide_table(tmp_path)
    found = inspect_recording(path)
    assert not found.soil.possible
    assert "[wheels.NAME]" in found.soil.missing[0].mend
    (tmp_path / "files").mkdir()
    columns, vehicle = found.write(tmp_path / "files")
    text = re.sub(r"^# (radius_m|width_m|position_m|mass_kg)", r"\1", vehicle.read_text(), flags=re.MULTILINE)
    vehicle.write_text(text)
    table = read_recording(path, topics=columns, vehicle=vehicle).wheel
    assert len(table) == 4 * 400
    for k, name in enumerate(NAMES):
        own = table.select(table.wheel == name)
        np.testing.assert_allclose(own["wheel_speed_rad_s"], 1.0 + 0.1 * k)
        np.testing.assert_allclose(own["torque_Nm"], 2.0 + k + 1e-3 * np.arange(400))
        np.testing.assert_allclose(own["travel_speed_m_s"][1:-1], 0.13 + 1e-4 * np.arange(1, 399), atol=1e-4)
    assert np.isfinite(table["slip"]).mean() > 0.95
    assert lacking(inspect_recording(path, topics=columns, vehicle=vehicle).soil) == ["the slope"]
    with pytest.raises(InputError, match=r"inspect .*wide\.csv --write"):
        read_recording(path, vehicle=vehicle)


def test_a_table_that_cannot_be_read_is_described_with_its_faults(tmp_path):
    path = tmp_path / "odd.csv"
    path.write_text("Load [V],Slip [%],Sinkgae [mm]\n1,2,3\n2,3,4\n")
    found = inspect_recording(path)
    assert not any(each.possible for each in (found.class_map, found.soil, found.explain))
    assert "Sinkgae" in found.soil.missing[0].what
    remarks = {each.name: each.remark for each in found.contents.sources}
    assert "expected sinkage_m" in remarks["Sinkgae [mm]"]
    assert found.as_dict()["schema"] == 1
    assert "Sinkgae" in found.as_dict()["fault"]


def test_a_bag_without_a_known_topic_is_described(tmp_path):
    from small_bags import bag_of, typestore

    types = typestore()
    message = types.types["std_msgs/msg/String"](data="x")
    path = bag_of(tmp_path / "bag", [('/say "it"', "std_msgs/msg/String", 10**18, message)], types)
    found = inspect_recording(path)
    assert uses(found) == {'/say "it"': ""}
    assert "no topic that is known" in found.soil.missing[0].what


def test_a_folder_is_described_stream_by_stream(tmp_path):
    trials(tmp_path, ["time_s", "load_N", "slip", "torque_Nm"]).rename(tmp_path / "wheel.csv")
    (tmp_path / "vehicle.toml").unlink()
    (tmp_path / "pose.csv").write_text("time_s,x_m,y_m,yaw_rad\n0,0,0,0\n8,1,0,0\n")
    found = inspect_recording(tmp_path)
    assert uses(found)["wheel.csv: load_N"] == "load_N"
    assert uses(found)["pose.csv"] == "pose"
    assert list(found.contents.files) == ["vehicle.toml"]  # every column is one of the contract's
    found.write()
    with pytest.raises(InputError, match=r"vehicle\.toml, key wheel\.radius_m: Field required"):
        inspect_recording(tmp_path)
