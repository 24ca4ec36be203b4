"""PlanarCaster: exact ranges among the walls of a world, in the plane (section 2.3)."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, cached_property, lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.cores import share
from lrf3d.base.errors import InputError, expect
from lrf3d.casting.crowd import records
from lrf3d.casting.kernels.beams import NO_GUESSES, RAY, cast_rays
from lrf3d.casting.kernels.scans import cast_scans, laser_of, rays_from
from lrf3d.casting.kernels.tree import Plain, Tree, build_tree
from lrf3d.casting.skyline import (
    STILL,
    Conditions,
    Rows,
    StandingWalls,
    cast_depth,
    cast_lidar,
    cast_lidars,
    swept,
)
from lrf3d.compiling import entry_of
from lrf3d.geometry.lines import (
    LARGEST_COORDINATE,
    TINY,
    Bool,
    Float,
    Int,
    as_table,
    sealed,
)
from lrf3d.geometry.pose import Pose, as_pose, as_poses
from lrf3d.laser import (
    DepthCamera,
    DepthImage,
    LaserRangeFinder,
    LaserScan,
    Lidar,
    LidarScan,
)
from lrf3d.world import World

if TYPE_CHECKING:
    from lrf3d.casting.kernels.echoes import Lit
    from lrf3d.casting.light import Lighting


# [trees] Trees that are kept: one for all heights of lasers at which the same walls are met.
MOST_TREES = 8

# [rays] Fewer than these are cast by one core: starting a thread would take longer.
MANY = 4096

# Stands for walls where nothing asks for them.
NO_WALLS = np.empty(0, np.int64)

# Limits of rays for which no range finder is given.
UNLIMITED = LaserRangeFinder(range_max=LARGEST_COORDINATE)


class PlanarCaster:
    """Casts scans at the walls of a world that reach up to the height of the beams.

    For the float64 pose, directions and walls the wall that a beam hits is exact; of walls at the
    same distance it is the first. The range is that distance, to within half a unit in its last
    place. Behind mirrors and through glass beams are followed in float64.

    Examples:
        >>> import lrf3d
        >>> caster = lrf3d.PlanarCaster(lrf3d.World([[3, -5, 3, 5]]))
        >>> scan = caster.cast(lrf3d.LaserRangeFinder(beams=3), (1, 0, 0))
        >>> scan.ranges.tolist(), scan.walls.tolist()
        ([inf, 2.0, inf], [-1, 0, -1])
    """

    lighting: "Lighting | None" = None
    """Lights its scans; None in a world without materials."""

    def __init__(self, world: World) -> None:
        expect(world, World, "caster for")
        self.world = world
        self._levels: list[float] = np.unique(world.heights).tolist()
        # A world never changes, so a tree stays valid; threads of one scan share it.
        self._tree = lru_cache(MOST_TREES)(self._build)
        # As kernels take it.
        self._plain = lru_cache(MOST_TREES)(lambda height: self.tree(height)[:])
        if world.materials:
            self.lighting = self._reflections

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.world!r})"

    def __reduce__(self) -> tuple[object, ...]:
        # What it holds of compiled code and of Embree is made again from the world.
        return type(self), (self.world,)

    def cast(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> LaserScan:
        """The true scan from a pose."""
        pose = as_pose(pose)
        expect(lrf, LaserRangeFinder, "range finder")
        if self.lighting is not None:
            (lit,) = self._lit(lrf, np.array([pose])).scans()
            return LaserScan.unchecked(lrf, pose, *lit.arrays(lrf.echoes))
        walls = np.empty(lrf.beams, np.int64)
        return LaserScan.unchecked(lrf, pose, self._once(lrf, pose, walls), walls)

    def ranges(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> Float:
        """The ranges (beams,) of `cast` alone: for few beams a scan around them takes as long.

        Examples:
            >>> import lrf3d
            >>> caster = lrf3d.PlanarCaster(lrf3d.World([[3, -5, 3, 5]]))
            >>> caster.ranges(lrf3d.LaserRangeFinder(beams=3), (1, 0, 0)).tolist()
            [inf, 2.0, inf]
        """
        pose = as_pose(pose)
        expect(lrf, LaserRangeFinder, "range finder")
        if self.lighting is not None:
            return np.asarray(self._lit(lrf, np.array([pose])).ranges[0])
        return self._once(lrf, pose, NO_WALLS)

    def _once(self, lrf: LaserRangeFinder, pose: Pose, walls: Int) -> Float:
        """Ranges (beams,) from a pose; walls are filled in unless empty."""
        ranges = np.empty(lrf.beams)
        place = np.empty((1, 3))
        place[0, 0], place[0, 1], place[0, 2] = pose
        self._fill(lrf.height, lrf.plain, place, ranges, walls)
        return ranges

    def cast_batch(self, lrf: LaserRangeFinder, poses: ArrayLike) -> Float:
        """Ranges (k, beams) from poses (k, 3), on all cores."""
        return self._batch(lrf, as_poses(poses), keep_walls=False)[0]

    def scan_batch(self, lrf: LaserRangeFinder, poses: ArrayLike) -> tuple[Float, Int]:
        """Ranges and walls (k, beams) from poses (k, 3), on all cores."""
        return self._batch(lrf, as_poses(poses), keep_walls=True)

    def cast_rays(
        self, origins: ArrayLike, directions: ArrayLike, lrf: LaserRangeFinder | None = None
    ) -> tuple[Float, Int]:
        """Ranges and walls (n,) of single rays, which end at their first wall, on all cores.

        Ranges are in lengths of the directions: metres for unit vectors. Beyond range_max they are
        +inf, below range_min −inf, and the wall is −1.

        Args:
            origins: (n, 2) [m].
            directions: (n, 2), of any length but 0.
            lrf: Its height, range_min and range_max count; without it rays are 0.5 m high and as
                long as the world.

        Raises:
            InputError: A number is not finite, or a direction has no length.

        Examples:
            >>> import lrf3d
            >>> caster = lrf3d.PlanarCaster(lrf3d.World([[3, -5, 3, 5]]))
            >>> ranges, walls = caster.cast_rays([(0, 0), (0, 0)], [(1, 0), (0, 1)])
            >>> ranges.tolist(), walls.tolist()
            ([3.0, inf], [0, -1])
        """
        starts = as_table(origins, "origins", 2)
        ways = as_table(directions, "directions", 2)
        if len(starts) != len(ways):
            raise InputError(f"{len(starts)} origins, {len(ways)} directions: expected as many")
        laser = lrf or UNLIMITED
        expect(laser, LaserRangeFinder, "range finder")
        rays = records(RAY, *starts.T, *ways.T, 0.0)
        ranges = np.empty(len(rays))
        walls = np.empty(len(rays), np.int64)
        tree = self._plain(laser.height)
        limits = laser.plain[-2:]
        invalid = []

        def work(start: int, stop: int) -> None:
            part = slice(start, stop)
            first = cast_rays(tree, limits, rays[part], NO_GUESSES, ranges[part], walls[part])
            if first >= 0:
                invalid.append(start + first)

        share(work, len(rays), MANY)
        if invalid:
            first = min(invalid)
            x, y, dx, dy, _ = rays[first].tolist()
            raise InputError(
                f"ray {first} from {(x, y)} along {(dx, dy)}: expected finite numbers of at most"
                f" {LARGEST_COORDINATE:g}, and a direction with a length"
            )
        return ranges, walls

    def along(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int]:
        """Ranges and walls (beams,) up to the first walls, of beams from poses (beams, 3).

        One pose (1, 3) holds for all beams.
        """
        ranges = np.empty(lrf.beams)
        walls = np.empty(lrf.beams, np.int64)
        # The kernel does not check its arguments.
        places = np.ascontiguousarray(poses, np.float64)
        _scanner()(self._plain(lrf.height), lrf.plain, places, ranges, walls)
        return ranges, walls

    def chains(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> Int:
        """The walls (beams, k) on the path of each beam of a scan: mirrors, glass, and the last.

        −1 stands after the last; without a range all are −1. k is the longest way.

        Examples:
            >>> import lrf3d
            >>> walls = [[2, -1, 4, 1], [0, 3, 6, 3]]
            >>> world = lrf3d.World(walls, objects=[0, 1], materials=["mirror", "plaster"])
            >>> ahead = lrf3d.LaserRangeFinder(0.0, 0.0, beams=1)
            >>> lrf3d.PlanarCaster(world).chains(ahead, (0, 0, 0)).tolist()
            [[0, 1]]
        """
        if self.lighting is None:
            return self.scan_batch(lrf, [as_pose(pose)])[1].T
        chains = self._lit(lrf, np.array([as_pose(pose)]), chains=True).chains[0]
        longest = max(1, int((chains >= 0).sum(axis=1).max(initial=0)))
        return np.asarray(chains[:, :longest])

    def tree(self, height: float) -> Tree:
        """The tree over the walls that reach up to a height [m]."""
        return self._tree(self._level(height))

    def cast_lidar(
        self, lidar: Lidar, pose: Sequence[float] | Float, moment: Conditions = STILL
    ) -> LidarScan:
        """The true scan of a lidar from its pose: walls up to their heights, tops, and the floor.

        A closed object of one height has a top, unless walls of another object reach into it. For a
        level lidar every decision is exact, as in `cast`, which equals its layer of elevation 0;
        ranges are rounded by about 1e-16 of their size. Tops are not seen in mirrors or through
        glass.
        """
        expect(lidar, Lidar, "lidar")
        lidar = replace(lidar, since=moment.time) if lidar.prisms else lidar
        pose = as_pose(pose)
        ranges, walls = self._layered(lidar, pose, moment)
        mirrored = None if self.lighting is None else self._mirror(lidar, pose, ranges, walls)
        motion = None if moment.motion is None else sealed(np.array(moment.motion))
        found = sealed(ranges), sealed(walls)
        light = None
        if isinstance(self.world, World):
            light = partial(self._intensities, lidar, pose, *found, motion, mirrored)
        return LidarScan(pose, lidar, *found, moment.time, motion, light)

    def _intensities(
        self, lidar: Lidar, pose: Pose, ranges: Float, walls: Rows, motion: Float | None,
        mirrored: tuple[Bool, Float] | None,
    ) -> Float:  # fmt: skip
        """The intensities (layers, columns) of a true scan, in which some beams were mirrored."""
        place = np.array(pose)
        poses = place[None] if motion is None else swept(lidar, place, motion)
        found = self._reflections.reflected(lidar, poses, ranges, walls)
        if mirrored is not None:
            found[mirrored[0]] = mirrored[1]
        return sealed(found)

    def cast_depth(
        self, camera: DepthCamera, pose: Sequence[float] | Float, moment: Conditions = STILL
    ) -> DepthImage:
        """The true depth image of a camera from its pose, of the same surfaces as `cast_lidar`."""
        expect(camera, DepthCamera, "depth camera")
        pose = as_pose(pose)
        depth, walls = self._layered(camera, pose, moment)
        return DepthImage(pose, camera, sealed(depth), sealed(walls), moment.time)

    def lidar_batches(self, lidar: Lidar, poses: Float) -> Iterator[tuple[Int, Float]]:
        """True ranges (k, layers, columns) of a lidar at some of the poses, with their numbers."""
        if lidar.is_level and self.lighting is None:
            yield from cast_lidars(self._standing, lidar, poses)
            return
        for number, pose in enumerate(poses):
            yield np.array([number]), self.cast_lidar(lidar, pose).ranges[None]

    def _layered(
        self, sensor: Lidar | DepthCamera, pose: Pose, moment: Conditions
    ) -> tuple[Float, Rows]:
        place = np.array(pose)
        if isinstance(sensor, DepthCamera):
            return cast_depth(self._standing, sensor, place, moment)
        return cast_lidar(self._standing, sensor, place, moment)

    def _mirror(self, lidar: Lidar, pose: Pose, ranges: Float, walls: Rows) -> tuple[Bool, Float]:
        """Continue, in place, the beams of a still lidar that hit mirrors and glass.

        It returns which they are, and their intensities.
        """
        assert self.lighting is not None
        turning = np.array(
            [bool(one and (one.mirrors or one.passes)) for one in self.world.materials]
        )
        chosen = (walls >= 0) & turning[self.world.objects[walls]]
        origin = (pose.x, pose.y, lidar.mount[2])
        beams = lidar.directions(pose)[chosen]
        # One layer of just these beams.
        lrf = replace(lidar.planar, beams=max(len(beams), 1))
        directions = beams[None] if len(beams) else np.empty((0, 1, 3))
        lit = self.lighting.light_layers(lrf, self.tree(-np.inf), origin, directions)
        found = lit.ranges.ravel()
        # Upright mirrors do not change the length of a beam down to the floor.
        floor = np.where(beams[:, 2] < 0.0, -origin[2] / np.minimum(beams[:, 2], -TINY), np.inf)
        lower = (floor < found) & (floor <= lidar.range_max)
        ranges[chosen] = np.where(lower, floor, found)
        walls[chosen] = np.where(lower | ~np.isfinite(found), -1, lit.walls.ravel())
        light = np.zeros(ranges.shape)
        light[chosen] = np.where(lower, 0.0, lit.intensities.ravel())
        if lidar.is_level:
            level = self.cast(lidar.planar, pose)
            flat = lidar.slopes == 0.0
            ranges[flat] = level.ranges
            walls[flat] = level.walls
            light[flat] = level.intensities
            chosen[flat] = True
        return chosen, light[chosen]

    @cached_property
    def _reflections(self) -> "Lighting":
        from lrf3d.casting.light import Lighting

        return Lighting(self.world)

    @cached_property
    def _standing(self) -> StandingWalls:
        return StandingWalls(self.world)

    def _level(self, height: float) -> float:
        """A key that is equal for all heights [m] at which the same walls are met."""
        return bisect_left(self._levels, height)

    def _build(self, level: float) -> Tree:
        least = [*self._levels, np.inf][int(level)]
        tall = np.flatnonzero(self.world.heights >= least).astype(np.int32)
        return build_tree(self.world.segments[tall], tall)

    def _fill(self, height: float, laser: Plain, poses: Float, ranges: Float, walls: Int) -> None:
        """Fill ranges (k · beams,) of scans from poses (k, 3), and walls unless empty; on one core.

        Beams end at the first wall, also at mirrors and glass.
        """
        _scanner()(self._plain(height), laser, poses, ranges, walls)

    def _batch(self, lrf: LaserRangeFinder, poses: Float, *, keep_walls: bool) -> tuple[Float, Int]:
        laser = laser_of(lrf)
        poses = np.ascontiguousarray(poses)
        if self.lighting is not None:
            lit = self._lit(lrf, poses)
            return lit.ranges, lit.walls
        ranges = np.empty((len(poses), lrf.beams))
        walls = np.empty((len(poses) if keep_walls else 0, lrf.beams), np.int64)

        def work(start: int, stop: int) -> None:
            part = slice(start, stop)
            self._fill(lrf.height, laser, poses[part], ranges[part].ravel(), walls[part].ravel())

        share(work, len(poses), max(8, MANY // lrf.beams))
        return ranges, walls

    def _lit(self, lrf: LaserRangeFinder, poses: Float, *, chains: bool = False) -> "Lit":
        """The light of scans from poses (k, 3), on all cores."""
        lighting = self.lighting
        assert lighting is not None
        # Mirrors may be nearer than range_min, and what they show beyond it.
        laser = laser_of(lrf, range_min=0.0)
        tree = self.tree(lrf.height)
        lit = lighting.empty(lrf, len(poses), chains=chains)
        rays = np.empty(lit.ranges.shape, RAY)
        rays_from(laser, poses, np.zeros(len(poses)), rays)

        def work(start: int, stop: int) -> None:
            part = slice(start, stop)
            found = lit.ranges[part].ravel(), lit.walls[part].ravel()
            self._fill(lrf.height, laser, poses[part], *found)
            lighting.light(lrf, tree, rays[part], lit.part(part))

        share(work, len(poses))
        return lit


@cache
def _scanner() -> Callable[..., None]:
    """The kernel of scans, which all casters call with arguments of the same types."""
    tree = build_tree(np.empty((0, 4)))
    return entry_of(cast_scans, tree[:], UNLIMITED.plain, np.empty((0, 3)), np.empty(0), NO_WALLS)
