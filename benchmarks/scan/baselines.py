"""Rivals: ways to cast a scan, each with one face, so that one benchmark measures all of them."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.raw_embree import RawEmbreeCaster, rays
from lrf3d.casting.scans import limit_ranges
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.study.bench.determinants import cast_determinants
from lrf3d.world import World
from lrf3d.world.extrude import extrude

Call = Callable[[], object]


class Rival(ABC):
    """One way to cast scans at the walls of a world; its index is built when it is made.

    Attributes:
        key: Its name in JSON.
        title: Its name in tables and pictures.
        most_walls: The largest world in which waiting for it is bearable.
        threads: Whether a batch of it uses all cores.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    most_walls: ClassVar[int] = 10_000_000
    threads: ClassVar[bool] = False

    @abstractmethod
    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        """Build all that is built once."""

    @abstractmethod
    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        """A call that casts scans from poses (k, 3), with what goes in made ready for it."""

    @abstractmethod
    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        """Ranges (k, beams) [m] after REP 117 and, where it tells them, walls."""

    def single(self, lrf: LaserRangeFinder, pose: Float) -> Call:
        """A call that casts one scan."""
        return self.scans(lrf, pose[None])

    @property
    def index_bytes(self) -> int | None:
        """Memory of what is built once [bytes], where it can be told."""
        return None


class Determinants(Rival):
    """Every beam against every wall, in NumPy."""

    key, title = "numpy", "NumPy determinants"
    most_walls = 10_000

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        """Keep the walls: there is no index."""
        self._segments = world.segments

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        """Cast pose after pose."""
        return lambda: [
            cast_determinants(self._segments, pose[:2], lrf.directions(pose)) for pose in poses
        ]

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        """Ranges and walls."""
        found: Any = self.scans(lrf, poses)()
        distances, walls = (np.array(part) for part in zip(*found, strict=True))
        return limited(distances, walls, lrf)


class Planar(Rival):
    """PlanarCaster."""

    key, title, threads = "planar", "PlanarCaster", True

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        """Build the tree."""
        self._caster = PlanarCaster(world)
        self._tree = self._caster.tree(lrf.height)

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        """Cast on all cores."""
        return lambda: self._caster.cast_batch(lrf, poses)

    def single(self, lrf: LaserRangeFinder, pose: Float) -> Call:
        """Cast a scan, from the pose to the ``LaserScan``."""
        plain = tuple(pose.tolist())
        return lambda: self._caster.cast(lrf, plain)

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        """Ranges and walls."""
        return self._caster.scan_batch(lrf, poses)

    @property
    def index_bytes(self) -> int:
        """The tree with the walls in it."""
        return self._tree.nbytes


class Embree(Rival):
    """EmbreeCaster, which proves what Embree finds."""

    key, title, threads = "embree", "EmbreeCaster", True

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        """Build Embree's scene and what the proof needs, by a first cast."""
        self._caster = EmbreeCaster(world)
        self._caster.cast(lrf, (0.0, 0.0, 0.0))

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        """Cast on all cores."""
        return lambda: self._caster.cast_batch(lrf, poses)

    def single(self, lrf: LaserRangeFinder, pose: Float) -> Call:
        """Cast a scan, from the pose to the ``LaserScan``."""
        plain = tuple(pose.tolist())
        return lambda: self._caster.cast(lrf, plain)

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        """Ranges and walls."""
        return self._caster.scan_batch(lrf, poses)


class RawEmbree(Rival):
    """``EmbreeScene.run`` of embreex: the bare float32 library, its rays made beforehand."""

    key, title = "raw", "Embree float32"

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        """Build Embree's scene; trimesh's own would be scaled, and its distances with it."""
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        vertices, faces = triangles(world)
        self._centre = world.origin
        self._scene = EmbreeScene()
        self._kept = TriangleMesh(self._scene, vertices, faces)

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        """Find the triangles, on one core."""
        origins, directions = rays32(lrf, poses, self._centre)
        return lambda: self._scene.run(origins, directions)

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        """Ranges and walls."""
        found = self._scene.run(*rays32(lrf, poses, self._centre), output=1)
        hit = found["primID"] >= 0
        distances = np.where(hit, found["tfar"].astype(np.float64), np.inf)
        walls = np.where(hit, found["primID"] // 2, -1)
        shape = len(poses), lrf.beams
        return limited(distances.reshape(shape), walls.reshape(shape), lrf)


class Location(Rival):
    """``mesh.ray.intersects_location`` of trimesh, over Embree."""

    key, title = "location", "trimesh location"

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        """Build the mesh and, by a first cast, trimesh's scene."""
        self._caster, self._centre = RawEmbreeCaster(world), world.origin
        self._caster.cast(lrf, (0.0, 0.0, 0.0))

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        """Find the places that the rays hit."""
        origins, directions = rays(lrf, poses, self._centre)
        find = self._caster.mesh.ray.intersects_location
        return lambda: find(origins, directions, multiple_hits=False)

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        """Ranges and walls."""
        return self._caster.scan_batch(lrf, poses)


def triangles(world: World) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Vertices and faces of the extruded walls, two triangles a wall, as libraries take them."""
    mesh = extrude(world)
    return np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32)


def rays32(
    lrf: LaserRangeFinder, poses: Float, centre: Float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Origins and directions (k beams, 3) in float32 of scans at poses (k, 3)."""
    origins, directions = rays(lrf, poses, centre)
    return origins.astype(np.float32), directions.astype(np.float32)


def limited(distances: Float, walls: Int, lrf: LaserRangeFinder) -> tuple[Float, Int]:
    """Ranges after REP 117, and walls where there is a range."""
    ranges = limit_ranges(distances, lrf)
    return ranges, np.where(np.isfinite(ranges), walls, -1)
