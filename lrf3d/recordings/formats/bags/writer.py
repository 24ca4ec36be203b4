"""Runs as ROS 2 bags: scans, poses, transforms, the map and the clock, for other programs.

A run enters; an .mcap file or the folder of a bag leaves, complete or not at all. Messages are
written as nested dicts and made by the definitions of rosbags.
"""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, OutputError
from lrf3d.base.files import replacing, unfinished_folder, writing
from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import Pose, between
from lrf3d.laser import LaserRangeFinder, Stamp
from lrf3d.messages import clouds
from lrf3d.messages.ros import (
    BASE,
    MAP,
    ODOMETRY,
    SCAN,
    STATIC_FRAMES,
    TRANSFORMS,
    WORLD,
    Fields,
    beam_truth,
    header_fields,
    imu_fields,
    line_marker,
    made,
    occupancy_grid,
    odometry,
    pose_fields,
    time_fields,
    transform,
)
from lrf3d.recordings.formats.bags.reader import missing_rosbags
from lrf3d.robot.odometry import OdometryBelief, WheelOdometry, twist_of
from lrf3d.simulation.run import Run
from lrf3d.world import World

# The topics of the time, of the finished map as cells, and of the map as it grows as lines.
CLOCK = "/clock"
GRID = "/map"
LINES = "/map_objects"

# The topic of estimated poses, at the scans for which covariances are known.
ESTIMATE = "/pose"

# The topics of a bag and their types, but for those of the lasers.
TOPICS = {
    STATIC_FRAMES: TRANSFORMS,
    GRID: "nav_msgs/msg/OccupancyGrid",
    LINES: "visualization_msgs/msg/MarkerArray",
    CLOCK: "rosgraph_msgs/msg/Clock",
    "/tf": TRANSFORMS,
    "/odom": ODOMETRY,
    ESTIMATE: "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/ground_truth": ODOMETRY,
    "/imu": "sensor_msgs/msg/Imu",
}


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
    # Version 8 of rosbag2's metadata is read by both older and newer releases of ROS 2.
    bag = Writer(folder, version=8, storage_plugin=StoragePlugin.MCAP)
    bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    mapped = bool(run.maps) and len(run.map) > 0
    missing = ["/imu"] * (run.imu is None) + [GRID, LINES] * (not mapped)
    missing += [ESTIMATE] * (run.estimate is None)
    kinds = {topic: kind for topic, kind in TOPICS.items() if topic not in missing}
    # The type of what each beam met; its topics are those of the scans under `/ground_truth`.
    beam_truth = "std_msgs/msg/Float64MultiArray"
    for lrf in run.lasers:
        kinds[scan_topic(run, lrf)] = SCAN
        if _is_simulated(run):
            kinds[f"/ground_truth{scan_topic(run, lrf)}"] = beam_truth
    kinds |= {f"/{topic}": kind for topic, kind in clouds.cloud_topics(run.cloud_sensors).items()}
    with bag:
        topics = {
            topic: bag.add_connection(
                topic, kind, typestore=store, offered_qos_profiles=_latched(topic)
            )
            for topic, kind in kinds.items()
        }
        for topic, stamp, fields in _messages(run, folder, mapped):
            connection = topics[topic]
            message = made(store, connection.msgtype, fields)
            data = store.serialize_cdr(message, connection.msgtype)
            bag.write(connection, stamp.nanoseconds, data)


def scan_topic(run: Run, lrf: LaserRangeFinder) -> str:
    """The topic of a laser's scans: its name is in it where there are several."""
    return f"/scan_{lrf.name}" if run.further else "/scan"


def _is_simulated(run: Run) -> bool:
    """Whether it is known what beams met: not in a recorded drive."""
    return run.knows_truth and bool((run.walls[:1] >= 0).any())


def _messages(run: Run, path: Path, mapped: bool) -> Iterator[tuple[str, Stamp, Fields]]:
    times = run.trajectory.times
    steps = np.diff(times, append=times[-1])
    # The last scan is as far from a next one as the others are.
    steps[-1:] = steps[-2:-1] if len(steps) > 1 else 0.0
    here = Pose(0.0, 0.0, 0.0)
    start = Stamp.of(float(times[0]))
    fixed = [transform(start, BASE, each.name, each.mount, each.height) for each in run.lasers]
    fixed += clouds.mount_transforms(run.cloud_sensors, start)
    if run.estimate is None and run.wheels is None:
        fixed.append(transform(start, MAP, WORLD, here))
    yield STATIC_FRAMES, start, {"transforms": fixed}
    if mapped:
        free = run.free_cells()
        world = World(run.map.segments, free=free)
        yield GRID, start, occupancy_grid(world, free.resolution, start, path)
    snapshots = dict(zip(run.snapshot_scans, range(len(run.maps)), strict=True))
    simulated = _is_simulated(run)
    inertial = 0
    variances = (0.0, 0.0) if run.imu is None else run.imu.variances
    covariances, twists = _wheel_covariances(run, steps)
    known = {}
    if run.estimate is not None:
        known = dict(zip(run.estimate.known_scans.tolist(), count(), strict=False))
    rows = zip(times.tolist(), run.odometry, run.trajectory.speeds, steps.tolist(), strict=True)
    for number, (time, wheels, speed, step) in enumerate(rows):
        while run.imu is not None and inertial < len(run.imu.times):
            if (at := float(run.imu.times[inertial])) > time:
                break
            values = run.imu.turn_rates[inertial], *run.imu.accelerations[inertial]
            imu = imu_fields(Stamp.of(at), [*map(float, values)], variances)
            yield "/imu", Stamp.of(at), imu
            inertial += 1
        stamp = Stamp.of(time)
        measured = Pose(*wheels.tolist())
        yield CLOCK, stamp, {"clock": time_fields(stamp)}
        # The pose of the laser comes before what it measured from there.
        moved = [transform(stamp, WORLD, BASE, measured)]
        if run.estimate is not None:
            estimated = Pose(*run.estimate.poses[number].tolist())
            moved.append(transform(stamp, MAP, WORLD, estimated @ measured.inverse()))
        yield "/tf", stamp, {"transforms": moved}
        if run.estimate is not None and number in known:
            pose = pose_fields(estimated, run.estimate.covariances[known[number]])
            yield ESTIMATE, stamp, {"header": header_fields(stamp, MAP), "pose": pose}
        sure = (covariances[number], twists[number])
        yield "/odom", stamp, odometry(stamp, measured, speed.tolist(), covariances=sure)
        truth = Pose(*run.trajectory.poses[number].tolist())
        exact = odometry(stamp, truth, speed.tolist(), frame=MAP)
        if run.attitudes is not None:
            turn = clouds.quaternion(truth.theta, *run.attitudes[number].tolist())
            exact["pose"]["pose"]["orientation"] = turn
        yield "/ground_truth", stamp, exact
        for laser, (lrf, scan) in enumerate(zip(run.lasers, run.scans_at(number), strict=True)):
            topic = scan_topic(run, lrf)
            yield topic, stamp, scan.as_ros(lrf.name, scan_time=step)
            if simulated:
                yield f"/ground_truth{topic}", stamp, beam_truth(run, number, laser)
        for topic, fields in clouds.cloud_messages(*run.clouds(number), stamp):
            yield f"/{topic}", stamp, fields
        if mapped and number in snapshots:
            shown = run.maps[snapshots[number]].segments, run.lasting_objects[snapshots[number]]
            yield LINES, stamp, {"markers": [line_marker(*shown, stamp)]}


def _wheel_covariances(run: Run, steps: Float) -> tuple[Sequence[Float | None], ...]:
    """Covariances (3, 3) of the pose and of the twist at each scan; None where they are exact.

    They are those of usual wheels, scaled by the actual errors of the increments if the truth is
    known.
    """
    poses = run.odometry
    if run.wheels is None and (run.estimate is None or not len(run.estimate.odometry)):
        return [None] * len(run), [None] * len(run)
    wheels = WheelOdometry()
    belief = OdometryBelief(wheels)
    increments = between(poses[:-1], poses[1:])
    twists = twist_of(increments)
    found = [(belief.covariance, np.zeros((3, 3)))]
    for pose, increment, twist, step in zip(poses, increments, twists, steps, strict=False):
        belief.drive(pose, increment)
        found.append((belief.covariance, belief.twist_covariance(twist / step, step)))
    factor = 1.0
    if run.knows_truth:
        off = twists - twist_of(between(run.trajectory.poses[:-1], run.trajectory.poses[1:]))
        usual = np.array([wheels.noise(*twist) for twist in twists.tolist()])
        usual = np.einsum("nii->ni", usual)[:, [0, 2]]
        drives = (usual > 0.0).all(axis=1)
        shares = off[drives][:, [0, 2]] ** 2 / usual[drives]
        factor = float(shares.mean()) if drives.any() else 1.0
    return [factor * pose for pose, _ in found], [factor * twist for _, twist in found]


def _latched(topic: str) -> list[Any]:
    """The quality of service of a topic whose last message late subscribers receive."""
    from rosbags import interfaces as ros

    if topic not in (STATIC_FRAMES, GRID, LINES):
        return []
    for_ever = ros.QosTime(9223372036, 854775807)
    kept = ros.Qos(
        history=ros.QosHistory.KEEP_LAST,
        depth=1,
        reliability=ros.QosReliability.RELIABLE,
        durability=ros.QosDurability.TRANSIENT_LOCAL,
        deadline=for_ever,
        lifespan=for_ever,
        liveliness=ros.QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=for_ever,
        avoid_ros_namespace_conventions=False,
    )
    return [kept]
