"""Clouds of Livox' own drivers, ``CustomMsg``, as messages of ``sensor_msgs/PointCloud2``.

Its points are records of one layout, so that a message is unpacked as a whole and not point by
point.
"""

import struct
from types import SimpleNamespace
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError

# The header after 4 bytes, the packing in ROS 2 and a count in ROS 1: seconds, nanoseconds and the
# length of the frame's name.
HEADER = "<4x3I"

# What comes before the points: their time base, two counts, and one byte that names the lidar.
REST = "<QIB3xI"

# Names, places and types, as PointCloud2 numbers them, of what is read of a point.
FIELDS = (("offset_time", 0, 6), ("x", 4, 7), ("y", 8, 7), ("z", 12, 7), ("line", 18, 2))

# Bytes of a point; ROS 2 pads all but the last to a multiple of four.
POINT = 19


def livox_cloud(data: Any, kind: str, *, aligned: bool) -> Any:
    """A message as a PointCloud2; aligned as in ROS 2, or as in ROS 1."""
    data = bytes(data)
    sec, nanosec, length = struct.unpack_from(HEADER, data)
    begin = struct.calcsize(HEADER)
    place = begin + length
    frame = data[begin:place].rstrip(b"\0").decode("utf-8", "replace")
    # Numbers of eight bytes are aligned from the fourth byte on.
    place += -(place - 4) % 8 * aligned
    count = struct.unpack_from(REST, data, place)[-1]
    step = POINT + aligned
    points = data[place + struct.calcsize(REST) :]
    if len(points) < count * step - aligned:
        raise InputError(f"a cloud of {len(points)} bytes, too few for {count} points")
    stamp = SimpleNamespace(sec=sec, nanosec=nanosec)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp, frame_id=frame), height=1, width=count,
        fields=[SimpleNamespace(name=name, offset=at, datatype=of) for name, at, of in FIELDS],
        point_step=step, row_step=count * step, is_bigendian=False,
        data=np.frombuffer(points.ljust(count * step, b"\0"), np.uint8),
    )  # fmt: skip
