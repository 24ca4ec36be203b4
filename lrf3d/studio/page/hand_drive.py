"""A drive by hand: the robot obeys, scans and maps while it goes, among all that moves."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np

from lrf3d.geometry.lines import Float, Int
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap
from lrf3d.mapping.tracking import ObjectTracker
from lrf3d.simulation.live import LiveRobot
from lrf3d.simulation.loop import line_mapper
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import Scenario
from lrf3d.studio.scene.timeline import DriveKeys, Moment, Timeline
from lrf3d.world.cameras import USUAL_FILM

# Fastest turn [rad/s]; time from standing to full speed, and back; and the longest step of the
# drive [s], so that the robot does not jump after a delay.
TURN_RATE = 1.5
_RAMP = 0.25
_LONGEST_STEP = 0.1


class HandDrive(Timeline):
    """The robot of a page, from where a scenario with a route or poses starts.

    A scene asks of it what it asks of a run and its timeline: the scans, the path and the map are
    those of now.
    """

    knows_truth = True
    estimate = None

    def __init__(self, scenario: Scenario, *, rng: int = 0) -> None:
        self.world = scenario.world
        self.lrf = scenario.lrf
        self.obstacles = scenario.obstacles
        self.lasers = scenario.lasers
        self.name = scenario.name
        self.radius = scenario.radius
        self.film = replace(USUAL_FILM, points_by=scenario.film.points_by)
        self._fastest = scenario.speed
        self.robot = LiveRobot(scenario, rng=rng)
        self._mapper = line_mapper(scenario.noise, **scenario.mapper)
        self._tracker = ObjectTracker()
        self.facing = self.robot.pose.theta
        """Where a camera behind the robot looks [rad]."""
        self.maps: dict[int, LineMap] = {}
        self.lasting_objects: dict[int, Int] = {}
        self._map_due = 0.0
        self._stale = True
        self.trajectory = SimpleNamespace(times=np.zeros(0), poses=np.zeros((0, 3)))
        """When and where the mapped scans were taken."""
        self._scans: dict[int, tuple[LaserScan, ...]] = {}
        self.latest = self.robot.scans()
        self._map_scan()
        super().__init__(cast(Run, self), playback=1.0)
        # A single scan is not a stop here: the robot drives on.
        self.dwells = False

    def step(self, seconds: float, forward: float = 0.0, turn: float = 0.0) -> bool:
        """Drive on for a time [s], scan and map; false where the robot rests and nothing moves.

        Forward and turn, to the left, are shares of the fastest, from −1 to 1.
        """
        moves = forward or turn or self.robot.speed or self.robot.turning or self.obstacles
        aligned = self.facing == self.robot.pose.theta
        if not moves and aligned and not self._stale and not self.robot.bumped:
            return False
        seconds = min(seconds, _LONGEST_STEP)
        robot = self.robot
        robot.drive(
            seconds,
            _towards(robot.speed, forward, self._fastest, seconds),
            _towards(robot.turning, turn, TURN_RATE, seconds),
        )
        # How fast a camera follows the robot's turns [1/s], and the angle [rad] that it leaves.
        calm = 3.0
        still_angle = 1e-3
        left = (robot.pose.theta - self.facing) * np.exp(-calm * seconds)
        self.facing = robot.pose.theta - float(left) * (abs(left) > still_angle)
        self.latest = self.robot.scans()
        x, y, theta = np.abs(np.array(self.robot.pose) - self.trajectory.poses[-1])
        # Distance [m] and turn [rad] after which another scan is mapped, as a robot at rest sees
        # nothing new and each update takes time; and how often the map is worked out at most [s].
        map_step = 0.12
        map_turn = np.radians(5.0)
        map_pause = 0.25
        if np.hypot(x, y) > map_step or theta > map_turn:
            self._map_scan()
        if self._stale and self.robot.time >= self._map_due:
            number = self.snapshot_after(0) + 1
            self.maps = {number: self._mapper.map}
            self.lasting_objects = {number: self._tracker.follow(self.maps[number])}
            self._map_due = self.robot.time + map_pause
            self._stale = False
        return True

    def driven(self) -> DriveKeys:
        """The path so far: it only grows, so that a page has most of it already."""
        path = self.trajectory
        poses = np.vstack([path.poses, self.robot.pose]) - [*self.origin, 0.0]
        return DriveKeys(np.append(path.times, self.robot.time), poses)

    def poses(self, times: Float) -> Float:
        """Where the robot is now, for each of the times [s], turned as it turns now."""
        turns = np.zeros((len(times), 3))
        turns[:, 2] = self.robot.turning * (times - self.robot.time)
        return np.array(self.robot.pose) + turns

    def moment(self, time: float) -> Moment:
        """What is to be seen now; the latest scan has no number of its own."""
        number = len(self.trajectory.times)
        robot = self.robot
        pose = np.array(robot.pose)
        time = robot.time
        return Moment(time, pose, number, robot.speed, True, time)

    def scan(self, number: int) -> LaserScan:
        """A mapped scan of the first laser by its number; the last one is that of now."""
        return self.scans_at(number)[0]

    def scans_at(self, number: int) -> tuple[LaserScan, ...]:
        """The scans of all lasers by their number."""
        return self._scans.get(number, self.latest)

    def snapshot_after(self, scan: int) -> int:
        """The number of the map, which changes with it; −1 for none."""
        return max(self.maps, default=-1)

    def _map_scan(self) -> None:
        self._mapper.update(self.latest)
        path = self.trajectory
        number = len(self.trajectory.times)
        self._scans[number] = self.latest
        kept = 500  # Scans that are kept: those of the last seconds are still seen.
        self._scans.pop(number - kept, None)
        path.times = np.append(path.times, self.robot.time)
        path.poses = np.vstack([path.poses, self.robot.pose])
        self._stale = True


def _towards(value: float, share: float, fastest: float, seconds: float) -> float:
    """A speed after a time [s] in which it nears a share of the fastest."""
    most = fastest * seconds / _RAMP
    return float(np.clip(share * fastest, value - most, value + most))
