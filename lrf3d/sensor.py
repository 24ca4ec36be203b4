"""Sensor: casts the true scan from a pose at a time, and adds noise.

Casters know walls and poses, but no time. Here the robot moves on during a scan, among obstacles
that move as well. By default all beams are sent at once, among walls alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.errors import InputError, expect, shown
from lrf3d.geometry import Float, wrap_angle
from lrf3d.laser import Chain, LaserRangeFinder, LaserScan, Noise
from lrf3d.laser.scan import LIGHT
from lrf3d.pose import as_pose, between
from lrf3d.robot import Trajectory
from lrf3d.world import World
from lrf3d.world.materials import BUILT_IN


class Caster(Protocol):
    """Anything that casts the beams of a laser range finder into a world."""

    def cast(self, lrf: LaserRangeFinder, pose: Float) -> LaserScan:
        """Return the true scan from a pose."""
        ...


CASTERS: dict[str, Callable[[World], Caster]] = {"embree": EmbreeCaster, "planar": PlanarCaster}
"""Casters by name."""


class Sensor:
    """A laser range finder among walls and dynamic obstacles, with its noise.

    Without the path of the robot all beams of a scan are cast from one pose. The last scan of a
    drive is taken where the robot arrives, so the interval before it may be shorter; the last beams
    of the scan before it are then sent from there.
    """

    def __init__(
        self,
        world: World,
        lrf: LaserRangeFinder,
        *,
        caster: Caster | str,
        noise: Noise,
        obstacles: Sequence[DynamicObstacle] = (),
        path: Trajectory | None = None,
    ) -> None:
        expect(lrf, LaserRangeFinder, "range finder")
        self.world, self.lrf, self.noise = world, lrf, noise
        self.caster, self.obstacles = caster_of(caster, world), tuple(obstacles)
        self._noisy, self._path = Chain([noise]), path if lrf.time_increment else None
        if path is None:
            return
        between = float(np.diff(path.times[:-1]).min(initial=np.inf))
        # Times are sums, so intervals of 0.2 s are not exactly 0.2 s.
        rounding = 4.0 * float(np.spacing(np.abs(path.times).max()))
        if lrf.scan_duration > between + rounding:
            raise InputError(
                f"scan_duration {lrf.scan_duration:g} s: longer than the {between:g} s between two"
                " scans; scan less often or faster"
            )

    def noisy(self, true_scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """The measured scan of a true one."""
        scan = self._noisy(true_scan, rng)
        if not isinstance(scan, LaserScan) or len(scan.ranges) != self.lrf.beams:
            raise InputError(
                f"noise {self.noise!r} returned {shown(scan)}; expected a LaserScan of"
                f" {self.lrf.beams} beams"
            )
        if scan.mount != true_scan.mount or scan.motion is not true_scan.motion:
            # A noise may make a scan of its own, without what it knows nothing of.
            kept: dict[str, Any] = {"mount": true_scan.mount, "laser": true_scan.laser}
            scan = replace(scan, motion=true_scan.motion, **kept)
        return scan

    def cast(self, pose: Float, time: float) -> LaserScan:
        """The true scan that begins at a time [s], where the robot is at a pose (3,).

        Along a path each beam is cast from the pose at its own time. For a robot at rest this is
        the scan of the caster, bit for bit.
        """
        path, lrf = self._path, self.lrf
        if path is None:
            return self._among(lrf, lrf.placed(pose), time)
        times: Float = time + lrf.time_increment * np.arange(lrf.beams, dtype=np.float64)
        places = path.at(times)
        poses = places + (np.asarray(pose) - places[0])
        # The turn is added to the given heading, which may lie beyond a full turn.
        poses[:, 2] = pose[2] + wrap_angle(places[:, 2] - places[0, 2])
        motion, poses = between(poses[0], poses[-1]), lrf.placed(poses)
        beams = [
            self._among(single, place, at)
            for single, place, at in zip(lrf.single_beams, poses, times.tolist(), strict=True)
        ]
        parts = [[getattr(beam, name) for beam in beams] for name in ("ranges", "walls", *LIGHT)]
        arrays: Any = [None if part[0] is None else np.concatenate(part) for part in parts]
        place = as_pose(lrf.placed(np.asarray(pose)))
        return LaserScan.unchecked(lrf, place, *arrays).at_time(time, motion)

    def _among(self, lrf: LaserRangeFinder, pose: Float, time: float) -> LaserScan:
        """The scan of one moment, in which each beam ends at the nearer of wall and obstacle.

        Obstacles have the index −1; in a world with materials they are of dark cloth.
        """
        world, scan = self.world, self.caster.cast(lrf, pose).at_time(time)
        # Mirrors show obstacles that no beam could meet by itself.
        lit = scan.intensities is not None
        met = [one for one in self.obstacles if lit or one.may_meet(lrf, pose, time)]
        if not met:
            return scan
        sides = np.concatenate([one.walls(time) for one in met])
        heights = np.repeat([one.height for one in met], [len(one.outline) for one in met])
        if not lit:
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


def caster_of(caster: Caster | str, world: World) -> Caster:
    """The caster for a world, by its name or as given."""
    if not isinstance(caster, str):
        return caster
    if caster not in CASTERS:
        raise InputError(f"caster {caster!r}: expected one of {', '.join(CASTERS)}")
    return CASTERS[caster](world)
