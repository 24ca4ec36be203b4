"""ROS 2 messages as nested dicts: of bags and of live topics.

Poses, walls and times enter; dicts leave, with the fields of the message types. A field that is
left out is zero or empty.
"""

from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.laser import Stamp
from lrf3d.pose import Pose
from lrf3d.scene.look import object_tints
from lrf3d.world import World
from lrf3d.world.ros_map import FREE, OCCUPIED, cell_size, map_cells

MAP, WORLD, BASE, LASER = "map", "odom", "base_link", "laser"
"""The frames: of the map and of the world, which are the same; of the robot, and of its laser."""

LINE_WIDTH = 0.1
"""Width of the lines of the map [m]: to be seen from above a room."""

LINE_LIST = 5
"""Number of visualization_msgs/Marker for lines between pairs of points."""

Fields = dict[str, Any]


def time_fields(stamp: Stamp) -> Fields:
    """A stamp as builtin_interfaces/Time."""
    return {"sec": stamp.sec, "nanosec": stamp.nanosec}


def header_fields(stamp: Stamp, frame: str) -> Fields:
    """A std_msgs/Header."""
    return {"stamp": time_fields(stamp), "frame_id": frame}


def place(x: float, y: float, z: float = 0.0) -> Fields:
    """A point or a vector."""
    return {"x": x, "y": y, "z": z}


def turn(theta: float) -> Fields:
    """The quaternion of a heading [rad]."""
    return {"x": 0.0, "y": 0.0, "z": sin(0.5 * theta), "w": cos(0.5 * theta)}


def transform(stamp: Stamp, parent: str, child: str, pose: Pose, height: float = 0.0) -> Fields:
    """The transform of a frame in its parent, at a height [m] above it."""
    moved = {"translation": place(pose.x, pose.y, height), "rotation": turn(pose.theta)}
    return {"header": header_fields(stamp, parent), "child_frame_id": child, "transform": moved}


def odometry(stamp: Stamp, pose: Pose, speed: list[float]) -> Fields:
    """The robot in the world, and its speed ahead [m/s] and about itself [rad/s]."""
    where = {"position": place(pose.x, pose.y), "orientation": turn(pose.theta)}
    twist = {"linear": place(speed[0], 0.0), "angular": place(0.0, 0.0, speed[1])}
    return {
        "header": header_fields(stamp, WORLD),
        "child_frame_id": BASE,
        "pose": {"pose": where},
        "twist": {"twist": twist},
    }


def occupancy_grid(world: World, finest: float, stamp: Stamp, path: Path) -> Fields:
    """A world as cells of at least a size [m]: 100 where a wall is, 0 where it is free, or −1."""
    size = cell_size(world, finest)
    cells, (x, y) = map_cells(world, size, path)
    data = np.full(cells.shape, -1, np.int8)
    data[cells == FREE], data[cells == OCCUPIED] = 0, 100
    rows, columns = cells.shape
    corner = {"position": place(x, y), "orientation": turn(0.0)}
    info = {"map_load_time": time_fields(stamp), "resolution": size}
    return {
        "header": header_fields(stamp, MAP),
        "info": {**info, "width": columns, "height": rows, "origin": corner},
        "data": data.ravel(),
    }


def line_marker(segments: Float, objects: Int, stamp: Stamp) -> Fields:
    """Segments (n, 4) [m] of a map as lines in the colours of their objects (n,)."""
    tints = np.repeat(object_tints(objects), 2, axis=0).tolist()
    return {
        "header": header_fields(stamp, MAP),
        "ns": "map",
        "type": LINE_LIST,
        "pose": {"orientation": turn(0.0)},
        "scale": place(LINE_WIDTH, 0.0),
        "points": [place(x, y) for x, y in segments.reshape(-1, 2).tolist()],
        "colors": [{"r": r, "g": g, "b": b, "a": 1.0} for r, g, b in tints],
        "color": {"a": 1.0},
    }
