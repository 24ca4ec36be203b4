"""Peers: libraries that cast rays too and are measured where they are installed (extra bench)."""

import warnings
from types import ModuleType
from typing import Any

import numpy as np

from lrf3d.casting.raw_embree import rays
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.study.bench.rivals import Call, Rival, limited, rays32, triangles
from lrf3d.world import World


class Open3D(Rival):
    """Open3D's ``RaycastingScene``, Embree on all cores with its rays made beforehand."""

    key, title, threads = "open3d", "Open3D", True

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        """Build the scene.

        Raises:
            ImportError: Open3D is not installed.
        """
        self._library = _library("open3d")
        vertices, faces = triangles(world)
        self._centre = world.origin
        self._scene = self._library.t.geometry.RaycastingScene()
        self._scene.add_triangles(vertices, faces.astype(np.uint32))

    def scans(self, lrf: LaserRangeFinder, poses: Float) -> Call:
        """Cast on all cores."""
        tensor = self._tensor(lrf, poses)
        return lambda: self._scene.cast_rays(tensor)

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        """Ranges and walls."""
        found = self._scene.cast_rays(self._tensor(lrf, poses))
        shape = len(poses), lrf.beams
        distances = found["t_hit"].numpy().astype(np.float64).reshape(shape)
        walls = (found["primitive_ids"].numpy().astype(np.int64) // 2).reshape(shape)
        return limited(distances, walls, lrf)

    def _tensor(self, lrf: LaserRangeFinder, poses: Float) -> Any:
        return self._library.core.Tensor(np.hstack(rays32(lrf, poses, self._centre)))


class MuJoCo(Rival):
    """MuJoCo's ``mj_multiRay`` at one mesh of all walls, scan after scan."""

    key, title = "mujoco", "MuJoCo"
    most_walls = 10_000

    def __init__(self, world: World, lrf: LaserRangeFinder) -> None:
        """Compile the model.

        Raises:
            ImportError: MuJoCo is not installed.
        """
        self._library = library = _library("mujoco")
        vertices, faces = triangles(world)
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
        """Cast pose after pose."""
        origins, directions = rays(lrf, poses, self._centre)
        starts = origins[:: lrf.beams, :, None]
        beams = directions.reshape(len(poses), -1, 1)
        return lambda: [
            self._cast(lrf, start, beam) for start, beam in zip(starts, beams, strict=True)
        ]

    def answers(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int | None]:
        """Ranges; of walls it knows only the mesh."""
        distances = np.array(self.scans(lrf, poses)()).reshape(len(poses), lrf.beams)
        missed = distances < 0.0
        distances[missed] = np.inf
        return limited(distances, np.zeros(distances.shape, np.int64), lrf)[0], None

    def _cast(self, lrf: LaserRangeFinder, start: Float, beams: Float) -> Float:
        met = np.zeros((lrf.beams, 1), np.int32)
        distances = np.empty((lrf.beams, 1))
        self._library.mj_multiRay(
            self._model, self._data, start, beams, None, 1, -1, met, distances, None,
            lrf.beams, lrf.range_max,
        )  # fmt: skip
        return distances


def _library(name: str) -> ModuleType:
    """Import a library whose own warnings are none of ours."""
    from importlib import import_module

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return import_module(name)
