"""The scene of a run: all that can be seen in it, as primitives, brought up to a moment."""

from dataclasses import replace
from typing import Any

import numpy as np

from lrf3d.geometry import Float, Single
from lrf3d.render.bindings import GL, pyrender
from lrf3d.render.ground_layer import GroundLayer
from lrf3d.render.movers import MovingBodies
from lrf3d.render.parts import build_walls
from lrf3d.render.primitives import Mesh, Primitive
from lrf3d.scene import look
from lrf3d.scene.beams import LINE_SIZES, POINT_SIZES, Beams
from lrf3d.scene.bodies import robot_mesh, world_from_robot
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Moment, Timeline, drive_keys
from lrf3d.scene.trail_and_map import RIBBON_SIZES, DrawnMap, legs_begun, trail_ribbon


class Scenery:
    """The primitives of a run.

    Attributes:
        scene: pyrender's scene of them.
        structures: What the walls make up.
        beams: The beams of the moment.
    """

    def __init__(self, timeline: Timeline) -> None:
        run = self.run = timeline.run
        self.structures = Structures.from_run(run)
        self.origin = self.structures.origin
        self.reach = min(run.lrf.range_max, look.REACH)
        self.scene = pyrender.Scene()
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]], np.float32)
        self.walls = build_walls(self.structures)
        rows, indices = robot_mesh(run.lrf.height)
        self.robot = Primitive("robot", (3, 3, 3), rows, indices=indices, cull=True)
        self.movers = MovingBodies(run.movers, self.origin, self.structures.indoor)
        self.ground = GroundLayer(self.structures, self.scene)
        self.sky = Primitive("sky", (2,), _mesh(10, 10))
        self.blob = Primitive("blob", (2,), corners, blend=True)
        self._keys, self._start = drive_keys(timeline), timeline.start
        self.trail = Primitive("trail", RIBBON_SIZES, trail_ribbon(self._keys), blend=True)
        self.fan = _dynamic("fan", (3, 1))
        self.lines = _dynamic("lines", LINE_SIZES)
        self.trace = _dynamic("lines", LINE_SIZES)
        self.dots = _dynamic("points", POINT_SIZES, mode=GL.GL_POINTS)
        self.map = _dynamic("lines", LINE_SIZES)
        self._scan_shown: tuple[Any, ...] = ()
        self._map_shown = -1
        self.beams: Beams | None = None
        for primitive in self.all:
            self.scene.add(Mesh([primitive]))
        self._constant = {
            "sun": tuple(look.SUN.tolist()),
            "haze": self.haze,
            "indoor": float(self.structures.indoor),
            "lift": 0.0,
            "reach": self.reach,
            "strength": look.FAN_STRENGTH_INDOOR if self.structures.indoor else look.FAN_STRENGTH,
        }

    @property
    def all(self) -> tuple[Primitive, ...]:
        """All primitives."""
        solid = (self.robot, self.walls.faces, self.sky)
        return (
            *solid,
            self.blob,
            self.trail,
            self.fan,
            self.lines,
            self.trace,
            self.dots,
            self.map,
            *self.movers.all,
        )

    @property
    def haze(self) -> tuple[float, float, float, float]:
        """Colour of what is far away, and one over the distance [m] at which half is haze."""
        if self.structures.indoor:
            return (*look.HAZE_INDOOR, 1.0 / look.HALF_HAZE_INDOOR)
        return (*look.HAZE, 1.0 / look.HALF_HAZE)

    def show(self, moment: Moment) -> dict[str, Any]:
        """Bring robot and trail up to a moment; gives the uniforms that say where."""
        self.movers.place(moment.time)
        place = moment.pose - np.array([*self.origin, 0.0])
        shift = -0.16 * look.SUN[:2] * (0.0 if self.structures.indoor else 1.0)
        moved: dict[str, Any] = {
            **self._constant,
            "world_from_robot": world_from_robot(place),
            "blob": (*(place[:2] + shift).tolist(), 0.52, 0.55),
        }
        moved["now"] = moment.time - self._start
        self.trail.count = 6 * legs_begun(self._keys, moved["now"])
        return moved

    def show_seen(self, moment: Moment) -> None:
        """Bring what is laid over the scene, beams and map, up to a moment that is shown."""
        stage = self.run.stage_after(moment.scan)
        if stage != self._map_shown:
            self._map_shown = stage
            drawn = DrawnMap.from_snapshot(self.run, stage, self.origin)
            self.map.update(drawn.lines(self.run.lrf.height))
        self._show_beams(moment, moment.pose - np.array([*self.origin, 0.0]))

    def look_from(self, matrix: Float, eye: Float, reach: float) -> None:
        """Choose what can be seen in a picture of a matrix (4, 4) from an eye (3,).

        Args:
            matrix: From the scene to the picture.
            eye: Where the eye is [m].
            reach: How much is seen to each side by an eye that looks down [m], else 0.
        """
        self.walls.look_from(matrix, eye)
        self.ground.look_from(eye, reach)

    def _show_beams(self, moment: Moment, place: Float) -> None:
        shown = (moment.scan, moment.scanning, *place[:2], self.movers.poses.tobytes())
        if shown == self._scan_shown:
            return
        self._scan_shown = shown
        height = self.run.lrf.height
        if not moment.scanning:
            for primitive in (self.fan, self.lines, self.trace, self.dots):
                primitive.update(np.zeros(0, np.float32))
            return
        scan = self.run.scan(moment.scan)
        local = np.array(scan.pose) - np.array([*self.origin, 0.0])
        world = self.run.world
        walls = world.segments - np.tile(self.origin, 2)
        self.beams = Beams.from_scan(
            replace(scan, pose=local), walls, world.objects, place[:2], self.movers.carry
        )
        self.fan.update(self.beams.fan(height))
        self.lines.update(self.beams.lines(height, self.reach))
        self.trace.update(self.beams.trace(height))
        self.dots.update(self.beams.dots(height, self.run.lrf.range_max))


def _mesh(columns: int, rows: int) -> Single:
    """Corners (6 · columns · rows, 2) of the triangles of a mesh over −1…1."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    first = np.column_stack([x.ravel(), y.ravel()])
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]])
    places = (first[:, None] + corners) / [columns, rows]
    return np.asarray((2.0 * places - 1.0).reshape(-1, 2), np.float32)


def _dynamic(program: str, sizes: tuple[int, ...], mode: int = GL.GL_TRIANGLES) -> Primitive:
    empty = np.zeros((0, sum(sizes)), np.float32)
    return Primitive(program, sizes, empty, mode=mode, capacity=2048, blend=True)
