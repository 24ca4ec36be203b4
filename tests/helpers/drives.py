"""Simulated drives whose wheels err, as recorded logs, and their solution by SLAM."""

from dataclasses import replace

import numpy as np

import lrf3d
from benchmarks.slam_consistency import identical_rooms
from lrf3d.geometry.pose import between, compose
from lrf3d.recordings import LaserLog
from lrf3d.recordings.log import WheelRecord
from lrf3d.slam.offline import solve_log

SCANNER = lrf3d.LaserRangeFinder(beams=181, range_max=15.0)

HALL = lrf3d.World(
    [
        *([0, 0, 9, 0], [9, 0, 9, 7], [9, 7, 0, 7], [0, 7, 0, 0]),
        *([3, 2, 3.5, 2], [6, 5, 6, 4.2], [2, 5.5, 2.6, 5.1], [7, 1.5, 7.4, 1.9]),
    ]
)
FLAT = lrf3d.World(
    [
        *([0, 0, 9, 0], [9, 0, 9, 7], [9, 7, 0, 7], [0, 7, 0, 0]),
        *([4, 0, 4, 2.5], [4, 4, 4, 7], [6, 5, 7, 5], [7, 5, 7, 6], [1, 5.5, 2, 6]),
    ]
)


class Holds:
    """A controller that holds one command."""

    def __init__(self, *command):
        self.held = command

    def command(self, time, pose, scan):
        return self.held


class NoMap:
    def update(self, scan):
        """Nothing."""


def path_of(start, steps):
    """The poses that steps lead through from a first one."""
    path = [start]
    for step in steps:
        path.append(compose(path[-1], step))
    return np.array(path)


def drive(world, route, *, seed=0, position=0.01, heading=0.004, bias=0.03, lrf=SCANNER):
    """Scans of a drive, its poses by wheels with noise and a bias [rad/m], and the true ones."""
    path = lrf3d.follow_route(np.array(route, dtype=float), speed=0.8, dt=0.25)
    noise = lrf3d.ProportionalNoise(0.02)
    run = lrf3d.simulate(world, path, lrf, noise=noise, rng=seed, mapper=NoMap())
    true = lrf3d.odometry_increments(run.trajectory.poses)
    steps = lrf3d.OdometryNoise(position, heading)(true, np.random.default_rng(seed))
    steps[:, 2] += bias * true[:, 0]
    return list(run.scans), path_of(run.trajectory.poses[0], steps), run.trajectory.poses


def flat_drive(count):
    """The first scans of a drive through the flat, their poses by wheels, and the true ones."""
    route = [(1, 1), (3, 3.2), (5.5, 3.2), (8, 1), (8, 3.5), (5, 3.4), (1.5, 3), (2, 1)]
    lrf = lrf3d.LaserRangeFinder(beams=181, range_max=20.0)
    return [part[:count] for part in drive(FLAT, route, seed=2, lrf=lrf)]


def followed(slam, scans, wheels):
    """A Slam that has followed a drive; yields it after each scan."""
    steps = [np.zeros(3), *lrf3d.odometry_increments(wheels)]
    for scan, step in zip(scans, steps, strict=True):
        slam.update(scan, step)
        yield slam


def recorded(scans, wheels, name="drive"):
    """A log of scans whose poses are those of the odometry."""
    placed = [replace(scan, pose=tuple(pose)) for scan, pose in zip(scans, wheels, strict=True)]
    return LaserLog(name, placed)


def solved(scans, wheels, places=None, name="drive"):
    """The solution of a log whose odometry lines come a second apart, by default one a scan."""
    places = np.arange(len(scans)) if places is None else places
    lines = WheelRecord(np.arange(float(len(wheels))), wheels, places)
    return solve_log(LaserLog(name, scans, wheels=lines))


def errors(true, found):
    """How far each pose is off [m]."""
    apart = between(true, found)
    return np.hypot(apart[:, 0], apart[:, 1])


def rooms(count):
    """A corridor of identical rooms of 5 m, each with a door in the middle."""
    return identical_rooms(count)[0]


def through(count):
    """A route through as many rooms, and back."""
    return identical_rooms(count)[1].tolist()
