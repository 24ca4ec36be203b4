"""Timed casters: the robot moves during a scan, among obstacles that move as well.

Casters know walls and poses, but no time. A TimedCaster casts the scan that begins at a time:

- `StillCaster`, the usual one, sends all beams at once, among walls alone;
- `SweepCaster` sends each beam at its own time, from its own pose;
- `ObstacleCaster` adds dynamic obstacles, at their places at the time of the beams.

Each wraps another caster and casts exactly. Obstacles are cast as walls, and a beam ends at the
nearer of the two.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.casting.planar import PlanarCaster
from lrf3d.errors import InputError
from lrf3d.geometry import Float, wrap_angle
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory
from lrf3d.world import World
from lrf3d.world.materials import BUILT_IN


class Caster(Protocol):
    """Anything that casts the beams of a laser range finder into a world."""

    def cast(self, lrf: LaserRangeFinder, pose: Float) -> LaserScan:
        """Return the true scan from a pose."""
        ...


class TimedCaster(Protocol):
    """Anything that casts the scan that begins at a time [s] and a pose."""

    def cast_at(self, lrf: LaserRangeFinder, pose: Float, time: float) -> LaserScan:
        """Return the true scan."""
        ...


@dataclass(frozen=True, slots=True)
class StillCaster:
    """Casts all beams at once, among static walls."""

    caster: Caster

    def cast_at(self, lrf: LaserRangeFinder, pose: Float, time: float) -> LaserScan:
        """The scan of the caster, with its time."""
        return self.caster.cast(lrf, pose).at_time(time)


@dataclass(frozen=True, slots=True)
class ObstacleCaster:
    """Adds dynamic obstacles to the scans of another caster; their wall index is −1.

    In a world with materials they are of dark cloth, and the world is needed.
    """

    caster: TimedCaster
    obstacles: tuple[DynamicObstacle, ...]
    world: World | None = None

    def cast_at(self, lrf: LaserRangeFinder, pose: Float, time: float) -> LaserScan:
        """The scan, in which each beam ends at the nearer of wall and obstacle."""
        scan = self.caster.cast_at(lrf, pose, time)
        # Mirrors show obstacles that no beam could meet by itself.
        met = [
            obstacle
            for obstacle in self.obstacles
            if scan.intensities is not None or obstacle.may_meet(lrf, pose, time)
        ]
        if not met:
            return scan
        sides = [obstacle.walls(time) for obstacle in met]
        heights = np.repeat([obstacle.height for obstacle in met], [len(part) for part in sides])
        if scan.intensities is not None:
            return self._among_materials(lrf, pose, np.concatenate(sides), heights).at_time(time)
        moving = PlanarCaster(World(np.concatenate(sides), heights=heights)).cast(lrf, pose).ranges
        # If both ranges are below range_min, −inf, neither is nearer; the wall is −1 in any case.
        nearer = moving < scan.ranges
        return replace(
            scan,
            ranges=np.where(nearer, moving, scan.ranges),
            walls=np.where(nearer, -1, scan.walls),
        )

    def _among_materials(
        self, lrf: LaserRangeFinder, pose: Float, sides: Float, heights: Float
    ) -> LaserScan:
        """The scan of the walls with the sides (n, 4) of obstacles: mirrors show these as well."""
        world = self.world
        assert world is not None
        objects = np.full(len(sides), world.object_count)
        among = World(
            np.concatenate([world.segments, sides]),
            np.concatenate([world.objects, objects]),
            np.concatenate([world.heights, heights]),
            materials=[*world.materials, BUILT_IN["dark cloth"]],
        )
        scan = PlanarCaster(among).cast(lrf, pose)
        return replace(scan, walls=np.where(scan.walls < len(world.segments), scan.walls, -1))


@dataclass(frozen=True, slots=True)
class SweepCaster:
    """Casts the beams one after the other while the robot moves along its path.

    The pose of a scan is that of its first beam. For a robot at rest the scan equals that of the
    caster bit for bit.
    """

    caster: TimedCaster
    path: Trajectory

    def cast_at(self, lrf: LaserRangeFinder, pose: Float, time: float) -> LaserScan:
        """The scan, each beam cast from the pose of the robot at its time."""
        times: Float = time + lrf.time_increment * np.arange(lrf.beams, dtype=np.float64)
        ways = self.path.at(times)
        poses = ways + (np.asarray(pose) - ways[0])
        # The turn is added to the given heading, which may lie beyond a full turn.
        poses[:, 2] = pose[2] + wrap_angle(ways[:, 2] - ways[0, 2])
        beams = [
            self.caster.cast_at(single, place, at)
            for single, place, at in zip(lrf.single_beams, poses, times.tolist(), strict=True)
        ]
        first = Pose(float(pose[0]), float(pose[1]), float(pose[2]))
        scan = LaserScan.unchecked(
            lrf,
            first,
            np.concatenate([beam.ranges for beam in beams]),
            np.concatenate([beam.walls for beam in beams]),
            *(_joined(beams, name) for name in ("intensities", "echoes", "echo_intensities")),
        )
        return scan.at_time(time)


def _joined(beams: Sequence[LaserScan], name: str) -> Float | None:
    """An attribute of the scans of single beams as that of the whole scan."""
    parts = [getattr(beam, name) for beam in beams]
    return None if parts[0] is None else np.concatenate(parts)


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
    cast: TimedCaster = StillCaster(caster)
    if obstacles:
        cast = ObstacleCaster(cast, tuple(obstacles), getattr(caster, "world", None))
    if path is None or lrf.time_increment == 0.0:
        return cast
    between = float(np.diff(path.times[:-1]).min(initial=np.inf))
    # Times are sums, so intervals of 0.2 s are not exactly 0.2 s.
    rounding = 4.0 * float(np.spacing(np.abs(path.times).max()))
    if lrf.scan_duration > between + rounding:
        raise InputError(
            f"scan_duration {lrf.scan_duration:g} s: longer than the {between:g} s between two"
            " scans; scan less often or faster"
        )
    return SweepCaster(cast, path)
