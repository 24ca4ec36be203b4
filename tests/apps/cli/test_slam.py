import json
import re

import bags
import numpy as np
import pytest
from drives import path_of
from program import lrf3d as program
from program import ran, refused, told

import lrf3d
from lrf3d.geometry.pose import compose

ROOM = lrf3d.World([[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 3, 6], [3, 6, 0, 4], [0, 4, 0, 0]])


@pytest.fixture(scope="module")
def log_text():
    """A log of a drive around in a room, whose wheels drift, and the true poses of its lines."""
    path = lrf3d.follow_route(np.array([(1, 1), (7, 1), (7, 5), (4, 4), (2, 1.5)]), dt=0.25)
    lrf = lrf3d.LaserRangeFinder(-np.pi / 2, np.pi / 2 - np.pi / 180, 180, range_max=20.0)
    run = lrf3d.simulate(ROOM, path, lrf, noise=lrf3d.ProportionalNoise(0.02), rng=1)
    true = run.trajectory.poses
    steps = lrf3d.odometry_increments(true)
    steps[:, 2] += 0.05 * steps[:, 0] + 0.003 * np.random.default_rng(1).normal(size=len(steps))
    lines = []
    for scan, (x, y, theta) in zip(run.scans, path_of(true[0], steps), strict=True):
        end = f"{scan.time} host {scan.time}"
        lines.append(f"ODOM {x} {y} {theta} 0 0 0 {end}")
        readings = " ".join(f"{value:.3f}" for value in np.minimum(scan.ranges, 81.9))
        lines.append(f"FLASER 180 {readings} {x} {y} {theta} {x} {y} {theta} {end}")
    return "\n".join(lines) + "\n", true


@pytest.fixture
def log(log_text, written):
    return written("room.log", log_text[0])


def test_a_laser_that_stands_is_said_to_stand(written, tmp_path):
    lrf = lrf3d.LaserRangeFinder(-np.pi / 2, np.pi / 2 - np.pi / 180, 180, range_max=20.0)
    scan = lrf3d.PlanarCaster(ROOM).cast(lrf, (2, 2, 0))
    rng = np.random.default_rng(1)
    lines = []
    for time in range(40):
        readings = scan.ranges + rng.normal(0.0, 0.02, len(scan.ranges))
        told = " ".join(f"{value:.3f}" for value in readings)
        lines.append(f"FLASER 180 {told} 2 2 0 2 2 0 {time} host {time}")
    path = written("still.log", "\n".join(lines))
    done = ran("slam", path, "--out", tmp_path / "out")
    assert "the laser stands, all poses lie within 0.0" in done.stdout


def test_slam_writes_run_map_trajectory_and_summary(log, log_text, written, tmp_path):
    true = log_text[1]
    relative = lrf3d.odometry_increments(true[[0, len(true) - 1]])[0]
    relations = written(
        "room.relations", f"0 {len(true) - 1} {relative[0]} {relative[1]} {relative[2]}\n"
    )
    folder = tmp_path / "out"
    summary = told("slam", log, "--relations", relations, "--out", folder)
    assert summary == json.loads((folder / "summary.json").read_text())
    written = {path.name for path in folder.iterdir()}
    expected = {"run.npz", "map.geojson", "map.png", "trajectory.tum", "summary.json"}
    assert written == expected == set(summary["files"].values())
    assert summary["score"]["translation_mean"] < 0.03
    assert summary["score"]["rotation_mean"] < 0.5
    assert summary["log"]["odometry_lines"] == len(true)
    assert summary["slam"]["scans_by_odometry_alone"] == 0
    assert summary["self_check"]["passed"] and summary["self_check"]["violation"] < 0.02
    table = np.loadtxt(folder / "trajectory.tum")
    assert table.shape == (len(true), 8)
    assert np.hypot(*(table[:, 1:3] - true[:, :2]).T).max() < 0.05
    run = lrf3d.load_run(folder)
    assert len(run) == len(true) and run.trajectory.length > 10.0
    # The map grows in it, up to the last scan.
    sizes = [len(line_map) for line_map in run.maps]
    assert len(sizes) > 10 and sizes[0] < sizes[-1]
    assert run.snapshot_scans[-1] == len(run) - 1 and len(run.snapshot_scans) == len(sizes)
    line_map = lrf3d.load_map(folder / "map.geojson")
    assert len(line_map) == summary["map"]["segments"] == len(run.world.segments)


def scanned(mount, dt):
    """A drive, the poses of a laser on a mount of its robot, and what that scans."""
    path = lrf3d.follow_route(np.array([(2, 1.5), (6, 1.5), (6, 4), (4, 4)]), dt=dt)
    lasers = compose(path.poses, np.array(mount))
    lrf = lrf3d.LaserRangeFinder(-np.pi / 2, np.pi / 2, 181, range_max=20.0)
    return path, lasers, lrf3d.simulate(ROOM, lrf3d.Trajectory(path.times, lasers), lrf, rng=1)


@pytest.mark.slow
@pytest.mark.parametrize("turn", ["forward", "to the left"])
def test_the_trajectory_of_a_bag_is_that_of_the_base(tmp_path, turn):
    mount = lrf3d.Pose(0.3, -0.1, 0.5 * np.pi if turn == "to the left" else 0.0)
    path, lasers, run = scanned(mount, 0.25)
    quaternion = (0.0, 0.0, np.sin(0.5 * mount.theta), np.cos(0.5 * mount.theta))
    messages = [bags.mounted((mount.x, mount.y, 0.4), quaternion)]
    for scan, pose in zip(run.scans, path.poses, strict=True):
        messages += [
            ("/odom", scan.time, bags.ODOMETRY, bags.odometry(scan.time, pose)),
            ("/scan", scan.time, bags.SCAN, bags.of_scan(scan)),
        ]
    table = solved(bags.write(tmp_path / "drive", *messages), tmp_path)
    # One line a scan, of the robot's base, where the laser's is a hand's breadth away.
    assert table[:, 0] == pytest.approx(path.times, abs=1e-6)
    assert table[:, 1:3] == pytest.approx(path.poses[:, :2], abs=0.04)
    turns = 2.0 * np.arctan2(table[:, 6], table[:, 7])
    assert np.cos(turns - path.poses[:, 2]).min() > 0.999
    run = lrf3d.load_run(tmp_path / "out")
    assert np.hypot(*(run.trajectory.poses - lasers)[:, :2].T).max() < 0.04


def solved(log, tmp_path):
    """The rows of trajectory.tum that ``lrf3d slam`` writes."""
    told("slam", log, "--out", tmp_path / "out")
    return np.loadtxt(tmp_path / "out" / "trajectory.tum")


@pytest.mark.slow
def test_the_trajectory_of_a_carmen_log_is_that_of_the_base(written, tmp_path):
    path, _, run = scanned((0.3, 0.0, 0.0), 0.125)
    lines = ["PARAM robot_frontlaser_offset 0.3 0 host 0"]
    for number, (scan, (x, y, theta)) in enumerate(zip(run.scans, path.poses, strict=True)):
        end = f"{scan.time} host {scan.time}"
        lines.append(f"ODOM {x} {y} {theta} 0 0 0 {end}")
        if number % 2 == 0:
            readings = " ".join(map(str, scan.ranges))
            place = " ".join(map(str, [*scan.pose, x, y, theta]))
            lines.append(f"FLASER 181 {readings} {place} {end}")
    log = written("drive.log", "\n".join(lines) + "\n")
    table = solved(log, tmp_path)
    assert len(table) == len(path) and table[:, 0] == pytest.approx(path.times, abs=1e-6)
    assert table[:, 1:3] == pytest.approx(path.poses[:, :2], abs=0.04)
    # Without ODOM lines the poses of the scans are the odometry, and there is a line for each.
    log.write_text("\n".join(line for line in lines if not line.startswith("ODOM")) + "\n")
    assert solved(log, tmp_path)[:, 1:3] == pytest.approx(path.poses[::2, :2], abs=0.04)


@pytest.mark.slow
def test_what_was_wrong_with_a_log_is_reported(log_text, written, tmp_path):
    text, true = log_text
    lines = text.splitlines()
    # Cut in the middle of a scan, and all of it before the cut twice.
    scans = len(lines) // 4
    part = "\n".join(lines[: 2 * scans + 1]) + "\n"
    log = written("twice.log", part + part + lines[2 * scans + 1][:200])
    folder = tmp_path / "out"
    done = ran("slam", log, "--out", folder)
    twice = f"{scans} scans and {scans + 1} odometry lines in the log more than once: read once"
    assert twice in done.stdout and "loop closure" in done.stdout
    assert f"1 bad line left out, the first line {4 * scans + 3}: " in done.stdout
    found = json.loads((folder / "summary.json").read_text())["log"]
    assert (found["scans"], found["doubled_scans"], found["bad_lines"]) == (2 * scans, scans, 1)
    table, half = np.loadtxt(folder / "trajectory.tum"), scans + 1
    # A line for each ODOM line of the log, in its order.
    assert len(table) == 2 * half and table[half:].tolist() == table[:half].tolist()
    assert np.hypot(*(table[:scans, 1:3] - true[:scans, :2]).T).max() < 0.05


def test_a_missing_log_and_wrong_relations_are_one_line(log, written, tmp_path):
    bad = written("bad.relations", "0 100000 1 0 0\n")
    assert "missing.log: no such file" in refused("slam", "missing.log")
    assert "another log" in refused("slam", log, "--relations", bad, "--out", tmp_path / "out")


@pytest.mark.slow
def test_readings_that_are_no_numbers_are_no_return_and_counted(log, tmp_path):
    text, lost = re.subn(r"(?<=FLASER 180 )\S+", "nan", log.read_text())
    log.write_text(text)
    done = ran("slam", log, "--out", tmp_path / "out")
    assert f"{lost} readings NaN" in done.stdout
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["log"]["readings_not_numbers"] == lost and summary["log"]["bad_lines"] == 0
    assert f"{lost} readings NaN" in program("map", log, "--out", tmp_path / "map").stdout


@pytest.mark.parametrize("factor", [0.0, 100.0, 1000.0, np.nan])
def test_a_map_of_nothing_is_a_failure(log, tmp_path, factor):
    lines = log.read_text().splitlines()
    for number, line in enumerate(lines):
        words = line.split()
        if words[0] == "FLASER":
            words[2:182] = [str(factor * float(word)) for word in words[2:182]]
        lines[number] = " ".join(words)
    log.write_text("\n".join(lines) + "\n")
    for command in ("slam", "map"):
        assert "room" in refused(command, log, "--out", tmp_path / "out")
        assert not (tmp_path / "out").exists()


def test_a_run_with_slam_reports_its_errors(tmp_path):
    folder = tmp_path / "out"
    arguments = ("run", "corridor", "--slam", "--scans", "60", "--no-video", "--out", folder)
    assert told(*arguments)["report"]["slam_largest_error_m"] < 0.15
    assert "--slam: it is a mapper itself" in refused(*arguments, "--mode", "paper")
