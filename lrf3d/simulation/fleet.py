"""Several robots at once: each drives, scans and maps, and sees and touches the others."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from heapq import heapify, heapreplace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import CollisionError, InputError, check_names, each_of, expect, shown
from lrf3d.base.interrupts import Progress, silent, stoppable
from lrf3d.casting.collision import (
    ROBOT_HEIGHT,
    Body,
    Collision,
    CollisionChecker,
    find_collision,
    robots_among,
)
from lrf3d.casting.crowd import Crowd, move_of
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.geometry.lines import ROUNDING, Float, Int, generator, lengths
from lrf3d.geometry.pose import Pose, as_pose, as_poses
from lrf3d.laser import LaserRangeFinder
from lrf3d.robot import Trajectory
from lrf3d.robot.kinematics import RADIUS
from lrf3d.simulation.driven import STILL, Driven
from lrf3d.simulation.loop import Simulation
from lrf3d.simulation.mappers import Mapper
from lrf3d.simulation.recorder import Collection
from lrf3d.simulation.run import Run
from lrf3d.simulation.sensor import caster_of
from lrf3d.simulation.steering import ControlledDrive, Controller, as_drive
from lrf3d.world import World

# Room [m] between two robots at the ends of their parts of a route: they cut corners.
APART = 0.5

# Largest number of places of a route that are compared with each other.
MOST_SPOTS = 2000

# Number of scans for which giving way is planned at a time: memory grows with its square.
WINDOW = 1000


@stoppable()
def simulate_fleet(
    world: World,
    drives: Sequence[Trajectory | ArrayLike | Controller],
    lrf: LaserRangeFinder | Sequence[LaserRangeFinder] | None = None,
    *,
    starts: Sequence[Sequence[float]] | Float | None = None,
    radius: float = RADIUS,
    outline: ArrayLike | None = None,
    height: float = ROBOT_HEIGHT,
    obstacles: Sequence[DynamicObstacle] = (),
    on_collision: str = "raise",
    mapper: Callable[[], Mapper] | None = None,
    rng: np.random.Generator | int | None = None,
    progress: Progress = silent,
    **settings: Any,
) -> list[Run]:
    """Drive several robots through a world at the same time.

    Args:
        world: The walls.
        drives: The drive of each robot: a Trajectory, before and after which the robot is at rest,
            poses (k, 3) a second apart, or a controller, as for a `Simulation`.
        lrf: The laser range finder of each robot, or several; it does not see its own robot.
        starts: Initial poses (n, 3), required where there are controllers.
        radius: Radius of the robots [m].
        outline: (n, 2) their outline [m] instead, x ahead.
        height: Height of the robots [m].
        obstacles: The dynamic obstacles.
        on_collision: What ends a controller's robot that touches a wall, an obstacle or another
            robot: ``raise``, or ``stop``, which lets it rest up to its next scan. Other drives are
            not checked; `check_drive` does.
        mapper: Makes the mapper of each robot; a LineMapper set up for the noise if not given.
        rng: A generator for the noise, or a seed; each robot has its own noise.
        progress: Called with the number of finished scans, and of all.
        **settings: ``caster``, ``noise``, ``scans`` and other arguments of `Simulation`.

    Raises:
        InputError: A scan takes longer than the interval to the next, or a controller has no start.
        CollisionError: A controller drives its robot into something.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> drives = [lrf3d.follow_route([[1, 1], [2, 1]]), lrf3d.follow_route([[1, 2], [2, 2]])]
        >>> runs = lrf3d.simulate_fleet(room, drives, rng=0)
        >>> len(runs)
        2
    """
    expect(world, World, "world")
    expect(progress, Callable, "progress")
    if mapper is not None and not callable(mapper):
        raise InputError(f"mapper {shown(mapper)}: expected a function that makes that of a robot")
    check_names("on_collision", [on_collision], ("raise", "stop"))
    obstacles = tuple(each_of(obstacles, DynamicObstacle, "obstacle"))
    body = Body(radius, outline)
    kept, places = _started(drives, starts)
    paths = [
        drive if isinstance(drive, Trajectory) else Trajectory([0.0], [start])
        for drive, start in zip(kept, places, strict=True)
    ]
    bodies, crowd = robots_among(body, paths, obstacles, height)
    # What they touch is known only when all of them have their commands.
    shared = caster_of(settings.get("caster", "embree"), world)
    settings |= {"radius": body.reach, "on_collision": "ignore", "lrf": lrf, "caster": shared}
    simulations = [
        Simulation(
            world, drive, rng=own, obstacles=crowd.without(robot), start=start,
            mapper=None if mapper is None else mapper(), **settings,
        )
        for robot, (drive, start, own) in enumerate(
            zip(kept, places, generator(rng).spawn(len(kept)), strict=True)
        )
    ]  # fmt: skip
    names = [f"robot {k}" for k in range(len(bodies))]
    names += [f"dynamic obstacle {k}" for k in range(len(obstacles))]
    checker = CollisionChecker(world, crowd, names=names)
    touches = _Touches(checker, crowd, body, on_collision == "stop")
    for robot, simulation in enumerate(simulations):
        touches.add(robot, simulation.drive)
    runs = _drive_all(simulations, touches, progress)
    return _among_each_other(runs, kept, bodies, obstacles)


def _started(
    drives: Sequence[Any], starts: Sequence[Sequence[float]] | Float | None
) -> tuple[list[Trajectory | Controller], list[Pose]]:
    """The drives of a fleet, and the pose at which the robot of each controller starts."""
    if not isinstance(drives, list | tuple):
        raise InputError(f"drives {shown(drives)}: expected a list of one a robot")
    kept = [as_drive(drive) for drive in drives]
    places: Float = np.zeros((len(kept), 3)) if starts is None else as_poses(starts)
    if len(places) != len(kept):
        raise InputError(f"{len(places)} starts of {len(kept)} robots: expected as many")
    for robot, drive in enumerate(kept):
        if starts is None and not isinstance(drive, Trajectory):
            raise InputError(
                f"robot {robot}: a controller without a pose to start at; give starts="
            )
    return kept, [as_pose(start) for start in places]


def _among_each_other(
    runs: Sequence[Run],
    drives: Sequence[Trajectory | Controller],
    bodies: Sequence[DynamicObstacle],
    obstacles: Sequence[DynamicObstacle],
) -> list[Run]:
    """The runs, each with the other robots and what else moves as its dynamic obstacles."""
    # Controllers end anywhere: what was driven is what the others saw.
    driven = [
        body if isinstance(drive, Trajectory) else replace(body, path=run.trajectory)
        for body, drive, run in zip(bodies, drives, runs, strict=True)
    ]
    last = max((float(run.trajectory.times[-1]) for run in runs), default=0.0)
    seen = tuple(obstacle.until(last) for obstacle in obstacles)
    return [
        replace(run, obstacles=(*driven[:robot], *driven[robot + 1 :], *seen))
        for robot, run in enumerate(runs)
    ]


def places_along(path: Trajectory, count: int, body: Body) -> list[int]:
    """The poses of a path at which robots start, evenly spread.

    Raises:
        InputError: The path is too short for them.
    """
    places = [len(path) * robot // count for robot in range(count)]
    spots = path.poses[places, :2]
    near = min((math.dist(a, b) for a, b in combinations(spots.tolist(), 2)), default=math.inf)
    if near <= 2.0 * body.reach:
        raise InputError(f"{count} robots: they would stand {near:.2f} m apart on the route")
    return places


def parts_of(route: Float, count: int, body: Body) -> list[Float]:
    """Equal parts (m, 2) of a route, with room for two robots between neighbours.

    The end of the route is left out where it leads back along what was driven before.

    Raises:
        InputError: The route is too short for them.
    """
    stations = np.append(0.0, np.cumsum(lengths(np.hstack([route[:-1], route[1:]]))))
    gap = 2.0 * body.reach + APART
    spots = np.linspace(0.0, stations[-1], min(2 + int(stations[-1] / body.reach), MOST_SPOTS))
    places = np.column_stack([np.interp(spots, stations, column) for column in route.T])
    near = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) < gap
    new = ~(near & (spots[:, None] - spots > 2.0 * gap)).any(axis=1)
    total = float(spots[new][-1])
    each = (total - (count - 1) * gap) / count
    if each < gap:
        raise InputError(
            f"{count} robots: a route of {total:.2f} m leaves each {max(each, 0.0):.2f} m;"
            f" expected at least {gap:.2f} m"
        )
    parts = []
    for begin in (each + gap) * np.arange(count):
        inside = (stations > begin) & (stations < begin + each)
        x, y = (np.interp([begin, begin + each], stations, column) for column in route.T)
        first, last = np.column_stack([x, y])
        parts.append(np.vstack([first, route[inside], last]))
    return parts


def giving_way(drives: Sequence[Trajectory], body: Body) -> list[Trajectory]:
    """Drives of as many poses, in which each robot keeps away from those before it.

    It rests, or drives back the way that it came, where one of them would be too near, and gets as
    far as it can.
    """
    given = list[Trajectory]()
    for drive in drives:
        path = drive.poses
        rows = [np.zeros(1, np.int64)]
        last = 0
        step = np.hypot(*np.diff(path[:, :2], axis=0).T).max(initial=0.0)
        room = float(np.hypot(2.0 * body.reach, step))
        for begin in range(0, len(path) - 1, WINDOW):
            part = slice(begin, begin + WINDOW + 1)
            others = [other.poses[part, :2] for other in given]
            count = len(drive.times[part])
            rows.append(last + _apart(path[last : last + count, :2], others, room, count))
            last = int(rows[-1][-1])
        given.append(Trajectory(drive.times, path[np.concatenate(rows)]))
    return given


def _apart(path: Float, others: Sequence[Float], room: float, count: int) -> Int:
    """Where on its path (k, 2) a robot is after each step, away from others (n, 2)."""
    # The places that the robot can have reached after each step.
    may = np.zeros((count, len(path)), np.bool_)
    may[0, 0] = True
    for time in range(1, count):
        before = may[time - 1]
        now = may[time]
        now |= before
        now[1:] |= before[:-1]
        now[:-1] |= before[1:]
        for other in others:
            now &= np.hypot(*(path - other[time]).T) > room
        if not now.any():
            now |= before
    at = np.full(count, np.flatnonzero(may[-1]).max())
    for time in range(count - 1, 0, -1):
        # It waits as late as it can.
        near = [k for k in (at[time] - 1, at[time], at[time] + 1) if 0 <= k < len(path)]
        at[time - 1] = max((k for k in near if may[time - 1, k]), default=at[time])
    return at[1:]


def before_touching(drives: Sequence[Trajectory], body: Body) -> tuple[list[Trajectory], str]:
    """Drives up to where two robots first touch each other, and a sentence that says so, if any."""
    robots, _ = robots_among(body, drives, ())
    nothing = World(np.empty((0, 4)))
    time = math.inf
    text = ""
    for robot, drive in enumerate(drives):
        hit = find_collision(drive, nothing, body, robots[robot + 1 :])
        if hit is not None and hit.time < time:
            time = hit.time
            names = f"robot{robot + 1} and robot{robot + 2 + hit.obstacle}"
            text = f"{names} would touch after {time:.1f} s, at ({hit.x:.2f}, {hit.y:.2f})"
    most = [max(1, int(np.searchsorted(drive.times, time))) for drive in drives]
    return [Trajectory(d.times[:k], d.poses[:k]) for d, k in zip(drives, most, strict=True)], text


def _drive_all(
    simulations: Sequence[Simulation], touches: _Touches, progress: Progress
) -> list[Run]:
    """Run simulations to their ends, always that with the earliest scan; in their order."""
    steps = [iter(simulation) for simulation in simulations]
    kept = [Collection(simulation) for simulation in simulations]
    total = sum(each.total for each in simulations)
    waiting = [(each.next_time, robot) for robot, each in enumerate(simulations)]
    heapify(waiting)
    done = 0
    while waiting and waiting[0][0] < math.inf:
        time, robot = waiting[0]
        touches.drive_until(time)
        kept[robot].add(next(steps[robot]))
        done += 1
        progress(done, total)
        touches.show(robot)
        heapreplace(waiting, (simulations[robot].next_time, robot))
    return [each.run() for each in kept]


class _Touches:
    """Collisions of controlled robots, computed once every robot has its command."""

    def __init__(self, checker: CollisionChecker, crowd: Crowd, body: Body, stops: bool) -> None:
        self._checker = checker
        self._crowd = crowd
        self._body = body
        self._stops = stops
        self._robots = dict[int, tuple[Driven, CollisionChecker]]()
        self._now = 0.0

    def add(self, robot: int, drive: Trajectory | ControlledDrive) -> None:
        """Check the robot of a drive, if it has a controller."""
        if isinstance(drive, ControlledDrive):
            if drive.sweep:
                raise InputError(
                    "scan_duration: scans of a fleet's controllers take no time; set it to 0"
                )
            self._robots[robot] = drive.driven, self._checker.without(robot)
            self.show(robot)

    def show(self, robot: int) -> None:
        """Show the others how a robot drives by its last command."""
        if robot in self._robots:
            driven, _ = self._robots[robot]
            self._crowd.hold(move_of(*driven.since, driven.twist), robot)

    def drive_until(self, time: float) -> None:
        """Find what is touched up to a time [s], the earliest first."""
        while self._now < time and self._robots:
            hits = {robot: hit for robot in self._robots if (hit := self._hit(robot, time))}
            self._now = min((hit.time for hit in hits.values()), default=time)
            for robot, hit in hits.items():
                # Two robots touch each other at once.
                if hit.time > self._now + ROUNDING:
                    continue
                if not self._stops:
                    raise CollisionError(f"robot {robot}: {hit}; its controller drove it there")
                self._robots[robot][0].stop(hit)
                self.show(robot)

    def _hit(self, robot: int, time: float) -> Collision | None:
        """What a robot touches up to a time [s]; one that rests may be driven into."""
        driven, checker = self._robots[robot]
        if self._stops and driven.twist == STILL:
            return None
        pose = driven.passed(self._now)
        return checker.held(self._body, pose, driven.twist, self._now, time - self._now)
