"""Images as robots record them, against patches whose colour is known; video; images that were held on their side."""

import struct
import zlib
from fractions import Fraction

import cv2
import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording import video
from bevameter.framework.core.recording.camera import decode_image
from bevameter.framework.core.recording.pixels import ENCODINGS, PixelError, bgr_of
from bevameter.framework.core.recording.readers import read_recording
from PIL import Image
from small_bags import bag_of, empty_header, raw_image, small_bag, typestore

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
RGB = (200, 120, 40)
WIDTH, HEIGHT = 8, 6


def yuv(rgb):
    """ITU-R BT.601, 8 bits, black at 16."""
    r, g, b = (value / 255 for value in rgb)
    y = 16 + 65.481 * r + 128.553 * g + 24.966 * b
    return [round(v) for v in (y, 128 - 37.797 * r - 74.203 * g + 112.0 * b, 128 + 112.0 * r - 93.786 * g - 18.214 * b)]


def mosaic(pattern):
    """A Bayer mosaic of one colour; the pattern names the first two rows."""
    value = dict(zip("rgb", RGB, strict=True))
    tile = np.array([[value[pattern[0]], value[pattern[1]]], [value[pattern[2]], value[pattern[3]]]])
    return np.tile(tile, (HEIGHT // 2, WIDTH // 2))


def written(encoding):
    """One colour as a camera of that encoding writes it, (h, step) of bytes or of 16 bits."""
    y, u, v = yuv(RGB)
    grey = 130
    colours = {"rgb": RGB, "bgr": RGB[::-1], "rgba": (*RGB, 255), "bgra": (*RGB[::-1], 255), "mono": (grey,)}
    packed = {"yuv422": (u, y, v, y), "uyvy": (u, y, v, y), "yuv422_yuy2": (y, u, y, v), "yuyv": (y, u, y, v)}
    planes = {"nv12": (u, v, HEIGHT // 2), "nv21": (v, u, HEIGHT // 2), "nv24": (u, v, HEIGHT * 2)}
    names = {"8UC1": "mono8", "8UC3": "bgr8", "8UC4": "bgra8"}
    names |= {"16" + name[1:]: kind[:-1] + "16" for name, kind in names.items()}
    encoding = names.get(encoding, encoding)
    if encoding in packed:
        return np.tile(np.array(packed[encoding], np.uint8), (HEIGHT, WIDTH // 2))
    if encoding in planes:
        first, second, rows = planes[encoding]
        below = np.tile(np.array([first, second], np.uint8), (rows, WIDTH // 2))
        return np.concatenate([np.full((HEIGHT, WIDTH), y, np.uint8), below])
    wide = encoding.endswith("16")
    stem = encoding.removesuffix("16") if wide else encoding.removesuffix("8")
    values = mosaic(stem[-4:]) if stem.startswith("bayer") else np.tile(colours[stem], (HEIGHT, WIDTH))
    return values.astype("<u2") * 257 if wide else values.astype(np.uint8)


def shown(encoding):
    return (130, 130, 130) if "mono" in encoding or encoding.endswith("UC1") else RGB[::-1]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_patch_of_each_encoding_has_its_colour(encoding):
    rows = written(encoding)
    image = bgr_of(rows.ravel().view("u1"), encoding, WIDTH, HEIGHT, rows.nbytes // len(rows))
    assert image.shape == (HEIGHT, WIDTH, 3)
    tolerance = 2 if "yu" in encoding or encoding[:2] in ("uy", "nv") else 0
    assert np.abs(image.astype(int) - shown(encoding)).max() <= tolerance
    padded = np.pad(rows.view("u1").reshape(len(rows), -1), ((0, 0), (0, 6)), constant_values=77)
    step = padded.shape[1]
    if encoding == "nv24":  # the plane of colours has rows of twice the length, and twice the padding
        padded = np.concatenate(
            [padded[:HEIGHT].ravel(), np.pad(rows[HEIGHT:].reshape(HEIGHT, -1), ((0, 0), (0, 12))).ravel()]
        )
    np.testing.assert_array_equal(bgr_of(padded.ravel(), encoding, WIDTH, HEIGHT, step), image)
    with pytest.raises(PixelError, match=f"pixels of {encoding}"):
        bgr_of(padded.ravel()[:-40], encoding, WIDTH, HEIGHT, step)
    for width, height in ((0, 4), (4, 0), (2**31, 2**31), (65_000, 65_000), (-4, 4)):
        with pytest.raises(PixelError):
            bgr_of(rows.ravel().view("u1"), encoding, width, height, 2**32 - 1)


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize(("width", "height"), [(1, 1), (2, 2), (3, 3), (1, 7), (7, 1), (5, 4)])
def test_small_and_odd_sizes_are_an_image_or_an_error(encoding, width, height, rng):
    try:
        image = bgr_of(rng.integers(0, 255, 2000).astype(np.uint8), encoding, width, height, 0)
    except PixelError:
        return
    assert image.shape == (height, width, 3)


def test_samples_of_16_bits_are_scaled_by_what_is_stated(tmp_path):
    levels = np.array([[0, 1024, 2048, 4095]], np.uint16)
    types = typestore()
    messages = [raw_image(types, "mono16", levels), raw_image(types, "16UC1", levels.astype(">u2"), big_endian=1)]
    path = small_bag(tmp_path / "b", "/camera", IMAGE, [(10**9 * (i + 1), m) for i, m in enumerate(messages)])
    topics = tmp_path / "map.toml"
    topics.write_text('[camera]\ntopic = "/camera"\nbit_depth = 12')
    for frame in read_recording(path, topics=topics).camera.frames():
        assert frame.image[0, :, 1].tolist() == [0, 64, 128, 255]
    assert next(read_recording(path).camera.frames()).image[0, :, 1].tolist() == [0, 4, 8, 16]
    png = cv2.imencode(".png", levels)[1].tobytes()
    assert decode_image(png, "x", bit_depth=12)[0, :, 2].tolist() == [0, 64, 128, 255]
    assert decode_image(png, "x")[0, :, 2].tolist() == [0, 4, 8, 16]


def test_images_of_a_topic_that_are_damaged_are_frames_with_their_problem(tmp_path, rng):
    types = typestore()
    bgr = rng.integers(0, 255, (6, 5, 3)).astype(np.uint8)
    pictures = [
        raw_image(types, "bgr8", bgr), raw_image(types, "rgb8", bgr[:, :, ::-1].copy()),
        raw_image(types, "bgr8", bgr[:3], step=15 * 100), raw_image(types, "bayer_odd", bgr[:, :, 0].copy()),
        raw_image(types, "bgr8", bgr, size=(2**32 - 1, 2**32 - 1)), raw_image(types, "bgr8", bgr),
    ]  # fmt: skip
    path = small_bag(tmp_path / "b", "/camera", IMAGE, [((i + 1) * 10**8, m) for i, m in enumerate(pictures)])
    frames = list(read_recording(path).camera.frames())
    for whole in (0, 1, 5):
        np.testing.assert_array_equal(frames[whole].image, bgr)
    for number, says in ((2, "5 x 3 pixels"), (3, "'bayer_odd' is not read"), (4, "4294967295 x")):
        assert frames[number].image is None
        assert says in frames[number].problem


def compressed(types, stated, data):
    return types.types[COMPRESSED](empty_header(types), stated, np.frombuffer(data, np.uint8))


def test_compressed_images_of_ros_transports(tmp_path):
    picture = np.full((48, 64, 3), RGB[::-1], np.uint8)
    jpeg, png = (cv2.imencode(kind, picture)[1].tobytes() for kind in (".jpg", ".png"))
    tile = np.tile(mosaic("grbg").astype(np.uint8), (8, 8))
    raw = cv2.imencode(".png", tile)[1].tobytes()
    stated = [
        ("jpeg", jpeg), ("png", png), ("", jpeg), ("rgb8; jpeg compressed bgr8", jpeg),
        ("bgr8; png compressed bgr8", png), ("bayer_grbg8; png compressed ", raw),
        ("bayer_grbg8; jpeg compressed bgr8", jpeg), ("rgb8; jpeg compressed bgr8", jpeg[:300]),
    ]  # fmt: skip
    types = typestore()
    messages = [((i + 1) * 10**8, compressed(types, *each)) for i, each in enumerate(stated)]
    frames = list(read_recording(small_bag(tmp_path / "b", "/camera/compressed", COMPRESSED, messages)).camera.frames())
    for frame in frames[:-1]:
        assert np.abs(frame.image.astype(int) - RGB[::-1]).max() <= 2
    assert "cut off" in frames[-1].problem


def test_images_of_distances_are_left_out_and_named(tmp_path):
    types = typestore()
    picture = np.full((4, 6, 3), RGB[::-1], np.uint8)
    metres = raw_image(types, "32FC1", np.ones((4, 6), np.float32))
    millimetres = raw_image(types, "16UC1", np.full((4, 6), 900, np.uint16))
    packed = compressed(types, "16UC1; compressedDepth png", bytes(12) + cv2.imencode(".png", picture)[1].tobytes())
    messages = [
        ("/color/image_raw", IMAGE, 1, raw_image(types, "bgr8", picture)), ("/lidar/range", IMAGE, 2, metres),
        ("/depth/image_raw", IMAGE, 3, millimetres), ("/depth/image_raw/compressedDepth", COMPRESSED, 4, packed),
    ]  # fmt: skip
    recording = read_recording(bag_of(tmp_path / "b", messages, types))
    np.testing.assert_array_equal(next(recording.camera.frames()).image, picture)
    said = " ".join(recording.problems)
    assert all(f"{topic}: {stated}" in said for topic, stated in (
        ("/lidar/range", "32FC1"), ("/depth/image_raw", "16UC1"), ("/depth/image_raw/compressedDepth", "16UC1; comp")
    ))  # fmt: skip
    topics = tmp_path / "map.toml"
    topics.write_text('[camera]\ntopic = "/lidar/range"')
    recording = read_recording(tmp_path / "b", topics=topics)
    assert recording.camera is None
    assert "/lidar/range: images are left out: 32FC1 is of distances, no image of the ground" in recording.problems


def test_a_camera_of_other_light_is_used_only_where_a_map_names_it(tmp_path):
    types = typestore()
    picture = np.full((4, 6), 90, np.uint8)
    path = small_bag(tmp_path / "b", "/infra/image_raw", IMAGE, [(10**9, raw_image(types, "mono8", picture))], types)
    with pytest.raises(InputError, match="no topic that is known"):
        read_recording(path)
    topics = tmp_path / "map.toml"
    topics.write_text('[camera]\ntopic = "/infra/image_raw"')
    assert len(read_recording(path, topics=topics).camera) == 1


def test_chunks_that_a_picture_does_not_need_do_not_get_to_the_decoder():
    png = cv2.imencode(".png", np.full((4, 6, 3), 50, np.uint8))[1].tobytes()

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    animation = chunk(b"acTL", struct.pack(">II", 2, 0)) + chunk(
        b"fcTL", struct.pack(">IIIIIHHBB", 0, 9999, 9999, 0, 0, 1, 1, 0, 0)
    )
    assert decode_image(png[:33] + animation + png[33:], "x").shape == (4, 6, 3)
    with pytest.raises(InputError, match="in the header's place"):  # a second header
        decode_image(png[:33] + png[8:33] + png[33:], "x")


@pytest.fixture
def av():
    return pytest.importorskip("av")


@pytest.fixture
def scene(rng):
    """Twenty images of ground that moves by, (96, 128)."""
    ground = cv2.GaussianBlur(rng.integers(0, 255, (96, 250, 3)).astype(np.uint8), (0, 0), 4)
    ground = cv2.normalize(ground, None, 0, 255, cv2.NORM_MINMAX)
    return [np.ascontiguousarray(ground[:, 4 * i : 4 * i + 128]) for i in range(20)]


def packets(av, scene, codec, **options):
    encoder = av.CodecContext.create(codec, "w")
    encoder.height, encoder.width = scene[0].shape[:2]
    encoder.pix_fmt, encoder.time_base, encoder.framerate = "yuv420p", Fraction(1, 10), Fraction(10)
    encoder.options = {"g": "8", **options}
    found = []
    for number, image in enumerate(scene):
        frame = av.VideoFrame.from_ndarray(image, format="bgr24")
        frame.pts = number
        found += encoder.encode(frame)
    return [bytes(packet) for packet in (*found, *encoder.encode(None))]


FFMPEG = "ffmpeg_image_transport_msgs/msg/FFMPEGPacket"
FOXGLOVE = "foxglove_msgs/msg/CompressedVideo"
VIDEO = {
    FFMPEG.replace("/", "__"): "std_msgs/Header header\nint32 width\nint32 height\nstring encoding\nuint64 pts\n"
    "uint8 flags\nbool is_bigendian\nuint8[] data",
    FOXGLOVE.replace("/", "__"): "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format",
}  # fmt: skip


def video_bag(path, kind, stated, data):
    types = typestore(**VIDEO)
    messages = []
    for number, packet in enumerate(data):
        packet = np.frombuffer(packet, np.uint8)
        if kind == FFMPEG:
            message = types.types[kind](empty_header(types), 128, 96, stated, number, 0, False, packet)
        elif kind == FOXGLOVE:
            message = types.types[kind](types.types["builtin_interfaces/msg/Time"](0, 0), "f", packet, stated)
        else:
            message = compressed(types, stated, packet)
        messages.append((10**9 + number * 10**8, message))
    return small_bag(path, "/camera/video", kind, messages, types)


@pytest.mark.parametrize(
    ("kind", "stated", "codec"),
    [(FFMPEG, "libx264", "libx264"), (FFMPEG, "hevc", "libx265"), (FOXGLOVE, "h264", "libx264"),
     (COMPRESSED, "h264", "libx264"), (FOXGLOVE, "vp9", "libvpx-vp9")],
)  # fmt: skip
def test_video_is_decoded(kind, stated, codec, tmp_path, av, scene):
    options = {"tune": "zerolatency"} if "x26" in codec else {"lag-in-frames": "0"}
    data = packets(av, scene, codec, **options, **({"x265-params": "log-level=none"} if codec == "libx265" else {}))
    recording = read_recording(video_bag(tmp_path / "b", kind, stated, data))
    frames = list(recording.camera.frames())
    assert len(frames) == len(recording.camera) == len(scene)
    np.testing.assert_allclose([frame.time_s for frame in frames], np.arange(20) * 0.1, atol=1e-9)
    for frame, image in zip(frames, scene, strict=True):
        assert np.abs(frame.image.astype(int) - image).mean() < 10  # the neighbours differ by 20
    assert [frame.time_s for frame in recording.camera.frames(lambda time_s: time_s > 1.45)] == pytest.approx(
        [1.5, 1.6, 1.7, 1.8, 1.9]
    )


def test_what_builds_on_a_damaged_packet_is_left_out_until_a_key_frame(tmp_path, av, scene):
    data = packets(av, scene, "libx264", tune="zerolatency")
    data[10] = data[10][: len(data[10]) // 2]
    data[18] = b""
    frames = list(read_recording(video_bag(tmp_path / "b", FOXGLOVE, "h264", data)).camera.frames())
    assert [frame.image is None for frame in frames] == [10 <= i < 16 or i >= 18 for i in range(20)]
    assert "image 10: damaged" in frames[10].problem
    assert "image 11: it builds on" in frames[11].problem


def test_video_without_its_decoder_names_what_to_install(tmp_path, monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(video, "import_module", missing)
    recording = read_recording(video_bag(tmp_path / "b", FOXGLOVE, "h264", [b"\0\0\1"] * 3))
    assert recording.camera is None
    assert any('pip install "bevameter[video]"' in problem for problem in recording.problems)


def test_a_video_too_large_is_not_decoded(tmp_path, av, scene, monkeypatch):
    monkeypatch.setattr(video, "MAX_IMAGE_PIXELS", 100)
    path = video_bag(tmp_path / "b", FOXGLOVE, "h264", packets(av, scene[:3], "libx264", tune="zerolatency"))
    assert [frame.image for frame in read_recording(path).camera.frames()] == [None] * 3


def camera_folder(folder, orientations, size=(64, 48)):
    """Pictures that are dark at the top when upright, stored as a camera stores them that was held in some way."""
    width, height = size
    upright = np.zeros((height, width, 3), np.uint8)
    upright[height // 2 :, :, 1] = 200
    stored_of = {
        1: upright, 2: upright[:, ::-1], 3: cv2.rotate(upright, cv2.ROTATE_180), 4: upright[::-1],
        6: cv2.rotate(upright, cv2.ROTATE_90_COUNTERCLOCKWISE), 8: cv2.rotate(upright, cv2.ROTATE_90_CLOCKWISE),
    }  # fmt: skip
    (folder / "camera").mkdir(parents=True)
    for number, orientation in enumerate(orientations):
        exif = Image.Exif()
        exif[0x0112] = orientation
        stored = Image.fromarray(np.ascontiguousarray(stored_of[orientation][:, :, ::-1]))
        stored.save(folder / "camera" / f"{number}.jpg", exif=exif, quality=95)
    rows = [f"{number},{number}.jpg" for number in range(len(orientations))]
    (folder / "camera" / "camera.csv").write_text("\n".join(["time_s,file", *rows]))
    return upright


@pytest.mark.parametrize("orientation", [1, 2, 3, 4, 6, 8])
def test_images_held_on_their_side_are_set_upright_as_opencv_does(orientation, tmp_path):
    upright = camera_folder(tmp_path, [orientation] * 2)
    recording = read_recording(tmp_path)
    assert recording.problems == ()
    image = next(recording.camera.frames()).image
    assert image.shape == upright.shape
    assert np.abs(image.astype(int) - upright).mean() < 4
    np.testing.assert_array_equal(image, cv2.imread(str(tmp_path / "camera" / "0.jpg")))


def test_the_orientation_of_most_images_holds_for_all(tmp_path):
    camera_folder(tmp_path, [6, 6, 8, 6])
    recording = read_recording(tmp_path)
    assert any("6 (3 images), 8 (1 images); 6 is taken" in problem for problem in recording.problems)
    assert [frame.image.shape for frame in recording.camera.frames()] == [(48, 64, 3)] * 4


@pytest.mark.parametrize(("size", "shape"), [((64, 48), (48, 64, 3)), ((48, 64), (64, 48, 3))])
def test_images_stay_as_stored_where_only_that_fits_the_calibration(size, shape, tmp_path):
    camera_folder(tmp_path, [6])
    width, height = size
    (tmp_path / "vehicle.toml").write_text(
        "[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n[camera]\nmatrix = [[50.0, 0, 32], [0, 50.0, 24], [0, 0, 1.0]]\n"
        f"width_px = {width}\nheight_px = {height}\nheight_m = 1.0\npitch_rad = 0.5\n"
    )
    recording = read_recording(tmp_path)
    assert next(recording.camera.frames()).image.shape == shape
    assert any("are not set upright" in problem for problem in recording.problems) == (size == (48, 64))
