"""A robot that obeys commands as they come, in simulated time.

A scenario and commands enter; true poses, odometry and scans leave. The page and the live topics of
ROS drive it; a simulation, which knows its whole drive, does not need it.
"""

from collections.abc import Callable
from typing import cast

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, generator
from lrf3d.laser import LaserScan
from lrf3d.pose import Pose, as_pose, between, compose
from lrf3d.robot import Unicycle
from lrf3d.robot.collision import CollisionChecker
from lrf3d.scenario import Scenario
from lrf3d.sensor import Sensor

WheelModel = Callable[[Float, np.random.Generator], Float]
"""What wheels measure of an increment (3,): ahead, to the left [m], turn [rad]."""


class LiveRobot:
    """A robot from where a scenario with a route or poses starts.

    Nobody knows where it will drive while a beam turns, so a scan takes no time. Without a wheel
    model the odometry is exact.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        rng: np.random.Generator | int | None = 0,
        wheels: WheelModel | None = None,
    ) -> None:
        self.scenario, self.wheels, self._rng = scenario, wheels, generator(rng)
        self._walls, self._body = CollisionChecker(scenario.world), Unicycle(scenario.radius)
        self._sensor = Sensor(
            scenario.world,
            scenario.lrf,
            caster="embree",
            noise=scenario.noise,
            obstacles=scenario.obstacles,
        )
        self.start = scenario.start or as_pose(cast(Float, scenario.poses)[0])
        self.time, self.speed, self.turning, self.bumped = 0.0, 0.0, 0.0, False
        self.restart()

    def restart(self) -> None:
        """Put the robot and its odometry back to the start; time goes on."""
        self.pose, self.speed, self.turning = self.start, 0.0, 0.0
        self.odometry = np.array(self.start)

    def place(self, pose: Pose) -> None:
        """Put the robot elsewhere, at rest; its wheels do not notice unless they are exact.

        Raises:
            InputError: The robot would stand in a wall.
        """
        if self._touches(pose, pose):
            raise InputError(f"({pose.x:g}, {pose.y:g}): the robot would stand in a wall")
        self.pose, self.speed, self.turning = pose, 0.0, 0.0
        if self.wheels is None:
            self.odometry = np.array(pose)

    def drive(self, seconds: float, speed: float, turning: float) -> None:
        """Drive an exact arc for a time; where it would touch something, turn on the spot."""
        last, self.speed, self.turning = self.pose, speed, turning
        self.time += seconds
        goal = self._body.move(last, speed, turning, seconds)
        self.bumped = goal[:2] != last[:2] and self._touches(last, goal)
        if self.bumped:
            # A round robot can still turn.
            self.speed, goal = 0.0, Pose(last.x, last.y, goal.theta)
        self.pose = goal
        increment = between(np.array(last), np.array(goal))
        if self.wheels is None:
            self.odometry = np.array(goal)
        elif increment.any():
            self.odometry = compose(self.odometry, self.wheels(increment, self._rng))

    def scan(self) -> LaserScan:
        """Measure from where the robot is now."""
        true_scan = self._sensor.cast(np.array(self.pose), self.time)
        return self._sensor.noisy(true_scan, self._rng)

    def _touches(self, here: Pose, there: Pose) -> bool:
        """Whether the body touches a wall on a straight way, or an obstacle at its end."""
        start, end = np.array([here[:2]]), np.array([there[:2]])
        return bool(len(self._walls.hit(start, end, self._body.radius)[0])) or any(
            one.distances(end, np.array([self.time]))[0] < self._body.radius
            for one in self.scenario.obstacles
        )
