"""DriveTask: robots that each drive to a goal without collisions.

The input is the commands of all robots; the output is their observations and rewards, and which
have finished. The robots are in one world but do not see each other: each is a separate attempt.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lrf3d.casting import PlanarCaster
from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int, numbers, wrap_angle
from lrf3d.laser import LaserScan, ProportionalNoise
from lrf3d.laser.noise import at_sigma
from lrf3d.planning.free_space import free_places
from lrf3d.pose import Pose
from lrf3d.robot.collision import CollisionChecker
from lrf3d.robot.unicycle import arcs
from lrf3d.scenario import Scenario
from lrf3d.sensor import Sensor

GOAL_NEAR, GOAL_FAR = 5.0, 20.0
"""Least and largest distance of a goal from the start [m], in a world large enough."""

CANDIDATES = 32
"""Number of random candidates for a goal, of which the first at such a distance is used."""

GOAL_RADIUS = 0.5
"""Distance from its goal at which a robot has arrived [m]."""

AT_GOAL, AT_WALL = 10.0, -10.0
"""Rewards at the goal and for a collision."""

EACH_STEP = -0.01
"""Reward of each step, so that fast drives score higher."""

ACTION_TURN_RATE = 1.5
"""Largest turn rate of an action [rad/s], equal to that of the route follower."""

GOAL_MARGIN = 0.1
"""Clearance of a robot from walls at its start, in addition to its radius [m]."""


class DriveTask:
    """Robots, each with a pose and a goal.

    Args:
        scenario: The world and its dynamic obstacles, the range finder and its noise, the robot's
            radius and speed, and its pace.
        count: Number of robots.
        sigma: Another standard deviation of the ranges [m] at range_max (Eq. 7); that of the
            scenario if not given. With 0 the ranges are true.

    Raises:
        InputError: The noise is invalid, or there is no free space to drive in.
    """

    def __init__(self, scenario: Scenario, count: int, *, sigma: float | None = None) -> None:
        noise = scenario.noise
        if sigma is not None:
            noise = at_sigma(noise, sigma) if sigma else ProportionalNoise(sigma)
        self.scenario, self.count = scenario, count
        self.lrf, self.dt = scenario.lrf, scenario.scan_interval
        # A scan takes no time, because the robot decides on its motion after it.
        self._caster = PlanarCaster(scenario.world)
        self._sensor = Sensor(
            scenario.world, self.lrf, caster=self._caster, noise=noise,
            obstacles=scenario.obstacles,
        )  # fmt: skip
        self._checker = CollisionChecker(scenario.world)
        least = scenario.radius + GOAL_MARGIN
        self._cells = free_places(scenario.world, least)
        self.farthest = float(np.hypot(*np.ptp(self._cells, axis=0))) + GOAL_FAR
        self.poses, self.goals = np.zeros((count, 3)), np.zeros((count, 2))
        self.times = np.zeros(count)

    def place(self, robots: Int, rng: np.random.Generator) -> None:
        """Place some robots, each with a new pose and a new goal."""
        cells = self._cells[rng.integers(len(self._cells), size=(len(robots), CANDIDATES + 1))]
        starts, goals = cells[:, 0], cells[:, 1:]
        distances = np.hypot(*np.moveaxis(goals - starts[:, None], 2, 0))
        # Distance of each candidate from the limits; argmin takes the first of those within them.
        misfit = np.maximum(GOAL_NEAR - distances, distances - GOAL_FAR).clip(min=0.0)
        self.goals[robots] = goals[np.arange(len(robots)), misfit.argmin(axis=1)]
        headings = rng.uniform(-np.pi, np.pi, len(robots))
        self.poses[robots] = np.column_stack([starts, headings])
        self.times[robots] = 0.0

    def step(self, actions: ArrayLike) -> tuple[Float, Bool, Bool]:
        """Drive for the time between two scans, with actions (k, 2).

        They are shares of the scenario's speed and of the fastest turn, left positive, clipped to
        −1 to 1. Returns (k,) each: the rewards, which robots are at their goal, and which hit a
        wall or a dynamic obstacle and so stay at their last pose.

        Raises:
            InputError: They are not finite numbers of this shape; no robot moves then.
        """
        given = numbers(actions, "actions")
        if given.shape != (self.count, 2):
            raise InputError(f"actions {given.shape}: expected {(self.count, 2)}")
        if not (finite := np.isfinite(given).all(axis=1)).all():
            robot = int(np.argmin(finite))
            raise InputError(
                f"action of robot {robot}: {given[robot].tolist()}; expected finite numbers from -1"
                " to 1"
            )
        shares = np.clip(given, -1.0, 1.0)
        v, omega = self.scenario.speed * shares[:, 0], ACTION_TURN_RATE * shares[:, 1]
        before = self.distances()
        moved = arcs(self.poses, v, omega, np.full(self.count, self.dt))
        hits, _ = self._checker.hit(self.poses[:, :2], moved[:, :2], self.scenario.radius)
        collided = np.zeros(self.count, np.bool_)
        collided[hits] = True
        moved[:, 2] = wrap_angle(moved[:, 2])
        self.times += self.dt
        for obstacle in self.scenario.obstacles:
            collided |= obstacle.distances(moved[:, :2], self.times) < self.scenario.radius
        self.poses = np.where(collided[:, None], self.poses, moved)
        after = self.distances()
        reached = (after < GOAL_RADIUS) & ~collided
        rewards = before - after + EACH_STEP + AT_GOAL * reached + AT_WALL * collided
        return rewards, reached, collided

    def distances(self) -> Float:
        """Distances (k,) of the robots from their goals [m]."""
        away = self.goals - self.poses[:, :2]
        return np.hypot(away[:, 0], away[:, 1])

    def scan(self, rng: np.random.Generator) -> tuple[Float, Float, Int]:
        """Measured and true ranges, and walls, (k, beams) each, after REP 117."""
        sensor, scenario = self._sensor, self.scenario
        noisy = sensor.noise != ProportionalNoise(0.0)
        # Intensities are of single scans, as are the places of dynamic obstacles.
        if scenario.obstacles or scenario.world.materials:
            scans = [
                sensor.cast(self.lrf, pose, time)
                for pose, time in zip(self.poses, self.times.tolist(), strict=True)
            ]
            truth = np.array([scan.ranges for scan in scans])
            walls = np.array([scan.walls for scan in scans])
        else:
            truth, walls = self._caster.scan_batch(self.lrf, self.poses)
            if not noisy:
                return truth, truth, walls
            rows = zip(self.poses.tolist(), self.times.tolist(), truth, walls, strict=True)
            scans = [
                LaserScan.unchecked(self.lrf, Pose(*pose), *row).at_time(time)
                for pose, time, *row in rows
            ]
        return np.array([sensor.noisy(scan, rng).ranges for scan in scans]), truth, walls

    def observe(self, ranges: Float) -> dict[str, NDArray[np.float32]]:
        """The observations of the robots, in finite float32 numbers.

        A beam without return has range_max, one below range_min has 0: the limits of what can be
        measured.
        """
        away = self.goals - self.poses[:, :2]
        bearings = np.arctan2(away[:, 1], away[:, 0]) - self.poses[:, 2]
        distances = np.minimum(self.distances(), self.farthest)
        goal = np.column_stack([distances, np.cos(bearings), np.sin(bearings)])
        return {
            "goal": goal.astype(np.float32),
            "ranges": np.clip(ranges, 0.0, self.lrf.range_max).astype(np.float32),
        }
