"""Topics recognised or mapped, and merged onto one clock; sound with gaps."""

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.readers import read_recording
from rosbags.rosbag2 import Writer as Writer2
from small_bags import empty_header, raw_image, small_bag, typestore


def test_missing_sound_messages_leave_a_gap_that_is_reported(tmp_path, rng):
    types = typestore()
    kind = "std_msgs/msg/Float32MultiArray"
    layout = types.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    sound = rng.uniform(-0.5, 0.5, 4 * 1000).astype(np.float32)
    messages = [
        (10**9 + i * 10**8 + int(rng.integers(0, 5 * 10**6)), types.types[kind](layout, sound[i * 100 : (i + 1) * 100]))
        for i in range(40) if not 10 <= i < 20
    ]  # fmt: skip
    path = small_bag(tmp_path / "b", "/mic", kind, messages)
    recording = read_recording(
        path.parent / "b", topics=write(tmp_path, '[sound]\ntopic = "/mic"\nsample_rate_Hz = 1000')
    )
    blocks = list(recording.sound.blocks(0.5, 0.5))
    silent = [block.samples is None for block in blocks]  # the fifth may begin within the gap, by the arrival's jitter
    assert silent[:4] + silent[5:] == [False, False, True, True, False, False, False]
    np.testing.assert_array_equal(blocks[1].samples, sound[500:1000])
    assert any("missing" in problem for problem in recording.problems)
    without = read_recording(path)
    assert without.sound is None
    assert any("sample rate" in problem for problem in without.problems)


def test_channels_of_a_topic_are_kept_with_their_mix(tmp_path, rng):
    types = typestore()
    kind = "std_msgs/msg/Float32MultiArray"
    layout = types.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    left = rng.uniform(-0.5, 0.5, 2000).astype(np.float32)
    both = np.stack([left, -left], axis=1)
    messages = [
        (10**9 + i * 10**8, types.types[kind](layout, both[i * 100 : (i + 1) * 100].ravel())) for i in range(20)
    ]
    path = small_bag(tmp_path / "b", "/mic", kind, messages)
    topics = write(tmp_path, '[sound]\ntopic = "/mic"\nsample_rate_Hz = 1000\nchannels = 2')
    blocks = list(read_recording(path.parent / "b", topics=topics).sound.blocks(0.5, 0.5))
    np.testing.assert_array_equal(blocks[1].channels, both[500:1000])
    np.testing.assert_array_equal(blocks[1].samples, left[500:1000])


def write(folder, text):
    path = folder / "map.toml"
    path.write_text(text)
    return path


def test_a_wheel_that_is_not_recognised_names_the_topics_there_are(tmp_path):
    types = typestore()
    kind = "std_msgs/msg/String"
    path = small_bag(tmp_path / "b", "/chat", kind, [(1, types.types[kind]("hello"))])
    with pytest.raises(InputError, match=r"/chat \(std_msgs/msg/String\).*topic map"):
        read_recording(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[wheel]\ntopic = "/nowhere"', "no topic /nowhere"),
        ('[wheel]\ntopic = "/wheel/load_N"\nfields = { load_kN = "data" }', "load_kN"),
        ('[wheel]\ntopic = "/wheel/load_N"\nfields = { load_N = "value" }', "no field 'value' in data"),
        ('[wheel]\ntopic = "/wheel/load_N"', "fields"),
        ('[pose]\ntopic = "/wheel/load_N"', "yaw_rad"),
        ('[wheels]\ntopic = "/wheel/load_N"', "wheels"),
        ('[sound]\ntopic = "/wheel/load_N"', "sample rate"),
    ],
)
def test_a_map_that_does_not_fit_is_named(text, says, tmp_path):
    types = typestore()
    kind = "std_msgs/msg/Float64"
    path = small_bag(tmp_path / "b", "/wheel/load_N", kind, [(i * 10**7, types.types[kind](5.0)) for i in range(9)])
    with pytest.raises(InputError, match=says):
        read_recording(path, topics=write(tmp_path, text))


def test_several_wheels_at_different_rates_and_a_gap(tmp_path):
    types = typestore()
    kind = "std_msgs/msg/Float64"
    number = types.types[kind]
    path = tmp_path / "b"
    with Writer2(path, version=9) as writer:
        for name, step in (("left/load_N", 10), ("left/torque_Nm", 100), ("right/load_N", 20)):
            connection = writer.add_connection(f"/wheels/{name}", kind, typestore=types)
            for i in range(0, 3000, step):
                if name == "left/torque_Nm" and 1000 <= i < 2000:
                    continue
                writer.write(connection, 10**9 + i * 10**6, types.serialize_cdr(number(float(i)), kind))
    recording = read_recording(path)
    left = recording.wheel.select(recording.wheel.wheel == "left")
    right = recording.wheel.select(recording.wheel.wheel == "right")
    assert (len(left), len(right)) == (300, 150)
    assert np.isnan(right["torque_Nm"]).all()
    gone = np.isnan(left["torque_Nm"])
    time = left["time_s"]
    assert gone[(time > 0.95) & (time < 1.95)].all()
    assert not gone[time < 0.895].any()
    np.testing.assert_allclose(left["torque_Nm"][time < 0.895], 1000 * time[time < 0.895])
    assert any("torque_Nm of wheel left" in problem for problem in recording.problems)


def test_a_force_sensor_whose_axis_points_up_has_its_load_turned(tmp_path):
    types = typestore()
    vector, wrench = types.types["geometry_msgs/msg/Vector3"], types.types["geometry_msgs/msg/Wrench"]
    kind = "geometry_msgs/msg/WrenchStamped"
    content = wrench(vector(x=4.0, y=0.0, z=-80.0), vector(x=0.0, y=7.0, z=0.0))
    message = types.types[kind](empty_header(types), content)
    path = small_bag(tmp_path / "b", "/wheel/ft", kind, [(i * 10**7, message) for i in range(5)])
    recording = read_recording(path)
    assert recording.wheel["load_N"].tolist() == [80.0] * 5
    assert recording.wheel["drawbar_pull_N"].tolist() == [4.0] * 5
    assert any("taken as drawbar pull" in problem for problem in recording.problems)
    assert any("sign turned" in problem for problem in recording.problems)
    said = '[wheel]\ntopic = "/wheel/ft"\nfields = { load_N = "wrench.force.z" }'
    assert read_recording(path, topics=write(tmp_path, said)).wheel["load_N"].tolist() == [-80.0] * 5


def test_several_cameras_need_a_map(tmp_path, rng):
    types = typestore()
    kind = "sensor_msgs/msg/Image"
    message = raw_image(types, "bgr8", rng.integers(0, 255, (4, 4, 3)).astype(np.uint8))
    number = "std_msgs/msg/Float64"
    with Writer2(tmp_path / "b", version=9) as writer:
        for topic in ("/left/image", "/right/image"):
            writer.write(writer.add_connection(topic, kind, typestore=types), 1, types.serialize_cdr(message, kind))
        load = writer.add_connection("/wheel/load_N", number, typestore=types)
        writer.write(load, 1, types.serialize_cdr(types.types[number](5.0), number))
    recording = read_recording(tmp_path / "b")
    assert recording.camera is None
    assert any("/left/image, /right/image" in problem for problem in recording.problems)
    with_map = read_recording(tmp_path / "b", topics=write(tmp_path, '[camera]\ntopic = "/left/image"'))
    assert len(with_map.camera) == 1
    assert with_map.wheel["load_N"].tolist() == [5.0]  # what the map does not mention is recognised
    ignored = read_recording(
        tmp_path / "b", topics=write(tmp_path, 'ignore = ["/wheel/load_N"]\n[camera]\ntopic = "/left/image"')
    )
    assert ignored.wheel is None
