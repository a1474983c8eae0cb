import shutil
from datetime import UTC, datetime

import cv2
import numpy as np
import pytest
import soundfile as sf
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.readers import read_recording

VEHICLE = "[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n"
WHEEL = "time_s,load_N,wheel_speed_rad_s,travel_speed_m_s,x_m,y_m\n" + "".join(
    f"{0.1 * i:.1f},100,1.0,0.15,{0.015 * i:.3f},{0.02 * i:.3f}\n" for i in range(100)
)
RATE = 4000


@pytest.fixture
def drive(tmp_path, rng):
    """A whole recording: four images, two seconds of sound, wheel, pose and labels."""
    folder = tmp_path / "drive"
    (folder / "camera").mkdir(parents=True)
    (folder / "recording.toml").write_text(
        'name = "sand"\nstart_time = 2024-05-01T10:00:00Z\nsite = "pit"\nnotes = "windy"\n'
        'streams = ["wheel", "camera", "sound", "pose", "labels"]\n[sound]\nstart_s = 1.5\n'
    )
    (folder / "vehicle.toml").write_text(VEHICLE)
    (folder / "wheel.csv").write_text(WHEEL)
    (folder / "pose.csv").write_text("time_s,x_m,y_m,yaw_rad\n0,0,0,0.1\n1,1,0,\n2,2,0,0.3\n")
    (folder / "labels.csv").write_text("start_s,end_s,class\n4,6,loam\n0,4,sand\n")
    rows = []
    for i in range(4):
        cv2.imwrite(str(folder / "camera" / f"{i}.png"), rng.integers(0, 255, (6, 8, 3)).astype(np.uint8))
        rows.append(f"{0.5 * i},{i}.png\n")
    (folder / "camera" / "camera.csv").write_text("time_s,file\n" + "".join(rows))
    sf.write(folder / "sound.wav", rng.uniform(-0.5, 0.5, 2 * RATE), RATE)
    return folder


def test_a_whole_folder(drive):
    recording = read_recording(drive)
    assert (recording.name, recording.site, recording.problems[1:]) == ("sand", "pit", ())
    assert recording.problems == ("pose.csv: 1 of 3 rows without a whole pose",)
    assert recording.start_time == datetime(2024, 5, 1, 10, tzinfo=UTC)
    assert recording.vehicle.wheel().radius_m == 0.2
    np.testing.assert_allclose(recording.wheel["slip"], 0.25)  # derived
    np.testing.assert_array_equal(recording.pose.time_s, [0.0, 2.0])
    assert recording.labels.at(np.array([-1.0, 0.0, 4.0, 5.9, 6.0])).tolist() == ["", "sand", "loam", "loam", ""]
    assert [frame.time_s for frame in recording.camera.frames()] == [0.0, 0.5, 1.0, 1.5]
    assert (recording.sound.start_s, recording.sound.duration_s) == (1.5, 2.0)
    assert [block.start_s for block in recording.sound.blocks(1.0, 0.5)] == [1.5, 2.0, 2.5]


def test_keys_of_others_in_recording_toml_are_left_out_and_named(drive):
    about = drive / "recording.toml"
    text = about.read_text().replace("start_time", "start")
    about.write_text('operator = "A. N. Other"\nweather = {wind = 3}\nground = "sand"\n' + text)
    recording = read_recording(drive)
    assert recording.start_time == datetime(2024, 5, 1, 10, tzinfo=UTC)
    assert recording.problems[0] == "recording.toml: operator, weather, ground left out, nothing here reads that"


def test_the_digest_is_that_of_the_content(drive, tmp_path):
    first = read_recording(drive).digest
    moved = tmp_path / "elsewhere" / "other name"
    shutil.copytree(drive, moved)
    (moved / "recording.toml").write_text('site = "renamed"\n[sound]\nstart_s = 1.5\n')
    assert read_recording(moved).digest == first
    data = (moved / "camera" / "3.png").read_bytes()
    (moved / "camera" / "3.png").write_bytes((moved / "camera" / "2.png").read_bytes())
    assert read_recording(moved).digest != first
    (moved / "camera" / "3.png").write_bytes(data)
    (moved / "wheel.csv").write_text(WHEEL.replace("100,1.0", "101,1.0", 1))
    assert read_recording(moved).digest != first


def test_places_in_wheel_rows_make_poses(drive):
    (drive / "pose.csv").unlink()
    (drive / "recording.toml").unlink()
    recording = read_recording(drive)
    assert recording.name == "drive"
    np.testing.assert_allclose(recording.pose.x_m[-1], 0.015 * 99, atol=1e-9)
    np.testing.assert_allclose(recording.pose.yaw_rad, np.arctan2(0.02, 0.015), atol=0.02)


def test_a_vehicle_may_be_given_instead(drive, tmp_path):
    other = tmp_path / "other.toml"
    other.write_text(VEHICLE.replace("0.2", "0.3"))
    np.testing.assert_allclose(read_recording(drive, vehicle=other).wheel["slip"], 0.5)
    wheel_alone = read_recording(drive / "wheel.csv")
    np.testing.assert_allclose(wheel_alone.wheel["slip"], 0.25)  # vehicle.toml of the same folder
    assert wheel_alone.camera is None


def test_an_image_that_cannot_be_read_is_a_frame_with_its_problem(drive):
    half = drive / "camera" / "1.png"
    half.write_bytes(half.read_bytes()[:60])
    (drive / "camera" / "2.png").unlink()
    recording = read_recording(drive)
    assert any("1 of 4 images are missing, first 2.png" in problem for problem in recording.problems)
    frames = list(recording.camera.frames())
    assert [frame.image is None for frame in frames] == [False, True, True, False]
    assert "1.png: a PNG cut off" in frames[1].problem
    assert "2.png: no such file" in frames[2].problem


def test_truncated_sound_is_reported(drive):
    sound = drive / "sound.wav"
    sound.write_bytes(sound.read_bytes()[: 44 + RATE * 2])
    recording = read_recording(drive)
    assert recording.sound.duration_s == 1.0
    assert any("sound.wav: cut off, ends after 1.000 s of 2.000 s" in problem for problem in recording.problems)


def test_sound_that_cannot_be_read_is_left_out_alone(drive):
    (drive / "sound.wav").write_text("this is no sound")
    recording = read_recording(drive)
    assert recording.sound is None
    assert len(recording.wheel) == 100
    assert any("sound is left out" in problem and "sound.wav: no sound" in problem for problem in recording.problems)
    for other in ("wheel.csv", "pose.csv", "labels.csv", "recording.toml"):
        (drive / other).unlink()
    shutil.rmtree(drive / "camera")
    with pytest.raises(InputError, match=r"sound\.wav: no sound"):
        read_recording(drive)


def replace(file, old, new):
    def change(drive):
        path = drive / file
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))

    return change


def remove(name):
    def change(drive):
        path = drive / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()

    return change


def copy(old, new):
    return lambda drive: shutil.copy(drive / old, drive / new)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (remove("wheel.csv"), "wheel.csv: no such file .expected the wheel that recording.toml lists"),
        (remove("camera"), "camera: no such file"),
        (remove("camera/camera.csv"), "camera.csv: no such file"),
        (remove("sound.wav"), "sound.wav: no such file"),
        (copy("sound.wav", "sound.flac"), "both sound.wav and sound.flac"),
        (replace("recording.toml", 'site = "pit"', 'Site = "pit"'), "key Site: no such key .expected site"),
        (replace("recording.toml", "start_time", "start_tiem"), "key start_tiem: no such key .expected start_time"),
        (
            replace("recording.toml", 'notes = "windy"', "start = 2024-05-01T10:00:00Z"),
            "key start: start_time is given",
        ),
        (
            replace("recording.toml", "start_time = 2024-05-01T10:00:00Z", "start = 12.5"),
            "key start: a number, expected",
        ),
        (
            replace("recording.toml", "2024-05-01T10:00:00Z", "0001-01-01T00:00:00+14:00"),
            "recording.toml, key start_time: 0001-01-01 .*within the years 1 to 9999 of UTC",
        ),
        (
            replace("recording.toml", "2024-05-01T10:00:00Z", "9999-12-31T23:59:59-14:00"),
            "recording.toml, key start_time: 9999-12-31 .*within the years 1 to 9999 of UTC",
        ),
        (replace("recording.toml", '"labels"', '"smell"'), "key streams.4: 'smell'"),
        (replace("recording.toml", "2024-05-01T10:00:00Z", '"noon"'), "key start_time: 'noon'"),
        (replace("recording.toml", "start_s = 1.5", "start_s = inf"), "key sound.start_s"),
        (replace("recording.toml", "[sound]", '[sound]\nfile = "../sound.wav"'), "leads out of the folder"),
        (replace("recording.toml", "[sound]", '[sound]\nfile = "noise.wav"'), "noise.wav: no such file"),
        (replace("recording.toml", 'name = "sand"', "name = "), "expected valid TOML"),
        (replace("vehicle.toml", "[wheel]", "[wheel_]"), "no wheel geometry"),
        (replace("wheel.csv", "load_N", "load_rpm"), "column load_rpm.*load_N"),
        (replace("pose.csv", "yaw_rad", "yaw"), "no column yaw_rad"),
        (replace("pose.csv", "2,2,0,0.3", "0.5,2,0,0.3"), "row 4, column time_s: time runs backwards, 1 s and then"),
        (replace("pose.csv", "1,1,0,", "1,inf,0,"), "row 3, column x_m: inf"),
        (replace("labels.csv", "4,6,loam", "4,6,"), "row 2, column class: a blank class"),
        (replace("labels.csv", "4,6,loam", "6,4,loam"), "row 2, column end_s: 6 s to 4 s"),
        (replace("labels.csv", "0,4,sand", "0,5,sand"), "overlaps another stretch"),
        (replace("camera/camera.csv", "1.png", "../../secret.png"), "row 3, column file: '../../secret.png' leads out"),
        (replace("camera/camera.csv", "1.png", "/etc/passwd"), "leads out of the folder"),
        (replace("camera/camera.csv", "1.png", "C:\\\\secret.png"), "leads out of the folder"),
        (replace("camera/camera.csv", "1.png", ""), "row 3, column file: ''"),
        (replace("camera/camera.csv", "1.5,", "0.2,"), "row 5, column time_s: time runs backwards"),
        (replace("camera/camera.csv", "file", "image"), "no column file"),
    ],
)
def test_what_is_wrong_is_named(change, says, drive):
    change(drive)
    with pytest.raises(InputError, match=says):
        read_recording(drive)


def test_images_that_are_all_missing_are_an_error(drive):
    for file in (drive / "camera").glob("*.png"):
        file.unlink()
    with pytest.raises(InputError, match=r"0\.png: no such file, nor any other"):
        read_recording(drive)


def test_a_link_out_of_the_folder_is_refused(drive, tmp_path):
    (tmp_path / "secret.png").write_bytes(b"x")
    (drive / "camera" / "1.png").unlink()
    try:
        (drive / "camera" / "1.png").symlink_to(tmp_path / "secret.png")
    except OSError:
        pytest.skip("this system makes no symbolic links")
    with pytest.raises(InputError, match="leads out of the folder"):
        read_recording(drive)


def test_an_image_that_is_a_link_to_itself_is_a_frame_without_one(drive):
    (drive / "camera" / "1.png").unlink()
    try:
        (drive / "camera" / "1.png").symlink_to("1.png")
    except OSError:
        pytest.skip("this system makes no symbolic links")
    recording = read_recording(drive)
    assert "camera: 1 of 4 images are missing, first 1.png" in recording.problems
    frames = list(recording.camera.frames())
    assert [frame.image is None for frame in frames] == [False, True, False, False]
    assert "a link that leads to itself" in frames[1].problem


def test_paths_that_are_no_recording(tmp_path):
    with pytest.raises(InputError, match="no such file or folder"):
        read_recording(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no stream of a recording in it"):
        read_recording(tmp_path)
    (tmp_path / "x.log").write_text("x")
    with pytest.raises(InputError, match=r"'\.log'"):
        read_recording(tmp_path / "x.log")
    (tmp_path / "t.toml").write_text("")
    (tmp_path / "labels.csv").write_text("start_s,end_s,class\n0,1,sand\n")
    with pytest.raises(InputError, match="no wheel table"):
        read_recording(tmp_path, topics=tmp_path / "t.toml")
    with pytest.raises(InputError, match=r"missing\.toml: no such file"):
        read_recording(tmp_path, vehicle=tmp_path / "missing.toml")


def test_a_real_folder(shared_data):
    recording = read_recording(shared_data / "granular-wheel")
    assert len(recording.wheel) == 28
    assert recording.vehicle.wheel().width_m == 1.0
    assert recording.digest == read_recording(shared_data / "granular-wheel" / "wheel.csv").digest
