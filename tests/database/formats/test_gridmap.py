"""Grid maps, read back by mcap, rosbags and mcap-ros2-support, and by grid_map's own formulas."""

import json
import math

import numpy as np
import pytest
from bevameter import InputError
from bevameter.database.exporters import Request, export
from bevameter.database.formats.gridmap import GRID_MAP, write_grid_map
from bevameter.framework.core.recording.bag_files import BagFile
from bevameter.framework.core.recording.bag_messages import decode
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from ruamel.yaml import YAML


def value_at(message, layer, x, y):
    """What grid_map finds at a place: GridMapMath.cpp, getIndexFromPosition; Eigen's column-major storage."""
    info, array = message.info, message.data[list(message.layers).index(layer)]
    assert [each.label for each in array.layout.dim] == ["column_index", "row_index"]
    columns, rows = (each.size for each in array.layout.dim)
    assert rows == round(info.length_x / info.resolution)
    assert columns == round(info.length_y / info.resolution)
    assert [each.stride for each in array.layout.dim] == [rows * columns, rows]
    row = math.floor((info.pose.position.x + 0.5 * info.length_x - x) / info.resolution)
    column = math.floor((info.pose.position.y + 0.5 * info.length_y - y) / info.resolution)
    return array.data[column * rows + row]


def check(message, grid):
    assert list(message.layers) == list(grid.layers)
    assert list(message.basic_layers) == []
    assert message.header.frame_id == "map"
    assert message.header.stamp.sec == 2_000_000_000
    assert (message.outer_start_index, message.inner_start_index) == (0, 0)
    assert message.info.pose.orientation.w == 1.0
    for name, layer in grid.layers.items():
        found = [[value_at(message, name, x, y) for x in grid.x] for y in grid.y]
        np.testing.assert_array_equal(found, layer.astype(np.float32))


def read_mcap(path):
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        ((schema, channel, message),) = list(reader.iter_messages())
        (metadata,) = list(reader.iter_metadata())
        return reader.get_header().profile, schema, channel, message, metadata


def test_an_mcap_file(grid, tmp_path):
    write_grid_map(grid, tmp_path / "map.mcap")
    profile, schema, channel, message, metadata = read_mcap(tmp_path / "map.mcap")
    assert (profile, channel.topic, channel.message_encoding) == ("ros2", "/terrain", "cdr")
    assert (schema.name, schema.encoding) == (GRID_MAP, "ros2msg")
    assert message.log_time == 2_000_000_000 * 10**9
    about = json.loads(metadata.metadata["json"])
    assert metadata.name == "bevameter"
    assert about == {
        "site": "quarry", "class_names": list(grid.class_names), "normal_stress_Pa": 20e3, "confidence": 0.95,
        "time_s": 2e9,
    }  # fmt: skip


def test_an_mcap_file_is_decoded_by_another_decoder(grid, tmp_path):
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support is not installed")
    write_grid_map(grid, tmp_path / "map.mcap")
    _, schema, _, message, _ = read_mcap(tmp_path / "map.mcap")
    check(decoder.DecoderFactory().decoder_for("cdr", schema)(message.data), grid)


def test_a_ros2_bag(grid, tmp_path):
    write_grid_map(grid, tmp_path / "bag")
    assert {path.name for path in tmp_path.iterdir()} == {"bag"}
    with Reader(tmp_path / "bag") as reader:
        ((connection, time, _),) = list(reader.messages())
        assert (connection.topic, connection.msgtype, time) == ("/terrain", GRID_MAP, 2_000_000_000 * 10**9)
    metadata = YAML(typ="safe").load((tmp_path / "bag" / "metadata.yaml").read_text(encoding="utf-8"))
    about = metadata["rosbag2_bagfile_information"]["custom_data"]["bevameter"]
    assert json.loads(about)["class_names"] == list(grid.class_names)
    (message,) = BagFile(tmp_path / "bag").messages()
    check(decode(message), grid)


def test_the_command_exports_the_layers_requested(view, tmp_path):
    request = Request(view, layers=["cohesion", "known"], bounds=(0, 0, 1, 2), resolution=0.25)
    export(request, tmp_path / "map.mcap")
    (message,) = BagFile(tmp_path / "map.mcap").messages()
    decoded = decode(message)
    assert list(decoded.layers) == ["cohesion", "known"]
    assert value_at(decoded, "cohesion", 0.1, 0.1) == pytest.approx(view.at(0.1, 0.1).cohesion[0])
    assert math.isnan(value_at(decoded, "cohesion", 0.1, 1.9))
    export(request, tmp_path / "bag", "gridmap")
    assert (tmp_path / "bag" / "metadata.yaml").is_file()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("there", "there: exists already .expected a name for a new folder"),
        ("none/bag", "there is no folder"),
        ("none/map.mcap", "there is no folder"),
        ("bag#1", "a path that SQLite takes for a URI"),
    ],
)
def test_what_cannot_be_written_is_one_clear_error(grid, tmp_path, name, said):
    (tmp_path / "there").mkdir()
    with pytest.raises(InputError, match=said):
        write_grid_map(grid, tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
