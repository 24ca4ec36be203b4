"""The inset: the map as it grows, seen from straight above, in a corner of the picture."""

from typing import Any

import numpy as np
import shapely

from lrf3d.geometry import Float, Single
from lrf3d.render.hud import Label, Line
from lrf3d.render.layout import scale_of
from lrf3d.render.primitives import Canvas, Mesh, Primitive
from lrf3d.render.scenery import Scenery
from lrf3d.scene import look
from lrf3d.scene.beams import LINE_SIZES, line_quads
from lrf3d.scene.timeline import Moment

_LEAST = 4.0
"""Least size [m] that is shown: there may be no wall, and a robot that stands."""

_MARGIN = 8.0
"""What is shown round the robot's path [m], at the least."""

_PAPER = (*look.PAPER, 0.94)
_FRAME = (0.05, 0.07, 0.10, 1.0)
_STONE = (*look.STONE, 1.0)
_CAPTION, _CAPTION_BACK = (60, 68, 80, 255), (245, 247, 250, 190)


class Inset:
    """Draws the map of a run over its film; the beams, trail and map are the scenery's own.

    Args:
        scenery: The scenery of the film.
        size: Width and height of the film's pictures [pixels].
        place: Left, top and side [pixels] of the inset in them.
    """

    def __init__(
        self, scenery: Scenery, size: tuple[int, int], place: tuple[int, int, int]
    ) -> None:
        self._scenery = scenery
        structures = scenery.structures
        self._scale = scale_of(size)
        left, top, side = place
        rim = max(2, round(2 * self._scale))
        self._outer = (left - rim, top - rim, side + 2 * rim, side + 2 * rim)
        self._box = (left, top, side, side)
        self._paper = _square(_PAPER)
        self._frame = _square(_FRAME)
        self._houses = Primitive("flat", (2, 4), _houses(scenery))
        free = structures.segments[~structures.closed]
        stone = np.full((len(free), 3), _STONE[:3])
        lines = line_quads(free[:, :2], free[:, 2:], stone, np.ones((len(free), 2)), 0.0)
        self._walls = Primitive("lines", LINE_SIZES, lines, blend=True)
        self._robot = Primitive("flat", (2, 4), _arrow())
        self._middle, self.window = self._place()
        own = (self._paper, self._frame, self._houses, self._walls, self._robot)
        scenery.scene.add(Mesh(list(own)))
        words = (Line(((0.0, f"{self.window:.0f} m"),), _CAPTION),)
        self._caption = Label(scenery, words, 0.72 * self._scale, back=_CAPTION_BACK)
        self._caption.place(size, left, top + side - self._caption.size[1])
        self._captioned = 2 * self._caption.size[0] <= side

    def draw(self, renderer: Canvas, moment: Moment, shared: dict[str, Any]) -> None:
        """Draw it over the picture, with the uniforms of the scene."""
        scenery, side = self._scenery, float(self._box[2])
        metre = side / self.window
        whole = {"view_projection": np.eye(4), "place": np.eye(4)}
        uniforms = {
            **shared,
            "view_projection": self.matrix(moment),
            "place": np.eye(4),
            "eye": (0.0, 0.0, 1e4),
            "haze": (0.0, 0.0, 0.0, 0.0),
            "viewport": (side, side),
            "half_width": 1.1 * self._scale / metre,
            "strength": 0.62,
            "nearer": 1e4,
            "slack": 0.0,
            "focus": 1.0,
            "sizes": (1e-6, 3.0 * self._scale, 3.0 * self._scale),
        }
        renderer.overlay(self._outer)
        renderer.draw(self._frame, whole)
        renderer.overlay(self._box)
        renderer.draw(self._paper, whole)
        renderer.draw(self._houses, uniforms)
        renderer.draw(self._walls, {**uniforms, "width": 1.6 * self._scale})
        renderer.draw(scenery.fan, uniforms)
        renderer.draw(scenery.trail, uniforms)
        for plan, special in scenery.movers.plans(1.0 / metre):
            renderer.draw(plan, {**uniforms, **special})
        renderer.draw(scenery.dots, uniforms)
        renderer.draw(scenery.map, {**uniforms, "width": 2.3 * self._scale})
        renderer.draw(self._robot, {**uniforms, "place": self._robot_matrix(moment)})
        renderer.overlay(None)
        if self._captioned:
            self._caption.draw(renderer)

    def _place(self) -> tuple[Float | None, float]:
        """The middle of what is shown and its size [m]; no middle where it follows the robot."""
        path = self._scenery.run.trajectory.poses[:, :2] - self._scenery.origin
        ends = self._scenery.structures.segments.reshape(-1, 2)
        everything = np.concatenate([ends, path])
        for points, margin in ((everything, 1.0), (path, _MARGIN + 12.0)):
            low, high = points.min(axis=0), points.max(axis=0)
            size = float((high - low).max())
            if size <= look.INSET_WHOLE - 2.0 * margin:
                # A room needs less of a rim than a city, and walls are needed around a path.
                rim = margin * min(1.0, size / 40.0) if points is everything else margin
                return 0.5 * (low + high), max(1.04 * size + 2.0 * rim, _LEAST)
        return None, look.INSET_FOLLOWED

    def matrix(self, moment: Moment) -> Float:
        """The matrix (4, 4) from the film's frame to the inset, north up, picture turned over."""
        middle = self._middle
        if middle is None:
            middle = moment.pose[:2] - self._scenery.origin
        zoom = 2.0 / self.window
        matrix = np.diag([zoom, -zoom, 0.0, 1.0])
        matrix[:2, 3] = [-zoom * middle[0], zoom * middle[1]]
        return matrix

    def _robot_matrix(self, moment: Moment) -> Float:
        """The matrix (4, 4) that puts the arrow at the robot, as large in any inset."""
        place = moment.pose[:2] - self._scenery.origin
        size = 0.034 * self.window
        cos, sin = size * np.cos(moment.pose[2]), size * np.sin(moment.pose[2])
        matrix = np.eye(4)
        matrix[:2, :2] = [[cos, -sin], [sin, cos]]
        matrix[:2, 3] = place
        return matrix


def _square(colour: tuple[float, ...]) -> Primitive:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]], np.float32)
    rows = np.concatenate([corners, np.tile(np.array(colour, np.float32), (6, 1))], axis=1)
    return Primitive("flat", (2, 4), rows, blend=True)


def _houses(scenery: Scenery) -> Single:
    """Triangles (v, 6) of the ground plans of solids."""
    solids = scenery.structures.solids
    if not len(solids):
        return np.zeros((0, 6), np.float32)
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(solids))
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    return np.concatenate([corners, np.tile(_STONE, (len(corners), 1))], axis=1).astype(np.float32)


def _arrow() -> Single:
    """An arrow head along x with a dark rim, as triangles (v, 6)."""
    head = look.DART[[0, 1, 2, 0, 2, 3]]
    rim = np.concatenate([head * 1.4, np.tile((*look.ROBOT_RIM, 1.0), (6, 1))], axis=1)
    return np.concatenate(
        [rim, np.concatenate([head, np.tile((*look.ROBOT, 1.0), (6, 1))], axis=1)]
    ).astype(np.float32)
