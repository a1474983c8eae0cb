import struct
import tracemalloc
import zlib

import cv2
import numpy as np
import pytest
import soundfile as sf
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording import sound
from bevameter.framework.core.recording.camera import decode_image, read_image
from bevameter.framework.core.recording.mp3 import Mp3Splitter
from bevameter.framework.core.recording.sound import SoundFileStream, read_channels, read_sound

RATE = 8000


@pytest.fixture
def picture(rng):
    return cv2.GaussianBlur(rng.integers(0, 255, (120, 160, 3)).astype(np.uint8), (0, 0), 2)


def encoded(picture, kind, *options):
    ok, data = cv2.imencode(kind, picture, list(options))
    assert ok
    return data.tobytes()


def test_images_are_decoded(picture, tmp_path):
    np.testing.assert_array_equal(decode_image(encoded(picture, ".png"), "x"), picture)
    (tmp_path / "x.jpg").write_bytes(encoded(picture, ".jpg", cv2.IMWRITE_JPEG_QUALITY, 95))
    assert np.abs(read_image(tmp_path / "x.jpg").astype(int) - picture).mean() < 4
    grey = decode_image(encoded(picture[:, :, 0], ".png"), "x")
    assert grey.shape == picture.shape


@pytest.mark.parametrize("options", [(), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1)])
@pytest.mark.parametrize("share", [0.05, 0.5, 0.97])
def test_half_a_jpeg_is_an_error_and_no_grey_picture(picture, share, options, tmp_path):
    data = encoded(picture, ".jpg", *options)
    path = tmp_path / "half.jpg"
    path.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(InputError, match=r"half\.jpg: a JPEG cut off after \d+ bytes"):
        read_image(path)


BASELINE = [(), (cv2.IMWRITE_JPEG_OPTIMIZE, 1), (cv2.IMWRITE_JPEG_RST_INTERVAL, 5)]


@pytest.mark.parametrize("options", BASELINE)
@pytest.mark.parametrize("share", [0.05, 0.5, 0.97])
def test_half_a_jpeg_with_an_end_marker_is_an_error(picture, share, options):
    data = encoded(picture, ".jpg", *options)
    start = data.index(b"\xff\xda") + 14
    half = data[: start + int(share * (len(data) - start))].rstrip(b"\xff")
    with pytest.raises(InputError, match=r"half\.jpg: a JPEG cut off: its \d+ bytes of coded data are less"):
        decode_image(half + b"\xff\xd9", "half.jpg")


def test_a_jpeg_whose_data_were_overwritten_is_an_error(picture):
    data = encoded(picture, ".jpg")
    half = len(data) // 2
    with pytest.raises(InputError, match=r"x\.jpg: .* bytes of coded data are (less|more) than the image"):
        decode_image(data[:half] + bytes(len(data) - half - 2) + data[-2:], "x.jpg")
    with pytest.raises(InputError, match=r"x\.jpg: damaged JPEG: its \d+ bytes of coded data are more"):
        decode_image(data[:half] + data[half - 1000 : half] + data[half:], "x.jpg")


@pytest.mark.parametrize("options", [*BASELINE, (cv2.IMWRITE_JPEG_PROGRESSIVE, 1)])
@pytest.mark.parametrize("quality", [5, 95, 100])
@pytest.mark.parametrize("colour", [None, 128])
def test_whole_jpegs_are_taken_with_what_cameras_put_behind_their_data(picture, options, quality, colour):
    shown = picture if colour is None else np.full_like(picture, colour)
    data = encoded(shown, ".jpg", cv2.IMWRITE_JPEG_QUALITY, quality, *options)
    expected = decode_image(data, "x.jpg")
    for whole in (data[:-2] + bytes(40) + data[-2:], data + bytes(1000)):
        np.testing.assert_array_equal(decode_image(whole, "x.jpg"), expected)


@pytest.mark.parametrize("share", [0.001, 0.5, 0.999])
def test_half_a_png_is_an_error(picture, share):
    data = encoded(picture, ".png")
    with pytest.raises(InputError, match="a PNG cut off"):
        decode_image(data[: max(int(len(data) * share), 8)], "half.png")


def test_a_png_with_a_flipped_byte_is_an_error(picture):
    data = bytearray(encoded(picture, ".png"))
    data[len(data) // 2] ^= 0xFF
    with pytest.raises(InputError, match="check sum"):
        decode_image(bytes(data), "x.png")


def test_an_image_too_large_by_its_header_is_not_decoded(picture):
    data = bytearray(encoded(picture, ".png"))
    data[16:24] = struct.pack(">II", 100_000, 100_000)
    data[29:33] = struct.pack(">I", zlib.crc32(bytes(data[12:29])))
    with pytest.raises(InputError, match="100000 x 100000 pixels"):
        decode_image(bytes(data), "x.png")
    jpeg = encoded(picture, ".jpg")
    place = jpeg.index(b"\xff\xc0") + 5
    with pytest.raises(InputError, match="65000 x 65000 pixels"):
        decode_image(jpeg[:place] + struct.pack(">HH", 65_000, 65_000) + jpeg[place + 4 :], "x.jpg")


@pytest.mark.parametrize(
    ("data", "says"),
    [(b"", "an empty file"), (b"hello", "begins with b'hello'"), (b"\xff\xd8", "cut off"),
     (b"\xff\xd8\xff\xd9" + b"\0" * 9, "cut off"), (b"\xff\xd8abcdefgh", "no marker at byte 2"),
     (b"\x89PNG\r\n\x1a\n", "PNG cut off")],
)  # fmt: skip
def test_files_that_are_no_image(data, says):
    with pytest.raises(InputError, match=says):
        decode_image(data, "x.jpg")


def test_an_image_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_image(tmp_path / "none.jpg")


@pytest.fixture
def tone():
    return (0.5 * np.sin(2 * np.pi * 300 * np.arange(4 * RATE) / RATE)).astype(np.float32)


@pytest.mark.parametrize("kind", ["wav", "flac", "ogg", "aiff"])
def test_sound_is_read(kind, tone, tmp_path):
    path = tmp_path / f"x.{kind}"
    sf.write(path, tone, RATE)
    samples, rate = read_sound(path)
    assert rate == RATE
    assert samples.dtype == np.float32
    np.testing.assert_allclose(samples, tone, atol=0.02 if kind == "ogg" else 1e-4)
    part, _ = read_sound(path, 1.0, 1.5)
    np.testing.assert_allclose(part, samples[RATE : 3 * RATE // 2], atol=1e-6 if kind != "ogg" else 1e-3)


@pytest.mark.parametrize("mode", ["CONSTANT", "VARIABLE"])
def test_mp3_is_read_to_its_end_whatever_its_first_frames_bit_rate(mode, tmp_path, rng):
    loud = np.repeat([0.0, 0.0, 0.4, 0.02, 0.4, 0.0], 2 * 16_000).astype(np.float32)
    noise = loud * rng.normal(0, 0.5, len(loud)).astype(np.float32)
    path = tmp_path / "x.mp3"
    sf.write(path, noise, 16_000, bitrate_mode=mode, compression_level=0.5)
    frames = Mp3Splitter().feed(path.read_bytes())
    path.write_bytes(b"ID3\x04\0\0\0\0\0\x0a" + bytes(10) + b"".join(frames) + b"TAG" + bytes(125))
    samples, rate = read_sound(path)
    assert rate == 16_000
    assert abs(len(samples) - len(noise)) < 3000
    power = [np.square(samples[i * 32_000 + 3000 : (i + 1) * 32_000 - 3000]).mean() for i in range(6)]
    assert [value > 0.01 for value in power] == [False, False, True, False, True, False]
    damaged = b"".join(frames[:100]) + rng.integers(0, 255, 5000).astype(np.uint8).tobytes() + b"".join(frames[100:])
    path.write_bytes(damaged)
    (problem,) = SoundFileStream(path).problems
    assert "x.mp3: damaged, read up to 3." in problem


def test_channels_become_their_mean_and_loud_floats_are_clipped(tone, tmp_path):
    path = tmp_path / "x.wav"
    sf.write(path, np.stack([tone, -tone / 2], axis=1), RATE, subtype="FLOAT")
    np.testing.assert_allclose(read_sound(path)[0], tone / 4, atol=1e-7)
    sf.write(path, tone * 10, RATE, subtype="FLOAT")
    assert np.abs(read_sound(path)[0]).max() == 1.0


def test_where_channels_cancel_the_loudest_is_heard(tone, tmp_path):
    path = tmp_path / "x.wav"
    sf.write(path, np.stack([tone, -0.95 * tone], axis=1), RATE, subtype="FLOAT")
    np.testing.assert_array_equal(read_sound(path)[0], tone)
    block = next(SoundFileStream(path).blocks(1.0, 1.0))
    np.testing.assert_array_equal(block.samples, tone[:RATE])
    np.testing.assert_array_equal(block.channels, read_channels(path, 0.0, 1.0)[0])
    sf.write(path, np.stack([tone, 0 * tone], axis=1), RATE, subtype="FLOAT")
    np.testing.assert_allclose(read_sound(path)[0], tone / 2, atol=1e-7)


def test_a_text_file_named_flac(tmp_path):
    path = tmp_path / "x.flac"
    path.write_text("this is no sound")
    with pytest.raises(InputError, match=r"x\.flac: no sound that can be read"):
        read_sound(path)


def test_empty_sound_in_each_meaning(tmp_path):
    path = tmp_path / "x.wav"
    with pytest.raises(InputError, match="no such file"):
        read_sound(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match="an empty file"):
        read_sound(path)
    sf.write(path, np.empty(0, np.float32), RATE)
    with pytest.raises(InputError, match="no sample"):
        read_sound(path)


@pytest.mark.parametrize("kind", ["wav", "flac", "ogg"])
def test_half_a_sound_file_is_reported_and_read_as_far_as_it_goes(kind, tone, tmp_path, rng):
    tone += rng.normal(0, 0.1, len(tone)).astype(np.float32)  # so that Ogg needs more than one page
    path = tmp_path / f"x.{kind}"
    sf.write(path, tone, RATE)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match="cut off, ends after"):
        read_sound(path)
    stream = SoundFileStream(path)
    assert 0.3 < stream.duration_s < 2.5
    assert "cut off, ends after" in stream.problems[0]
    blocks = list(stream.blocks(0.25, 0.25))
    assert len(blocks) == int(stream.duration_s / 0.25 + 1e-9)
    np.testing.assert_allclose(blocks[0].samples, tone[: RATE // 4], atol=0.3 if kind == "ogg" else 1e-4)


def test_samples_that_are_no_numbers(tone, tmp_path):
    path = tmp_path / "x.wav"
    tone[RATE + 80] = np.nan
    tone[3 * RATE + 80] = np.inf
    sf.write(path, tone, RATE, subtype="FLOAT")
    with pytest.raises(InputError, match=r"1\.0100 s: sample nan"):
        read_sound(path)
    blocks = list(SoundFileStream(path, start_s=10.0).blocks(1.0, 1.0))
    assert [block.samples is None for block in blocks] == [False, True, False, True]
    assert "11.00 s" in blocks[1].problem


@pytest.mark.parametrize("kind", ["wav", "flac"])
@pytest.mark.parametrize(("block_s", "hop_s"), [(0.5, 0.5), (0.5, 0.2), (0.1, 0.7)])
def test_blocks_are_the_stretches_they_say(kind, block_s, hop_s, tone, tmp_path):
    path = tmp_path / f"x.{kind}"
    sf.write(path, tone, RATE)
    whole, _ = read_sound(path)
    blocks = list(SoundFileStream(path, start_s=3.0).blocks(block_s, hop_s))
    size, hop = round(block_s * RATE), round(hop_s * RATE)
    assert len(blocks) == (len(whole) - size) // hop + 1
    for number, block in enumerate(blocks):
        assert block.start_s == pytest.approx(3.0 + number * hop_s)
        np.testing.assert_array_equal(block.samples, whole[number * hop : number * hop + size])


def test_memory_does_not_grow_with_the_length_of_sound(tmp_path, rng):
    path = tmp_path / "long.wav"
    with sf.SoundFile(path, "w", 48_000, 1, subtype="PCM_16") as file:
        for _ in range(60):
            file.write(rng.uniform(-0.5, 0.5, 48_000 * 2))
    tracemalloc.start()
    count = sum(1 for _ in SoundFileStream(path).blocks(0.5, 0.25))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert count == 479
    assert peak < 2_000_000  # the file holds 23 MB of samples


def test_limits(tone, tmp_path, monkeypatch):
    path = tmp_path / "x.wav"
    sf.write(path, tone, RATE)
    with pytest.raises(InputError, match=r"within its 4\.000 s"):
        read_sound(path, 3.0, 5.0)
    monkeypatch.setattr(sound, "MAX_SOUND_SAMPLES", 1000)
    with pytest.raises(InputError, match="32000 samples"):
        read_sound(path)
    sf.write(path, tone, 500)
    with pytest.raises(InputError, match="sample rate 500 Hz"):
        read_sound(path)
