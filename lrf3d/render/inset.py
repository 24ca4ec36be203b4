"""The inset: the map as it grows, seen from straight above, in a corner of the picture."""

import math
from typing import Any

import numpy as np

from lrf3d.geometry import Float, Single
from lrf3d.render.hud import RECTANGLE, Line, Panel, Stamp, box_of, panel_size, rounded_box
from lrf3d.render.layout import scale_of
from lrf3d.render.pictures import Picture
from lrf3d.render.primitives import Draw, FrameRenderer, Mesh, Primitive
from lrf3d.render.scenery import Frame, Scenery
from lrf3d.scene import look
from lrf3d.scene.beams import LINE_SIZES, line_quads
from lrf3d.scene.bodies import robot_arrow, world_from_robot
from lrf3d.scene.outlines import triangles

_LEAST = 4.0
"""Least size [m] that is shown: there may be no wall, and a robot that stands."""

_MARGIN = 8.0
"""What is shown round the robot's path [m], at the least."""

_HEIGHT = 1e4
"""Height of its eye, and how much nearer to it marks on walls are [m]: nothing hides them."""

_WALL_WIDTH, _MAP_WIDTH, _POINT_SIZE = 1.6, 2.3, 3.0
"""Widths of free walls and of the map, and diameter of hit points [pixels at 720 lines]."""

_TRAIL_HALF_WIDTH, _HALF_WIDTH_UNDER = 1.1, 2.0
"""Half the width of the trail, by itself and under that of an estimate [pixels at 720 lines]."""

_FAN_STRENGTH = 0.62
"""Opacity of the fan at the robot: stronger than in the film, as the inset is small."""

_ARROW_SIZE = 0.034
"""Size of the robot's arrow, as a share of what is shown."""

_STONE = (*look.STONE, 1.0)
_FRAME, _RIM, _RADIUS = (13, 17, 25, 255), 2.0, 6.0
"""Colour, width of the frame and radius of its corners [pixels at 720 lines]."""

_AS_IT_IS = np.eye(4)
"""The place of what is given in the film's frame."""

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
        rim = max(2, round(_RIM * self._scale))
        radius = _RADIUS * self._scale
        shown = min(rim + math.ceil(radius), side // 2)
        self._frame = Stamp(scenery, _frame(side + 2 * rim, rim, radius), shown)
        self._frame.place(size, left - rim, top - rim)
        self._box = (left, top, side, side)
        self._paper = Primitive("cover", (2,), RECTANGLE)
        self._paper_box = box_of(size, (left, top), (side, side))
        self._houses = Primitive("flat", (2, 4), _houses(scenery))
        free = structures.segments[~structures.closed]
        stone = np.full((len(free), 3), _STONE[:3])
        lines = line_quads(free[:, :2], free[:, 2:], stone, np.ones((len(free), 2)), 0.0)
        self._walls = Primitive("lines", LINE_SIZES, lines, blend=True)
        self._robot = Primitive("flat", (2, 4), robot_arrow())
        self._middle, self.window = self._place()
        own = (self._paper, self._houses, self._walls, self._robot)
        scenery.scene.add(Mesh(list(own)))
        self._caption = Stamp(scenery, _scale_bar(self.window, side, 0.72 * self._scale))
        self._caption.place(size, left, top + side - self._caption.size[1])
        self._captioned = 2 * self._caption.size[0] <= side

    def cover(self, renderer: FrameRenderer) -> None:
        """Lay its paper down before all else: what lies under it then needs no drawing."""
        renderer.draw(self._paper, {"box": self._paper_box})

    def draw(self, renderer: FrameRenderer, frame: Frame) -> None:
        """Draw it on its paper."""
        scenery, side = self._scenery, float(self._box[2])
        pixel = self.window / side
        under = scenery.run.estimate is not None
        half_width = _HALF_WIDTH_UNDER if under else _TRAIL_HALF_WIDTH
        # What it shows otherwise than the film does, whatever layer it is.
        camera = {
            "view_projection": self.matrix(frame.pose),
            "eye": (0.0, 0.0, _HEIGHT),
            "thick": 0.0,
            "viewport": (side, side),
            "slack": 0.0,
        }
        own: dict[str, Any] = {
            "nearer": _HEIGHT,
            "half_width": half_width * self._scale * pixel,
            "strength": _FAN_STRENGTH,
            # So far from the eye, points have their least size.
            "focus": 1.0,
            "sizes": (1e-6, _POINT_SIZE * self._scale, _POINT_SIZE * self._scale),
        }
        walls, lines = ({"width": width * self._scale} for width in (_WALL_WIDTH, _MAP_WIDTH))
        layers = (
            Draw(self._houses, {"place": _AS_IT_IS}),
            Draw(self._walls, walls),
            *scenery.draw_goal(frame),
            *scenery.draw_fan(frame),
            *scenery.draw_trail(frame),
            *scenery.draw_estimate(frame),
            *scenery.obstacles.plans(frame.moment.time, pixel),
            *scenery.draw_points(frame),
            *(Draw(each, lines) for each, _ in scenery.draw_map(frame)),
            Draw(self._robot, {"place": self._robot_matrix(frame.pose)}),
        )
        renderer.overlay(self._box)
        renderer.look_through(camera)
        for primitive, special in layers:
            renderer.draw(primitive, {**special, **own})
        renderer.overlay(None)
        self._frame.draw(renderer)
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

    def matrix(self, pose: Float) -> Float:
        """The matrix (4, 4) from the film's frame to the inset, north up, picture turned over.

        Where it follows the robot, its pose (3,) is in the middle.
        """
        middle = pose[:2] if self._middle is None else self._middle
        zoom = 2.0 / self.window
        matrix = np.diag([zoom, -zoom, 0.0, 1.0])
        matrix[:2, 3] = [-zoom * middle[0], zoom * middle[1]]
        return matrix

    def _robot_matrix(self, pose: Float) -> Float:
        """The matrix (4, 4) that puts the arrow at the robot, as large in any inset."""
        matrix = world_from_robot(pose)
        matrix[:2, :2] *= _ARROW_SIZE * self.window
        return matrix


def _scale_bar(window: float, side: int, scale: float) -> Picture:
    """A bar of a round length with its number, for a side [pixels] that shows so much [m]."""
    # The longest of 1, 2 and 5 times a power of ten that takes up to a third of the side.
    power = 10.0 ** np.floor(np.log10(window / 3.0))
    metres = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= window / 3.0)
    words = (Line(((0.0, f"{metres:g} m"),), _CAPTION),)
    wide, high = panel_size(words, scale)
    long, thick = round(metres / window * side), max(1, round(1.6 * scale))
    pad = round(12 * scale)
    picture = rounded_box((max(wide, long + 2 * pad), high), _CAPTION_BACK, 6 * scale)
    picture[: high - pad // 2, :wide] = Panel(words, scale, _CAPTION_BACK).draw(words)[
        : high - pad // 2
    ]
    bottom = high - round(0.6 * pad)
    picture[bottom - thick : bottom, pad : pad + long] = _CAPTION
    for end in (pad, pad + long - thick):
        picture[bottom - 4 * thick : bottom, end : end + thick] = _CAPTION
    return picture


def _frame(side: int, rim: int, radius: float) -> Picture:
    """A square frame with round corners, and nothing in it."""
    picture = rounded_box((side, side), _FRAME, radius)
    within = rounded_box((side - 2 * rim,) * 2, _FRAME, radius - 0.5 * rim)
    picture[rim : side - rim, rim : side - rim, 3] = 255 - within[..., 3]
    return picture


def _houses(scenery: Scenery) -> Single:
    """Triangles (v, 6) of the ground plans of solids and trunks."""
    corners = triangles(scenery.structures.footprints)[0].reshape(-1, 2)
    return np.concatenate([corners, np.tile(_STONE, (len(corners), 1))], axis=1).astype(np.float32)
