"""EmbreeCaster: Embree finds the walls, float64 proves them, and the ranges are exact.

Most beams are proved by one look at the wall that Embree names: see `embree_walls` for what that
takes. The few others (near ends and other walls, at grazing incidence) are cast again among the
float64 walls. Meshes, layers and tilted lasers are cast in 3D, with float64 distances.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from lrf3d.casting.embree_walls import REACH, float32_error, triangles
from lrf3d.casting.kernels.clear_parts import clear_parts
from lrf3d.casting.kernels.embree_proof import prove, prove_many, send, send_many
from lrf3d.casting.mesh_scene import MeshScene
from lrf3d.casting.scans import limit_ranges, make_scan
from lrf3d.casting.threads import share
from lrf3d.casting.wall_tree import build_tree
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan, layer_directions
from lrf3d.pose import as_pose, as_poses
from lrf3d.world import World

BLOCK = 64
"""Poses whose rays are handed to Embree at once: 600 kB with 181 beams, no copy of a batch."""

FAR = 1.01
"""How much farther than the range Embree looks, so that its error never hides a wall in range."""

_NOTHING = np.empty(0, dtype=np.int32)


class EmbreeCaster:
    """Casts scans with Embree; at walls, decisions and ranges are the exact ones of PlanarCaster.

    Args:
        world: A world, or a ``trimesh.Trimesh``, whose triangles then stand where a world has
            its walls; their distances are those of their planes in float64.
    """

    def __init__(self, world: Any) -> None:
        self.world = world
        self._walls = world if isinstance(world, World) else None
        self._levels = np.empty(0) if self._walls is None else np.unique(self._walls.heights)
        self._scenes: dict[tuple[int, int], _WallScene] = {}
        self._mesh: MeshScene | None = None

    def cast(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> LaserScan:
        """The true scan from a pose; ``walls`` holds triangles where a mesh was given."""
        pose = as_pose(pose)
        if self._walls is None:
            ranges, faces = self.cast_layers(lrf, pose)
            return make_scan(lrf, pose, ranges[0], faces[0])
        return LaserScan.measured(lrf, pose, *self._scene(lrf).cast(lrf, pose))

    def cast_batch(self, lrf: LaserRangeFinder, poses: Float) -> Float:
        """Ranges (k, beams) from poses (k, 3), on all cores."""
        return self._cast_batch(lrf, poses, np.empty((0, lrf.beams), np.int64))

    def scan_batch(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int]:
        """Ranges and walls (k, beams) from poses (k, 3), on all cores."""
        walls = np.empty((len(poses), lrf.beams), np.int64)
        return self._cast_batch(lrf, poses, walls), walls

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

        Walls reach from the ground to their heights; distances are computed in float64 from the
        plane of the wall or triangle that Embree finds in float32.

        Args:
            lrf: The range finder: its angles, limits and height.
            pose: Pose x, y [m], theta [rad].
            elevations: Angles of the layers above the laser's own plane [rad].
            pitch: Turn about the robot's left [rad]; the beam ahead sinks where it is positive.
            roll: Turn about the robot's ahead [rad]; its left side rises where it is positive.

        Returns:
            Ranges (layers, beams) [m] after REP 117, and the walls or triangles, −1 for none.
        """
        x, y, theta = as_pose(pose)
        beams = layer_directions(lrf, theta, elevations, pitch=pitch, roll=roll)
        origin = np.array([x, y, lrf.height])
        distances, faces = self._solid().cast(origin, beams.reshape(-1, 3), FAR * lrf.range_max)
        ranges = limit_ranges(distances, lrf).reshape(beams.shape[:2])
        return ranges, np.where(np.isfinite(ranges), faces.reshape(ranges.shape), -1)

    def _solid(self) -> MeshScene:
        """The scene of the walls at their heights, or of the mesh; built at the first need."""
        if self._mesh is None:
            made = MeshScene.of_mesh if self._walls is None else MeshScene.of_world
            self._mesh = made(self.world)
        return self._mesh

    def _scene(self, lrf: LaserRangeFinder) -> "_WallScene":
        """The scene for beams of this height and range: built once for each level and range."""
        assert self._walls is not None
        level = int(self._levels.searchsorted(lrf.height))
        key = level, math.frexp(lrf.range_max)[1]
        if key not in self._scenes:
            tall = np.flatnonzero(self._walls.heights >= lrf.height).astype(np.int32)
            self._scenes[key] = _WallScene(self._walls.segments[tall], tall, 2.0 ** key[1])
        return self._scenes[key]

    def _cast_batch(self, lrf: LaserRangeFinder, poses: Float, walls: Int) -> Float:
        poses = np.ascontiguousarray(as_poses(poses))
        ranges = np.empty((len(poses), lrf.beams))
        if self._walls is None:
            for k, pose in enumerate(poses):
                scan = self.cast(lrf, pose)
                ranges[k] = scan.ranges
                walls[k : k + 1] = scan.walls
            return ranges
        scene = self._scene(lrf)

        def work(start: int, stop: int) -> None:
            for k in range(start, stop, BLOCK):
                part = slice(k, min(k + BLOCK, stop))
                scene.cast_many(lrf, poses[part], ranges[part], walls[part])

        share(work, len(poses))
        return ranges


class _WallScene:
    """Walls of one level, as Embree and as float64 has them, for ranges up to a distance [m]."""

    def __init__(self, segments: Float, index: Any, distance: float) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.tree = build_tree(segments, index)
        box = self.tree.boxes[0] if len(segments) else np.zeros(4)
        centre = np.round(0.5 * (box[:2] + box[2:]))
        self.centre = (float(centre[0]), float(centre[1]))
        # Half as far again: the laser may stand beside the world.
        self.radius = 1.5 * float(np.abs(box.reshape(2, 2) - centre).max()) + 1e-30
        distance = min(FAR * distance, 4.0 * self.radius)
        self.delta = 2.0 * float32_error(self.radius, distance)
        self.local = (*self.centre, self.radius, 1.5 * self.delta)
        self.clear = clear_parts(
            self.tree.boxes, self.tree.links, self.tree.walls, REACH * self.delta
        )
        self.embree = EmbreeScene()
        self.mesh = None
        if len(segments):
            self.mesh = TriangleMesh(
                self.embree, *triangles(self.tree.walls, self.centre, self.delta)
            )

    def cast(self, lrf: LaserRangeFinder, pose: tuple[float, float, float]) -> tuple[Float, Int]:
        """The ranges and walls of a scan, one of each for a beam."""
        rays = send(lrf.fan, *pose, *self.centre)
        found = self.embree.run(*rays, FAR * lrf.range_max) if self.mesh else _NOTHING
        ranges, walls = prove(
            *self.tree, self.clear, self.local, found, lrf.fan, *pose, *lrf.spread,
            lrf.range_min, lrf.range_max,
        )  # fmt: skip
        return ranges, walls

    def cast_many(self, lrf: LaserRangeFinder, poses: Float, ranges: Float, walls: Int) -> None:
        """Cast scans at poses (k, 3); fill the ranges (k, beams), and the walls unless empty."""
        rays = send_many(lrf.fan, poses, *self.centre)
        found = self.embree.run(*rays, FAR * lrf.range_max) if self.mesh else _NOTHING
        prove_many(
            *self.tree, self.clear, self.local, found, lrf.fan, poses, *lrf.spread,
            lrf.range_min, lrf.range_max, ranges, walls,
        )  # fmt: skip
