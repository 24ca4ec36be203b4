"""Baselines: methods to cast a scan, with one interface, so that one benchmark measures all.

Open3D and MuJoCo take part where they are installed (extra bench).
"""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.raw_embree import RawEmbreeCaster, rays
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.laser.range_finder import within_limits
from lrf3d.world import World
from lrf3d.world.extrude import extrude

Call = Callable[[], object]

PAIRS = 1_000_000
"""Pairs of beam and wall that NumPy intersects at once: some 50 MB of determinants."""


class Baseline(ABC):
    """One way to cast scans at the walls of a world; its index is built when it is made.

    Attributes:
        key: Its name in JSON.
        title: Its name in tables and pictures.
        most_walls: The largest world in which waiting for it is bearable.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    most_walls: ClassVar[int] = 10_000_000

    @abstractmethod
    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        """Build all that is built once.

        Raises:
            ImportError: A library is not installed.
        """

    @abstractmethod
    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        """A call that casts scans from poses (k, 3), with what goes in made ready for it."""

    @abstractmethod
    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        """Ranges (k, beams) [m] after REP 117 and, where it names them, walls."""

    def single(self, lrf: LaserRangeFinder, pose: Float) -> Call:
        """A call that casts one scan."""
        return self.scans(lrf, pose[None])

    @property
    def index_bytes(self) -> int | None:
        """Memory of what is built once [bytes], where it is known."""
        return None


class Determinants(Baseline):
    """Every beam against every wall, in NumPy."""

    key, title = "numpy", "NumPy determinants"
    most_walls = 10_000

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        self._segments = world.segments

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        return lambda: [
            cast_determinants(self._segments, pose[:2], lrf.directions(pose)) for pose in poses
        ]

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        found: Any = self.scans(lrf, poses)()
        distances, walls = (np.array(part) for part in zip(*found, strict=True))
        return _limited(distances, walls, lrf)


class _Own(Baseline):
    """A caster of lrf3d, on all cores."""

    _caster: PlanarCaster | EmbreeCaster

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        return lambda: self._caster.cast_batch(lrf, poses)

    def single(self, lrf: LaserRangeFinder, pose: Float) -> Call:
        # From the pose to the LaserScan.
        plain = tuple(pose.tolist())
        return lambda: self._caster.cast(lrf, plain)

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        return self._caster.scan_batch(lrf, poses)


class Planar(_Own):
    """PlanarCaster."""

    key, title = "planar", "PlanarCaster"

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        self._caster = caster = PlanarCaster(world)
        self._tree = caster.tree(lrf.height)

    @property
    def index_bytes(self) -> int:
        return sum(part.nbytes for part in self._tree)


class Embree(_Own):
    """EmbreeCaster, which proves what Embree finds."""

    key, title = "embree", "EmbreeCaster"

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        self._caster = EmbreeCaster(world)
        # Embree's scene, and what the proof needs, are built by the first cast.
        self._caster.cast(lrf, (0.0, 0.0, 0.0))


class RawEmbree(Baseline):
    """``EmbreeScene.run`` of embreex: the bare float32 library, its rays made beforehand."""

    key, title = "raw", "Embree float32"

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        # The scene of trimesh would be scaled, and its distances with it.
        vertices, faces = _triangles(world)
        self._centre = world.origin
        self._scene = EmbreeScene()
        self._kept = TriangleMesh(self._scene, vertices, faces)

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        origins, directions = _rays32(lrf, poses, self._centre)
        return lambda: self._scene.run(origins, directions)

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        found = self._scene.run(*_rays32(lrf, poses, self._centre), output=1)
        hit = found["primID"] >= 0
        distances = np.where(hit, found["tfar"].astype(np.float64), np.inf)
        walls = np.where(hit, found["primID"] // 2, -1)
        shape = len(poses), lrf.beams
        return _limited(distances.reshape(shape), walls.reshape(shape), lrf)


class Location(Baseline):
    """``mesh.ray.intersects_location`` of trimesh, over Embree."""

    key, title = "location", "trimesh location"

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        self._caster, self._centre = RawEmbreeCaster(world), world.origin
        self._caster.cast(lrf, (0.0, 0.0, 0.0))

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        origins, directions = rays(lrf, poses, self._centre)
        find = self._caster.mesh.ray.intersects_location
        return lambda: find(origins, directions, multiple_hits=False)

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        return self._caster.scan_batch(lrf, poses)


class Open3D(Baseline):
    """Open3D's ``RaycastingScene``, Embree on all cores with its rays made beforehand."""

    key, title = "open3d", "Open3D"

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        self._library = _library("open3d")
        vertices, faces = _triangles(world)
        self._centre = world.origin
        self._scene = self._library.t.geometry.RaycastingScene()
        self._scene.add_triangles(vertices, faces.astype(np.uint32))

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        tensor = self._tensor(lrf, poses)
        return lambda: self._scene.cast_rays(tensor)

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        found = self._scene.cast_rays(self._tensor(lrf, poses))
        shape = len(poses), lrf.beams
        distances = found["t_hit"].numpy().astype(np.float64).reshape(shape)
        walls = (found["primitive_ids"].numpy().astype(np.int64) // 2).reshape(shape)
        return _limited(distances, walls, lrf)

    def _tensor(self, lrf: LaserRangeFinder, poses: Float) -> Any:
        return self._library.core.Tensor(np.hstack(_rays32(lrf, poses, self._centre)))


class MuJoCo(Baseline):
    """MuJoCo's ``mj_multiRay`` at one mesh of all walls, scan after scan."""

    key, title = "mujoco", "MuJoCo"
    most_walls = 10_000

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        self._library = library = _library("mujoco")
        vertices, faces = _triangles(world)
        spec = library.MjSpec()
        mesh = spec.add_mesh(name="walls", uservert=vertices.ravel(), userface=faces.ravel())
        # Walls enclose no volume, which a mesh must unless it is a shell.
        mesh.inertia = library.mjtMeshInertia.mjMESH_INERTIA_SHELL
        spec.worldbody.add_geom(type=library.mjtGeom.mjGEOM_MESH, meshname="walls")
        self._model = spec.compile()
        self._data = library.MjData(self._model)
        library.mj_forward(self._model, self._data)
        self._centre = world.origin

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        origins, directions = rays(lrf, poses, self._centre)
        starts = origins[:: lrf.beams, :, None]
        beams = directions.reshape(len(poses), -1, 1)
        return lambda: [
            self._cast(lrf, start, beam) for start, beam in zip(starts, beams, strict=True)
        ]

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        distances = np.array(self.scans(lrf, poses)()).reshape(len(poses), lrf.beams)
        distances[distances < 0.0] = np.inf
        # Of walls it knows only the mesh.
        return within_limits(distances, lrf.range_min, lrf.range_max), None

    def _cast(self, lrf: LaserRangeFinder, start: Float, beams: Float) -> Float:
        met = np.zeros((lrf.beams, 1), np.int32)
        distances = np.empty((lrf.beams, 1))
        self._library.mj_multiRay(
            self._model, self._data, start, beams, None, 1, -1, met, distances, None,
            lrf.beams, lrf.range_max,
        )  # fmt: skip
        return distances


BASELINES: tuple[type[Baseline], ...] = (
    Determinants, Planar, RawEmbree, Location, Embree, Open3D, MuJoCo,
)  # fmt: skip
"""In the order of the table."""

OWN = (Planar, Embree)
"""Those that are lrf3d's."""


def cast_determinants(segments: Float, origin: Float, beams: Float) -> tuple[Float, Int]:
    """Section 2.3 of Teslić et al. to the letter: every beam against every wall, by determinants.

    Returns:
        Distances (b,) [m] and walls (b,) that unit beams (b, 2) from an origin (2,) meet.
    """
    starts, spans = segments[:, :2] - origin, segments[:, 2:] - segments[:, :2]
    distances = np.full(len(beams), np.inf)
    walls = np.full(len(beams), -1)
    size = max(1, PAIRS // max(1, len(beams)))
    for first in range(0, len(segments), size):
        hits = _intersect(beams, starts[first : first + size], spans[first : first + size])
        nearest = hits.argmin(axis=1)
        reached = hits[np.arange(len(beams)), nearest]
        nearer = reached < distances
        distances[nearer] = reached[nearer]
        walls[nearer] = first + nearest[nearer]
    return distances, walls


def _intersect(beams: Float, starts: Float, spans: Float) -> Float:
    """Distances (b, n) from the origin along unit beams (b, 2) to segments, +inf where missed.

    The segments run from starts (n, 2) along spans (n, 2), seen from the laser. With the
    determinants det(beam, span), det(start, span) and det(start, beam), the beam meets the line
    at t = det(start, span) / det(beam, span), at the part u = det(start, beam) / det(beam, span)
    of the segment. A beam along a segment is left out.
    """
    across = np.outer(beams[:, 0], spans[:, 1]) - np.outer(beams[:, 1], spans[:, 0])
    ahead = starts[:, 0] * spans[:, 1] - starts[:, 1] * spans[:, 0]
    aside = np.outer(beams[:, 1], starts[:, 0]) - np.outer(beams[:, 0], starts[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance: Float = ahead / across
        place = aside / across
    distance[~((distance >= 0.0) & (place >= 0.0) & (place <= 1.0))] = np.inf
    return distance


def _triangles(world: World) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Vertices and faces of the extruded walls, two triangles a wall, as libraries take them."""
    mesh = extrude(world)
    return np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32)


def _rays32(
    lrf: LaserRangeFinder, poses: Float, centre: Float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Origins and directions (k beams, 3) in float32 of scans at poses (k, 3)."""
    origins, directions = rays(lrf, poses, centre)
    return origins.astype(np.float32), directions.astype(np.float32)


def _limited(distances: Float, walls: Int, lrf: LaserRangeFinder) -> tuple[Float, Int]:
    """Ranges after REP 117, and walls where there is a range."""
    ranges = within_limits(distances, lrf.range_min, lrf.range_max)
    return ranges, np.where(np.isfinite(ranges), walls, -1)


def _library(name: str) -> ModuleType:
    """Import a library without its warnings."""
    from importlib import import_module

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return import_module(name)
