"""WallScene: the walls of a world, in float64 and as triangles for Embree, to cast scans at."""

import math
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.batch_caster import Kernels
from lrf3d.casting.embree_library import EmbreeLibrary, embree_library, embreex_installed
from lrf3d.casting.embree_walls import (
    all_clear_parts,
    ends_of,
    float32_error,
    narrowest_cluster,
    triangles,
)
from lrf3d.casting.kernels.embree_proof import Local, ProvedWalls
from lrf3d.casting.kernels.embree_scans import cast_scan, cast_scans, prove_scans, send_rays
from lrf3d.casting.kernels.scans import PlainLaser, laser_of
from lrf3d.casting.kernels.tree import build_tree
from lrf3d.casting.planar import planar_kernels
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder

POSES_SENT = 64
"""Poses whose rays are passed to embreex at a time: 600 kB with 181 beams, not a whole batch."""

Faces32 = tuple[NDArray[np.float32], NDArray[np.int32]]


class WallScene(Protocol):
    """Walls that scans are cast at, exactly."""

    def kernels(self, lrf: LaserRangeFinder) -> Kernels:
        """The code that casts the scans of a range finder."""
        ...


def build_wall_scene(segments: Float, index: NDArray[np.int32], distance: float) -> WallScene:
    """The scene of segments (n, 4), with their indices (n,), for ranges up to a distance [m].

    Embree is called from compiled code if its library can be used, and otherwise through embreex.
    Where that is missing, the walls are searched in their tree; the scans are the same.
    """
    if not embreex_installed():
        return TreeScene(segments, index)
    prepared = _prepare(segments, index, distance)
    library = embree_library()
    return RunScene(*prepared) if library is None else PacketScene(*prepared, library)


def _prepare(
    segments: Float, index: NDArray[np.int32], distance: float
) -> tuple[ProvedWalls, Faces32]:
    """The walls as the proof needs them, and the triangles that stand for them in Embree."""
    tree = build_tree(segments, index)
    box = tree.boxes[0] if len(segments) else np.zeros(4)
    centre = np.round(0.5 * (box[:2] + box[2:]))
    # Half as far again: the laser may stand beside the world.
    radius = 1.5 * float(np.abs(box.reshape(2, 2) - centre).max()) + 1e-30
    along = segments[:, 2:] - segments[:, :2]
    longest = float(np.hypot(along[:, 0], along[:, 1]).max(initial=0.0))
    delta = 2.0 * float32_error(radius, min(distance + 2.0 * longest, 4.0 * radius))
    # Embree works in units of about the radius, a power of two that rounds nothing: at any scale
    # its float32 numbers stay clear of the smallest and of the largest.
    unit = math.ldexp(1.0, -math.frexp(radius)[1])
    x, y = float(centre[0]), float(centre[1])
    ends = ends_of(tree.walls)
    width = narrowest_cluster(ends)
    local = Local(x, y, unit, radius, 1.5 * delta, longest + 8.0 * delta, width)
    vertices, owners = triangles(tree.walls, ends, (x, y), delta, unit)
    known = ProvedWalls(tree, all_clear_parts(tree, delta), owners, local)
    return known, (vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))


class TreeScene:
    """Casts as `PlanarCaster` does, without Embree."""

    def __init__(self, segments: Float, index: NDArray[np.int32]) -> None:
        self._tree = build_tree(segments, index)

    def kernels(self, lrf: LaserRangeFinder) -> Kernels:
        """The code that casts the scans of a range finder."""
        return planar_kernels(self._tree, lrf)


class PacketScene:
    """Casts by compiled code that calls Embree directly, packet by packet."""

    def __init__(self, known: ProvedWalls, mesh: Faces32, library: EmbreeLibrary) -> None:
        # The scene is kept here for as long as its address is in use.
        self._scene = library.build(*mesh)
        plain = known.tree[:], known.clear, known.owners, known.local[:]
        self._fixed = self._scene.intersect, self._scene.address, plain

    def kernels(self, lrf: LaserRangeFinder) -> Kernels:
        """The code that casts the scans of a range finder."""
        # Bound methods keep this scene, and with it Embree's, while another thread replaces it.
        laser = laser_of(lrf)
        return Kernels(partial(self._scan, laser), partial(self._scans, laser))

    def _scan(self, laser: PlainLaser, x: float, y: float, theta: float) -> tuple[Float, Int]:
        return cast_scan(*self._fixed, laser, x, y, theta)

    def _scans(self, laser: PlainLaser, poses: Float, ranges: Float, walls: Int) -> None:
        cast_scans(*self._fixed, laser, poses, ranges, walls)


class RunScene:
    """Casts through embreex: rays are passed to it, and its answers are proved."""

    def __init__(self, known: ProvedWalls, mesh: Faces32) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._known = known
        self._embree = EmbreeScene()
        self._kept = TriangleMesh(self._embree, *mesh) if len(known.tree.walls) else None

    def kernels(self, lrf: LaserRangeFinder) -> Kernels:
        """The code that casts the scans of a range finder."""
        laser = laser_of(lrf)
        return Kernels(partial(self._scan, laser), partial(self._scans, laser))

    def _scan(self, laser: PlainLaser, x: float, y: float, theta: float) -> tuple[Float, Int]:
        beams = laser[0].shape[1]
        ranges, walls = np.empty((1, beams)), np.empty((1, beams), np.int64)
        self._scans(laser, np.array([[x, y, theta]]), ranges, walls)
        return ranges[0], walls[0]

    def _scans(self, laser: PlainLaser, poses: Float, ranges: Float, walls: Int) -> None:
        known = self._known
        reach = (laser[-1] + known.local.beyond) * known.local.unit
        for k in range(0, len(poses), POSES_SENT):
            part = slice(k, k + POSES_SENT)
            found = np.empty(0, dtype=np.int32)
            if self._kept is not None:
                rays = send_rays(laser, poses[part], known.local)
                found = self._embree.run(*rays, reach)
            prove_scans(known, found, laser, poses[part], ranges[part], walls[part])
