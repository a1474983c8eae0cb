"""Bags of a few messages, written by rosbags, and the messages of cameras."""

from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore


def typestore(**more):
    """ROS 2's standard types, and more of them: text of a definition by name, with _ for /."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in more.items():
        types.register(get_types_from_msg(text, name.replace("__", "/")))
    return types


def small_bag(path, topic, kind, messages, types=None):
    """Write messages, (time [ns], message), of one topic."""
    return bag_of(path, [(topic, kind, time_ns, message) for time_ns, message in messages], types or typestore())


def bag_of(path, messages, types):
    """Write messages of any topics, (topic, type, time [ns], message)."""
    connections = {}
    with Writer(path, version=9) as writer:
        for topic, kind, time_ns, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(connections[topic], time_ns, types.serialize_cdr(message, kind))
    return path


def empty_header(types):
    return types.types["std_msgs/msg/Header"](types.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0), "")


def raw_image(types, encoding, pixels, step=None, size=None, big_endian=0):
    """An Image of an array (h, w, ...), or of bytes of the `size` (width, height) that is stated."""
    height, width = pixels.shape[:2]
    step = step or pixels.nbytes // height
    width, height = size or (width, height)
    data = pixels.ravel().view("u1")
    return types.types["sensor_msgs/msg/Image"](empty_header(types), height, width, encoding, big_endian, step, data)
