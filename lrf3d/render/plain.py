"""The plain renderer, for machines without OpenGL: rays by Embree, and triangles over them.

It draws the same values as OpenGL does, with one sample a pixel, colours as they were baked, and
nothing of what shaders add to them, such as shine.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.casting.triangle_rays import TriangleRays
from lrf3d.geometry import Float, Single
from lrf3d.render.fill import Surfaces, fill_discs, fill_triangles, shade
from lrf3d.render.glsl import air
from lrf3d.render.packing import lit
from lrf3d.scene import look
from lrf3d.scene.facades import layers
from lrf3d.scene.shapes import Body, Lens, Lines, Mark, Pixels, Points, Seen, Soft, single
from lrf3d.scene.stage import Stage

_LIFTED = 0.02
"""How much nearer to the eye translucent faces are than what they lie on [m]."""

_NEAR = 0.2
"""Depth [m] before which lines are cut and other marks are left out."""


class _Canvas(NamedTuple):
    """Colours (h, w, 3), and one over the depth (h, w) of what is there."""

    colours: Single
    near: Single


class PlainRenderer:
    """Draws what is to be seen of a stage into RGBA pictures of a size [pixels]."""

    def __init__(self, stage: Stage, size: tuple[int, int]) -> None:
        self._size = size
        self._scale = max(min(size) / 720.0, look.LEAST_SCALE)
        quads = stage.faces.rows()
        self._corners = single(quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 16))
        self._cut = np.inf
        self._rays = TriangleRays(single(self._corners[..., :3]))
        indoor, ground = stage.structures.indoor, stage.ground
        sky = air(indoor=indoor)
        self._surfaces = Surfaces(
            self._corners,
            *_texels(layers(indoor)),
            *_texels(_halved(ground.picture)),
            np.array([*ground.corner, *ground.size, *ground.land]),
            np.array([*sky["HAZE"], *sky["ZENITH"]]),
        )
        self._picture: Pixels = np.full((size[1], size[0], 4), 255, np.uint8)

    def draw(self, seen: Seen) -> Pixels:
        """The picture (h, w, 4) uint8 of what is to be seen; the next one writes over it."""
        width, height = self._size
        lens, ghost = seen.lens, seen.ghost
        ways = _ways(lens, self._size)
        fixed = np.array([*lens.eye, lens.focus, lens.thick])
        if seen.cut != self._cut:
            self._cut, corners = seen.cut, self._corners.copy()
            corners[..., 2] = np.minimum(corners[..., 2], seen.cut)
            self._surfaces = self._surfaces._replace(corners=corners)
            self._rays = TriangleRays(single(corners[..., :3]))
        hits = self._rays.first(np.tile(single(lens.eye), (len(ways), 1)), ways)
        none = np.full(len(ways), -1, np.int32)
        colours, near = shade(ways, none if ghost else hits, fixed, self._surfaces)
        canvas = _Canvas(colours.reshape(height, width, 3), near.reshape(height, width))
        for _, body in seen.bodies:
            self._draw_body(canvas, lens, body)
        if ghost:
            # Walls that fade are laid over all that stands in them.
            walls, depth = shade(ways, hits, fixed, self._surfaces)
            walls += ghost * (np.array(look.GHOST, np.float32) - walls)
            shown = (hits >= 0) & (depth > near)
            colours[shown] += (1.0 - ghost * look.GHOST_STRENGTH) * (walls - colours)[shown]
        for _, mark in seen.marks:
            self._draw_mark(canvas, lens, mark)
        if seen.plan is not None:
            left, top, side = seen.plan.box
            part = canvas.colours[top : top + side, left : left + side]
            part[:] = np.array(look.PLAN_BACK) / 255.0
            inset = _Canvas(part, np.zeros(part.shape[:2], np.float32))
            for _, mark in seen.plan.marks:
                self._draw_mark(inset, seen.plan.lens, mark)
        self._picture[..., :3] = 255.0 * np.clip(canvas.colours, 0.0, 1.0) + 0.5
        return self._picture

    def close(self) -> None:
        """Nothing is held that needs to be freed."""

    def _draw_body(self, canvas: _Canvas, lens: Lens, body: Body) -> None:
        faces, turn = body.faces, body.pose[:3, :3]
        colours = np.insert(lit(faces, turn), 3, 1.0, axis=2)
        self._fill(canvas, lens, faces.corners @ turn.T + body.pose[:3, 3], colours, 0.0, True)

    def _draw_mark(self, canvas: _Canvas, lens: Lens, mark: Mark) -> None:
        if isinstance(mark, Soft):
            nearer = lens.nearer if lens.nearer > 1.0 else _LIFTED
            self._fill(canvas, lens, mark.corners, mark.colours, nearer, False)
        elif isinstance(mark, Points):
            self._draw_points(canvas, lens, mark)
        else:
            self._draw_lines(canvas, lens, mark)

    def _fill(
        self, canvas: _Canvas, lens: Lens, corners: Any, colours: Any, nearer: float, solid: bool
    ) -> None:
        """Fill triangles (t, 3, 3) with colours and opacities (t, 3, 4)."""
        clip, near = _projected(corners.reshape(-1, 3), lens, nearer, canvas)
        rows = np.column_stack([clip[:, :2], near, colours.reshape(-1, 4)]).reshape(-1, 3, 7)
        before = (clip[:, 2] > _NEAR).reshape(-1, 3).all(axis=1)
        fill_triangles(rows[before], False, solid, canvas.colours, canvas.near)

    def _draw_points(self, canvas: _Canvas, lens: Lens, points: Points) -> None:
        clip, near = _projected(points.places, lens, lens.nearer, canvas)
        low, high = (self._scale * size for size in points.pixels)
        size = np.clip(points.size * lens.focus / np.maximum(clip[:, 2], _NEAR), low, high)
        rows = np.column_stack([clip[:, :2], near, size, points.colours])
        # What lies on a thin wall is seen from the side that it faces, or from far above.
        faces = ((lens.eye - points.places)[:, :2] * points.sides).sum(axis=1) >= 0.0
        shown = (clip[:, 2] > _NEAR) & (faces | (lens.nearer > 1e3))
        fill_discs(rows[shown], canvas.colours, canvas.near)

    def _draw_lines(self, canvas: _Canvas, lens: Lens, lines: Lines) -> None:
        ends = np.stack([lines.starts, lines.ends]).astype(float)
        depths = ends @ lens.matrix[3, :3] + lens.matrix[3, 3]
        # What lies behind the eye is cut off.
        apart = np.where(depths[1] == depths[0], 1.0, depths[1] - depths[0])
        cut = ends[0] + ((1.01 * _NEAR - depths[0]) / apart)[:, None] * (ends[1] - ends[0])
        ends = np.where((depths < _NEAR)[..., None], cut, ends)
        drawn = [_projected(end, lens, lens.nearer, canvas) for end in ends]
        way = (drawn[1][0] - drawn[0][0])[:, :2]
        half = 0.5 * max(lines.width * self._scale, 1.0) / np.maximum(np.hypot(*way.T), 1e-9)
        across = half[:, None] * np.column_stack([-way[:, 1], way[:, 0]])
        corners = [
            np.column_stack([place[:, :2] + side * across, near, lines.colours, opacity])
            for (place, near), opacity in zip(drawn, lines.opacities.T, strict=True)
            for side in (1.0, -1.0)
        ]
        triangles = np.stack([corners[k] for k in (0, 1, 3, 0, 3, 2)], axis=1).reshape(-1, 3, 7)
        shown = np.repeat(depths.max(axis=0) > _NEAR, 2)
        fill_triangles(triangles[shown], lines.hidden, False, canvas.colours, canvas.near)


def _ways(lens: Lens, size: tuple[int, int]) -> Single:
    """Directions (n, 3) through all pixels of a picture, as long as a depth of 1 m."""
    inverse = np.linalg.inv(lens.matrix)

    def ray(x: float, y: float) -> Float:
        far = inverse @ np.array([x, y, 1.0, 1.0])
        way = far[:3] / far[3] - lens.eye
        return np.asarray(way / (lens.matrix[3, :3] @ way), np.float32)

    corner = ray(-1.0, -1.0)
    across, down = (ray(1.0, -1.0) - corner) / size[0], (ray(-1.0, 1.0) - corner) / size[1]
    rows, columns = (np.arange(side, dtype=np.float32) + 0.5 for side in size[::-1])
    ways = corner + columns[:, None] * across + (rows[:, None] * down)[:, None]
    return single(ways.reshape(-1, 3))


def _projected(places: Any, lens: Lens, nearer: float, canvas: _Canvas) -> tuple[Float, Float]:
    """x, y [pixels] and depth [m] (n, 3) of places (n, 3), and one over the depth to test (n,).

    That is the depth of points which are nearer to the eye by a distance [m].
    """
    height, width = canvas.near.shape
    clip = places @ lens.matrix[[0, 1, 3], :3].T + lens.matrix[[0, 1, 3], 3]
    clip[:, :2] = (0.5 + 0.5 * clip[:, :2] / np.maximum(clip[:, 2:], 1e-3)) * [width, height]
    ray = lens.eye - places
    away = np.linalg.norm(ray, axis=1)
    step = np.minimum(nearer + lens.slack * away, 0.5 * away) / np.maximum(away, 1e-9)
    depth = clip[:, 2] + step * (ray @ lens.matrix[3, :3])
    return clip, 1.0 / np.maximum(depth, 1e-3)


def _halved(picture: Pixels) -> tuple[Pixels, ...]:
    """A picture and copies of it, each half as wide and high as the one before."""
    levels = [picture]
    while min(levels[-1].shape[:2]) > 2:
        levels.append(np.asarray(Image.fromarray(levels[-1]).reduce(2)))
    return tuple(levels)


def _texels(levels: tuple[Pixels, ...]) -> tuple[Pixels, NDArray[np.int64]]:
    """All texels of levels one after the other, and start, width and height (n, 3) of each."""
    sizes = np.array([level.size for level in levels])
    sides = np.array([level.shape[-2:-4:-1] for level in levels])
    table = np.column_stack([np.cumsum(sizes) - sizes, sides])
    return np.concatenate([level.ravel() for level in levels]), table
