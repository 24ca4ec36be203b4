"""EmbreeCaster: Embree finds the walls, with the exact ranges of PlanarCaster; and casts in 3D.

Level beams among walls are cast by a `WallScene`. A mesh is cut by the plane of the beams, and its
cuts are treated as walls. Layers and tilted lasers are cast in 3D, in float64.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np

from lrf3d.casting.caster import FEW, PlanarCaster
from lrf3d.casting.kernels.beams import Records
from lrf3d.casting.kernels.echoes import Lit
from lrf3d.casting.kernels.scans import laser_of
from lrf3d.casting.kernels.tree import Plain
from lrf3d.casting.triangle_rays import MeshScene, embreex_installed
from lrf3d.casting.wall_scene import WallScene
from lrf3d.errors import InputError, shown
from lrf3d.geometry import Bool, Float, Int, is_finite, numbers
from lrf3d.laser import LaserRangeFinder, LaserScan, layer_directions
from lrf3d.laser.range_finder import within_limits
from lrf3d.pose import as_pose
from lrf3d.world import World
from lrf3d.world.mesh import level_cut


class EmbreeCaster(PlanarCaster):
    """Casts scans with Embree; at walls, decisions and ranges are the exact ones of PlanarCaster.

    Args:
        world: A world, or a ``trimesh.Trimesh``, whose triangles then stand where a world has
            its walls. Level beams meet the triangles where these meet the plane at their height;
            the ends of such a cut are rounded to float64, but for upright edges, which are exact.

    Examples:
        >>> import lrf3d
        >>> caster = lrf3d.EmbreeCaster(lrf3d.World([[3, -5, 3, 5]]))
        >>> lrf = lrf3d.LaserRangeFinder(beams=3)
        >>> caster.cast(lrf, (1, 0, 0)).ranges.tolist()
        [inf, 2.0, inf]
        >>> caster.cast_batch(lrf, [(1, 0, 0), (2, 0, 0)])[:, 1].tolist()
        [2.0, 1.0]
    """

    def __init__(self, world: Any) -> None:
        self._triangles: Float | None = None
        if not isinstance(world, World):
            if not hasattr(world, "triangles"):
                raise InputError(f"caster for {shown(world)}: expected a World or a Trimesh")
            self._triangles = np.asarray(world.triangles, dtype=np.float64).reshape(-1, 3, 3)
        super().__init__(world if self._triangles is None else World(np.empty((0, 4))))
        self.world = world
        self._scenes: dict[tuple[int, int], WallScene] = {}
        self._solid: MeshScene | None = None
        # The cuts of a mesh are kept for some heights of the laser.
        self._cut = lru_cache(8)(partial(_cut, self._triangles))

    def cast(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> LaserScan:
        """The true scan from a pose; for a mesh, ``walls`` holds indices of triangles."""
        if self._triangles is None:
            return super().cast(lrf, pose)
        laser_of(lrf)
        caster, faces = self._cut(lrf.height)
        scan = caster.cast(lrf, pose)
        return LaserScan.unchecked(lrf, scan.pose, scan.ranges, _named(faces, scan.walls))

    def trace(self, lrf: LaserRangeFinder, rays: Records) -> tuple[Float, Int]:
        """Ranges and walls, or triangles of a mesh, (n,) of rays (n,) to what they meet first."""
        if self._triangles is None:
            return super().trace(lrf, rays)
        laser_of(lrf)
        caster, faces = self._cut(lrf.height)
        ranges, walls = caster.trace(lrf, rays)
        return ranges, _named(faces, walls)

    def cast_layers(
        self,
        lrf: LaserRangeFinder,
        pose: Sequence[float] | Float,
        elevations: Sequence[float] = (0.0,),
        *,
        pitch: float = 0.0,
        roll: float = 0.0,
    ) -> tuple[Float, Int]:
        """Cast in 3D: layers of beams at elevations [rad], from a laser that may be tilted.

        The ranges (layers, beams) [m] follow REP 117; of the walls or triangles −1 is none. A layer
        without elevation, of a laser that is not tilted, is the scan of `cast`. Inclined beams are
        cast in float64 without a proof: right where they pass edges by more than about 1e-14 rad.

        The pitch turns the laser about the robot's left [rad]: the beam ahead sinks where it is
        positive; the roll about its ahead [rad]: its left side rises.
        """
        if self._lighting is not None:
            return self.light_layers(lrf, pose, elevations, pitch=pitch, roll=roll)[:2]
        level = _level_layers(lrf, elevations, pitch, roll)
        x, y, theta = as_pose(pose)
        ranges = np.empty((len(level), lrf.beams))
        walls = np.empty((len(level), lrf.beams), np.int64)
        if level.any():
            scan = self.cast(lrf, (x, y, theta))
            ranges[level], walls[level] = scan.ranges, scan.walls
        if not level.all():
            beams = layer_directions(lrf, theta, elevations, pitch=pitch, roll=roll)[~level]
            if self._solid is None:
                self._solid = MeshScene.of(self.world, self._triangles)
            origin = np.array([x, y, lrf.height])
            found, faces = self._solid.cast(origin, beams.reshape(-1, 3), lrf.range_max)
            found = within_limits(found, lrf.range_min, lrf.range_max)
            ranges[~level] = found.reshape(-1, lrf.beams)
            walls[~level] = np.where(np.isfinite(found), faces, -1).reshape(-1, lrf.beams)
        return ranges, walls

    def light_layers(
        self,
        lrf: LaserRangeFinder,
        pose: Sequence[float] | Float,
        elevations: Sequence[float] = (0.0,),
        *,
        pitch: float = 0.0,
        roll: float = 0.0,
    ) -> Lit:
        """Cast as `cast_layers` does, with mirrors, glass, intensities and echoes.

        Up to the first mirror or pane level layers are exact; all else is cast in float64.

        Examples:
            >>> import lrf3d
            >>> walls = [[2, -1, 2, 1], [-1, -1, -1, 1]]
            >>> world = lrf3d.World(walls, [0, 1], materials=["mirror", "plaster"])
            >>> ahead = lrf3d.LaserRangeFinder(0.0, 0.0, beams=1, height=1.0)
            >>> found = lrf3d.EmbreeCaster(world).light_layers(ahead, (0, 0, 0), [0.0, 0.1, 0.9])
            >>> found.ranges[:, 0].round(3).tolist()
            [5.0, 5.025, inf]
            >>> found.chains[1, 0, :3].tolist()
            [0, 1, -1]
        """
        if self._lighting is None:
            raise InputError("world without materials: its beams have no intensities")
        level = _level_layers(lrf, elevations, pitch, roll)
        x, y, theta = as_pose(pose)
        beams = layer_directions(lrf, theta, elevations, pitch=pitch, roll=roll)[~level]
        lit = self._lighting.light_layers(lrf, self.tree(-math.inf), (x, y, lrf.height), beams)
        flat = self._lit(
            lrf, np.array([(x, y, theta)] * int(level.any())).reshape(-1, 3), chains=True
        )
        # Each layer is a row of the inclined ones, in their order, or the level scan after these.
        rows = np.where(level, len(beams), np.cumsum(~level) - 1)
        return Lit(*(np.concatenate(both)[rows] for both in zip(lit, flat, strict=True)))

    def _fill(self, height: float, laser: Plain, poses: Float, ranges: Float, walls: Int) -> None:
        # A scene is built for ranges up to a power of two.
        key = bisect_left(self._levels, height), math.frexp(laser[-1])[1]
        scene = self._scenes.get(key)
        few = ranges.shape[1] <= FEW
        if scene is None or few:
            tree = self.tree(height)
            if few or not len(tree.walls) or not embreex_installed():
                super()._fill(height, laser, poses, ranges, walls)
                return
            scene = self._scenes[key] = WallScene(tree, math.ldexp(1.0, key[1]))
        scene.cast(laser, poses, ranges, walls)

    def _batch(self, lrf: LaserRangeFinder, poses: Float, *, keep_walls: bool) -> tuple[Float, Int]:
        if self._triangles is None:
            return super()._batch(lrf, poses, keep_walls=keep_walls)
        laser_of(lrf)
        caster, faces = self._cut(lrf.height)
        ranges, walls = caster._batch(lrf, poses, keep_walls=keep_walls)
        return ranges, _named(faces, walls)


def _cut(triangles: Any, height: float) -> tuple[EmbreeCaster, Int]:
    """A caster for the cut of a mesh at a height [m], and the triangle of each wall."""
    segments, faces = level_cut(triangles, height)
    world = World(segments, heights=np.full(len(segments), max(height, 1.0)))
    return EmbreeCaster(world), faces


def _level_layers(lrf: LaserRangeFinder, elevations: object, pitch: float, roll: float) -> Bool:
    """Which layers (n,) of a range finder, checked with all angles, are level."""
    laser_of(lrf)
    angles: Float = np.asarray(numbers(elevations, "elevations"), dtype=np.float64)
    if angles.ndim != 1 or not np.isfinite(angles).all() or not is_finite(pitch, roll):
        found = f"layers at {shown(elevations)}, pitch {shown(pitch)}, roll {shown(roll)}"
        raise InputError(f"{found}: expected finite numbers of radians")
    return np.asarray((angles == 0.0) & (pitch == 0.0 == roll))


def _named(names: Int, rows: Int) -> Int:
    """The names of the walls in some rows; −1 stays −1."""
    return np.append(names, -1)[rows]
