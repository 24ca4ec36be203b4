"""Compiled loops of the plain renderer: what rays see, and triangles and discs over that."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import borrower, compiled
from lrf3d.geometry.lines import Float, Single
from lrf3d.studio.render.skins import dress
from lrf3d.studio.scene.look import (
    CLIMB,
    DAWN,
    EMBER,
    EMBER_SHARE,
    FALL,
    FRONT,
    GREY,
    LEAST_FALL,
    MAP_LIGHT,
    MAP_SHARE,
    NIGHT_LOW,
    RIM,
    TINY,
    TOP_TINT,
    WHITE,
)

# Depth from which on walls are drawn [m].
NEAREST = 0.05

# Coarseness of the copy of the ground's picture, in lengths of a pixel: it is seen at a slant.
_SLANT = 0.35

# What keeps a place between the last two cells of a picture from its edge [cells].
_INSIDE = 1.001

# Steepness of the edge of the map's colour as it climbs a wall [1/m].
_CLIMB_EDGE = 1.5

# Power of the share of the sky that is haze, which falls from the horizon up.
_SKY = 2.6

# Least depth that is divided by [m].
_LEAST_AWAY = 1e-6

# Least difference of two depths that is divided by [m].
_FLAT = 1e-12


class Surfaces(NamedTuple):
    """What rays see: triangles, the ground and their tones."""

    # (t, 3, 13) place, colour, place in front of it, whether it is a wall, and what the wall shows.
    corners: Single
    # Texels of the ground's picture, all levels one after another.
    ground: NDArray[np.uint8]
    # (n, 3) where each level starts, its width and height.
    ground_levels: NDArray[np.int64]
    # (7,) corner and size of that picture [m], and the colour of the land around.
    area: Float
    # (4, 3) colours of the haze, of the sky overhead, of white at night; factors of the lit.
    tones: Float
    # Share of light on roofs next to a wall that was seen.
    top: float
    # Height at which walls are cut [m].
    cut: float


class LaserLight(NamedTuple):
    """What the laser has lit by now: see :mod:`lrf3d.studio.scene.stage.exposure`."""

    # (h, w, 4) the picture of times.
    times: Single
    # (h, w, 4) the map in the same cells, and how much of each it covers.
    tints: Single
    # (4,) corner of both [m], and one over their size [1/m].
    area: Float
    # (2,) what time it is, and how fast that passes.
    clock: Float


@borrower
def depth_of(place: Single, matrix: Float) -> float:
    """The depth of a place that a matrix (3, 4) shows as x, y and depth."""
    depth: float = matrix[2, 3]
    for k in range(3):
        depth += matrix[2, k] * place[k]
    return depth


@borrower
def project(
    start: Single, end: Single, share: float, matrix: Float, height: int, width: int, found: Float
) -> None:
    """Pixels and one over the depth of the place at a share of the way from a start to an end."""
    x = matrix[0, 3]
    y = matrix[1, 3]
    depth = matrix[2, 3]
    for k in range(3):
        place = start[k] + share * (end[k] - start[k])
        x += matrix[0, k] * place
        y += matrix[1, k] * place
        depth += matrix[2, k] * place
    found[0] = (0.5 + 0.5 * x / depth) * width
    found[1] = (0.5 + 0.5 * y / depth) * height
    found[2] = 1.0 / depth


@borrower
def outlined(corners: Single, matrix: Float, height: int, width: int, outline: Float) -> int:
    """Fill in the outline (6, 3) of a triangle (3, …) in the picture; returns its corners.

    What lies before the eye is cut off: three or four corners are left, or none.
    """
    count = 0
    for i in range(3):
        j = (i + 1) % 3
        from_eye = depth_of(corners[i], matrix)
        there = depth_of(corners[j], matrix)
        seen = from_eye >= NEAREST
        if seen:
            project(corners[i], corners[i], 0.0, matrix, height, width, outline[count])
            count += 1
        if seen != (there >= NEAREST):
            share = (NEAREST - from_eye) / (there - from_eye + _FLAT)
            project(corners[i], corners[j], share, matrix, height, width, outline[count])
            count += 1
    return count


@borrower
def across(outline: Float, count: int, y: float, ends: Float) -> None:
    """Fill in where a row at y crosses an outline: left, right, and one over the depth at both."""
    ends[0] = math.inf
    ends[1] = -math.inf
    for i in range(count):
        p = outline[i]
        q = outline[(i + 1) % count]
        if (p[1] <= y) != (q[1] <= y):
            share = (y - p[1]) / (q[1] - p[1])
            x = p[0] + share * (q[0] - p[0])
            depth = p[2] + share * (q[2] - p[2])
            if x < ends[0]:
                ends[0] = x
                ends[2] = depth
            if x > ends[1]:
                ends[1] = x
                ends[3] = depth


@compiled
def number_nearest(corners: Single, matrix: Float, hits: NDArray[np.int32], near: Single) -> None:
    """Number in hits (h, w) which of triangles (t, 3, …) a matrix (3, 4) shows in each pixel.

    One over their depths is kept in near.
    """
    height, width = hits.shape
    outline = np.empty((6, 3))
    ends = np.empty(4)
    for t in range(len(corners)):
        count = outlined(corners[t], matrix, height, width, outline)
        if count < 3:
            continue
        low = outline[:count, 1].min()
        high = outline[:count, 1].max()
        for row in range(max(math.ceil(low - 0.5), 0), min(math.ceil(high - 0.5), height)):
            across(outline, count, row + 0.5, ends)
            left = ends[0]
            right = ends[1]
            begin = ends[2]
            step = (ends[3] - begin) / max(right - left, TINY)
            for column in range(
                math.ceil(max(left - 0.5, 0.0)), math.ceil(min(right - 0.5, float(width)))
            ):
                depth = begin + (column + 0.5 - left) * step
                if depth > near[row, column]:
                    hits[row, column] = t
                    near[row, column] = depth


@borrower
def plane(corners: Single, eye: Float, found: Float) -> None:
    """Fill in the numbers (10,) by which `shade` intersects rays from an eye with a triangle.

    The dot product of a ray's direction with the first three numbers is a volume. Its dot products
    with the next three and the three after, divided by the volume, are the weights of the second
    and the third corner (Möller and Trumbore, 1997); the last number divided by it is the distance.
    """
    found[9] = 0.0
    for k in range(3):
        i = (k + 1) % 3
        j = (k + 2) % 3
        a = corners[1, i] - corners[0, i]
        b = corners[1, j] - corners[0, j]
        c = corners[2, i] - corners[0, i]
        d = corners[2, j] - corners[0, j]
        x = eye[i] - corners[0, i]
        y = eye[j] - corners[0, j]
        found[k] = c * b - d * a
        found[3 + k] = c * y - d * x
        found[6 + k] = x * b - y * a
        found[9] -= found[k] * (eye[k] - corners[0, k])


@borrower
def sample(picture: Single, x: float, y: float, area: Float, found: Float) -> None:
    """Read a picture (h, w, 4) at a place [m], between its cells; nothing is beyond its edges."""
    height, width = picture.shape[:2]
    u = (x - area[0]) * area[2] * width - 0.5
    v = (y - area[1]) * area[3] * height - 0.5
    # What a sliver of a triangle gives may be no number.
    u = u if 0.0 <= u else 0.0
    v = v if 0.0 <= v else 0.0
    u = min(u, width - _INSIDE)
    v = min(v, height - _INSIDE)
    column = int(u)
    row = int(v)
    a = u - column
    b = v - row
    for k in range(4):
        low = picture[row, column, k] * (1.0 - a) + picture[row, column + 1, k] * a
        high = picture[row + 1, column, k] * (1.0 - a) + picture[row + 1, column + 1, k] * a
        found[k] = low + b * (high - low)


@borrower
def read_ground(surfaces: Surfaces, x: float, y: float, length: float, found: Single) -> None:
    """Read the colour of the ground at a place [m] where a pixel has a length [m]."""
    area = surfaces.area
    levels = surfaces.ground_levels
    u = (x - area[0]) / area[2]
    v = (y - area[1]) / area[3]
    for k in range(3):
        found[k] = area[4 + k]
    if 0.0 <= u < 1.0 and 0.0 <= v < 1.0:
        # The copy whose texels are as large as a pixel.
        level = int(math.log2(max(length * levels[0, 1] / area[2], 1.0)) + 0.5)
        begin, wide, high = levels[min(level, len(levels) - 1)]
        texel = begin + 3 * (int(v * high) * wide + int(u * wide))
        for k in range(3):
            found[k] = surfaces.ground[texel + k] / WHITE


@borrower
def grey(colour: Single) -> float:
    """The brightness of a colour."""
    bright: float = GREY[0] * colour[0] + GREY[1] * colour[1] + GREY[2] * colour[2]
    return bright


@borrower
def expose(
    seen: Single,
    bright: float,
    when: Float,
    clock: Float,
    height: float,
    tones: Float,
    most: float,
) -> None:
    """Light a colour by the laser, as ``common.glsl`` does.

    In the dark, it is as bright as the plain surface. It gets at most a given share of light.
    """
    age = (clock[0] - when[0]) * clock[1] - when[3]
    share = min(max(age / DAWN, 0.0), 1.0)
    sure = min(max(0.5 + (when[1] - 0.5) / RIM, 0.0), 1.0)
    on = most * sure * share * share * (3.0 - 2.0 * share)
    shown = grey(seen)
    hot = on / (1.0 + 2.0 * age * age)
    share = on * max(1.0 - FALL * height, LEAST_FALL)
    for k in range(3):
        dark = NIGHT_LOW[k] + bright * (tones[2, k] - NIGHT_LOW[k])
        cool = seen[k] * tones[3, k] * (1.0 - EMBER_SHARE[0] * hot)
        lit = cool + EMBER[k] * hot * (EMBER_SHARE[1] + EMBER_SHARE[2] * shown)
        seen[k] = dark + share * (lit - dark)


@compiled
def shade(
    ways: Single, hits: NDArray[np.int32], fixed: Float, surfaces: Surfaces, laser: LaserLight
) -> tuple[Single, Single]:
    """Colours (n, 3) and inverse depths (n,) of what rays (n, 3) from an eye meet.

    The hits (n,) are numbers of triangles, or −1. The fixed values are the eye (3,), the number of
    pixels in a metre at a distance of one, and the density of the air.
    """
    corners = surfaces.corners
    tones = surfaces.tones
    eye = fixed[:3]
    focus = fixed[3]
    clock = laser.clock
    colours = np.empty((len(ways), 3), np.float32)
    near = np.zeros(len(ways), np.float32)
    value = np.empty(9)
    when = np.empty(4)
    tint = np.empty(4)
    planes = np.empty((len(corners), 10))
    for t in range(len(corners)):
        plane(corners[t], eye, planes[t])
    for n in range(len(ways)):
        seen = colours[n]
        hit = hits[n]
        way = ways[n]
        if hit >= 0:
            own = planes[hit]
            corner = corners[hit]
            volume = own[0] * way[0] + own[1] * way[1] + own[2] * way[2]
            u = (own[3] * way[0] + own[4] * way[1] + own[5] * way[2]) / volume
            v = (own[6] * way[0] + own[7] * way[1] + own[8] * way[2]) / volume
            away = own[9] / volume
            for k in range(9):
                first = corner[0, k]
                value[k] = first + u * (corner[1, k] - first) + v * (corner[2, k] - first)
            for k in range(3):
                seen[k] = value[3 + k]
            wall = value[8]
            bare = grey(seen)
            pixel = max(away / focus, TINY)
            along = corner[0, 9] + u * (corner[1, 9] - corner[0, 9])
            along += v * (corner[2, 9] - corner[0, 9])
            keeps = dress(seen, (along, value[2]), corner[0, 10:13], pixel, surfaces.cut)
            sample(laser.times, value[6], value[7], laser.area, when)
            bright = grey(seen)
            sure = min(2.0 * when[1], 1.0)
            most = surfaces.top + wall * (1.0 - surfaces.top)
            expose(seen, bare, when, clock, value[2], tones, most)
            climbed = (clock[0] - when[2]) * clock[1] * CLIMB - value[2]
            found = min(max(_CLIMB_EDGE * climbed + 0.5, 0.0), 1.0) * (1.0 + wall * (sure - 1.0))
            if found > 0.0:
                x, y = (value[0], value[1]) if wall > 0.5 else (value[6], value[7])
                sample(laser.tints, x, y, laser.area, tint)
                share = keeps * found * (wall + (1.0 - wall) * TOP_TINT * surfaces.top) * MAP_SHARE
                front = 0.5 * wall * found * min(max(1.0 - climbed / FRONT, 0.0), 1.0)
                light = share * (MAP_LIGHT[0] + MAP_LIGHT[1] * bright) + front
                for k in range(3):
                    seen[k] += tint[k] * light - seen[k] * share * tint[3]
        elif way[2] < 0.0:
            away = -eye[2] / way[2]
            x = eye[0] + away * way[0]
            y = eye[1] + away * way[1]
            read_ground(surfaces, x, y, _SLANT * away * max(away / eye[2], 1.0) / focus, seen)
            sample(laser.times, x, y, laser.area, when)
            expose(seen, grey(seen), when, clock, 0.0, tones, 1.0)
        else:
            rise = way[2] / math.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2)
            for k in range(3):
                seen[k] = tones[0, k] + (1.0 - (1.0 - rise) ** _SKY) * (tones[1, k] - tones[0, k])
            continue
        near[n] = 1.0 / max(away, _LEAST_AWAY)
        far = (away * fixed[4]) ** 2
        for k in range(3):
            seen[k] += far / (1.0 + far) * (tones[0, k] - seen[k])
    return colours, near


@compiled
def fill_triangles(rows: Float, solid: bool, colours: Single, near: Single) -> None:
    """Fill triangles (t, 3, 7): x, y [pixels], one over the depth, colour and opacity.

    A pixel is drawn where it is nearer than the one that is there; only solid ones set the depth.
    """
    height, width = near.shape
    for t in range(len(rows)):
        a = rows[t, 0]
        b = rows[t, 1]
        c = rows[t, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < TINY:
            continue
        low = min(a[1], b[1], c[1])
        high = max(a[1], b[1], c[1])
        for row in range(max(int(low - 0.5), 0), min(int(high + 1.5), height)):
            y = row + 0.5
            left = float(width)
            right = 0.0
            # Where the row crosses the sides of the triangle.
            for p, q in ((a, b), (b, c), (c, a)):
                if (p[1] <= y) != (q[1] <= y):
                    x = p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0])
                    left = min(left, x)
                    right = max(right, x)
            for column in range(
                math.ceil(max(left - 0.5, 0.0)), math.ceil(min(right - 0.5, float(width)))
            ):
                x = column + 0.5
                u = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
                v = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
                depth = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2])
                if depth < near[row, column]:
                    continue
                cover = a[6] + u * (b[6] - a[6]) + v * (c[6] - a[6])
                for k in range(3):
                    at = a[3 + k] + u * (b[3 + k] - a[3 + k]) + v * (c[3 + k] - a[3 + k])
                    colours[row, column, k] += cover * (at - colours[row, column, k])
                if solid:
                    near[row, column] = depth


@borrower
def blend(under: Single, row: Float, cover: float) -> None:
    """Cover a colour by a share of that of a disc (8,)."""
    for k in range(3):
        under[k] = under[k] + cover * (row[4 + k] - under[k])


@compiled
def fill_discs(rows: Float, colours: Single, near: Single) -> None:
    """Draw soft discs (n, 8): x, y, one over the depth, diameter [pixels], colour and opacity."""
    height, width = near.shape
    for n in range(len(rows)):
        x = rows[n, 0]
        y = rows[n, 1]
        depth = rows[n, 2]
        reach = 0.5 * rows[n, 3] + 0.5
        for row in range(max(int(y - reach), 0), min(int(y + reach) + 1, height)):
            for column in range(max(int(x - reach), 0), min(int(x + reach) + 1, width)):
                away = math.hypot(column + 0.5 - x, row + 0.5 - y)
                cover = min(max(reach - away, 0.0), 1.0) * rows[n, 7]
                if depth >= near[row, column]:
                    blend(colours[row, column], rows[n], cover)
