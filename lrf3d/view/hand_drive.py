"""A drive by hand: the robot obeys, scans and maps while it goes, among all that moves."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.laser import LaserScan
from lrf3d.mapping.tracking import ObjectTracker
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory, Unicycle
from lrf3d.robot.collision import CollisionChecker
from lrf3d.scenario import Scenario
from lrf3d.scene.map_bands import WallTops
from lrf3d.scene.structures import Sight
from lrf3d.scene.trail_and_map import DrawnMap
from lrf3d.sensor import Sensor
from lrf3d.simulation import line_mapper
from lrf3d.view.page_data import joined_beams

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

_MAP_PAUSE = 0.25
"""The map is worked out no more often than this [s]."""


@dataclass(frozen=True, slots=True)
class Wish:
    """What the hand wants: forward and turn (to the left), each from −1 to 1."""

    forward: float = 0.0
    turn: float = 0.0


class HandDrive:
    """The robot of a page.

    Args:
        scenario: The world, and how robot, range finder, noise and mapper are set up.
        start: Where the robot starts.
        rng: A seed of the noise, the same after each restart.
        clock: Gives the time [s] that working out the map is measured with.
    """

    def __init__(
        self,
        scenario: Scenario,
        start: Pose,
        *,
        rng: int = 0,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._origin = Sight.of(scenario.world, np.array([start[:2]])).origin
        self._scenario, self._start, self._seed = scenario, start, rng
        self._obstacles = CollisionChecker(scenario.world)
        walls = scenario.world.segments - np.tile(self._origin, 2)
        self._tops = WallTops(walls, scenario.world.heights)
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

    def restart(self) -> None:
        """Go back to the start with an empty map."""
        self.pose, self.time = self._start, 0.0
        self.speed = self.turning = 0.0
        self.bumped = False
        self._fresh = True
        self._rng = np.random.default_rng(self._seed)
        self._mapper = line_mapper(self._scenario.noise, **self._scenario.mapper)
        self._tracker = ObjectTracker()
        self._mapped: Pose | None = None
        self._stale = False
        self._map_due = 0.0

    def step(self, seconds: float) -> dict[str, Any] | None:
        """Drive on for a time [s], scan and map; return what the page shows, as plain values.

        Where the robot rests and nothing moves, there is no news: None.
        """
        seconds = min(seconds, _LONGEST_STEP)
        if self._rests():
            return None
        self._drive(seconds)
        scan = self._scan()
        if self._worth_mapping():
            self._mapper.update(scan)
            self._mapped, self._stale = self.pose, True
        news = self._news(scan)
        if self._stale and self._clock() >= self._map_due:
            news["map"] = self._map()
        return news

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
            if self._obstacles.first(way, self._robot.radius) is not None:
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

    def _map(self) -> dict[str, Any]:
        begin = self._clock()
        line_map = self._mapper.map
        drawn = DrawnMap.from_map(line_map, self._tracker.follow(line_map), self._origin)
        taken = self._clock() - begin
        self._map_due = self._clock() + max(_MAP_PAUSE, taken / _MAP_SHARE)
        self._stale = False
        return {
            "segments": np.round(drawn.segments, 3).ravel().tolist(),
            "colours": drawn.colour_bytes.ravel().tolist(),
            "tops": np.round(self._tops.bands(drawn.segments), 3).tolist(),
            "objects": line_map.object_count,
        }

    def _moved(self) -> list[float]:
        """Poses of the dynamic obstacles in turn: x, y [m] in the local frame, theta [rad]."""
        shift = np.array([*self._origin, 0.0])
        return [
            value
            for obstacle in self.obstacles
            for value in (obstacle.path.at(np.array([self.time]))[0] - shift).tolist()
        ]

    def _news(self, scan: LaserScan) -> dict[str, Any]:
        x, y = (self.pose[:2] - self._origin).tolist()
        pose = {"x": x, "y": y, "theta": self.pose.theta}
        ranges = np.where(scan.hits, np.round(scan.ranges, 3), -1.0 * (scan.ranges < 0.0))
        fresh, self._fresh = self._fresh, False
        return {
            "time": self.time,
            "pose": {**pose, "speed": self.speed, "turning": self.turning},
            "scanPose": pose,
            # JSON knows no infinity: a beam without return is null.
            "ranges": [
                None if np.isposinf(r) else v
                for r, v in zip(scan.ranges, ranges.tolist(), strict=True)
            ],
            "obstacles": self._moved(),
            "joined": joined_beams(scan.ranges, scan.walls).tolist(),
            "bumped": self.bumped,
            "fresh": fresh,
            "map": None,
        }


def _towards(value: float, wanted: float, full: float, seconds: float) -> float:
    """A speed that nears the wanted one, quicker when it slows down than when it gains."""
    slows = abs(wanted) < abs(value) or wanted * value < 0.0
    change = full * seconds / (_STOP if slows else _RAMP)
    return float(np.clip(wanted, value - change, value + change))
