"""Timed casters: the robot moves during a scan, among obstacles that move as well.

Casters know walls and poses, but no time. A timed caster is a function of a range finder, a pose
and the time at which the scan begins. By default all beams are sent at once, among walls alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from lrf3d.casting.caster import PlanarCaster
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.errors import InputError
from lrf3d.geometry import Float, wrap_angle
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.pose import as_pose
from lrf3d.robot import Trajectory
from lrf3d.world import World
from lrf3d.world.materials import BUILT_IN


class Caster(Protocol):
    """Anything that casts the beams of a laser range finder into a world."""

    def cast(self, lrf: LaserRangeFinder, pose: Float) -> LaserScan:
        """Return the true scan from a pose."""
        ...


TimedCaster = Callable[[LaserRangeFinder, Float, float], LaserScan]
"""Casts the scan that begins at a pose and a time [s]."""


def timed(
    caster: Caster,
    lrf: LaserRangeFinder,
    path: Trajectory | None,
    obstacles: Sequence[DynamicObstacle] = (),
) -> TimedCaster:
    """The caster for scans along a path, composed of no more than the scans need.

    Without a path all beams of a scan are sent at once. The last scan of a drive is taken where the
    robot arrives, so the interval before it may be shorter; the last beams of the scan before it
    are then sent from there.

    Raises:
        InputError: A scan takes longer than the time to the next.
    """

    def cast(lrf: LaserRangeFinder, pose: Float, time: float) -> LaserScan:
        return caster.cast(lrf, pose).at_time(time)

    among: TimedCaster = cast
    if obstacles:
        among = partial(_among, cast, tuple(obstacles), getattr(caster, "world", None))
    if path is None or lrf.time_increment == 0.0:
        return among
    between = float(np.diff(path.times[:-1]).min(initial=np.inf))
    # Times are sums, so intervals of 0.2 s are not exactly 0.2 s.
    rounding = 4.0 * float(np.spacing(np.abs(path.times).max()))
    if lrf.scan_duration > between + rounding:
        raise InputError(
            f"scan_duration {lrf.scan_duration:g} s: longer than the {between:g} s between two"
            " scans; scan less often or faster"
        )
    return partial(_swept, among, path)


def _among(
    cast: TimedCaster, obstacles: tuple[DynamicObstacle, ...], world: World | None,
    lrf: LaserRangeFinder, pose: Float, time: float,
) -> LaserScan:  # fmt: skip
    """The scan of another caster, in which each beam ends at the nearer of wall and obstacle.

    Obstacles are cast as exactly as walls; their index is −1. In a world with materials they are of
    dark cloth.
    """
    scan = cast(lrf, pose, time)
    # Mirrors show obstacles that no beam could meet by itself.
    lit = scan.intensities is not None
    met = [one for one in obstacles if lit or one.may_meet(lrf, pose, time)]
    if not met:
        return scan
    sides = np.concatenate([one.walls(time) for one in met])
    heights = np.repeat([one.height for one in met], [len(one.outline) for one in met])
    if not lit or world is None:
        moving = PlanarCaster(World(sides, heights=heights)).cast(lrf, pose).ranges
        # If both are below range_min, −inf, neither is nearer; the wall is −1 in any case.
        nearer = moving < scan.ranges
        ranges = np.where(nearer, moving, scan.ranges)
        walls = np.where(nearer, -1, scan.walls)
        return LaserScan.unchecked(lrf, scan.pose, ranges, walls).at_time(time)
    among = World(
        np.concatenate([world.segments, sides]),
        np.concatenate([world.objects, np.full(len(sides), world.object_count)]),
        np.concatenate([world.heights, heights]),
        materials=[*world.materials, BUILT_IN["dark cloth"]],
    )
    scan = PlanarCaster(among).cast(lrf, pose)
    walls = np.where(scan.walls < len(world.segments), scan.walls, -1)
    return replace(scan, walls=walls).at_time(time)


def _swept(
    cast: TimedCaster, path: Trajectory, lrf: LaserRangeFinder, pose: Float, time: float
) -> LaserScan:
    """The scan of a robot that moves on, each beam cast from its pose at the time of the beam.

    The pose of the scan is that of its first beam. For a robot at rest the scan equals that of the
    caster bit for bit.
    """
    times: Float = time + lrf.time_increment * np.arange(lrf.beams, dtype=np.float64)
    places = path.at(times)
    poses = places + (np.asarray(pose) - places[0])
    # The turn is added to the given heading, which may lie beyond a full turn.
    poses[:, 2] = pose[2] + wrap_angle(places[:, 2] - places[0, 2])
    beams = [
        cast(single, place, at)
        for single, place, at in zip(lrf.single_beams, poses, times.tolist(), strict=True)
    ]
    names = "ranges walls intensities echoes echo_intensities".split()
    parts = [[getattr(beam, name) for beam in beams] for name in names]
    arrays: Any = [None if part[0] is None else np.concatenate(part) for part in parts]
    return LaserScan.unchecked(lrf, as_pose(pose), *arrays).at_time(time)
