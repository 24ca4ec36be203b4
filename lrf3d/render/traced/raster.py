"""Triangles, points and panels over what rays have found, compiled: depth is tested, colours blend.

Corners of triangles come in as rows: x, y and w in the picture's −1…1 times w, the depth that the
corner is tested with, then what its program interpolates.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float
from lrf3d.render.traced.shading import MOST, as_byte, fragment
from lrf3d.render.traced.textures import clamp, mix
from lrf3d.scene.look import POINT_HALO, POINT_HALO_STRENGTH

FIXED = 4
"""Numbers of a row before what is interpolated."""

_NEAR = 0.05
"""Depth [m] before which triangles are cut."""

ROUNDED = 1e-3
"""By how much rows are looked at past where an edge is reckoned to cross them [pixels]."""

Edge = tuple[float, float, float, float, float]


class RasterTarget(NamedTuple):
    """What triangles are drawn on, and how.

    Attributes:
        colours: (h, w, s, 3) of all samples.
        near: (h, w, s) one over their depths.
        box: Left, top, width and height of the part that is drawn in [pixels].
        places: (s, 2) where in a pixel its samples lie.
        test: Whether what lies behind is left out.
        opaque: Whether what is drawn hides what comes later.
    """

    colours: NDArray[np.uint8]
    near: NDArray[np.float32]
    box: tuple[int, int, int, int]
    places: Float
    test: bool
    opaque: bool


class FragmentProgram(NamedTuple):
    """What gives the pixels of a triangle their colours, as :func:`~.shading.fragment` takes it."""

    number: int
    fixed: Float
    eye: Float
    light: Float


@inner
def blend(
    colours: NDArray[np.uint8],
    row: int,
    column: int,
    sample: int,
    colour: tuple[float, float, float],
    alpha: float,
) -> None:
    """Lay a colour over a sample."""
    for channel, value in enumerate(colour):
        under = colours[row, column, sample, channel] / 255.0
        colours[row, column, sample, channel] = as_byte(under + (value - under) * alpha)


@inner
def cut(corners: Float, first: int, columns: int, room: Float) -> int:
    """Fill room with what of a triangle lies before the eye; gives its number of corners."""
    count = 0
    for k in range(3):
        here, there = first + k, first + (k + 1) % 3
        w, next_w = corners[here, 2], corners[there, 2]
        if w >= _NEAR:
            for column in range(columns):
                room[count, column] = corners[here, column]
            count += 1
        if (w >= _NEAR) != (next_w >= _NEAR):
            share = (_NEAR - w) / (next_w - w)
            for column in range(columns):
                a, b = corners[here, column], corners[there, column]
                room[count, column] = a + (b - a) * share
            room[count, 3] = _NEAR
            count += 1
    return count


@inner
def edge(a: Float, b: Float, sign: float) -> Edge:
    """The edge from corner a to b: a point of it, its direction and −1 where both were swapped.

    Two triangles that share an edge get the same numbers, so that no pixel falls between them.
    """
    if a[0] < b[0] or (a[0] == b[0] and a[1] < b[1]):
        return a[0], a[1], b[0] - a[0], b[1] - a[1], sign
    return b[0], b[1], a[0] - b[0], a[1] - b[1], -sign


@inner
def side(edge: Edge, x: float, y: float) -> float:
    """On which side of an edge a place is: more than 0 inside, and by how much."""
    px, py, dx, dy, turn = edge
    return turn * (dx * (y - py) - dy * (x - px))


@inner
def owns(edge: Edge, inside: float) -> bool:
    """Whether a place belongs to the triangle: on the edge itself to the one on its left."""
    return inside > 0.0 or (inside == 0.0 and edge[4] > 0.0)


@inner
def fill(
    a: Float,
    b: Float,
    c: Float,
    cull: bool,
    canvas: RasterTarget,
    program: FragmentProgram,
    at: Float,
) -> None:
    """Fill a triangle; of a corner come x, y [pixels], 1/w, 1/depth and the rest over w."""
    colours, near, box, places, test, opaque = canvas
    extra = len(a) - FIXED
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    # The picture is drawn turned over, so that faces seen from before run clockwise in it.
    if area == 0.0 or not np.isfinite(area) or (cull and area > 0.0):
        return
    sign = 1.0 if area > 0.0 else -1.0
    whole = 1.0 / abs(area)
    a_side, b_side, c_side = edge(b, c, sign), edge(c, a, sign), edge(a, b, sign)
    low = max(min(a[1], b[1], c[1]), float(box[1]))
    high = min(max(a[1], b[1], c[1]), float(box[1] + box[3]))
    left = max(min(a[0], b[0], c[0]), float(box[0]))
    right = min(max(a[0], b[0], c[0]), float(box[0] + box[2]))
    if low >= high or left >= right:
        return
    samples = len(places)
    for row in range(math.floor(low), math.ceil(high)):
        # Where the row can meet the inside of all edges: long thin triangles cost no more than
        # the pixels that they cover.
        x0, x1 = left, right
        for px, py, dx, dy, turn in (a_side, b_side, c_side):
            # The edge is turn · (dx · (y − py) − dy · (x − px)).
            slope = -turn * dy
            most = turn * (dy * px - dx * py) + max(turn * dx * row, turn * dx * (row + 1.0))
            if slope > 0.0:
                x0 = max(x0, -most / slope - ROUNDED)
            elif slope < 0.0:
                x1 = min(x1, -most / slope + ROUNDED)
            elif most < 0.0:
                x1 = x0
        for column in range(math.floor(x0), math.ceil(x1)):
            if column < box[0] or column >= box[0] + box[2]:
                continue
            shaded = False
            r = g = bl = alpha = 0.0
            for sample in range(samples):
                x, y = column + places[sample, 0], row + places[sample, 1]
                u, v, t = side(a_side, x, y), side(b_side, x, y), side(c_side, x, y)
                if not (owns(a_side, u) and owns(b_side, v) and owns(c_side, t)):
                    continue
                u, v, t = u * whole, v * whole, t * whole
                inverse = u * a[3] + v * b[3] + t * c[3]
                if test and inverse < near[row, column, sample]:
                    continue
                if not shaded:
                    shaded = True
                    x, y = column + 0.5, row + 0.5
                    u, v = side(a_side, x, y) * whole, side(b_side, x, y) * whole
                    t = 1.0 - u - v
                    w = u * a[2] + v * b[2] + t * c[2]
                    for k in range(extra):
                        at[k] = (u * a[FIXED + k] + v * b[FIXED + k] + t * c[FIXED + k]) / w
                    r, g, bl, alpha = fragment(
                        program.number, at, w, program.fixed, program.eye, program.light
                    )
                if alpha <= 0.0:
                    break
                blend(colours, row, column, sample, (r, g, bl), alpha)
                if opaque:
                    near[row, column, sample] = inverse


@compiled
def draw_triangles(
    corners: Float, cull: bool, canvas: RasterTarget, program: FragmentProgram
) -> None:
    """Draw triangles, rows (3 t, 4 + n) of corners; cull leaves out those seen from behind."""
    columns = corners.shape[1]
    box = canvas.box
    room = np.empty((4, columns))
    at = np.zeros(MOST)
    for first in range(0, len(corners), 3):
        count = cut(corners, first, columns, room)
        for k in range(count):
            corner = room[k]
            w = 1.0 / corner[2]
            corner[0] = box[0] + (0.5 + 0.5 * corner[0] * w) * box[2]
            corner[1] = box[1] + (0.5 + 0.5 * corner[1] * w) * box[3]
            corner[2] = w
            corner[3] = 1.0 / corner[3]
            for column in range(FIXED, columns):
                corner[column] *= w
        for k in range(1, count - 1):
            fill(room[0], room[k], room[k + 1], cull, canvas, program, at)


@compiled
def draw_points(
    points: Float,
    box: tuple[int, int, int, int],
    test: bool,
    colours: NDArray[np.uint8],
    near: NDArray[np.float32],
) -> None:
    """Draw points (n, 7): x, y [pixels], depth, diameter [pixels] and colour."""
    samples = colours.shape[2]
    for k in range(len(points)):
        x, y, depth, diameter = points[k, 0], points[k, 1], points[k, 2], points[k, 3]
        if depth < _NEAR:
            continue
        reach = 0.5 * (POINT_HALO * diameter + 1.0)
        top = max(math.floor(y - reach), box[1])
        bottom = min(math.ceil(y + reach), box[1] + box[3])
        left = max(math.floor(x - reach), box[0])
        right = min(math.ceil(x + reach), box[0] + box[2])
        for row in range(top, bottom):
            for column in range(left, right):
                away = math.hypot(column + 0.5 - x, row + 0.5 - y)
                cover = clamp(0.5 * diameter + 0.5 - away, 0.0, 1.0)
                bloom = max(1.0 - 2.0 * away / (POINT_HALO * diameter), 0.0)
                cover = max(cover, POINT_HALO_STRENGTH * bloom * bloom)
                if cover <= 0.0:
                    continue
                share = clamp(away / diameter / 0.4, 0.0, 1.0)
                hot = 0.6 * (1.0 - share * share * (3.0 - 2.0 * share))
                for sample in range(samples):
                    if test and 1.0 / depth < near[row, column, sample]:
                        continue
                    colour = (
                        mix(points[k, 4], 1.0, hot),
                        mix(points[k, 5], 1.0, hot),
                        mix(points[k, 6], 1.0, hot),
                    )
                    blend(colours, row, column, sample, colour, cover)


@compiled
def draw_panel(panel: NDArray[np.uint8], left: int, top: int, colours: NDArray[np.uint8]) -> None:
    """Lay a panel (h, w, 4) uint8 over the picture, its upper left corner at a pixel."""
    height, width, samples = colours.shape[:3]
    for row in range(max(top, 0), min(top + panel.shape[0], height)):
        for column in range(max(left, 0), min(left + panel.shape[1], width)):
            pixel = panel[row - top, column - left]
            for sample in range(samples):
                colour = pixel[0] / 255.0, pixel[1] / 255.0, pixel[2] / 255.0
                blend(colours, row, column, sample, colour, pixel[3] / 255.0)
