"""EmbreeCaster: Embree finds the walls, with the exact ranges of PlanarCaster; and casts in 3D.

Embree works in float32, so the wall that it finds for a beam is a guess: the planar kernels check
that the beam meets it, and look for nearer ones. A mesh is cut by the plane of the beams, and its
cuts are treated as walls. Layers and tilted lasers are cast in 3D, in float64.
"""

import math
from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.casting.caster import MOST_TREES, PlanarCaster
from lrf3d.casting.kernels.beams import RAY, cast_rays
from lrf3d.casting.kernels.echoes import Lit
from lrf3d.casting.kernels.scans import FEW, rays_from
from lrf3d.casting.kernels.tree import Plain, Tree, build_tree
from lrf3d.casting.skyline import Conditions, Rows
from lrf3d.casting.triangle_rays import MeshScene, TriangleRays, embreex_installed
from lrf3d.geometry.lines import Bool, Float, Int, is_finite, numbers
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser import DepthCamera, LaserRangeFinder, Lidar, layer_directions
from lrf3d.laser.range_finder import within_limits
from lrf3d.world import World
from lrf3d.world.mesh import level_cut

# [rays] Rays that are prepared together: 160 kB, which stay in the cache of a core.
AT_ONCE = 4_000


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
        self._scene = lru_cache(MOST_TREES)(self._walls)

    @cached_property
    def _solid(self) -> MeshScene:
        return MeshScene.of(self.world, self._triangles)

    def _level(self, height: float) -> float:
        return super()._level(height) if self._triangles is None else height

    def _build(self, level: float) -> Tree:
        if self._triangles is None:
            return super()._build(level)
        # The walls of a mesh are its cuts, by the names of their triangles.
        segments, faces = level_cut(self._triangles, level)
        return build_tree(segments, faces.astype(np.int32))

    def _walls(self, level: float) -> tuple[TriangleRays, float, float]:
        """The walls as they stand in the tree, of two triangles each, seen from their middle x, y.

        Embree counts coordinates from there.
        """
        tree = self._tree(level)
        box = tree.boxes[:, 0]
        middle = np.round(0.5 * (box[:2] + box[2:]))
        ends = tree.walls.reshape(-1, 2, 2) - middle
        corners = np.empty((len(ends), 2, 3, 3), np.float32)
        corners[..., :2] = ends[:, [[0, 1, 1], [0, 1, 0]]]
        corners[..., 2] = [[-1.0, -1.0, 2.0], [-1.0, 2.0, 2.0]]
        return TriangleRays(corners.reshape(-1, 3, 3)), *middle.tolist()

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
        if self.lighting is not None:
            return self.light_layers(lrf, pose, elevations, pitch=pitch, roll=roll)[:2]
        x, y, theta = as_pose(pose)
        level = _level_layers(lrf, elevations, pitch, roll)
        beams = layer_directions(lrf, theta, elevations, pitch=pitch, roll=roll)[~level]
        scan = self.cast(lrf, (x, y, theta))
        ranges = np.tile(scan.ranges, (len(level), 1))
        walls = np.tile(scan.walls, (len(level), 1))
        if len(beams):
            start = np.array([x, y, lrf.height])
            found, faces = self._solid.cast(start, beams.reshape(-1, 3), lrf.range_max)
            found = within_limits(found, lrf.range_min, lrf.range_max).reshape(-1, lrf.beams)
            ranges[~level] = found
            walls[~level] = np.where(np.isfinite(found), faces.reshape(found.shape), -1)
        return ranges, walls

    def light_layers(
        self,
        lrf: LaserRangeFinder,
        pose: Sequence[float] | Float,
        elevations: Sequence[float] = (0.0,),
        **tilt: float,
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
        if self.lighting is None:
            raise InputError("world without materials: its beams have no intensities")
        x, y, theta = as_pose(pose)
        level = _level_layers(lrf, elevations, **tilt)
        beams = layer_directions(lrf, theta, elevations, **tilt)[~level]
        lit = self.lighting.light_layers(lrf, self.tree(-math.inf), (x, y, lrf.height), beams)
        poses = np.array([(x, y, theta)] * int(level.any())).reshape(-1, 3)
        flat = self._lit(lrf, poses, chains=True)
        # Each layer is a row of the inclined ones, in their order, or the level scan after these.
        rows = np.where(level, len(beams), np.cumsum(~level) - 1)
        return Lit(*(np.concatenate(both)[rows] for both in zip(lit, flat, strict=True)))

    def _layered(
        self, sensor: Lidar | DepthCamera, pose: Pose, moment: Conditions
    ) -> tuple[Float, Rows]:
        if self._triangles is None:
            return super()._layered(sensor, pose, moment)
        beams = sensor.directions(pose)
        sizes = np.linalg.norm(beams, axis=2)
        flat = (beams / sizes[..., None]).reshape(-1, 3)
        origin = np.array([pose.x, pose.y, sensor.mount[2]])
        far = sensor.range_max * float(sizes.max())
        found, faces = (each.reshape(sizes.shape) for each in self._solid.cast(origin, flat, far))
        down = beams[..., 2] < 0.0
        floor = np.where(down, -origin[2] / np.where(down, beams[..., 2], -1.0), np.inf)
        ranges = np.minimum(found / sizes, floor)
        ranges = within_limits(ranges, sensor.range_min, sensor.range_max)
        met = np.isfinite(ranges) & (found / sizes <= floor)
        return ranges, np.where(met, faces, -1).astype(np.int32)

    def _fill(self, height: float, laser: Plain, poses: Float, ranges: Float, walls: Int) -> None:
        tree = self._plain(height)
        beams = laser[0].shape[1]
        if beams <= FEW or not len(tree[-1]) or not embreex_installed():
            super()._fill(height, laser, poses, ranges, walls)
            return
        scene, x, y = self._scene(self._level(height))
        many = max(1, AT_ONCE // beams)
        for first in range(0, len(poses), many):
            rays = np.empty((len(poses[first : first + many]), beams), RAY)
            rays_from(laser, poses[first : first + many], np.zeros(len(rays)), rays)
            flat = rays.ravel()
            ends = np.zeros((2, rays.size, 3), np.float32)
            ends[0, :, 0] = flat["x"] - x
            ends[0, :, 1] = flat["y"] - y
            ends[1, :, 0] = flat["dx"]
            ends[1, :, 1] = flat["dy"]
            part = slice(first * beams, first * beams + rays.size)
            guesses = scene.first(*ends) // 2
            cast_rays(tree, laser[-2:], flat, guesses, ranges[part], walls[part])


def _level_layers(
    lrf: LaserRangeFinder, elevations: object, pitch: float = 0.0, roll: float = 0.0
) -> Bool:
    """Which layers (n,) of a range finder, checked with all angles, are level."""
    expect(lrf, LaserRangeFinder, "range finder")
    angles: Float = np.asarray(numbers(elevations, "elevations"), dtype=np.float64)
    if angles.ndim != 1 or not np.isfinite(angles).all() or not is_finite(pitch, roll):
        raise InputError(
            f"layers at {shown(elevations)}, pitch {shown(pitch)}, roll {shown(roll)}: expected"
            " finite numbers of radians"
        )
    return np.asarray((angles == 0.0) & (pitch == 0.0 == roll))
