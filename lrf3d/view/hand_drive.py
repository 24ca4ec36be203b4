"""A drive by hand: the robot obeys, scans and maps while it goes, among all that moves."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np

from lrf3d.geometry import Float, Int, generator
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap
from lrf3d.mapping.tracking import ObjectTracker
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory, Unicycle
from lrf3d.robot.collision import CollisionChecker
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scene.moments import Scene
from lrf3d.scene.stage import Stage
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

_OPEN = 60
"""Scans after which the path between them is thinned for good."""

_CALM, _ALIGNED = 3.0, 1e-3
"""How fast a camera follows the robot's turns [1/s], and the angle [rad] that it leaves."""


class HandDrive:
    """The robot of a page, from where it starts.

    A scene asks of it what it asks of a run: the scans, the path and the map are those of now.
    """

    knows_truth, estimate = True, None

    def __init__(
        self, scenario: Scenario, start: Pose, *, rng: int = 0, stage: Stage | None = None
    ) -> None:
        self.world, self.lrf, self.obstacles = scenario.world, scenario.lrf, scenario.obstacles
        self.film = replace(USUAL_FILM, points_by=scenario.film.points_by)
        self._fastest = scenario.speed
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
        self.pose, self.time, self.speed, self.turning = start, 0.0, 0.0, 0.0
        self.facing = start.theta
        """Where a camera behind the robot looks [rad]."""
        self.bumped = False
        self.line_map = LineMap.empty()
        self.map_number, self._map_due, self._stale = -1, 0.0, True
        self.maps: dict[int, LineMap] = {}
        self.lasting_objects: dict[int, Int] = {}
        self._times: list[float] = []
        self._poses: list[Pose] = []
        self._scans: dict[int, LaserScan] = {}
        self._old, self._settled = DriveKeys(np.zeros(0), np.zeros((0, 3))), 0
        self.latest = self._measure()
        self._map_scan()
        self.scene = Scene(_LiveTimeline(self), stage=stage)

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
        before = self._poses[-1]
        gone = np.hypot(self.pose.x - before.x, self.pose.y - before.y)
        if gone > _MAP_STEP or abs(self.pose.theta - before.theta) > _MAP_TURN:
            self._map_scan()
        if self._stale and self.time >= self._map_due:
            self.line_map, self.map_number = self._mapper.map, self.map_number + 1
            self.maps = {self.map_number: self.line_map}
            self.lasting_objects = {self.map_number: self._tracker.follow(self.line_map)}
            self._map_due, self._stale = self.time + _MAP_PAUSE, False
        self.scene.keys = self._driven()
        return True

    def moment(self) -> Moment:
        """What is to be seen now; the latest scan has no number of its own."""
        return Moment(self.time, np.array(self.pose), len(self._times), self.speed, True)

    @property
    def trajectory(self) -> SimpleNamespace:
        """When and where the mapped scans were taken."""
        return SimpleNamespace(times=np.array(self._times), poses=np.array(self._poses))

    def scan(self, number: int) -> LaserScan:
        """A mapped scan by its number; the last one is that of now."""
        return self._scans.get(number, self.latest)

    def snapshot_after(self, scan: int) -> int:
        """The number of the map, which changes with it."""
        return self.map_number

    def _driven(self) -> DriveKeys:
        """The path so far in few keys; what is older is settled, so that a page has it already."""
        times = np.array([*self._times[self._settled :], self.time])
        poses = np.array([*self._poses[self._settled :], self.pose]) - [*self.scene.origin, 0.0]
        old, new = self._old, DriveKeys(times, poses).thinned()
        if len(times) > _OPEN:
            settled = DriveKeys(times[:-1], poses[:-1]).thinned()
            self._old = DriveKeys(
                *(np.concatenate([a, b[:-1]]) for a, b in zip(old, settled, strict=True))
            )
            self._settled = len(self._times) - 1
        return DriveKeys(*(np.concatenate(each) for each in zip(old, new, strict=True)))

    def _drive(self, seconds: float, forward: float, turn: float) -> None:
        """Gain the speed that is wanted, and stop where the next step would touch a wall."""
        self.speed = _towards(self.speed, forward, self._fastest, seconds)
        self.turning = _towards(self.turning, turn, TURN_RATE, seconds)
        self.time += seconds
        self.bumped = False
        goal = self._robot.move(self.pose, self.speed, self.turning, seconds)
        if goal[:2] != self.pose[:2]:
            step = Trajectory([0.0, max(seconds, 1e-6)], [self.pose, goal])
            if self._collisions.first(step, self._robot.radius) is not None:
                # A round robot can still turn on the spot.
                self.bumped, self.speed = True, 0.0
                goal = Pose(self.pose.x, self.pose.y, goal.theta)
        self.pose = goal
        left = (goal.theta - self.facing) * np.exp(-_CALM * seconds)
        self.facing = goal.theta - float(left) * (abs(left) > _ALIGNED)

    def _measure(self) -> LaserScan:
        return self._sensor.measure(np.array(self.pose), self.time, self._rng)[1]

    def _map_scan(self) -> None:
        self._mapper.update(self.latest)
        self._scans[len(self._times)] = self.latest
        self._scans.pop(len(self._times) - _KEPT, None)
        self._times.append(self.time)
        self._poses.append(self.pose)
        self._stale = True


class _LiveTimeline(Timeline):
    """The timeline of a drive that knows only where the robot is now."""

    def __init__(self, drive: HandDrive) -> None:
        self._drive = drive
        super().__init__(cast(Run, drive), playback=1.0)

    def poses(self, times: Float) -> Float:
        """Where the robot is now, for each of the times."""
        return np.tile(np.array(self._drive.pose), (len(times), 1))


def _towards(value: float, share: float, fastest: float, seconds: float) -> float:
    """A speed after a time [s] in which it nears a share of the fastest."""
    most = fastest * seconds / _RAMP
    return float(np.clip(share * fastest, value - most, value + most))
