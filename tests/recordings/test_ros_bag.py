"""ROS bags that lrf3d writes: other programs find what they need, and reading gives it back."""

import json
import math
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from bags import STORE, rosbag2
from estimates import estimated
from synthetic_run import around, box, make_run, make_world

import lrf3d
from lrf3d import InputError, MissingLibraryError, OutputError, Pose, export_run, load_log
from lrf3d.geometry.lines import wrap_angle
from lrf3d.laser import LaserRangeFinder, Stamp
from lrf3d.recordings.formats.bags.contents import ODOMETRY, SCAN, TRANSFORMS
from lrf3d.world import Material


@pytest.fixture(scope="module")
def run():
    world = make_world(box(0, 0, 10, 8), box(4.5, 3.5, 1, 1))
    lrf = LaserRangeFinder(-2.0, 2.1, 91, range_min=0.05, range_max=5.3)
    return make_run(world, around(5, 4, 2.5, 30, heading=np.pi / 2), lrf, sigma=0.02)


@pytest.fixture(scope="module")
def mcap(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("bag") / "run.mcap"
    export_run(run, "mcap", path)
    return path


@pytest.mark.parametrize("poses", ["auto", "truth", "tf", "odom"])
def test_a_bag_that_is_read_back_has_the_same_float32_bits(run, mcap, poses):
    log = load_log(mcap, poses=poses)
    assert len(log) == len(run) and log.bad_count == 0
    for before, after in zip(run.scans, log.scans, strict=True):
        expected = before.as_ros("laser")
        assert np.array_equal(after.ranges, expected["ranges"].astype(np.float64))
        assert np.array_equal(after.as_ros("laser")["ranges"], expected["ranges"])
        assert after.as_ros("laser")["header"] == expected["header"]
        assert after.pose[:2] == before.pose[:2]
        assert abs(wrap_angle(after.pose.theta - before.pose.theta)) < 1e-15
        assert after.angles == pytest.approx(before.angles, abs=1e-6)
        assert after.range_max == pytest.approx(5.3, rel=1e-7)
    assert any(np.isposinf(each.ranges).any() for each in log.scans)


def messages_of(path, topic):
    with rosbag2.Reader(path) as bag:
        wanted = [each for each in bag.connections if each.topic == topic]
        return [STORE.deserialize_cdr(data, c.msgtype) for c, _, data in bag.messages(wanted)]


@pytest.mark.parametrize("kind", ["mcap", "rosbag2"])
def test_other_programs_find_what_they_need(run, kind, tmp_path):
    path = tmp_path / ("run.mcap" if kind == "mcap" else "run_bag")
    export_run(run, kind, path)
    with rosbag2.Reader(path) as bag:
        topics = {each.topic: each for each in bag.connections}
        order = [(each.topic, time) for each, time, _ in bag.messages()]
    assert {name: each.msgtype for name, each in topics.items()} == {
        "/scan": SCAN,
        "/odom": ODOMETRY,
        "/ground_truth": ODOMETRY,
        "/ground_truth/scan": "std_msgs/msg/Float64MultiArray",
        "/tf": TRANSFORMS,
        "/tf_static": TRANSFORMS,
        "/clock": "rosgraph_msgs/msg/Clock",
        "/map": "nav_msgs/msg/OccupancyGrid",
        "/map_objects": "visualization_msgs/msg/MarkerArray",
    }
    # Whoever comes late still has to hear where the laser is mounted.
    assert topics["/tf_static"].ext.offered_qos_profiles[0].durability.name == "TRANSIENT_LOCAL"
    assert order[0][0] == "/tf_static" and all(a[1] <= b[1] for a, b in pairwise(order))
    scans = messages_of(path, "/scan")
    clocks = [each.clock for each in messages_of(path, "/clock")]
    times = [Stamp.of(time).nanoseconds for time in run.trajectory.times.tolist()]
    for stamps in (clocks, [each.header.stamp for each in scans]):
        assert [each.sec * 10**9 + each.nanosec for each in stamps] == times
    for each in scans:
        reach = np.float32(each.angle_increment) * (len(each.ranges) - 1)
        assert np.float32(each.angle_max) == np.float32(each.angle_min) + np.float32(reach)
        assert each.header.frame_id == "laser" and each.scan_time == 1.0
    moved = messages_of(path, "/tf") + messages_of(path, "/tf_static")
    edges = {(e.header.frame_id, e.child_frame_id) for each in moved for e in each.transforms}
    assert edges == {("map", "odom"), ("odom", "base_link"), ("base_link", "laser")}
    assert list(tmp_path.iterdir()) == [path]


def test_the_grid_of_a_bag_is_the_map_and_what_beams_passed(run, mcap):
    [grid] = messages_of(mcap, "/map")
    assert grid.header.frame_id == "map"
    cells = grid.data.reshape(grid.info.height, grid.info.width)
    corner = np.array([grid.info.origin.position.x, grid.info.origin.position.y])

    def at(points):
        column, row = ((np.asarray(points) - corner) / grid.info.resolution).astype(int).T
        return cells[row, column]

    middles = 0.5 * (run.map.segments[:, :2] + run.map.segments[:, 2:])
    assert (at(middles) == 100).all()
    assert (at(run.trajectory.poses[:, :2]) == 0).all()
    assert set(np.unique(cells)) == {-1, 0, 100}


def test_the_lines_of_a_bag_are_the_map_snapshots_in_their_colours(run, mcap, tmp_path):
    half = (len(run) - 1) // 2
    kept = replace(run, snapshot_scans=(half, len(run) - 1), maps=(run.map, run.map))
    export_run(kept, "mcap", tmp_path / "two.mcap")
    first, last = messages_of(tmp_path / "two.mcap", "/map_objects")
    assert first.markers[0].header.stamp.sec == int(run.trajectory.times[half])
    [marker] = last.markers
    ends = np.array([(point.x, point.y) for point in marker.points])
    assert np.array_equal(ends.reshape(-1, 4), run.map.segments)
    colours = [(each.r, each.g, each.b) for each in marker.colors[::2]]
    assert len(set(colours)) == run.map.object_count
    assert len(marker.colors) == len(marker.points)


def test_a_bag_of_a_run_with_an_estimate_moves_the_map_over_the_odometry(run, tmp_path):
    drift = np.linspace(0.0, 0.4, len(run))
    driven = run.trajectory.poses + np.column_stack([drift, -drift, 0.2 * drift])
    believed = estimated(run, shift=(0.3, 0.4, 0.05))
    estimate = replace(believed.estimate, odometry=driven)
    export_run(replace(believed, estimate=estimate), "mcap", tmp_path / "run.mcap")
    [fixed] = messages_of(tmp_path / "run.mcap", "/tf_static")
    assert [each.child_frame_id for each in fixed.transforms] == ["laser"]
    poses = messages_of(tmp_path / "run.mcap", "/pose")
    assert len(poses) == len(estimate.known_scans)
    rows = np.ix_([0, 1, 5], [0, 1, 5])
    known = [each.pose.covariance.reshape(6, 6)[rows] - 1e-6 * np.eye(3) for each in poses]
    assert np.allclose(known, estimate.covariances)
    moves = messages_of(tmp_path / "run.mcap", "/tf")
    measured = messages_of(tmp_path / "run.mcap", "/odom")
    truth = messages_of(tmp_path / "run.mcap", "/ground_truth")
    assert len(moves) == len(measured) == len(truth) == len(run)
    for number, moved in enumerate(moves):
        edges = {(each.header.frame_id, each.child_frame_id): each for each in moved.transforms}
        assert set(edges) == {("map", "odom"), ("odom", "base_link")}
        odom_from_base = planar(edges["odom", "base_link"])
        map_from_base = planar(edges["map", "odom"]) @ odom_from_base
        for base, expected in ((odom_from_base, driven), (map_from_base, estimate.poses)):
            x, y, theta = expected[number]
            assert base[:2] == pytest.approx((x, y), abs=1e-9)
            assert wrap_angle(base.theta - theta) == pytest.approx(0.0, abs=1e-9)
        places = [each[number].pose.pose.position for each in (measured, truth)]
        assert (places[0].x, places[0].y) == pytest.approx(tuple(driven[number, :2]))
        assert (places[1].x, places[1].y) == pytest.approx(tuple(run.trajectory.poses[number, :2]))


def planar(moved):
    """The pose in the plane of a stamped transform."""
    shift, turn = moved.transform.translation, moved.transform.rotation
    return Pose(shift.x, shift.y, 2.0 * math.atan2(turn.z, turn.w))


def test_a_bag_holds_all_lasers_the_wheels_the_imu_and_what_each_beam_met(tmp_path):
    lasers = [
        LaserRangeFinder(-1, 1, 21, name="front", mount=(0.3, 0.1, 0.5), scan_duration=0.2),
        LaserRangeFinder(-2, 2, 31, name="rear", mount=(-0.3, 0, math.pi)),
    ]
    world = make_world([[-9, -9, 9, -9], [9, -9, 9, 9], [9, 9, -9, 9], [-9, 9, -9, -9]])
    drive = lrf3d.drive((0, 0, 0), 1.0, 0.5, duration=3.0, dt=1.0)
    sensors = {"odometry": lrf3d.WheelOdometry(), "imu": lrf3d.Imu(rate=10.0)}
    run = lrf3d.simulate(world, drive, lasers, rng=0, **sensors)
    export_run(run, "mcap", tmp_path / "run.mcap")
    front, rear = (messages_of(tmp_path / "run.mcap", f"/scan_{lrf.name}") for lrf in lasers)
    assert len(front) == len(rear) == len(run)
    assert front[1].time_increment == pytest.approx(0.01) and rear[1].time_increment == 0.0
    (fixed,) = messages_of(tmp_path / "run.mcap", "/tf_static")
    mounts = {each.child_frame_id: each.transform.translation.x for each in fixed.transforms}
    assert mounts == {"front": 0.3, "rear": -0.3}
    wheels = messages_of(tmp_path / "run.mcap", "/odom")
    assert [each.pose.pose.position.x for each in wheels] == run.wheels[:, 0].tolist()
    inertial = messages_of(tmp_path / "run.mcap", "/imu")
    assert [each.angular_velocity.z for each in inertial] == run.imu.turn_rates.tolist()
    met = messages_of(tmp_path / "run.mcap", "/ground_truth/scan_rear")[2].data.reshape(-1, 4)
    assert np.array_equal(met[:, 0], run.true_scan(2, laser=1).ranges)
    assert np.array_equal(met[:, 1], run.walls[2, 21:]) and (met[:, 3] == -1).all()


def test_layouts_for_other_programs_show_topics_that_a_bag_has(mcap):
    folder = Path(__file__).parents[2] / "docs" / "ros"
    layout = json.loads((folder / "foxglove.json").read_text(encoding="utf-8"))
    shown = set(layout["configById"]["3D!lrf3d"]["topics"])
    plots = [plot for name, plot in layout["configById"].items() if name.startswith("Plot")]
    shown |= {path["value"].partition(".")[0] for plot in plots for path in plot["paths"]}
    rviz = yaml.safe_load((folder / "lrf3d.rviz").read_text(encoding="utf-8"))
    displays = rviz["Visualization Manager"]["Displays"]
    shown |= {each["Topic"]["Value"] for each in displays if "Topic" in each}
    with rosbag2.Reader(mcap) as bag:
        assert shown <= {each.topic for each in bag.connections}


def test_a_bag_is_replaced_and_nothing_else_is(run, tmp_path):
    bag = tmp_path / "run_bag"
    export_run(run, "rosbag2", bag, every=3)
    export_run(run, "rosbag2", bag, every=10)
    assert len(load_log(bag)) == 3 and load_log(bag).name == "run_bag"
    other = tmp_path / "photos"
    other.mkdir()
    (other / "a.jpg").write_text("")
    with pytest.raises(OutputError, match="is not a bag"):
        export_run(run, "rosbag2", other)
    with pytest.raises(OutputError, match="nowhere"):
        export_run(run, "mcap", tmp_path / "nowhere" / "run.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["photos", "run_bag"]
    assert [path.name for path in other.iterdir()] == ["a.jpg"]


def test_a_run_before_time_0_is_refused(run, tmp_path):
    early = SimpleNamespace(trajectory=SimpleNamespace(times=np.array([-1.0])))
    from lrf3d.recordings.formats.bags.writer import write as write_run

    with pytest.raises(InputError, match="cannot hold times before 0"):
        write_run(early, tmp_path / "run.mcap")


def test_intensities_come_back_and_without_rosbags_the_error_says_what_to_install(
    run, tmp_path, monkeypatch
):
    world = replace(run.world, materials=(Material.of("brick"), Material.of("glass")))
    lit = lrf3d.simulate(world, run.trajectory.poses[:3], run.lrf, rng=0)
    bag = tmp_path / "run.mcap"
    export_run(lit, "mcap", bag)
    for before, after in zip(lit.scans, load_log(bag).scans, strict=True):
        assert np.array_equal(after.intensities, before.intensities.astype(np.float32))
        assert after.echoes is None
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    for call in (lambda: load_log(bag), lambda: export_run(lit, "mcap", tmp_path / "again.mcap")):
        with pytest.raises(MissingLibraryError, match=r"pip install -e .*\[ros\]"):
            call()
    assert list(tmp_path.iterdir()) == [bag]


def test_covariances_of_a_bag_fit_the_errors_of_what_was_measured(tmp_path):
    world = make_world(box(-20, -20, 40, 40))
    drive = lrf3d.drive((0, 0, 0), 1.0, 0.1, duration=60.0, dt=0.5)
    wheels = lrf3d.WheelOdometry(slip=0.05, swerve=0.01, skid=0.02)
    imu = lrf3d.Imu(gyro_noise=0.002, accelerometer_noise=0.03)
    run = lrf3d.simulate(world, drive, lrf3d.LaserRangeFinder(beams=3), rng=0,
                         odometry=wheels, imu=imu)  # fmt: skip
    export_run(run, "mcap", tmp_path / "run.mcap")
    measured = messages_of(tmp_path / "run.mcap", "/odom")
    truth = messages_of(tmp_path / "run.mcap", "/ground_truth")
    assert truth[0].header.frame_id == "map" and measured[0].header.frame_id == "odom"
    squares = []
    for odometry, true in zip(measured[1:], truth[1:], strict=True):
        covariance = odometry.pose.covariance.reshape(6, 6)
        assert (covariance.diagonal()[2:5] > 1e5).all()
        where, exact = odometry.pose.pose, true.pose.pose
        off = [where.position.x - exact.position.x, where.position.y - exact.position.y]
        turns = [math.atan2(each.orientation.z, each.orientation.w) for each in (where, exact)]
        off.append(wrap_angle(2 * (turns[0] - turns[1])))
        rows = [0, 1, 5]
        squares.append(off @ np.linalg.solve(covariance[np.ix_(rows, rows)], off))
    # Three degrees of freedom; the errors of one drive depend on each other.
    assert 0.1 < np.mean(squares) < 12.0
    first, last = (measured[k].pose.covariance[[0, 7, 35]] for k in (1, -1))
    assert (last > 3 * first).all()
    inertial = messages_of(tmp_path / "run.mcap", "/imu")[0]
    assert inertial.angular_velocity_covariance[8] == pytest.approx(100 * 0.002**2, rel=0.2)
    assert inertial.linear_acceleration_covariance[0] == pytest.approx(100 * 0.03**2, rel=0.2)
    with rosbag2.Reader(tmp_path / "run.mcap") as bag:
        assert bag.start_time > 0
