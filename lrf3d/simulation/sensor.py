"""Sensor: casts the true scan from a pose at a time, and adds noise.

Casters know walls and poses, but no time. Here the robot moves on during a scan, among obstacles
that move as well. By default all beams are sent at once, among walls alone.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.crowd import Crowd, moves_of
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.casting.kernels.beams import RAY
from lrf3d.casting.kernels.movers import poses_along
from lrf3d.casting.kernels.scans import rays_from
from lrf3d.casting.skyline import Conditions
from lrf3d.geometry.lines import Float, Records, least_of
from lrf3d.geometry.pose import Pose, as_pose, as_poses, between
from lrf3d.laser import Chain, LaserRangeFinder, LaserScan, Lidar, Noise, with_ranges
from lrf3d.laser.scan import LIGHT, ScanBatch
from lrf3d.robot import Trajectory
from lrf3d.robot.attitude import LEVEL
from lrf3d.world import World


class Caster(Protocol):
    """Anything that casts the beams of a laser range finder into a world."""

    def cast(self, lrf: LaserRangeFinder, pose: Float) -> LaserScan:
        """Return the true scan from a pose."""


class Moving(Protocol):
    """Anything that knows where a robot is while it scans, every interval [s]."""

    interval: float

    def at(self, times: Float) -> Float:
        """Poses (n, 3) of the robot at times (n,) [s] of the scan that it begins."""


# Casters by name.
CASTERS: dict[str, Callable[[World], Caster]] = {"embree": EmbreeCaster, "planar": PlanarCaster}


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
        obstacles: Sequence[DynamicObstacle] | Crowd = (),
        path: "Trajectory | Moving | None" = None,
    ) -> None:
        expect(lrf, LaserRangeFinder, "range finder")
        self.world = world
        self.lrf = lrf
        self.noise = noise
        self.caster = caster_of(caster, world)
        self._noisy = Chain([noise])
        self._crowd = obstacles if isinstance(obstacles, Crowd) else Crowd(obstacles)
        self._crowded = len(self._crowd) > 0
        self._lit = len(world.materials) > 0 and self._crowded
        # What casts single rays; other casters know no light of obstacles.
        self._rays = self.caster if isinstance(self.caster, PlanarCaster) else None
        if self._rays is None and self._lit:
            self._rays = PlanarCaster(world)
        # The path, if the robot moves on while it scans.
        self._path = path if lrf.time_increment else None
        check_duration(lrf.scan_duration, path)

    def without(self, own: int) -> "Sensor":
        """The same sensor on the robot that is this obstacle of its crowd; −1 for no obstacle."""
        other = copy(self)
        other._crowd = self._crowd.without(own)
        return other

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
            scan = replace(
                scan, motion=true_scan.motion, mount=true_scan.mount, laser=true_scan.laser
            )
        ranges = self._far_enough(scan.ranges)
        return scan if ranges is scan.ranges else with_ranges(scan, ranges)

    def noisy_ranges(self, true_scans: ScanBatch, rng: np.random.Generator) -> Float | None:
        """The measured ranges (k, beams) of true scans; None if the noise takes single scans."""
        if not self._noisy.batched:
            return None
        return self._far_enough(self._noisy(true_scans, rng).ranges)

    def _far_enough(self, ranges: Float) -> Float:
        """Set ranges that noise moved below range_min to −inf."""
        limit = self.lrf.range_min
        return ranges if least_of(ranges) >= limit else np.where(ranges < limit, -np.inf, ranges)

    def cast(self, pose: Float, time: float, attitude: tuple[float, float] = LEVEL) -> LaserScan:
        """The true scan that begins at a time [s], where the robot is at a pose (3,).

        The attitude is its pitch and roll [rad]: beams of a tilted robot also meet the floor.

        Along a path each beam is cast from the pose at its own time. For a robot at rest this is
        the scan of the caster, bit for bit. Obstacles have the index −1; in a world with materials
        they are of dark cloth.
        """
        if any(attitude):
            return self._tilted(pose, time, attitude)
        if self._path is None and not self._lit:
            return self._among(self.lrf.placed(pose), time)
        return self._beam_by_beam(pose, time)

    def _beam_by_beam(self, pose: Float, time: float) -> LaserScan:
        """The scan along a path, or with light of obstacles."""
        lrf = self.lrf
        place = as_pose(lrf.placed(pose))
        motion = None
        if self._path is None:
            poses = np.array([place])
            times = np.array([time])
        else:
            times = time + lrf.delays
            poses = poses_on(self._path, pose, times)
            motion = between(poses[0], poses[-1])
            poses = lrf.placed(poses)
        if self._rays is not None:
            return self._one_by_one(self._rays, place, poses, times, motion)
        # Beam i of the scan of moment i, as casters with only `cast` know no single rays.
        scans = [self._among(*at) for at in zip(poses, times.tolist(), strict=True)]
        arrays: Any = [
            None if getattr(scans[0], name) is None
            else np.array([getattr(scan, name)[i] for i, scan in enumerate(scans)])
            for name in ("ranges", "walls", *LIGHT)
        ]  # fmt: skip
        return LaserScan.unchecked(lrf, place, *arrays, time=time, motion=motion)

    def _tilted(self, pose: Float, time: float, attitude: tuple[float, float]) -> LaserScan:
        """The scan of a robot that is pitched and rolled [rad], and believes to be level."""
        if not isinstance(self.caster, PlanarCaster):
            raise InputError(f"attitude: {shown(self.caster)} casts level beams only")
        lidar = Lidar.of(self.lrf, attitude)
        motion = None
        if self._path is not None:
            motion = motion_along(self._path, pose, time, self.lrf.scan_duration)
        moment = Conditions(time, motion, self._crowd)
        scan = self.caster.cast_lidar(lidar, lidar.planar.placed(pose), moment)
        place = as_pose(self.lrf.placed(pose))
        rows: list[Any] = [scan.ranges[0], scan.walls[0].astype(np.int64)]
        if self.world.materials:
            light = scan.intensities[0]
            faint = light < self.lrf.threshold
            rows = [np.where(faint, np.inf, rows[0]), np.where(faint, -1, rows[1]), light]
        return LaserScan.unchecked(self.lrf, place, *rows, time=time, motion=motion)

    def _one_by_one(
        self, caster: PlanarCaster, place: Pose, poses: Float, times: Float, motion: Float | None
    ) -> LaserScan:
        """The scan of beams at times (beams,) [s], or at one, from as many poses."""
        lrf = self.lrf
        lighting = caster.lighting
        # Mirrors may be nearer than range_min, and what they show beyond it.
        near = lrf if lighting is None else replace(lrf, range_min=0.0)
        ranges, walls = caster.along(near, poses)
        time = times.item(0)
        rays = np.empty(lrf.beams, RAY)
        if self._crowded or lighting is not None:
            rays_from(lrf.plain, poses, times, rays[None])
        count = len(self.world.segments)
        if self._crowded:
            named = -1 if lighting is None else count
            self._crowd.stop_rays(near, rays, ranges, walls, named=named)
        if lighting is None:
            return LaserScan.unchecked(lrf, place, ranges, walls, time=time, motion=motion)
        lit = lighting.empty(lrf)
        lit.ranges[:] = ranges
        lit.walls[:] = walls
        tree = caster.tree(lrf.height)
        lighting.light(lrf, tree, rays, lit, self._crowd.plain, self._crowd.own)
        lit.walls[lit.walls >= count] = -1
        light = lit.arrays(lrf.echoes)
        return LaserScan.unchecked(lrf, place, *light, time=time, motion=motion)

    def _among(self, pose: Any, time: float) -> LaserScan:
        """The scan of one moment, in which each beam ends at the nearer of wall and obstacle."""
        scan = self.caster.cast(self.lrf, pose).at_time(time)
        if not self._crowded:
            return scan
        ranges = scan.ranges.copy()
        walls = scan.walls.copy()
        self._crowd.stop_scans(self.lrf, np.array([pose]), time, ranges[None], walls[None])
        return LaserScan.unchecked(self.lrf, scan.pose, ranges, walls, time=time)


def motion_along(path: Any, pose: Float, time: float, duration: float) -> Float:
    """The motion (3,) along a path from a pose (3,) at a time [s], during a scan [s]."""
    if not duration:
        return np.zeros(3)
    poses = poses_on(path, pose, np.array([time, time + duration]))
    return between(poses[0], poses[1])


def poses_on(path: Any, pose: Float, times: Float) -> Float:
    """Poses (n, 3) on a path at times (n,) [s], with the robot at a pose (3,) at the first."""
    if not isinstance(path, Trajectory):
        found = as_poses(path.at(times))
        if len(found) not in (1, len(times)):
            raise InputError(
                f"path: {len(found)} poses at {len(times)} times; expected one at each"
            )
        return found
    return poses_along(legs_of(path), times, np.array(as_pose(pose)))


@lru_cache(8)
def legs_of(path: Trajectory) -> Records:
    """The moves along a trajectory, which all sensors of its robot share."""
    return moves_of(path.times, path.poses)


def check_duration(duration: float, path: "Trajectory | Moving | None") -> None:
    """Check that a scan takes no longer [s] than the path gives it."""
    interval = getattr(path, "interval", np.inf)
    rounding = 0.0
    if isinstance(path, Trajectory):
        interval = float(np.diff(path.times[:-1]).min(initial=np.inf))
        # Times are sums, so intervals of 0.2 s are not exactly 0.2 s.
        rounding = 4.0 * float(np.spacing(np.abs(path.times).max()))
    if duration > interval + rounding:
        raise InputError(
            f"scan_duration {duration:g} s: longer than the {interval:g} s between two scans; scan"
            " less often or faster"
        )


def caster_of(caster: Caster | str, world: World) -> Caster:
    """The caster for a world, by its name or as given."""
    if not isinstance(caster, str):
        if not callable(getattr(caster, "cast", None)):
            raise InputError(f"caster {shown(caster)}: it has no method cast(lrf, pose)")
        return caster
    if caster not in CASTERS:
        raise InputError(f"caster {shown(caster)}: expected one of {', '.join(CASTERS)}")
    return CASTERS[caster](world)
