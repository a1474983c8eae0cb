"""Rasters as grid_map_msgs/GridMap, in an MCAP file or a ROS 2 bag.

The message and its order are those of grid_map (P. Fankhauser, M. Hutter, "A Universal Grid Map Library: Implementation
and Use Case for Rough Terrain Navigation" (2016), in: Robot Operating System (ROS), Vol. 1,
doi:10.1007/978-3-319-26054-9_5; github.com/ANYbotics/grid_map, grid_map_msgs/msg/GridMap.msg and GridMapInfo.msg):

- rows run along -x and columns along -y: element (0, 0) has the greatest x and y (GridMapMath.cpp,
  `getPositionFromIndex`);
- a layer is float32 in column-major order, as its labels ``column_index`` and ``row_index`` say
  (GridMapMsgHelpers.hpp);
- the pose is that of the map's centre.
"""

from __future__ import annotations

import json
import os
import shutil
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...framework.core.arguments import path_of
from ...framework.core.errors import InputError
from ...framework.core.files import check_outputs, whole
from ..exporters import Exporter, Request, register
from ..grid import Grid

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

GRID_MAP = "grid_map_msgs/msg/GridMap"

_DEFINITIONS = {
    "grid_map_msgs/msg/GridMapInfo": "float64 resolution\nfloat64 length_x\nfloat64 length_y\n"
    "geometry_msgs/Pose pose\n",
    GRID_MAP: "std_msgs/Header header\ngrid_map_msgs/GridMapInfo info\nstring[] layers\nstring[] basic_layers\n"
    "std_msgs/Float32MultiArray[] data\nuint16 outer_start_index\nuint16 inner_start_index\n",
}

_BAG_VERSION = 8
"""Of the ROS 2 bag's metadata: the older of the two that rosbags writes, which newer distributions read, too."""


_NOT_IN_A_URI = frozenset("#?%")
_TOPIC = "/terrain"


@register
class GridMap(Exporter):
    """One message on /terrain."""

    name = "gridmap"
    endings = (".mcap", "")
    holds = "a grid_map_msgs/GridMap, in an MCAP file or, where the name has no ending, a ROS 2 bag"

    def write(self, request: Request, out: Path) -> None:
        """Write the layers requested."""
        write_grid_map(request.grid(), out)


def write_grid_map(grid: Grid, path: str | Path) -> None:
    """Write a raster as one grid_map_msgs/GridMap on /terrain, in the frame map.

    What the message has no field for, such as the names of the classes, is JSON in the file's metadata under the name
    ``bevameter`` (of a ROS 2 bag, its custom data).

    Parameters
    ----------
    grid
        The raster; layers become float32, unknown stays NaN.
    path
        An MCAP file where it ends in .mcap, else the folder of a ROS 2 bag (SQLite), which must not exist.

    Raises
    ------
    InputError
        A file that cannot be written, or a folder that exists.
    """
    path = path_of("path", path, "the path of a file or folder to write")
    store = _types()
    message = _message(grid, store)
    data = bytes(store.serialize_cdr(message, GRID_MAP))
    about = json.dumps(describe(grid), ensure_ascii=False)
    if path.suffix.lower() == ".mcap":
        _write_mcap(path, store, data, _stamp(grid), about)
    else:
        _write_bag(path, store, data, _stamp(grid), about)


def describe(grid: Grid) -> dict[str, Any]:
    """Say what a raster's numbers mean: site, names of the classes, normal stress and confidence."""
    return {
        "site": grid.site,
        "class_names": list(grid.class_names),
        "normal_stress_Pa": grid.normal_stress,
        "confidence": grid.confidence,
        "time_s": grid.time_s,
    }


def _types() -> Typestore:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store


def _stamp(grid: Grid) -> int:
    """Time of the message [ns]."""
    return round(grid.time_s * 1e9)


def _message(grid: Grid, store: Typestore) -> Any:
    def make(kind: str, **values: Any) -> Any:
        return store.types[kind](**values)

    rows, columns = grid.shape
    length_x, length_y = columns * grid.resolution, rows * grid.resolution
    seconds, nanoseconds = divmod(_stamp(grid), 10**9)
    stamp = make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    centre = make(
        "geometry_msgs/msg/Point", x=grid.origin[0] + 0.5 * length_x, y=grid.origin[1] + 0.5 * length_y, z=0.0
    )
    level = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    pose = make("geometry_msgs/msg/Pose", position=centre, orientation=level)

    def array(layer: np.ndarray) -> Any:
        # Turned by half a turn and transposed, and then column by column: the transposition cancels.
        values = np.ascontiguousarray(layer[::-1, ::-1], dtype=np.float32).ravel()
        dimension = "std_msgs/msg/MultiArrayDimension"
        dimensions = [
            make(dimension, label="column_index", size=rows, stride=rows * columns),
            make(dimension, label="row_index", size=columns, stride=columns),
        ]
        layout = make("std_msgs/msg/MultiArrayLayout", dim=dimensions, data_offset=0)
        return make("std_msgs/msg/Float32MultiArray", layout=layout, data=values)

    return make(
        GRID_MAP,
        header=make("std_msgs/msg/Header", stamp=stamp, frame_id="map"),
        info=make(
            "grid_map_msgs/msg/GridMapInfo", resolution=grid.resolution, length_x=length_x, length_y=length_y, pose=pose
        ),
        layers=list(grid.layers),
        basic_layers=[],
        data=[array(layer) for layer in grid.layers.values()],
        outer_start_index=0,
        inner_start_index=0,
    )


def _write_mcap(path: Path, store: Typestore, data: bytes, time_ns: int, about: str) -> None:
    from mcap.writer import Writer

    definition = store.generate_msgdef(GRID_MAP, ros_version=2)[0].encode()
    with whole(path) as part, part.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="bevameter")
        schema = writer.register_schema(GRID_MAP, "ros2msg", definition)
        channel = writer.register_channel(_TOPIC, "cdr", schema)
        writer.add_message(channel, log_time=time_ns, data=data, publish_time=time_ns)
        writer.add_metadata("bevameter", {"json": about})
        writer.finish()


def _write_bag(path: Path, store: Typestore, data: bytes, time_ns: int, about: str) -> None:
    """Write the bag's folder beside its place, and move it there once it is whole."""
    from rosbags.rosbag2 import Writer

    if path.exists():
        raise InputError(path, "exists already", expected="a name for a new folder")
    if set(str(path)) & _NOT_IN_A_URI:
        raise InputError(path, "a path that SQLite takes for a URI", expected="a path without #, ? and %")
    check_outputs([path], [])
    part = path.with_name(f".{os.getpid()}.{path.name}") / path.name  # files in the bag are named after its folder
    try:
        with Writer(part, version=_BAG_VERSION) as writer:
            writer.set_custom_data("bevameter", about)
            connection = writer.add_connection(_TOPIC, GRID_MAP, typestore=store)
            writer.write(connection, time_ns, data)
        os.replace(part, path)
    except OSError as error:
        problem = f"cannot be written: {error.strerror or error}"
        raise InputError(path, problem, expected="a folder that may be written") from error
    finally:
        with suppress(OSError):
            shutil.rmtree(part.parent)
