"""What live robots publish, and simulated time, for any middleware.

Commands enter; messages leave as dicts with the fields of ROS. Time advances in ticks; stamps are
exact multiples of the interval between two scans, and never run back.
"""

from collections.abc import Callable
from math import ceil
from pathlib import Path
from time import monotonic

from lrf3d.interrupts import asked
from lrf3d.io import ros_messages as ros
from lrf3d.io.bag_contents import TRANSFORMS
from lrf3d.laser import Stamp
from lrf3d.live import live_fleet
from lrf3d.robot.odometry import WheelOdometry
from lrf3d.ros.driven import DrivenRobot, Messages, Say, Topic
from lrf3d.ros.settings import Settings
from lrf3d.scenario import Scenario

LONGEST_TICK = 0.02
"""Longest tick [s]: the clock, transforms and odometry come at 50 Hz of simulated time or more."""

FINEST_CELL = 0.1
"""Least side of a cell of the published grid [m]: a whole city is then some megabytes."""

LATE, IDLE, CHECKED_EVERY = 0.25, 0.01, 2.0
"""How far ticks may be behind before they count as late, how long clients are served at a time
while time is paused, and from one check of the pace to the next [s]."""

CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", depth=1)
FIXED = Topic("tf_static", TRANSFORMS, depth=1, latched=True)
GRID = Topic("map", "nav_msgs/msg/OccupancyGrid", depth=1, latched=True)


class Stream:
    """Live robots in a world, and the messages that they publish.

    Calls are made from one thread; ``say`` reports what users should know.
    """

    def __init__(self, scenario: Scenario, settings: Settings, say: Say) -> None:
        self.scenario, self.settings, self.say = scenario, settings, say
        self.paused, self._count = False, 0
        self.interval = scenario.scan_interval if settings.rate is None else 1.0 / settings.rate
        self.ticks = ceil(self.interval / LONGEST_TICK - 1e-9)
        """Number of ticks from scan to scan."""
        wheels = scenario.odometry or (WheelOdometry() if settings.wheels else None)
        robots = live_fleet(scenario, settings.robots, rng=settings.rng, wheels=wheels)
        self.robots = [
            DrivenRobot(robot, scenario, settings, f"robot{k}/" if len(robots) > 1 else "", say)
            for k, robot in enumerate(robots, 1)
        ]
        # Compiles kernels and builds search trees before anybody listens.
        robots[0].scans()
        given = {CLOCK: settings.clock, GRID: settings.give != "none", FIXED: True}
        own = [topic for robot in self.robots for topic in robot.topics]
        self.topics = [topic for topic, wanted in given.items() if wanted] + [*dict.fromkeys(own)]
        """All topics that are published."""

    @property
    def stamp(self) -> Stamp:
        """The time of the last tick."""
        return Stamp.of(self.robots[0].robot.time)

    def run(self, publish: Callable[[Messages], None], serve: Callable[[float], None]) -> None:
        """Drive and publish until the program is interrupted; serve clients between two ticks.

        After a standstill of the program, such as a suspended machine, time does not hurry.
        """
        publish(self.first())
        speed_up, lost = self.settings.speed_up, 0.0
        tick = self.interval / self.ticks / speed_up if speed_up else 0.0
        due = checked = monotonic()
        while not asked():
            if not self.paused:
                publish(self.tick())
            due, now = due + (IDLE if self.paused else tick), monotonic()
            if now > due + LATE:
                lost, due = lost + now - due, now
            serve(due - now)
            if (passed := now - checked) > CHECKED_EVERY:
                if speed_up and (share := 1.0 - lost / passed) < 0.97:
                    self.say("warning", f"behind: only {share:.2f} of the speed; scan less often")
                checked, lost = now, 0.0

    def first(self) -> Messages:
        """What is published once: where lasers are mounted, and the map where it is given."""
        mounts = [mount for robot in self.robots for mount in robot.mounts]
        yield FIXED, {"transforms": [ros.transform(self.stamp, *mount) for mount in mounts]}
        if GRID in self.topics:
            world = self.scenario.world
            yield GRID, ros.occupancy_grid(world, FINEST_CELL, self.stamp, Path(world.name))

    def tick(self) -> Messages:
        """Drive on by a tick, and publish where the robots are; scan where an interval ends."""
        if self._count:
            for robot in self.robots:
                robot.show()
            for robot in self.robots:
                robot.drive(self.interval / self.ticks)
        scans = self._count % self.ticks == 0
        # Time is counted, not summed.
        now = self._count * self.interval / self.ticks
        self._count += 1
        for robot in self.robots:
            robot.robot.time = now
            robot.robot.show(0.0, 0.0)
        if self.settings.clock:
            yield CLOCK, {"clock": ros.time_fields(self.stamp)}
        for robot in self.robots:
            yield from robot.messages(self.stamp, scan_time=self.interval if scans else None)

    def step(self) -> Messages:
        """One interval between two scans, also while time is paused."""
        for _ in range(self.ticks):
            yield from self.tick()

    def reset(self) -> None:
        """Put the robots back to their starts; time goes on."""
        for robot in self.robots:
            robot.reset()
