"""Recordings whose beams lie otherwise than assumed, which their turns show."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_run import box, make_world

import lrf3d
from lrf3d.base.errors import InputError, Lrf3dWarning
from lrf3d.laser import ConstantNoise
from lrf3d.recordings import LaserLog, load_log
from lrf3d.recordings.repair.repairs import repaired_log
from lrf3d.slam.offline import solve_log


@pytest.fixture(scope="module")
def drive_with():
    """A drive round a pillar, with a range finder of some width [°] and number of beams."""
    world = make_world(box(0, 0, 9, 6), box(4, 2.5, 1, 1), box(7, 0, 2, 2))
    phases = np.linspace(0.0, 4.0, 60)
    poses = np.column_stack([4.5 + 2 * np.cos(phases), 3 + 1.5 * np.sin(phases), phases + 1.6])

    def drive(wide, beams):
        end = np.radians(wide / 2)
        laser = lrf3d.LaserRangeFinder(-end, end, beams, range_max=30.0)
        trajectory = lrf3d.Trajectory(0.1 * np.arange(60.0), poses)
        return lrf3d.simulate(world, trajectory, laser, noise=ConstantNoise(0.01), rng=0)

    return drive


def flaser(path, scans):
    with path.open("w") as file:
        for scan in scans:
            ranges = " ".join(f"{r:.3f}" for r in scan.ranges)
            x, y, theta = scan.pose
            pose = f"{x} {y} {theta}"
            file.write(f"FLASER {len(scan.ranges)} {ranges} {pose} {pose} {scan.time} h 0\n")
    return path


@pytest.mark.parametrize(
    ("wide", "beams"), [(180, 361), (180, 121), (240, 683), (270, 271), (360, 361)]
)
def test_beams_without_a_declared_fan_are_spread_as_scans_turn(wide, beams, drive_with, tmp_path):
    log = load_log(flaser(tmp_path / "a.log", drive_with(wide, beams).scans))
    assert np.ptp(log.scans[0].angles) == pytest.approx(np.pi)
    for said in (repaired_log(log).notes, solve_log(log).recording.sentences):
        assert ("as the scans turn" in str(said)) == (wide != 180)
    assert np.ptp(repaired_log(log).scans[0].angles) == pytest.approx(np.radians(wide))


def test_a_fan_that_is_none_of_the_usual_ones_is_refused(drive_with, tmp_path):
    log = load_log(flaser(tmp_path / "a.log", drive_with(310, 311).scans))
    for solve in (repaired_log, solve_log):
        with pytest.raises(InputError, match="turn unlike the odometry"):
            solve(log)


def test_scans_of_a_vertical_plane_are_warned_of(drive_with):
    angles, scans = np.linspace(-np.pi / 2, np.pi / 2, 181), []
    with np.errstate(divide="ignore"):
        floor = np.where(angles < 0.0, 0.5, 2.0) / np.abs(np.sin(angles))
        for scan in drive_with(180, 181).scans:
            ranges = np.minimum(scan.ranges[90] / np.cos(angles), floor)
            scans.append(lrf3d.LaserScan(scan.pose, angles, ranges, time=scan.time))
    log = LaserLog("sideways", scans)
    for solve in (repaired_log, solve_log):
        with pytest.warns(Lrf3dWarning, match="scan a level plane"):
            solve(log)


def test_a_map_is_made_of_a_mirrored_laser_as_slam_does(drive_with):
    scans = drive_with(200, 201).scans
    # Its beams do not lie evenly about the heading.
    scans = [replace(s, angles=-s.angles[20:], ranges=s.ranges[20:], walls=None) for s in scans]
    log = repaired_log(LaserLog("mirrored", scans))
    assert "clockwise" in str(log.notes)
    straight = [scan.points() for scan in log.scans]
    for points, scan in zip(straight, drive_with(200, 201).scans, strict=True):
        assert points[::-1] == pytest.approx(scan.points()[20:])
