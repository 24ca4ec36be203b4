"""A drive by hand: the robot obeys, scans and maps while it goes, among all that moves."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np

from lrf3d.collision import CollisionChecker
from lrf3d.geometry import Float, Int, generator
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap
from lrf3d.mapping.tracking import ObjectTracker
from lrf3d.pose import Pose, as_pose
from lrf3d.robot import Unicycle
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scene.timeline import DriveKeys, Moment, Timeline
from lrf3d.sensor import Sensor
from lrf3d.simulation import line_mapper
from lrf3d.world.cameras import USUAL_FILM

TURN_RATE = 1.5
"""Fastest turn [rad/s]: a full one in four seconds."""

_RAMP = 0.25
"""Time [s] from standing to full speed, and back."""

_LONGEST_STEP = 0.1
"""A step of the drive lasts at most this [s], so that no hitch sends the robot off."""

_MAP_STEP, _MAP_TURN = 0.12, np.radians(5.0)
"""Distance [m] and turn [rad] after which another scan is mapped: a robot at rest sees nothing new,
and each update takes time."""

_MAP_PAUSE = 0.25
"""The map is worked out no more often than this [s]."""

_KEPT = 500
"""Scans that are kept: those of the last seconds are still seen."""

_CALM, _ALIGNED = 3.0, 1e-3
"""How fast a camera follows the robot's turns [1/s], and the angle [rad] that it leaves."""


class HandDrive(Timeline):
    """The robot of a page, from where a scenario with a route or poses starts.

    A scene asks of it what it asks of a run and its timeline: the scans, the path and the map are
    those of now.
    """

    knows_truth, estimate = True, None

    def __init__(self, scenario: Scenario, *, rng: int = 0) -> None:
        self.world, self.lrf, self.obstacles = scenario.world, scenario.lrf, scenario.obstacles
        self.name = scenario.name
        self.film = replace(USUAL_FILM, points_by=scenario.film.points_by)
        self._fastest, self.radius = scenario.speed, scenario.radius
        self._collisions = CollisionChecker(scenario.world)
        self._robot = Unicycle(scenario.radius)
        # Where the hand will drive while a beam turns nobody knows: a scan takes no time.
        self._sensor = Sensor(
            scenario.world,
            scenario.lrf,
            caster="embree",
            noise=scenario.noise,
            obstacles=self.obstacles,
        )
        self._rng = generator(rng)
        self._mapper = line_mapper(scenario.noise, **scenario.mapper)
        self._tracker = ObjectTracker()
        start = scenario.start or as_pose(cast(Float, scenario.poses)[0])
        self.pose, self.time, self.speed, self.turning = start, 0.0, 0.0, 0.0
        self.facing = start.theta
        """Where a camera behind the robot looks [rad]."""
        self.bumped = False
        self.maps: dict[int, LineMap] = {}
        self.lasting_objects: dict[int, Int] = {}
        self._map_due, self._stale = 0.0, True
        self.trajectory = SimpleNamespace(times=np.zeros(0), poses=np.zeros((0, 3)))
        """When and where the mapped scans were taken."""
        self._scans: dict[int, LaserScan] = {}
        self.latest = self._measure()
        self._map_scan()
        super().__init__(cast(Run, self), playback=1.0)
        # A single scan is not a stop here: the robot drives on.
        self.dwells = False

    def step(self, seconds: float, forward: float = 0.0, turn: float = 0.0) -> bool:
        """Drive on for a time [s], scan and map; false where the robot rests and nothing moves.

        Forward and turn, to the left, are shares of the fastest, from −1 to 1.
        """
        moves = forward or turn or self.speed or self.turning or self.obstacles
        aligned = self.facing == self.pose.theta
        if not moves and aligned and not self._stale and not self.bumped:
            return False
        self._drive(min(seconds, _LONGEST_STEP), forward, turn)
        self.latest = self._measure()
        x, y, theta = np.abs(np.array(self.pose) - self.trajectory.poses[-1])
        if np.hypot(x, y) > _MAP_STEP or theta > _MAP_TURN:
            self._map_scan()
        if self._stale and self.time >= self._map_due:
            number = self.snapshot_after(0) + 1
            self.maps = {number: self._mapper.map}
            self.lasting_objects = {number: self._tracker.follow(self.maps[number])}
            self._map_due, self._stale = self.time + _MAP_PAUSE, False
        return True

    def driven(self) -> DriveKeys:
        """The path so far: it only grows, so that a page has most of it already."""
        path = self.trajectory
        poses = np.vstack([path.poses, self.pose]) - [*self.origin, 0.0]
        return DriveKeys(np.append(path.times, self.time), poses)

    def poses(self, times: Float) -> Float:
        """Where the robot is now, for each of the times [s], turned as it turns now."""
        turns = np.zeros((len(times), 3))
        turns[:, 2] = self.turning * (times - self.time)
        return np.array(self.pose) + turns

    def moment(self, time: float) -> Moment:
        """What is to be seen now; the latest scan has no number of its own."""
        number = len(self.trajectory.times)
        return Moment(self.time, np.array(self.pose), number, self.speed, True)

    def scan(self, number: int) -> LaserScan:
        """A mapped scan by its number; the last one is that of now."""
        return self._scans.get(number, self.latest)

    def snapshot_after(self, scan: int) -> int:
        """The number of the map, which changes with it; −1 for none."""
        return max(self.maps, default=-1)

    def _drive(self, seconds: float, forward: float, turn: float) -> None:
        """Gain the speed that is wanted, and stop where the next step would touch a wall."""
        self.speed = _towards(self.speed, forward, self._fastest, seconds)
        self.turning = _towards(self.turning, turn, TURN_RATE, seconds)
        self.time += seconds
        self.bumped = False
        goal = self._robot.move(self.pose, self.speed, self.turning, seconds)
        if goal[:2] != self.pose[:2]:
            here, there = np.array([self.pose[:2]]), np.array([goal[:2]])
            if self._collisions.hit(here, there, self._robot.radius)[0] >= 0:
                # A round robot can still turn on the spot.
                self.bumped, self.speed = True, 0.0
                goal = Pose(self.pose.x, self.pose.y, goal.theta)
        self.pose = goal
        left = (goal.theta - self.facing) * np.exp(-_CALM * seconds)
        self.facing = goal.theta - float(left) * (abs(left) > _ALIGNED)

    def _measure(self) -> LaserScan:
        true_scan = self._sensor.cast(np.array(self.pose), self.time)
        return self._sensor.noisy(true_scan, self._rng)

    def _map_scan(self) -> None:
        self._mapper.update(self.latest)
        path, number = self.trajectory, len(self.trajectory.times)
        self._scans[number] = self.latest
        self._scans.pop(number - _KEPT, None)
        path.times = np.append(path.times, self.time)
        path.poses = np.vstack([path.poses, self.pose])
        self._stale = True


def _towards(value: float, share: float, fastest: float, seconds: float) -> float:
    """A speed after a time [s] in which it nears a share of the fastest."""
    most = fastest * seconds / _RAMP
    return float(np.clip(share * fastest, value - most, value + most))
