"""Lasers away from the centre of their robots, of which their logs say nothing."""

from dataclasses import replace

import numpy as np
import pytest
from drives import HALL

import lrf3d
from lrf3d.geometry.pose import between, compose
from lrf3d.laser.range_finder import CENTRE
from lrf3d.recordings.log import LaserLog
from lrf3d.recordings.repair import mount
from lrf3d.recordings.repair.repairs import MAPPING, recordings_of, repair

PLACES = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (-0.2, 0.1, np.pi), (0.0, 0.0, 0.5 * np.pi)]


def log_of(place):
    """A drive in turns, whose log has the poses of the robot as those of the laser."""
    turns = np.tile([0.0, 0.8, 0.0, -0.6], 3)
    path = lrf3d.drive((2.0, 3.5, 0.0), np.full(12, 0.35), turns, duration=1.2, dt=0.1)
    lrf = lrf3d.LaserRangeFinder(-1.5, 1.5, 91, range_max=12.0, mount=place)
    noise = lrf3d.ProportionalNoise(0.02)
    run = lrf3d.simulate(HALL, path, lrf, noise=noise, scan_interval=0.3, rng=0)
    return LaserLog("hall", [replace(scan, pose=scan.robot, mount=CENTRE) for scan in run.scans])


@pytest.mark.parametrize("place", PLACES)
def test_turns_show_where_the_laser_is_mounted(place):
    log = log_of(place)
    [found] = repair(log, MAPPING)
    assert ("mount" in found.found) == any(place)
    robots = np.array([scan.robot for scan in found.scans])
    assert np.allclose(robots, log.poses, atol=1e-6)
    true = compose(log.poses, np.array(place))
    poses = np.array([scan.pose for scan in found.scans])
    x, y, turn = np.abs(between(true, poses)).T
    assert max(x.max(), y.max()) < 0.03 and turn.max() < 0.02
    assert any("stands" in sentence for sentence in found.sentences) == any(place)


@pytest.mark.parametrize("shown, found", [(1.0, True), (0.1, False)])
def test_no_mount_explains_turns_that_scans_do_not_show(shown, found, monkeypatch):
    turns = 0.2 * np.sin(np.arange(30.0))
    driven = np.column_stack([np.full(30, 0.5), np.zeros(30), turns])
    monkeypatch.setattr(mount, "_motions", lambda _: (driven, driven * [-1.0, 1.0, shown]))
    assert bool(mount.find(recordings_of(log_of(PLACES[0]), MAPPING)[0])) == found
