"""A drive by hand: the robot obeys, scans and maps while it goes, among all that moves.

Speeds enter step by step; a scene shows the path, the scans and the map of now.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.laser import DepthImage, LaserScan, LidarScan
from lrf3d.mapping import LineMap
from lrf3d.planning.planner import planned_way
from lrf3d.robot.following import MAX_TURN_RATE
from lrf3d.simulation.live import LiveRobot
from lrf3d.simulation.loop import line_mapper
from lrf3d.simulation.scenario import Scenario
from lrf3d.simulation.sensor import Caster
from lrf3d.studio.page.errand import Errand
from lrf3d.studio.scene.timeline import DriveKeys, Moment, Timeline
from lrf3d.world.cameras import USUAL_FILM

# Time from standing to full speed, and back [s].
_RAMP = 0.25

# Longest step of the drive [s], so that the robot does not jump after a delay.
_LONGEST_STEP = 0.1

# Rate at which the camera follows the robot's turns [1/s]: in a third of a second by two thirds.
_CALM = 3.0

# Difference [rad] at which the camera has caught up with the robot.
_STILL_ANGLE = 1e-3

# Distance [m] after which another scan is mapped: a robot at rest sees nothing new, and each
# update of the map takes time.
_MAP_STEP = 0.12

# Turn [rad] after which another scan is mapped.
_MAP_TURN = np.radians(5.0)

# Least time between two maps [s], as working a map out takes longer than adding a scan to it.
_MAP_PAUSE = 0.25

# Number of scans that are kept: those of the last seconds still fade.
_KEPT_SCANS = 500


class DrivenPath:
    """Where a robot that goes on has scanned; adding a scan to a long path copies nothing."""

    def __init__(self, robot: LiveRobot) -> None:
        self._robot = robot
        # Times and poses, of which the first rows are taken: full arrays double.
        self._rows = np.zeros((64, 4))
        self._count = 0

    @property
    def times(self) -> Float:
        """Times (k,) of the scans [s]."""
        return self._rows[: self._count, 0]

    @property
    def poses(self) -> Float:
        """Poses (k, 3) of the robot at the scans."""
        return self._rows[: self._count, 1:]

    def append(self) -> None:
        """Add the time and the pose of the robot as it is now."""
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        self._rows[self._count] = (self._robot.time, *self._robot.pose)
        self._count += 1

    def at(self, times: Float) -> Float:
        """Poses (m, 3) at times (m,) [s] near now: the robot's, turned as it turns now."""
        turns = np.zeros((len(times), 3))
        turns[:, 2] = self._robot.turning * (times - self._robot.time)
        return np.array(self._robot.pose) + turns

    def keys(self, origin: Float) -> DriveKeys:
        """The path up to now, in a frame with an origin (2,): it only grows."""
        poses = np.vstack([self.poses, self._robot.pose]) - [*origin, 0.0]
        return DriveKeys(np.append(self.times, self._robot.time), poses)


class HandDrive:
    """The robot of a page, from where a scenario with a route or poses starts.

    It is :class:`~lrf3d.studio.scene.shown.Shown`: its scans, its path and its map are those of
    now.
    """

    knows_truth = True
    estimate = None
    attitudes = None
    # It is shown as fast as it drives.
    playback = 1.0

    def __init__(
        self, scenario: Scenario, *, rng: int = 0, caster: Caster | str = "embree"
    ) -> None:
        self.world = scenario.world
        self.obstacles = scenario.obstacles
        self.lasers = scenario.lasers
        self.name = scenario.name
        self.radius = scenario.radius
        self.film = replace(USUAL_FILM, points_by=scenario.film.points_by)
        self._fastest = scenario.speed
        self.robot = LiveRobot(scenario, rng=rng, caster=caster)
        # Where a camera behind the robot looks [rad].
        self.facing = self.robot.pose.theta
        self._mapper = line_mapper(scenario.noise, **scenario.mapper)
        # The newest map, by its number.
        self.maps: dict[int, LineMap] = {}
        self._map_due = 0.0
        # Whether scans were mapped after the newest map.
        self._stale = False
        self.trajectory = DrivenPath(self.robot)
        self._scans: dict[int, tuple[LaserScan, ...]] = {}
        self.latest = self.robot.scans()
        self._map_scan()
        self._errand: Errand | None = None
        self._lost = False

    @property
    def obstruction(self) -> str:
        """What keeps the robot from its goal, in words."""
        if self._lost:
            return "there is no way to this place"
        return "a wall is in the way" if self.robot.bumped else ""

    def go_to(self, place: Float, heading: float | None = None) -> None:
        """Drive to a place (2,) [m] along a planned path, and turn to a heading [rad] there."""
        way = planned_way(self.world, np.array(self.robot.pose[:2]), place, self.radius)
        self._lost = way is None
        self._errand = None if way is None else Errand(way, heading)

    def step(self, seconds: float, forward: float = 0.0, turn: float = 0.0) -> bool:
        """Drive on for a time [s], scan and map; false where the robot rests and nothing moves.

        Forward and turn, to the left, are shares of the fastest, from −1 to 1.
        """
        robot = self.robot
        if forward or turn:
            self._errand = None
            self._lost = False
        if self._errand is not None:
            speed, turn = self._errand.command(np.array(robot.pose))
            forward = min(speed / self._fastest, 1.0)
            if self._errand.done:
                self._errand = None
        unsettled = self._stale or robot.bumped or self.facing != robot.pose.theta
        moves = any((forward, turn, robot.speed, robot.turning, self.obstacles))
        if not (moves or unsettled):
            return False
        seconds = min(seconds, _LONGEST_STEP)
        robot.drive(
            seconds,
            _towards(robot.speed, forward, self._fastest, seconds),
            _towards(robot.turning, turn, MAX_TURN_RATE, seconds),
        )
        left = (robot.pose.theta - self.facing) * float(np.exp(-_CALM * seconds))
        self.facing = robot.pose.theta - left * (abs(left) > _STILL_ANGLE)
        self.latest = robot.scans()
        x, y, theta = np.abs(np.array(robot.pose) - self.trajectory.poses[-1])
        if np.hypot(x, y) > _MAP_STEP or theta > _MAP_TURN:
            self._map_scan()
        if self._stale and robot.time >= self._map_due:
            number = self.snapshot_after(0) + 1
            self.maps = {number: self._mapper.map}
            self._map_due = robot.time + _MAP_PAUSE
            self._stale = False
        return True

    def scans_at(self, number: int) -> tuple[LaserScan, ...]:
        """The scans of all lasers by their number; that of the latest follows the mapped ones."""
        return self._scans.get(number, self.latest)

    def clouds(self, number: int) -> tuple[Iterator[LidarScan], Iterator[DepthImage]]:
        """What the lidars and the depth cameras see now."""
        return self.robot.clouds()

    def snapshot_after(self, scan: int) -> int:
        """The number of the map, which changes with it; −1 for none."""
        return max(self.maps, default=-1)

    def _map_scan(self) -> None:
        self._mapper.update(self.latest)
        number = len(self.trajectory.times)
        self._scans[number] = self.latest
        self._scans.pop(number - _KEPT_SCANS, None)
        self.trajectory.append()
        self._stale = True


class DriveTimeline(Timeline):
    """The timeline of a drive by hand, of which nothing but the present is seen."""

    def __init__(self, drive: HandDrive) -> None:
        super().__init__(drive)
        self._robot = drive.robot
        # A single scan is not a stop here: the robot drives on.
        self.dwells = False

    def poses(self, times: Float) -> Float:
        """Where the robot is now, for each of the times [s], turned as it turns now."""
        return self.run.trajectory.at(times)

    def moment(self, time: float) -> Moment:
        """What is to be seen now; the latest scan has the number after the mapped ones."""
        now = self._robot.time
        return Moment(
            now,
            np.array(self._robot.pose),
            len(self.run.trajectory.times),
            self._robot.speed,
            True,
            now,
        )


def _towards(value: float, share: float, fastest: float, seconds: float) -> float:
    """A speed after a time [s] in which it nears a share of the fastest."""
    most = fastest * seconds / _RAMP
    return float(np.clip(share * fastest, value - most, value + most))
