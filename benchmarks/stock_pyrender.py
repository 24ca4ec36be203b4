"""Stock pyrender drawing a run's world: what a film would cost without a renderer of our own.

The same buildings, ground and robot under the same sun, as one would set them up by its manual: a
mesh for each building, a sun that throws shadows, and a picture that is read back.
"""

import numpy as np
import pyglet
import shapely
import trimesh

from lrf3d.geometry.lines import Float
from lrf3d.simulation.run import Run
from lrf3d.studio.render.buffers import GL, make_current
from lrf3d.studio.scene.bodies import robot_body, world_from_robot
from lrf3d.studio.scene.cameras import chase
from lrf3d.studio.scene.look import SUN
from lrf3d.studio.scene.shapes import Pixels
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.timeline import Timeline

# pyrender imports its viewer, which opens a window unless this is set.
pyglet.options["headless"] = True
import pyrender  # noqa: E402

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
    """Draws pictures of a run with pyrender's own renderer; 4 samples a pixel, as it always has."""

    def __init__(self, run: Run, *, size: tuple[int, int], playback: float) -> None:
        self.timeline = Timeline(run, playback=playback)
        structures = Structures.from_run(run)
        self._camera = chase(self.timeline, structures)
        self._size = size
        self._scene = pyrender.Scene(bg_color=(0.6, 0.75, 0.95), ambient_light=(0.45, 0.45, 0.5))
        for mesh in _buildings(structures):
            self._scene.add(mesh)
        self._scene.add(_ground(structures))
        self._robot = self._scene.add(_robot(run.lrf.height, run.radius))
        sun = np.eye(4)
        sun[:3, 2] = SUN
        sun[:3, 0] = np.cross([0.0, 1.0, 0.0], SUN) / np.hypot(SUN[0], SUN[2])
        sun[:3, 1] = np.cross(SUN, sun[:3, 0])
        self._scene.add(pyrender.DirectionalLight(color=np.ones(3), intensity=3.0), pose=sun)
        lens = pyrender.PerspectiveCamera(yfov=1.0, znear=0.2, zfar=4000.0)
        self._eye = self._scene.add(lens)
        flags = pyrender.RenderFlags
        self._flags = flags.OFFSCREEN | flags.SHADOWS_DIRECTIONAL
        make_current()
        self._renderer = pyrender.Renderer(*size)

    def draw(self, time: float) -> Pixels:
        """The picture (h, w, 3) uint8 at a time of the run [s]."""
        moment = self.timeline.moment(time)
        look = self._camera.look(time, self._size[0] / self._size[1])
        place = moment.pose - np.array([*self.timeline.origin, 0.0])
        self._eye.camera.yfov, self._eye.camera.znear = look.field, max(0.2, 0.004 * look.away)
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


def _buildings(structures: Structures) -> list[Mesh]:
    """A mesh for each solid, of its walls and its roof."""
    colours = dict(zip(structures.objects.tolist(), structures.colours.tolist(), strict=True))
    meshes = []
    for solid, height, number in zip(
        structures.solids, structures.solid_heights, structures.solid_objects, strict=True
    ):
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(solid))
        corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
        plan, faces = np.unique(corners, axis=0, return_inverse=True)
        body = trimesh.creation.extrude_triangulation(plan, faces.reshape(-1, 3), height)
        places, ups = body.triangles.reshape(-1, 3), body.face_normals.repeat(3, axis=0)
        colour = np.tile([*colours[int(number)], 1.0], (len(places), 1))
        meshes.append(Mesh([pyrender.Primitive(positions=places, normals=ups, color_0=colour)]))
    return meshes


def _ground(structures: Structures) -> Mesh:
    ends = structures.segments.reshape(-1, 2)
    (x, y), (u, v) = ends.min(axis=0) - _LAND, ends.max(axis=0) + _LAND
    places = np.array([[x, y, 0], [u, y, 0], [u, v, 0], [x, y, 0], [u, v, 0], [x, v, 0]])
    up = np.tile([0.0, 0.0, 1.0], (6, 1))
    colour = np.tile([0.37, 0.36, 0.35, 1.0], (6, 1))
    return Mesh([pyrender.Primitive(positions=places, normals=up, color_0=colour)])


def _robot(laser_height: float, radius: float) -> Mesh:
    corners, colours = robot_body(laser_height, radius)
    ups = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ups = (ups / np.linalg.norm(ups, axis=1, keepdims=True)).repeat(3, axis=0)
    colour = np.column_stack([colours.reshape(-1, 3), np.ones(len(ups))])
    places = corners.reshape(-1, 3)
    return Mesh([pyrender.Primitive(positions=places, normals=ups, color_0=colour)])
