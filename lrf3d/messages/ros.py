"""ROS 2 messages as nested dicts: of bags and of live topics.

Poses, walls and times enter; dicts leave, with the fields of the message types. A field that is
left out is zero or empty.
"""

from collections.abc import Mapping, Sequence
from math import cos, sin
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lrf3d.geometry.lines import Float, Int
from lrf3d.geometry.pose import Pose
from lrf3d.laser import Stamp

# Readers of logs, which know types of messages, need neither runs nor maps.
if TYPE_CHECKING:
    from lrf3d.simulation.run import Run
    from lrf3d.world import World

# The frame of the map, which is that of the world.
MAP = "map"

# The frame of the world, in which odometry is.
WORLD = "odom"

# The frame of the robot.
BASE = "base_link"

# The frame of the robot on the ground, which many programs require; it equals base_link here.
FOOTPRINT = "base_footprint"

# Type of the messages of scans.
SCAN = "sensor_msgs/msg/LaserScan"

# Type of the messages of odometry.
ODOMETRY = "nav_msgs/msg/Odometry"

# Type of the messages of transforms.
TRANSFORMS = "tf2_msgs/msg/TFMessage"

# The topic of constant transforms; a robot's namespace may come before it.
STATIC_FRAMES = "/tf_static"

# Variance of an exact pose, [m²] or [rad²]: not 0, as filters divide by it.
EXACT = 1e-6

# Variance of height, roll and pitch, which a robot on the ground does not measure.
UNKNOWN = 1.0 / EXACT

# What the vertical accelerometer of a robot at rest measures [m/s²].
GRAVITY = 9.80665

# Width of the lines of the map [m]: to be seen from above a room.
LINE_WIDTH = 0.1

# Number of visualization_msgs/Marker for lines between pairs of points.
LINE_LIST = 5

# A message as a dict.
Fields = dict[str, Any]

# Rows of x, y and the turn about z among those of a pose in space.
_PLANAR = [0, 1, 5]


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
    return turned(stamp, parent, child, place(pose.x, pose.y, height), turn(pose.theta))


def turned(stamp: Stamp, parent: str, child: str, shift: Fields, rotation: Fields) -> Fields:
    """The transform of a frame that is shifted and turned in its parent."""
    moved = {"translation": shift, "rotation": rotation}
    return {"header": header_fields(stamp, parent), "child_frame_id": child, "transform": moved}


def spread(planar: Float | None = None) -> Float:
    """The covariance (36,) of a pose or a twist from (3, 3) in the plane; None if it is exact."""
    full = np.diag([EXACT, EXACT, UNKNOWN, UNKNOWN, UNKNOWN, EXACT])
    if planar is not None:
        full[np.ix_(_PLANAR, _PLANAR)] += planar
    return full.ravel()


def pose_fields(pose: Pose, covariance: Float | None = None) -> Fields:
    """A geometry_msgs/PoseWithCovariance; the covariance (3, 3) is in the plane."""
    where = {"position": place(pose.x, pose.y), "orientation": turn(pose.theta)}
    return {"pose": where, "covariance": spread(covariance)}


def odometry(
    stamp: Stamp,
    pose: Pose,
    speed: list[float],
    *,
    frame: str = WORLD,
    prefix: str = "",
    covariances: Sequence[Float | None] = (None, None),
) -> Fields:
    """The robot's pose in a frame, its speed [m/s] and its turn rate [rad/s].

    The covariances (3, 3) in the plane are those of the pose and of the twist.
    """
    twist = {"linear": place(speed[0], 0.0), "angular": place(0.0, 0.0, speed[1])}
    of_pose, of_twist = covariances
    return {
        "header": header_fields(stamp, frame),
        "child_frame_id": prefix + BASE,
        "pose": pose_fields(pose, of_pose),
        "twist": {"twist": twist, "covariance": spread(of_twist)},
    }


def imu_fields(
    stamp: Stamp,
    measured: Sequence[float],
    variances: Sequence[float],
    *,
    prefix: str = "",
) -> Fields:
    """A sensor_msgs/Imu; the orientation is unknown.

    The turn rate [rad/s] and the accelerations ahead and to the left [m/s²] are measured; the
    variances of the gyro and of the accelerometers are the same for all axes.
    """
    turn_rate, ahead, left = measured
    of_gyro, of_accelerometers = (np.eye(3).ravel() * max(each, EXACT) for each in variances)
    return {
        "header": header_fields(stamp, prefix + BASE),
        "orientation_covariance": [-1.0] + 8 * [0.0],
        "angular_velocity": place(0.0, 0.0, turn_rate),
        "angular_velocity_covariance": of_gyro,
        "linear_acceleration": place(ahead, left, GRAVITY),
        "linear_acceleration_covariance": of_accelerometers,
    }


def beam_truth(run: "Run", index: int, laser: int) -> Fields:
    """What each beam of a scan met, a row each: true range [m], wall, object, material, or −1.

    The material is its number among those of the world, counted from 0 as the objects have them.
    """
    scan = run.true_scan(index, laser=laser)
    world = run.world
    objects = np.where(scan.walls >= 0, world.objects[scan.walls], -1)
    kinds = list(dict.fromkeys(world.materials))
    numbers = np.array([kinds.index(each) for each in world.materials] or [-1])
    materials = np.where(objects >= 0, numbers[np.minimum(objects, len(numbers) - 1)], -1)
    rows = np.column_stack([scan.ranges, scan.walls, objects, materials])
    layout = [
        {"label": label, "size": size, "stride": stride}
        for label, size, stride in (("beam", len(rows), rows.size), ("value", 4, 4))
    ]
    return {"layout": {"dim": layout}, "data": rows.ravel()}


def occupancy_grid(world: "World", finest: float, stamp: Stamp, path: Path) -> Fields:
    """A world as cells of at least a size [m]: 100 where a wall is, 0 where it is free, or −1."""
    from lrf3d.world.ros_map import FREE, OCCUPIED, cell_size, map_cells

    size = cell_size(world, finest)
    cells, (x, y) = map_cells(world, size, path)
    data = np.full(cells.shape, -1, np.int8)
    data[cells == FREE] = 0
    data[cells == OCCUPIED] = 100
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
    from lrf3d.mapping.tints import object_tints

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


def made(store: Any, kind: str, fields: Mapping[str, Any]) -> Any:
    """A message of a type; a field that is not given is zero or empty."""
    _, definitions = store.fielddefs[kind]
    values = {
        name: _value(store, shape, form, fields.get(name)) for name, (shape, form) in definitions
    }
    return store.types[kind](**values)


def _value(store: Any, shape: Any, form: Any, given: Any) -> Any:
    if shape.name == "NAME":
        return made(store, form, given or {})
    if shape.name == "BASE":
        empty = {"string": "", "bool": False}.get(form[0], 0)
        return empty if given is None else given
    return _array(store, form, given)


def _array(store: Any, form: Any, given: Any) -> Any:
    (element, inner), count = form
    if element.name == "NAME":
        return [made(store, inner, each) for each in given or ()]
    if inner[0] == "string":
        return [*(given or ())]
    return np.asarray(np.zeros(count) if given is None else given, dtype=inner[0])
