"""Stock pyrender drawing a run's world: what a film would cost without a renderer of our own.

The same buildings, ground and robot under the same sun, as one would set them up by its manual: a
mesh for each building, a sun that throws shadows, and a picture that is read back.
"""

from typing import Any

import numpy as np
import shapely

from lrf3d.geometry import Float
from lrf3d.render.bindings import GL, pyrender
from lrf3d.render.buffers import make_current
from lrf3d.render.pictures import Picture
from lrf3d.run import Run
from lrf3d.scene.bodies import robot_mesh, world_from_robot
from lrf3d.scene.cameras import make_camera
from lrf3d.scene.look import SUN
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline

_LAND = 200.0
"""How far the ground reaches past the world [m]."""


class Mesh(pyrender.Mesh):  # type: ignore[misc]
    """pyrender's mesh, with bounds that do not need ``np.infty``, which NumPy 2 took away."""

    @property
    def bounds(self) -> Float:
        """Corners (2, 3) of the box around all primitives [m]."""
        boxes = np.array([primitive.bounds for primitive in self.primitives])
        return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


class StockFilm:
    """Draws pictures of a run with pyrender's own renderer; 4 samples a pixel, as it always has.

    Args:
        run: The run.
        size: Width and height of the pictures [pixels].
        view: Name of the camera.
        playback: Seconds of the run in a second of the film.
        shadows: Whether the sun throws shadows.
        merged: Whether all buildings are one mesh.
    """

    def __init__(
        self,
        run: Run,
        *,
        size: tuple[int, int],
        view: str = "chase",
        playback: float = 1.0,
        shadows: bool = True,
        merged: bool = False,
    ) -> None:
        self.timeline = Timeline(run, playback=playback)
        structures = Structures.from_run(run)
        self._camera = make_camera(view, self.timeline, structures)
        self._size = size
        self._scene = pyrender.Scene(bg_color=(0.6, 0.75, 0.95), ambient_light=(0.45, 0.45, 0.5))
        for mesh in _buildings(structures, merged=merged):
            self._scene.add(mesh)
        self._scene.add(_ground(structures))
        self._robot = self._scene.add(_robot(run.lrf.height))
        sun = np.eye(4)
        sun[:3, 2] = SUN
        sun[:3, 0] = np.cross([0.0, 1.0, 0.0], SUN) / np.hypot(SUN[0], SUN[2])
        sun[:3, 1] = np.cross(SUN, sun[:3, 0])
        self._scene.add(pyrender.DirectionalLight(color=np.ones(3), intensity=3.0), pose=sun)
        lens = pyrender.PerspectiveCamera(yfov=1.0, znear=0.2, zfar=4000.0)
        self._eye = self._scene.add(lens)
        flags = pyrender.RenderFlags
        self._flags = flags.OFFSCREEN | (flags.SHADOWS_DIRECTIONAL if shadows else flags.NONE)
        make_current()
        self._renderer = pyrender.Renderer(*size)

    def draw(self, time: float) -> Picture:
        """The picture (h, w, 3) uint8 at a time of the run [s]."""
        moment = self.timeline.moment(time)
        look = self._camera.look(time, self._size[0] / self._size[1])
        place = moment.pose - np.array([*self.timeline.origin, 0.0])
        self._eye.camera.yfov, self._eye.camera.znear = look.field, look.near
        self._scene.set_pose(self._eye, look.pose)
        self._scene.set_pose(self._robot, world_from_robot(place))
        make_current()
        # Other renderers of this process leave these otherwise than pyrender takes for granted.
        GL.glFrontFace(GL.GL_CCW)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glDisable(GL.GL_SCISSOR_TEST)
        colour, _ = self._renderer.render(self._scene, self._flags)
        return np.asarray(colour)

    def close(self) -> None:
        """Free what the driver holds."""
        self._renderer.delete()


def _buildings(structures: Structures, *, merged: bool) -> list[Mesh]:
    """A mesh for each object, of its walls and its roof, or one of all."""
    objects = np.unique(structures.objects)
    pieces = [_building(structures, number) for number in objects]
    if merged:
        pieces = [tuple(np.concatenate(rows) for rows in zip(*pieces, strict=True))]
    return [
        Mesh([pyrender.Primitive(positions=place, normals=normal, color_0=colour)])
        for place, normal, colour in pieces
    ]


def _building(structures: Structures, number: int) -> tuple[Any, ...]:
    """Positions, normals and colours (v, 3) of the triangles of an object."""
    walls = structures.objects == number
    segments, heights = structures.segments[walls], structures.heights[walls]
    low = np.concatenate([segments.reshape(-1, 2, 2), np.zeros((len(segments), 2, 1))], axis=2)
    high = low.copy()
    high[:, :, 2] = heights[:, None]
    faces = np.stack([low[:, 0], low[:, 1], high[:, 1], low[:, 0], high[:, 1], high[:, 0]], axis=1)
    along = segments[:, 2:] - segments[:, :2]
    normals = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(along))])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    places = [faces.reshape(-1, 3)]
    ups = [np.repeat(normals, 6, axis=0)]
    for solid in np.flatnonzero(structures.solid_objects == number):
        triangles = shapely.get_parts(
            shapely.constrained_delaunay_triangles(structures.solids[solid])
        )
        corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
        corners = corners[:, ::-1] if _clockwise(corners[0]) else corners
        flat = np.full((*corners.shape[:2], 3), structures.solid_heights[solid])
        flat[:, :, :2] = corners
        places.append(flat.reshape(-1, 3))
        ups.append(np.tile([0.0, 0.0, 1.0], (3 * len(corners), 1)))
    place = np.concatenate(places).astype(np.float32)
    colour = np.tile([*structures.colours[walls][0], 1.0], (len(place), 1)).astype(np.float32)
    return place, np.concatenate(ups).astype(np.float32), colour


def _clockwise(corners: Float) -> bool:
    first, second = corners[1] - corners[0], corners[2] - corners[0]
    return bool(first[0] * second[1] - first[1] * second[0] < 0.0)


def _ground(structures: Structures) -> Mesh:
    ends = structures.segments.reshape(-1, 2)
    (x, y), (u, v) = ends.min(axis=0) - _LAND, ends.max(axis=0) + _LAND
    places = np.array([[x, y, 0], [u, y, 0], [u, v, 0], [x, y, 0], [u, v, 0], [x, v, 0]])
    up = np.tile([0.0, 0.0, 1.0], (6, 1))
    colour = np.tile([0.37, 0.36, 0.35, 1.0], (6, 1))
    return Mesh([pyrender.Primitive(positions=places, normals=up, color_0=colour)])


def _robot(laser_height: float) -> Mesh:
    rows, indices = robot_mesh(laser_height)
    corners = indices.reshape(-1, 3)
    colour = np.column_stack([rows[:, 6:9], np.ones(len(rows))])
    return Mesh(
        [
            pyrender.Primitive(
                positions=rows[:, :3], normals=rows[:, 3:6], color_0=colour, indices=corners
            )
        ]
    )
