"""EmbreeCaster: Embree finds the walls, float64 arithmetic proves them, and the ranges are exact.

Most beams are proved with the wall that Embree reports alone; `embree_walls` gives the argument.
The few others (near ends and other walls, at grazing incidence) are cast again among the float64
walls. A mesh is cut by the plane of the beams, and its cuts are treated as walls. Layers and tilted
lasers are cast in 3D, in float64.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lrf3d.casting.batch_caster import BatchCaster, Kernels, limited
from lrf3d.casting.exact import RationalCaster
from lrf3d.casting.kernels.scans import BEYOND_WALLS
from lrf3d.casting.mesh_scene import MeshScene, level_cut
from lrf3d.casting.wall_scene import WallScene, build_wall_scene
from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan, layer_directions
from lrf3d.pose import as_pose
from lrf3d.world import World


class LayerLight(NamedTuple):
    """Layers of beams with their light; −1 stands for no wall, and after the last one of a chain.

    Attributes:
        ranges: (layers, beams) ranges [m] after REP 117.
        walls: (layers, beams) the walls that they end on.
        intensities: (layers, beams) their intensities, 0 where nothing returned.
        echoes: (layers, beams, k) ranges [m] of the strongest echoes, the nearest first; k is 0
            where the laser reports one echo.
        echo_intensities: (layers, beams, k) their intensities.
        chains: (layers, beams, 16) the walls on the way of each beam.
    """

    ranges: Float
    walls: Int
    intensities: Float
    echoes: Float
    echo_intensities: Float
    chains: Int


LEVELS = 8
"""Number of laser heights for which the cuts of a mesh are kept."""


class EmbreeCaster(BatchCaster):
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
        if not (isinstance(world, World) or hasattr(world, "triangles")):
            raise InputError(f"caster for {shown(world)}: expected a World or a trimesh.Trimesh")
        self.world = world
        self._walls = world if isinstance(world, World) else None
        self._rationals = RationalCaster(World(np.empty((0, 4))) if self._walls is None else world)
        self._levels = np.empty(0) if self._walls is None else np.unique(self._walls.heights)
        if self._walls is not None and self._walls.materials:
            from lrf3d.casting.lighting import Lighting
            from lrf3d.casting.planar import PlanarCaster

            # Embree finds the first walls; behind mirrors and glass the float64 walls are cast at.
            self._lights = Lighting(self._walls, PlanarCaster(self._walls).tree)
        self._scenes: dict[tuple[int, int], WallScene] = {}
        self._mesh: MeshScene | None = None
        self._cuts: dict[float, tuple[EmbreeCaster, Int]] = {}

    def cast(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> LaserScan:
        """The true scan from a pose; for a mesh, ``walls`` holds indices of triangles."""
        if self._walls is not None:
            return super().cast(lrf, pose)
        caster, faces = self._cut(lrf.height)
        scan = caster.cast(lrf, pose)
        return replace(scan, walls=_named(faces, scan.walls))

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

        Walls reach from the ground to their heights. A layer without elevation, of a laser that is
        not tilted, is the scan of `cast`, exact also at corners. Inclined beams are cast in float64
        without a proof: right where they pass edges by more than about 1e-14 rad. Of 600 within
        1e-7 rad of corners of pillars the largest error was 1.3e-12 m.

        Args:
            lrf: The range finder: its angles, limits and height.
            pose: Pose x, y [m], theta [rad].
            elevations: Angles of the layers above the laser's own plane [rad].
            pitch: Turn about the robot's left [rad]; the beam ahead sinks where it is positive.
            roll: Turn about the robot's ahead [rad]; its left side rises where it is positive.

        Returns:
            Ranges (layers, beams) [m] after REP 117, and the walls or triangles, −1 for none. In
            worlds with materials they are those of `light_layers`.
        """
        if self._lights is not None:
            return self.light_layers(lrf, pose, elevations, pitch=pitch, roll=roll)[:2]
        x, y, theta = as_pose(pose)
        level = (np.asarray(elevations, dtype=np.float64) == 0.0) & (pitch == 0.0 == roll)
        ranges = np.empty((len(level), lrf.beams))
        walls = np.empty((len(level), lrf.beams), np.int64)
        if level.any():
            scan = self.cast(lrf, (x, y, theta))
            ranges[level], walls[level] = scan.ranges, scan.walls
        if not level.all():
            beams = layer_directions(lrf, theta, elevations, pitch=pitch, roll=roll)[~level]
            origin = np.array([x, y, lrf.height])
            distances, faces = self._solid().cast(origin, beams.reshape(-1, 3), lrf.range_max)
            ranges[~level], walls[~level] = limited(lrf, distances, faces)
        return ranges, walls

    def light_layers(
        self,
        lrf: LaserRangeFinder,
        pose: Sequence[float] | Float,
        elevations: Sequence[float] = (0.0,),
        *,
        pitch: float = 0.0,
        roll: float = 0.0,
    ) -> LayerLight:
        """Cast in 3D with the light of each beam: mirrors, glass, intensities and echoes.

        Walls are upright, so mirrors turn inclined beams in plan and leave their slope; beams go
        over what is lower. As in `cast_layers`, level layers are exact and others are cast in
        float64, from leg to leg.

        Args:
            lrf: The range finder: its angles, limits, height, and what it makes of the light.
            pose: Pose x, y [m], theta [rad].
            elevations: Angles of the layers above the laser's own plane [rad].
            pitch: Turn about the robot's left [rad].
            roll: Turn about the robot's ahead [rad].

        Raises:
            InputError: The world has no materials.

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
        lights = self._lights
        if lights is None:
            raise InputError("world without materials: its beams have no intensities")
        x, y, theta = as_pose(pose)
        level = (np.asarray(elevations, dtype=np.float64) == 0.0) & (pitch == 0.0 == roll)
        beams = layer_directions(lrf, theta, elevations, pitch=pitch, roll=roll)[~level]
        origin = np.array([x, y, lrf.height])
        lit = lights.light_solid(lrf, self._solid(), origin, beams.reshape(-1, 3))
        flat = self._lit(
            lrf, np.array([(x, y, theta)] * int(level.any())).reshape(-1, 3), chains=True
        )
        # Each layer is a row of the inclined ones, in their order, or the level scan after these.
        rows = np.where(level, len(beams), np.cumsum(~level) - 1)
        return LayerLight(
            *(np.concatenate(both)[rows] for both in zip(lit[:6], flat[:6], strict=True))
        )

    def _solid(self) -> MeshScene:
        """The 3D scene of the walls or of the mesh, built at its first use."""
        if self._mesh is None:
            made = MeshScene.of_mesh if self._walls is None else MeshScene.of_world
            self._mesh = made(self.world)
        return self._mesh

    def _cut(self, height: float) -> tuple["EmbreeCaster", Int]:
        """A caster for the cut of the mesh at a height [m], and the triangle of each wall."""
        found = self._cuts.get(height)
        if found is None:
            triangles = np.asarray(self.world.triangles, dtype=np.float64).reshape(-1, 3, 3)
            segments, faces = level_cut(triangles, height)
            world = World(segments, heights=np.full(len(segments), max(height, 1.0)))
            found = EmbreeCaster(world), faces
            if len(self._cuts) >= LEVELS:
                self._cuts = {}
            self._cuts[height] = found
        return found

    def _scene(self, lrf: LaserRangeFinder) -> WallScene:
        """The scene for beams of this height and range: built once for each level and range."""
        assert self._walls is not None
        level = int(self._levels.searchsorted(lrf.height))
        key = level, math.frexp(min(lrf.range_max, BEYOND_WALLS))[1]
        if key not in self._scenes:
            tall = np.flatnonzero(self._walls.heights >= lrf.height).astype(np.int32)
            segments = self._walls.segments[tall]
            self._scenes[key] = build_wall_scene(segments, tall, math.ldexp(1.0, key[1]))
        return self._scenes[key]

    def _kernels(self, lrf: LaserRangeFinder) -> Kernels:
        return self._scene(lrf).kernels(lrf)

    def _cast_batch(self, lrf: LaserRangeFinder, poses: Float, walls: Int) -> Float:
        if self._walls is not None:
            return super()._cast_batch(lrf, poses, walls)
        caster, faces = self._cut(lrf.height)
        ranges = caster._cast_batch(lrf, poses, walls)
        walls[:] = _named(faces, walls)
        return ranges


def _named(names: Int, rows: Int) -> Int:
    """The names of the walls in some rows; −1 stays −1."""
    return np.append(names, -1)[rows]
