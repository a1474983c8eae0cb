"""Sound of a bag's messages: samples of any format, MP3 and coded files, cut anywhere; clocks that drift."""

import io

import numpy as np
import pytest
import soundfile as sf
from bevameter.framework.core.recording import sound_messages
from bevameter.framework.core.recording.mp3 import Mp3Splitter, decode_frames, mp3_share
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.recording.sound_messages import numbers
from small_bags import bag_of, empty_header, small_bag, typestore

RATE = 16_000
DATA, INFO, STAMPED = (f"audio_common_msgs/msg/Audio{kind}" for kind in ("Data", "Info", "Stamped"))
TYPES = {
    "audio_common_msgs__msg__AudioData": "uint8[] data",
    "audio_common_msgs__msg__AudioInfo": "uint8 channels\nuint32 sample_rate\nstring sample_format\nuint32 bitrate\n"
    "string coding_format",
}
NUMBER = "std_msgs/msg/Float64"
ENCODED = {"U8": ("u1", 128, 127), "S8": ("i1", 0, 127), "S16LE": ("<i2", 0, 32767), "S16BE": (">i2", 0, 32767),
           "S32LE": ("<i4", 0, 2**31 - 1), "F32LE": ("<f4", 0, 1), "F64LE": ("<f8", 0, 1)}  # fmt: skip


@pytest.fixture
def tone(rng):
    """Six seconds of a rising tone in a little noise."""
    time = np.arange(6 * RATE) / RATE
    return (0.4 * np.sin(2 * np.pi * (200 + 80 * time) * time) + rng.normal(0, 0.01, len(time))).astype(np.float32)


def pcm_bytes(samples, form):
    if form in ("S24LE", "S24BE"):
        whole = np.round(samples * (2**23 - 1)).astype("<i4").view(np.uint8).reshape(-1, 4)[:, :3]
        return (whole if form == "S24LE" else whole[:, ::-1]).tobytes()
    kind, zero, one = ENCODED[form]
    values = samples.astype(float) * one + zero
    return (values if one == 1 else np.round(values)).astype(kind).tobytes()


def coded(samples, kind, rate=RATE, subtype=None):
    buffer = io.BytesIO()
    sf.write(buffer, samples, rate, format=kind, subtype=subtype)
    return buffer.getvalue()


def cut(data, sizes):
    """Cut data into pieces of these sizes, over and over, and give where each begins as a share of all."""
    pieces, place = [], 0
    while place < len(data):
        size = sizes[len(pieces) % len(sizes)]
        pieces.append((place / len(data), data[place : place + size]))
        place += size
    return pieces


def sound_bag(path, pieces, seconds, info=None, lost=(), jitter=lambda number: 0.0):
    """A bag with a load, and pieces of sound, each at the time at which its share of all the seconds begins."""
    types = typestore(**TYPES)
    number = types.types[NUMBER]
    messages = [("/wheel/load_N", NUMBER, 10**9 + i * 10**8, number(5.0)) for i in range(20)]
    if info is not None:
        channels, rate, sample_format, coding = info
        messages.append(("/audio_info", INFO, 10**9, types.types[INFO](channels, rate, sample_format, 0, coding)))
    for place, (share, piece) in enumerate(pieces):
        if place not in lost:
            time_ns = 10**9 + int((share * seconds + jitter(place)) * 1e9)
            messages.append(("/audio", DATA, time_ns, types.types[DATA](np.frombuffer(piece, np.uint8))))
    return bag_of(path, sorted(messages, key=lambda message: message[2]), types)


def heard(recording):
    """The sound as one array; what is missing is NaN."""
    stream = recording.sound
    blocks = list(stream.blocks(0.05, 0.05))
    size = round(0.05 * stream.sample_rate)
    return np.concatenate([np.full(size, np.nan) if b.samples is None else b.samples for b in blocks])


@pytest.mark.parametrize("form", [*ENCODED, "S24LE", "S24BE"])
@pytest.mark.parametrize("sizes", [(1600, 4800), (777, 1, 1501)])
def test_samples_of_each_format_cut_anywhere(form, sizes, tone, tmp_path):
    stereo = np.stack([tone, 0.5 * tone], axis=1)
    pieces = cut(pcm_bytes(stereo, form), sizes)
    recording = read_recording(sound_bag(tmp_path / "b", pieces, 6.0, (2, RATE, form, "wave")))
    assert [p for p in recording.problems if "audio" in p] == []
    sound = heard(recording)
    assert len(sound) >= len(tone) - RATE // 10
    np.testing.assert_allclose(sound, 0.75 * tone[: len(sound)], atol=0.01 if form[1:] == "8" else 1e-3)


def test_after_a_loss_the_beginning_of_a_sample_is_found_again(tone, tmp_path):
    pieces = cut(pcm_bytes(tone, "S16LE"), (801, 1200, 2003))
    recording = read_recording(
        sound_bag(tmp_path / "b", pieces, 6.0, (1, RATE, "S16LE", "wave"), lost=(*range(20, 29), 100))
    )
    assert any("of sound are missing" in problem for problem in recording.problems)
    sound = heard(recording)
    here = ~np.isnan(sound)
    assert 0.8 < here.mean() < 0.95
    quiet = np.abs(sound[here])
    assert quiet.max() < 0.5  # bytes in the wrong places are as loud as can be
    assert np.abs(sound[-8000:] - tone[len(sound) - 8000 : len(sound)]).max() < 0.9


@pytest.mark.parametrize(("kind", "channels"), [("MP3", 1), ("MP3", 2), ("FLAC", 2), ("OGG", 1), ("WAV", 1)])
@pytest.mark.parametrize("sizes", [(417, 418), (1, 2, 1001, 333)])
def test_coded_sound_cut_anywhere(kind, channels, sizes, tone, tmp_path):
    rate = 44_100
    time = np.arange(3 * rate) / rate
    mono = (0.4 * np.sin(2 * np.pi * (200 + 80 * time) * time)).astype(np.float32)
    data = coded(mono if channels == 1 else np.stack([mono, mono], axis=1), kind, rate)
    recording = read_recording(sound_bag(tmp_path / "b", cut(data, sizes), 3.0))
    assert [p for p in recording.problems if "audio" in p] == []
    assert recording.sound.sample_rate == rate
    sound = heard(recording)
    assert len(sound) > 2.7 * rate
    delay = 1105 if kind == "MP3" else 0  # of encoder and decoder
    np.testing.assert_allclose(sound[delay + 2000 : 2 * rate], mono[2000 : 2 * rate - delay], atol=0.05)


def test_mp3_decoded_in_stretches_is_the_same_as_decoded_in_one(rng):
    loud = np.repeat(rng.uniform(0, 1, 60), RATE // 10)
    frames = Mp3Splitter().feed(coded((rng.normal(0, 0.2, len(loud)) * loud).astype(np.float32), "MP3"))
    splitter = Mp3Splitter()
    assert [frame for frame in splitter.feed(b"\xff\xfb" * 50 + b"".join(frames))] == frames
    whole = decode_frames(frames, [], splitter.header)
    assert np.abs(whole).max() > 0.3
    for size in (1, 7, 50):
        parts = [decode_frames(frames[i : i + size], frames[:i], splitter.header) for i in range(0, len(frames), size)]
        np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-5)


def test_no_samples_are_taken_for_mp3(rng):
    for scale in (0, 2, 300, 20_000):
        assert mp3_share([rng.normal(0, scale, 50_000).astype("<i2").tobytes()]) < 0.02


def test_mp3_with_lost_messages_has_gaps_where_they_were(tmp_path):
    rate = 16_000
    time = np.arange(20 * rate) / rate
    mono = (0.3 * np.sin(2 * np.pi * 300 * time) * (1 + (time.astype(int) % 2))).astype(np.float32)
    data = coded(mono, "MP3", rate)
    frames = Mp3Splitter().feed(data)
    pieces = [(number / len(frames), frame) for number, frame in enumerate(frames)]
    recording = read_recording(sound_bag(tmp_path / "b", pieces, 20.0, lost=range(200, 250)))
    assert any("of sound are missing" in p and 1.7 < float(p.split()[1]) < 1.9 for p in recording.problems)
    sound = heard(recording)
    gone = np.isnan(sound)
    gap = 200 / len(frames) * 20
    assert gone[int((gap + 0.1) * rate) : int((gap + 1.7) * rate)].all()
    level = [np.sqrt(np.mean(sound[i * rate + 4000 : (i + 1) * rate - 2000] ** 2)) for i in range(19)]
    assert [round(v / 0.212) for v in level if np.isfinite(v)] == [
        1 + i % 2 for i, v in enumerate(level) if np.isfinite(v)
    ]


@pytest.mark.parametrize("share", [1.003, 0.997])
def test_times_are_the_recorders_where_the_microphones_clock_drifts(share, tmp_path, rng):
    clicks = np.zeros(100 * 1000, np.float32)
    clicks[::1000] = 0.9  # one a second of the microphone's clock
    pieces = cut(pcm_bytes(clicks, "S16LE"), (200,))
    delays = rng.uniform(0, 0.03, len(pieces))
    path = sound_bag(tmp_path / "b", pieces, 100 * share, (1, 1000, "S16LE", "wave"), jitter=delays.__getitem__)
    blocks = list(read_recording(path).sound.blocks(0.02, 0.02))
    times = np.array([b.start_s for b in blocks if b.samples is not None and b.samples.max() > 0.5])
    assert len(times) > 90
    off = times - np.round(times / share) * share
    assert np.abs(off).max() < 0.16  # 0.3 s if nothing were done


def test_messages_that_come_late_and_catch_up_leave_no_gap(tone, tmp_path):
    pieces = cut(pcm_bytes(tone, "S16LE"), (640,))

    def late(number):
        """Messages are held back at the beginning and later once more, and then come all at once."""
        due = number * 0.02
        return next(
            (end - due - 1e-3 + 1e-6 * number for begin, end in ((0, 0.3), (2.0, 2.4)) if begin <= due < end), 0.0
        )

    path = sound_bag(tmp_path / "b", pieces, 6.0, (1, RATE, "S16LE", "wave"), jitter=late)
    recording = read_recording(path)
    assert [p for p in recording.problems if "audio" in p] == []
    assert recording.sound.start_s == pytest.approx(0.0, abs=0.03)
    np.testing.assert_allclose(heard(recording), tone, atol=1e-4)


@pytest.mark.parametrize(
    ("info", "says"),
    [
        ((1, 8000, "S16LE", "wave"), "at 8000 Hz and 1 channels it lasts 6.0 s longer than its messages' times"),
        ((1, RATE, "S16LE", "opus"), "coded as 'opus'"),
        (None, "unknown sample rate"),
        ((1, 0, "S16LE", "wave"), "unknown sample rate"),
    ],
)
def test_sound_that_is_not_read_is_left_out_alone(info, says, tone, tmp_path):
    recording = read_recording(sound_bag(tmp_path / "b", cut(pcm_bytes(tone, "S16LE"), (801,)), 6.0, info))
    assert recording.sound is None
    assert len(recording.wheel) == 20
    (problem,) = (p for p in recording.problems if says in p)
    assert "/audio" in problem


def test_mp3_of_which_nothing_is_left_is_left_out_alone(tmp_path, rng):
    pieces = [(i / 50, rng.integers(0, 255, 417).astype(np.uint8).tobytes()) for i in range(50)]
    recording = read_recording(sound_bag(tmp_path / "b", pieces, 2.0, (1, RATE, "S16LE", "mp3")))
    assert recording.sound is None
    assert any("coded as 'mp3', of which nothing is found" in problem for problem in recording.problems)
    broken = b"fLaC" + rng.integers(0, 255, 3000).astype(np.uint8).tobytes()
    recording = read_recording(sound_bag(tmp_path / "c", cut(broken, (417,)), 2.0))
    assert recording.sound is None
    assert any("/audio: sound is left out: no sound that can be read" in problem for problem in recording.problems)


def test_a_bomb_of_coded_silence_is_not_decoded_to_its_end(tmp_path, monkeypatch):
    data = coded(np.zeros(600 * RATE, np.float32), "FLAC")
    recording = read_recording(sound_bag(tmp_path / "b", cut(data, (4096,)), 2.0))
    assert recording.sound is None
    assert any("of sound in the 2 s of its messages" in problem for problem in recording.problems)
    monkeypatch.setattr(sound_messages, "MAX_CODED_BYTES", 1000)
    recording = read_recording(tmp_path / "b")
    assert any("more than 1000 bytes" in problem for problem in recording.problems)


def test_messages_that_say_themselves_how_they_are_written(tone, tmp_path):
    types = typestore(
        audio_common_msgs__msg__AudioData="float32[] float32_data\nint32[] int32_data\nint16[] int16_data\n"
        "int8[] int8_data\nuint8[] uint8_data",
        audio_common_msgs__msg__AudioInfo="int32 format\nint32 channels\nint32 rate\nint32 chunk",
        audio_common_msgs__msg__Audio="audio_common_msgs/AudioData audio_data\naudio_common_msgs/AudioInfo info",
        audio_common_msgs__msg__AudioStamped="std_msgs/Header header\naudio_common_msgs/Audio audio",
        foxglove_msgs__msg__RawAudio="builtin_interfaces/Time timestamp\nuint8[] data\nstring format\n"
        "uint32 sample_rate\nuint32 number_of_channels",
    )
    make, empty = types.types, {n: np.empty(0, n) for n in ("float32", "int32", "int16", "int8", "uint8")}
    info = make[INFO](8, 1, RATE, 1600)
    of_lists, of_bytes = [], []
    for i in range(60):
        part = tone[i * 1600 : (i + 1) * 1600]
        lists = empty | {"int16": np.round(part * 32767).astype(np.int16)}
        data = make[DATA](**{f"{name}_data": values for name, values in lists.items()})
        audio = make["audio_common_msgs/msg/Audio"](data, info)
        of_lists.append((10**9 + i * 10**8, make[STAMPED](empty_header(types), audio)))
        values = np.frombuffer(pcm_bytes(part, "S16LE"), np.uint8)
        stamp = make["builtin_interfaces/msg/Time"](0, 0)
        of_bytes.append((10**9 + i * 10**8, make["foxglove_msgs/msg/RawAudio"](stamp, values, "pcm-s16", RATE, 1)))
    for name, kind, messages in (("a", STAMPED, of_lists), ("b", "foxglove_msgs/msg/RawAudio", of_bytes)):
        recording = read_recording(small_bag(tmp_path / name, "/microphone", kind, messages, types))
        assert recording.problems == ()
        np.testing.assert_allclose(heard(recording), tone, atol=1e-3)


def test_bytes_become_the_numbers_that_they_are():
    assert numbers(b"\x01\x00\x80\xff\xff\xff\x00", "<i3").tolist() == [-(2**23) + 1, -1]
    assert numbers(b"\x80\x00\x01\x7f\xff\xff", ">i3").tolist() == [-(2**23) + 1, 2**23 - 1]
