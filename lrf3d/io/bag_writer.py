"""Runs as ROS 2 bags: scans, poses, transforms, the map and the clock, for other programs.

A run enters; an .mcap file or the folder of a bag leaves, complete or not at all. Messages are
written as nested dicts and made by the definitions of rosbags.
"""

import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import cos, sin
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lrf3d.errors import InputError, OutputError
from lrf3d.files import replacing, unfinished_folder, writing
from lrf3d.io.bag_reader import ODOMETRY, SCAN, STATIC_FRAMES, TRANSFORMS, missing_rosbags
from lrf3d.laser import Stamp
from lrf3d.pose import Pose
from lrf3d.run import Run
from lrf3d.scene.look import object_tints
from lrf3d.world import World
from lrf3d.world.ros_map import FREE, OCCUPIED, cell_size, map_cells

MAP, WORLD, BASE, LASER = "map", "odom", "base_link", "laser"
"""The frames: of the map and of the world, which are the same; of the robot, and of its laser."""

CLOCK, GRID, LINES = "/clock", "/map", "/map_objects"
"""The topics of the time, of the finished map as cells, and of the map as it grows as lines."""

TOPICS = {
    STATIC_FRAMES: TRANSFORMS,
    GRID: "nav_msgs/msg/OccupancyGrid",
    LINES: "visualization_msgs/msg/MarkerArray",
    CLOCK: "rosgraph_msgs/msg/Clock",
    "/tf": TRANSFORMS,
    "/odom": ODOMETRY,
    "/ground_truth": ODOMETRY,
    "/scan": SCAN,
}
"""The topics of a bag and their types."""

BAG_VERSION: Literal[8] = 8
"""The version of rosbag2's metadata that both older and newer releases of ROS 2 read."""

LINE_WIDTH = 0.1
"""Width of the lines of the map [m]: to be seen from above a room."""

LINE_LIST = 5
"""Number of visualization_msgs/Marker for lines between pairs of points."""

Fields = dict[str, Any]


def write(run: Run, path: Path) -> None:
    """Write a run to an MCAP file, completely or not at all."""
    with replacing(path) as unfinished, _bag_of(run, path) as folder:
        shutil.move(folder / f"{folder.name}.mcap", unfinished)


def write_folder(run: Run, path: Path) -> None:
    """Write a run to the folder of a bag; a bag in its place is replaced."""
    if path.exists() and not (path / "metadata.yaml").is_file():
        raise OutputError(f"{path}: exists and is not a bag; choose another place")
    with _bag_of(run, path) as folder:
        old = Path(folder.parent, "old")
        try:
            if path.exists():
                path.rename(old)
            folder.rename(path)
        except BaseException:
            # Until the new bag is in its place, the older one is kept.
            if old.exists() and not path.exists():
                old.rename(path)
            raise


@contextmanager
def _bag_of(run: Run, path: Path) -> Iterator[Path]:
    """The bag of a run, in a temporary folder with the name of a path."""
    if run.trajectory.times[0] < 0.0:
        raise InputError(f"{path}: a bag cannot hold times before 0, but the run begins earlier")
    with writing(path), unfinished_folder(path) as place:
        folder = place / path.stem
        _fill(run, folder)
        yield folder


def _fill(run: Run, folder: Path) -> None:
    try:
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise missing_rosbags(folder) from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    bag = Writer(folder, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP)
    bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    mapped = bool(run.maps) and len(run.map) > 0
    with bag:
        topics = {
            topic: bag.add_connection(
                topic, kind, typestore=store, offered_qos_profiles=_latched(topic)
            )
            for topic, kind in TOPICS.items()
            if mapped or topic not in (GRID, LINES)
        }
        for topic, stamp, fields in _messages(run, folder, mapped):
            connection = topics[topic]
            message = made(store, connection.msgtype, fields)
            data = store.serialize_cdr(message, connection.msgtype)
            bag.write(connection, stamp.nanoseconds, data)


def _messages(run: Run, path: Path, mapped: bool) -> Iterator[tuple[str, Stamp, Fields]]:
    """The messages of a run in the order of time: topic, stamp and fields."""
    times = run.trajectory.times
    steps = np.diff(times, append=times[-1])
    # The last scan is as far from a next one as the others are.
    steps[-1:] = steps[-2:-1] if len(steps) > 1 else 0.0
    here, start = Pose(0.0, 0.0, 0.0), Stamp.of(float(times[0]))
    fixed = [_transform(start, BASE, LASER, here, run.lrf.height)]
    if run.estimate is None:
        fixed.append(_transform(start, MAP, WORLD, here))
    yield STATIC_FRAMES, start, {"transforms": fixed}
    if mapped:
        yield GRID, start, _grid(run, start, path)
    snapshots = dict(zip(run.snapshot_scans, range(len(run.maps)), strict=True))
    rows = zip(run.scans, run.odometry, run.trajectory.speeds, steps.tolist(), strict=True)
    for number, (scan, wheels, speed, step) in enumerate(rows):
        stamp, measured = Stamp.of(scan.time), Pose(*wheels.tolist())
        yield CLOCK, stamp, {"clock": _time(stamp)}
        # The pose of the laser comes before what it measured from there.
        moved = [_transform(stamp, WORLD, BASE, measured)]
        if run.estimate is not None:
            estimated = Pose(*run.estimate.poses[number].tolist())
            moved.append(_transform(stamp, MAP, WORLD, estimated @ measured.inverse()))
        yield "/tf", stamp, {"transforms": moved}
        yield "/odom", stamp, _odometry(stamp, measured, speed.tolist())
        yield "/ground_truth", stamp, _odometry(stamp, scan.pose, speed.tolist())
        yield "/scan", stamp, scan.as_ros(LASER, scan_time=step)
        if mapped and number in snapshots:
            yield LINES, stamp, {"markers": [_lines(run, snapshots[number], stamp)]}


def made(store: Any, kind: str, fields: Mapping[str, Any]) -> Any:
    """A message of a type; a field that is not given is zero or empty."""
    _, definitions = store.fielddefs[kind]
    values = {
        name: _value(store, shape, form, fields.get(name)) for name, (shape, form) in definitions
    }
    return store.types[kind](**values)


def _value(store: Any, shape: Any, form: Any, given: Any) -> Any:
    """The value of a field: a number, a message, or an array of either."""
    if shape.name == "NAME":
        return made(store, form, given or {})
    if shape.name == "BASE":
        empty = {"string": "", "bool": False}.get(form[0], 0)
        return empty if given is None else given
    (element, inner), count = form
    if element.name == "NAME":
        return [made(store, inner, each) for each in given or ()]
    return np.asarray(np.zeros(count) if given is None else given, dtype=inner[0])


def _time(stamp: Stamp) -> Fields:
    return {"sec": stamp.sec, "nanosec": stamp.nanosec}


def _header(stamp: Stamp, frame: str) -> Fields:
    return {"stamp": _time(stamp), "frame_id": frame}


def _place(x: float, y: float, z: float = 0.0) -> Fields:
    return {"x": x, "y": y, "z": z}


def _turn(theta: float) -> Fields:
    """The quaternion of a heading [rad]."""
    return {"x": 0.0, "y": 0.0, "z": sin(0.5 * theta), "w": cos(0.5 * theta)}


def _transform(stamp: Stamp, parent: str, child: str, pose: Pose, height: float = 0.0) -> Fields:
    """The transform of a frame in its parent, at a height [m] above it."""
    moved = {"translation": _place(pose.x, pose.y, height), "rotation": _turn(pose.theta)}
    return {"header": _header(stamp, parent), "child_frame_id": child, "transform": moved}


def _odometry(stamp: Stamp, pose: Pose, speed: list[float]) -> Fields:
    """The robot in the world, and its speed ahead [m/s] and about itself [rad/s]."""
    where = {"position": _place(pose.x, pose.y), "orientation": _turn(pose.theta)}
    twist = {"linear": _place(speed[0], 0.0), "angular": _place(0.0, 0.0, speed[1])}
    return {
        "header": _header(stamp, WORLD),
        "child_frame_id": BASE,
        "pose": {"pose": where},
        "twist": {"twist": twist},
    }


def _grid(run: Run, stamp: Stamp, path: Path) -> Fields:
    """The finished map as a grid: 100 where a wall is, 0 where beams passed, −1 elsewhere."""
    free = run.free_cells()
    world = World(run.map.segments, free=free)
    size = cell_size(world, free.resolution)
    cells, (x, y) = map_cells(world, size, path)
    data = np.full(cells.shape, -1, np.int8)
    data[cells == FREE], data[cells == OCCUPIED] = 0, 100
    rows, columns = cells.shape
    corner = {"position": _place(x, y), "orientation": _turn(0.0)}
    info = {"map_load_time": _time(stamp), "resolution": size, "width": columns, "height": rows}
    return {
        "header": _header(stamp, MAP), "info": {**info, "origin": corner}, "data": data.ravel()
    }  # fmt: skip


def _lines(run: Run, snapshot: int, stamp: Stamp) -> Fields:
    """A map snapshot as lines in the colours of its objects."""
    ends = run.maps[snapshot].segments.reshape(-1, 2).tolist()
    tints = np.repeat(object_tints(run.lasting_objects[snapshot]), 2, axis=0).tolist()
    return {
        "header": _header(stamp, MAP),
        "ns": "map",
        "type": LINE_LIST,
        "pose": {"orientation": _turn(0.0)},
        "scale": _place(LINE_WIDTH, 0.0),
        "points": [_place(x, y) for x, y in ends],
        "colors": [{"r": r, "g": g, "b": b, "a": 1.0} for r, g, b in tints],
        "color": {"a": 1.0},
    }


def _latched(topic: str) -> list[Any]:
    """The quality of service of a topic whose last message late subscribers receive."""
    from rosbags import interfaces as ros

    if topic not in (STATIC_FRAMES, GRID, LINES):
        return []
    for_ever = ros.QosTime(9223372036, 854775807)
    latched = ros.Qos(
        ros.QosHistory.KEEP_LAST,
        depth=1,
        reliability=ros.QosReliability.RELIABLE,
        durability=ros.QosDurability.TRANSIENT_LOCAL,
        deadline=for_ever,
        lifespan=for_ever,
        liveliness=ros.QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=for_ever,
        avoid_ros_namespace_conventions=False,
    )
    return [latched]
