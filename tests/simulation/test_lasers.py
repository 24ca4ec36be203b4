"""Several lasers on mounts: driven, mapped, kept, resumed, localised and followed."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from stops import record_up_to

import lrf3d
from lrf3d.laser.unrolling import together, unrolled
from lrf3d.recordings.degrade import degrade_log
from lrf3d.recordings.formats.carmen_writer import write_log
from lrf3d.recordings.log import LaserLog
from lrf3d.slam import SlamMapper

WIDE = np.radians(135.0)
SETTINGS = {"beams": 271, "range_max": 20.0}
FRONT = lrf3d.LaserRangeFinder(-WIDE, WIDE, mount=(0.3, 0.3, np.pi / 4), name="front", **SETTINGS)
REAR = lrf3d.LaserRangeFinder(
    -WIDE, WIDE, mount=(-0.3, -0.3, -0.75 * np.pi), name="rear", scan_duration=0.1, **SETTINGS
)
ROOM = lrf3d.load_world("paper_room")
ROUTE = lrf3d.follow_route([[1, 1], [4, 1], [4, 2.5]], speed=1.0)
QUIET = lrf3d.ProportionalNoise(0.01)


@pytest.fixture(scope="module")
def run():
    return lrf3d.simulate(ROOM, ROUTE, [FRONT, REAR], rng=0, noise=[QUIET, QUIET])


def off_walls(points):
    """How far points (n, 2) lie from the nearest wall."""
    walls = shapely.multilinestrings(ROOM.segments.reshape(-1, 2, 2))
    return shapely.distance(shapely.points(points), walls)


def test_the_beams_of_each_laser_leave_from_its_mount_and_end_at_walls(run):
    for index in (0, 7, len(run) - 1):
        for laser, lrf in enumerate(run.lasers):
            scan = run.true_scan(index, laser=laser)
            robot = lrf3d.Pose(*run.trajectory.poses[index].tolist())
            assert scan.pose == pytest.approx(robot @ lrf3d.Pose(*lrf.mount))
            assert scan.robot == pytest.approx(robot) and scan.laser == lrf.name
            assert off_walls(unrolled(scan).points()).max() < 1e-9


def test_a_file_holds_all_lasers_and_a_stopped_run_goes_on(run, tmp_path):
    def simulation():
        sensors = {"odometry": lrf3d.WheelOdometry(), "imu": lrf3d.Imu(rate=30.0)}
        return lrf3d.Simulation(ROOM, ROUTE, [FRONT, REAR], rng=0, noise=[QUIET, QUIET], **sensors)

    whole = lrf3d.record(simulation(), tmp_path / "whole.npz")
    assert whole.lasers == run.lasers and np.array_equal(whole.ranges, run.ranges)
    assert np.array_equal(whole.motions, run.motions) and whole.map.segments.shape[1] == 4

    record_up_to(9, simulation(), tmp_path / "cut.npz")
    lrf3d.record(simulation(), tmp_path / "cut.npz", resume=True)
    assert (tmp_path / "cut.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()


def test_two_lasers_map_as_one_that_sees_all_around(run):
    around = lrf3d.LaserRangeFinder(-np.pi, np.pi, 541, range_max=20.0)
    one = lrf3d.simulate(ROOM, ROUTE, around, rng=0, noise=QUIET)
    two, single = lrf3d.score_run(run), lrf3d.score_run(one)
    assert two.length_f1 > single.length_f1 - 0.01 and two.segment_f1 >= single.segment_f1
    assert two.perpendicular_rms < single.perpendicular_rms + 0.002


def test_scans_of_a_moment_are_joined_at_the_centre_of_the_robot(run):
    scans = run.scans_at(3)
    whole = together(scans)
    points = np.vstack([unrolled(scan).points() for scan in scans])
    assert np.sort(whole.points(), axis=0) == pytest.approx(np.sort(points, axis=0))
    assert whole.robot == whole.pose == pytest.approx(tuple(run.trajectory.poses[3]))
    assert (np.diff(whole.angles) >= 0.0).all() and len(whole.angles) == 2 * 271


def test_slam_takes_the_scans_of_all_lasers_at_a_moment_or_those_of_the_first(run):
    scans = [scan for index in range(len(run)) for scan in run.scans_at(index)]
    log = LaserLog("two", scans[:-1])
    assert log.of_moments().notes == (
        "scans of 2 lasers at one moment taken together, 1 scan without all others left out",
    )
    found = lrf3d.slam_log(log).trajectory.poses
    assert np.abs(found - run.trajectory.poses[:-1]).max() < 0.02
    late = [scan.at_time(scan.time + 0.1 * (scan.laser == "rear")) for scan in scans]
    (note,) = LaserLog("late", late).of_moments().notes
    assert note == f"{len(run)} scans of other lasers not used"


def test_a_map_of_two_lasers_and_a_worse_log_keep_the_scans_of_each(run, tmp_path):
    scans = [scan for index in range(len(run)) for scan in run.scans_at(index)]
    log = LaserLog("two", [replace(scan, motion=None, time_increment=0.0) for scan in scans])
    mapped = lrf3d.map_log(log)
    assert [lrf.name for lrf in mapped.lasers] == ["front", "rear"]
    assert mapped.lasers[1].mount == pytest.approx(REAR.mount)
    assert mapped.trajectory.poses == pytest.approx(run.trajectory.poses[::2])
    kept = [scan.points() for scan in log.scans if scan.laser == "rear"][::2]
    shown = [mapped.scan(k, laser=1).points() for k in range(len(mapped))]
    for one, other in zip(kept, shown, strict=True):
        assert one == pytest.approx(other)
    write_log(degrade_log(log, every=3), tmp_path / "worse.log")
    worse = lrf3d.load_log(tmp_path / "worse.log")
    of_each = [[each.ranges for each in log.scans if each.laser == name][::3]
               for name in ("front", "rear")]  # fmt: skip
    for name, ranges in zip(worse.lasers, of_each, strict=True):
        own = [scan for scan in worse.scans if scan.laser == name]
        assert np.array_equal([scan.ranges for scan in own], ranges)
    assert worse.scans[1].mount == pytest.approx(REAR.mount)


def test_a_robot_of_two_lasers_is_localised_and_finds_its_own_way(run):
    start = lrf3d.PoseEstimate(lrf3d.Pose(*run.trajectory.poses[0]), np.diag([0.01, 0.01, 0.001]))
    localiser = lrf3d.Localiser(lrf3d.KnownLines.from_world(ROOM), start)
    steps = lrf3d.odometry_increments(run.trajectory.poses)
    track = lrf3d.localise(localiser, map(run.scans_at, range(len(run))), steps)
    assert np.abs(track.errors(run.trajectory.poses)).max() < 0.01
    mapper = SlamMapper(rng=0)
    lrf3d.simulate(ROOM, ROUTE, [FRONT, REAR], rng=0, noise=QUIET, mapper=mapper)
    assert mapper.errors().max() < 0.02


WORLD = """
[[object]]
points = [[0, 0], [5, 0], [5, 4]]
[noise]
sigma = 0.02
[[laser]]
name = "front"
beams = 11
mount = [0.2, 0, 90]
[[laser]]
name = "rear"
mount = [-0.2, 0, 180]
noise = {sigma = 0.1}
[robot]
poses = [[1, 1, 0]]
"""


def test_a_world_file_has_several_lasers_each_with_its_noise(tmp_path):
    (tmp_path / "two.toml").write_text(WORLD)
    scenario = lrf3d.load_scenario(tmp_path / "two.toml", ["laser.range_max=12"])
    assert [each.name for each in scenario.lasers] == ["front", "rear"]
    assert scenario.lasers[0].mount == pytest.approx((0.2, 0.0, np.pi / 2))
    assert {each.range_max for each in scenario.lasers} == {12.0}
    assert scenario.further[0][1] == lrf3d.ProportionalNoise(0.1)
    assert scenario.run(rng=0).ranges.shape == (1, 11 + 181)
    (tmp_path / "two.toml").write_text(WORLD.replace('"rear"', '"front"'))
    with pytest.raises(lrf3d.InputError, match="two of the name 'front'"):
        lrf3d.load_scenario(tmp_path / "two.toml")


@pytest.mark.parametrize("heading", ["0.785", "-1.5708"])
def test_a_heading_that_looks_like_radians_is_named(tmp_path, heading):
    (tmp_path / "two.toml").write_text(WORLD.replace("0.2, 0, 90", f"0.2, 0, {heading}"))
    with pytest.warns(
        lrf3d.base.errors.Lrf3dWarning, match=f"heading {heading} is read as degrees"
    ):
        scenario = lrf3d.load_scenario(tmp_path / "two.toml")
    assert scenario.lasers[0].mount.theta == np.radians(float(heading))


@pytest.mark.parametrize(
    ("mount", "expected"),
    [((np.nan, 0, 0), "finite"), ((1e9, 0, 0), "100 m"), ((1, 2), "three numbers")],
)
def test_a_mount_that_makes_no_sense_is_reported(mount, expected):
    with pytest.raises(lrf3d.InputError, match=expected):
        lrf3d.LaserRangeFinder(mount=mount)
    with pytest.raises(lrf3d.InputError, match="two of the name 'laser'"):
        lrf3d.Simulation(ROOM, ROUTE, [lrf3d.LaserRangeFinder()] * 2)


def test_a_carmen_log_has_all_lasers_with_their_mounts(tmp_path):
    wheels = lrf3d.WheelOdometry(scale=0.02)
    run = lrf3d.simulate(ROOM, ROUTE, [FRONT, REAR], rng=0, noise=QUIET, odometry=wheels)
    path = tmp_path / "drive.log"
    lrf3d.export_run(run, "carmen", path)
    log = lrf3d.load_log(path)
    assert log.lasers == ["laser", "laser2"] and len(log) == 2 * len(run)
    for scan, lrf in zip(log.scans[6:8], run.lasers, strict=True):
        assert scan.mount == pytest.approx(lrf.mount, abs=1e-9)
    truth = lrf3d.load_log(path, poses="truth")
    for scan, true in zip(truth.scans[6:8], run.scans_at(3), strict=True):
        assert scan.pose == pytest.approx(true.pose, abs=1e-9)
    # Without odometry in its place, the mount of a further laser is unknown.
    lines = path.read_text().splitlines()
    front = [line for line in lines if not line.startswith("ROBOTLASER2 ")]
    rear = [f"RLASER 181 {' '.join(['1'] * 181)} 1 1 {k} 0 0 0 {k} h {k}" for k in range(5)]
    path.write_text("\n".join(front + rear))
    found = lrf3d.load_log(path)
    assert found.lasers == ["laser"] and "unknown mounts (5 of laser2)" in " ".join(found.notes)
