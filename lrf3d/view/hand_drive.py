"""A drive by hand: the robot obeys, scans and maps while it goes, among all that moves.

What is seen of it is a scene of its own, whose run grows.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import cast

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap
from lrf3d.mapping.tracking import ObjectTracker
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory, Unicycle
from lrf3d.robot.collision import CollisionChecker
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scene.moments import Scene
from lrf3d.scene.shapes import Lines
from lrf3d.scene.stage import Stage
from lrf3d.scene.timeline import DriveKeys, Moment, Timeline
from lrf3d.scene.trail_and_map import DrawnMap, trail_lines
from lrf3d.sensor import Sensor
from lrf3d.simulation import line_mapper
from lrf3d.world.cameras import USUAL_FILM

TURN_RATE = 1.5
"""Fastest turn [rad/s]: a full one in four seconds."""

_RAMP = 0.35
"""Time [s] from standing to full speed: hands like a soft start and a quick one."""

_STOP = 0.2
"""Time [s] from full speed to standing."""

_LONGEST_STEP = 0.1
"""A step of the drive lasts at most this [s], so that no hitch sends the robot off."""

_MAP_STEP, _MAP_TURN = 0.12, np.radians(5.0)
"""Distance [m] and turn [rad] after which another scan is mapped: a robot at rest sees nothing new,
and each update takes time."""

_MAP_SHARE = 0.2
"""Share of the time that may go into working out the map."""

_KEPT = 500
"""Scans that are kept: those of the last seconds are still seen."""

_MAP_PAUSE = 0.25
"""The map is worked out no more often than this [s]."""


@dataclass(frozen=True, slots=True)
class Wish:
    """What the hand wants: forward and turn (to the left), each from −1 to 1."""

    forward: float = 0.0
    turn: float = 0.0


class HandDrive:
    """The robot of a page, from where it starts; noise of a seed is the same after each restart.

    Working out the map is measured with a clock [s].
    """

    def __init__(
        self,
        scenario: Scenario,
        start: Pose,
        *,
        rng: int = 0,
        stage: Stage | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._scenario, self._start, self._seed = scenario, start, rng
        self._collisions = CollisionChecker(scenario.world)
        self._robot = Unicycle(scenario.radius)
        self.obstacles = scenario.obstacles
        # Where the hand will drive while a beam turns nobody knows: a scan takes no time.
        self._sensor = Sensor(
            scenario.world,
            scenario.lrf,
            caster="embree",
            noise=scenario.noise,
            obstacles=self.obstacles,
        )
        self._clock = clock
        self.wish = Wish()
        self.restart()
        self.scene = _LiveScene(self, stage)

    def restart(self) -> None:
        """Go back to the start with an empty map."""
        self.pose, self.time = self._start, 0.0
        self.speed = self.turning = 0.0
        self.bumped = False
        self._fresh = True
        self._rng = np.random.default_rng(self._seed)
        self._mapper = line_mapper(self._scenario.noise, **self._scenario.mapper)
        self._tracker = ObjectTracker()
        self.line_map, self.objects = LineMap.empty(), np.zeros(0, np.int64)
        self.map_number = 0
        self._mapped: Pose | None = None
        self.kept: dict[int, LaserScan] = {}
        self.times: list[float] = []
        self.path: list[tuple[float, Pose]] = [(0.0, self._start)]
        self.scan = self._scan()
        self._stale = False
        self._map_due = 0.0

    def step(self, seconds: float) -> bool:
        """Drive on for a time [s], scan and map; false where the robot rests and nothing moves."""
        seconds = min(seconds, _LONGEST_STEP)
        if self._rests():
            return False
        self._fresh = False
        self._drive(seconds)
        self.scan = self._scan()
        if self._worth_mapping():
            self._mapper.update(self.scan)
            self._mapped, self._stale = self.pose, True
            self.kept[len(self.times)] = self.scan
            self.kept.pop(len(self.times) - _KEPT, None)
            self.times.append(self.time)
        if self.pose[:2] != self.path[-1][1][:2]:
            self.path.append((self.time, self.pose))
        if self._stale and self._clock() >= self._map_due:
            self._map()
        return True

    def moment(self) -> Moment:
        """What is to be seen now; the newest scan has no number of its own."""
        return Moment(self.time, np.array(self.pose), len(self.times), self.speed, True)

    @property
    def counts(self) -> str:
        """What the map holds, in words."""
        return self.line_map.counts

    def _rests(self) -> bool:
        """Whether nothing has changed and nothing will: then the clock stands still, too."""
        moves = self.speed or self.turning or self.wish != Wish() or self.obstacles
        return not (moves or self._fresh or self._stale or self.bumped)

    def _drive(self, seconds: float) -> None:
        """Follow the wish, and stop where the next step would touch a wall."""
        fastest = self._scenario.speed
        self.speed = _towards(self.speed, self.wish.forward * fastest, fastest, seconds)
        self.turning = _towards(self.turning, self.wish.turn * TURN_RATE, TURN_RATE, seconds)
        self.time += seconds
        self.bumped = False
        goal = self._robot.move(self.pose, self.speed, self.turning, seconds)
        if goal[:2] != self.pose[:2]:
            way = Trajectory([0.0, max(seconds, 1e-6)], [self.pose, goal])
            if self._collisions.first(way, self._robot.radius) is not None:
                # A round robot can still turn on the spot.
                self.bumped, self.speed = True, 0.0
                goal = Pose(self.pose.x, self.pose.y, goal.theta)
        self.pose = goal

    def _scan(self) -> LaserScan:
        _, scan = self._sensor.measure(np.array(self.pose), self.time, self._rng)
        return scan

    def _worth_mapping(self) -> bool:
        if self._mapped is None:
            return True
        gone = np.hypot(self.pose.x - self._mapped.x, self.pose.y - self._mapped.y)
        return bool(gone > _MAP_STEP or abs(self.pose.theta - self._mapped.theta) > _MAP_TURN)

    def _map(self) -> None:
        begin = self._clock()
        self.line_map = self._mapper.map
        self.objects = self._tracker.follow(self.line_map)
        taken = self._clock() - begin
        self._map_due = self._clock() + max(_MAP_PAUSE, taken / _MAP_SHARE)
        self._stale = False
        self.map_number += 1


class _LiveTimeline(Timeline):
    """The timeline of a drive that knows only where the robot is now."""

    def __init__(self, run: Run, drive: HandDrive) -> None:
        self._drive = drive
        super().__init__(run, playback=1.0)

    def poses(self, times: Float) -> Float:
        """Where the robot is now, for each of the times."""
        return np.tile(np.array(self._drive.pose), (len(times), 1))


class _LiveScene(Scene):
    """The scene of a drive: scans, trail and map are those of now."""

    def __init__(self, drive: HandDrive, stage: Stage | None) -> None:
        scan, scenario = drive.scan, drive._scenario
        path = Trajectory([0.0], [drive.pose])
        ranges, walls = scan.ranges[None], scan.walls[None]
        film = replace(USUAL_FILM, points_by=scenario.points_by)
        run = Run(
            scenario.world, scenario.lrf, path, ranges, ranges, walls, (), (), drive.obstacles, film
        )
        super().__init__(_LiveTimeline(run, drive), stage=stage)
        self._drive = drive
        self.run = cast(Run, _Growing(run, drive))

    def drawn_map(self, scan: int) -> DrawnMap:
        """The map as it is known now."""
        drive = self._drive
        made: DrawnMap = self._same(
            "drawn", drive.map_number, DrawnMap.from_map, drive.line_map, drive.objects, self.origin
        )
        return made

    def _trail(self, moment: Moment) -> Lines | None:
        made: Lines = self._same("trail", (moment.time, len(self._drive.path)), self._driven)
        return made

    def _driven(self) -> Lines:
        times = np.array([time for time, _ in self._drive.path])
        poses = np.array([pose for _, pose in self._drive.path]) - [*self.origin, 0.0]
        keys = DriveKeys(times, poses)
        return trail_lines(keys, self._drive.time, self._fade)


class _Growing:
    """What a scene asks of a run, of one that is still driven."""

    knows_truth = True

    def __init__(self, run: Run, drive: HandDrive) -> None:
        self._drive = drive
        self.world, self.lrf, self.obstacles, self.film = (
            run.world,
            run.lrf,
            run.obstacles,
            run.film,
        )

    @property
    def trajectory(self) -> SimpleNamespace:
        """When the scans were taken that are kept."""
        drive = self._drive
        poses = np.array([drive._start])
        return SimpleNamespace(times=np.array(drive.times), poses=poses)

    def scan(self, number: int) -> LaserScan:
        """A scan by its number; the last one is that of now."""
        drive = self._drive
        return drive.kept.get(number, drive.scan)

    def snapshot_after(self, scan: int) -> int:
        """The number of the map."""
        return self._drive.map_number


def _towards(value: float, wanted: float, full: float, seconds: float) -> float:
    """A speed that nears the wanted one, quicker when it slows down than when it gains."""
    slows = abs(wanted) < abs(value) or wanted * value < 0.0
    change = full * seconds / (_STOP if slows else _RAMP)
    return float(np.clip(wanted, value - change, value + change))
