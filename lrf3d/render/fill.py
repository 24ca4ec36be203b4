"""Compiled loops of the plain renderer: what rays see, and triangles and discs over that."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Float, Single
from lrf3d.scene.look import (
    CLIMB,
    DAWN,
    EMBER,
    EMBER_SHARE,
    FALL,
    FRONT,
    LEAST_FALL,
    MAP_LIGHT,
    MAP_SHARE,
    NIGHT_LOW,
    ROOF_SHARE,
)

_SLANT = 0.35
"""How coarse copies of the ground's picture are, in lengths of a pixel: it is seen at a slant."""


class Surfaces(NamedTuple):
    """What rays see: triangles, the ground and their tones."""

    corners: Single
    """(t, 3, 9) place, colour, place before it, and whether it is a wall."""
    ground: NDArray[np.uint8]
    ground_levels: NDArray[np.int64]
    """Texels of the ground's picture, and (n, 3) where each level starts, its width and height."""
    area: Float
    """(7,) corner and size of that picture [m], and the colour of the land around."""
    tones: Float
    """(4, 3) colours of the haze, of the sky overhead, of white at night; factors of the lit."""


class LaserLight(NamedTuple):
    """What the laser has lit by now: see :mod:`lrf3d.scene.exposure`."""

    times: Single
    """(h, w, 4) the picture of times."""
    tints: Single
    """(h, w, 4) the map in the same cells, and how much of each it covers."""
    area: Float
    """(4,) corner of both [m], and one over their size [1/m]."""
    clock: Float
    """(2,) what time it is, and how fast that passes."""


@inner
def level_of(texels: float, levels: NDArray[np.int64]) -> int:
    """The level of a texture whose texels are as large as a pixel, given in texels."""
    return min(max(int(math.log2(max(texels, 1.0)) + 0.5), 0), len(levels) - 1)


@inner
def cross_dot(a: Float, b: Float, c: Float) -> float:
    """The volume a × b · c that three directions span."""
    x, y = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2]
    return float(x * c[0] + y * c[1] + (a[0] * b[1] - a[1] * b[0]) * c[2])


@borrower
def sample(picture: Single, x: float, y: float, area: Float, found: Float) -> None:
    """Read a picture (h, w, 4) at a place [m], between its cells; nothing is beyond its edges."""
    height, width = picture.shape[:2]
    u, v = (x - area[0]) * area[2] * width - 0.5, (y - area[1]) * area[3] * height - 0.5
    # What a sliver of a triangle gives may be no number.
    u = u if 0.0 <= u else 0.0
    v = v if 0.0 <= v else 0.0
    u, v = min(u, width - 1.001), min(v, height - 1.001)
    column, row = int(u), int(v)
    a, b = u - column, v - row
    for k in range(4):
        low = picture[row, column, k] * (1.0 - a) + picture[row, column + 1, k] * a
        high = picture[row + 1, column, k] * (1.0 - a) + picture[row + 1, column + 1, k] * a
        found[k] = low + b * (high - low)


@borrower
def grey(colour: Single) -> float:
    """How bright a colour is."""
    bright: float = 0.3 * colour[0] + 0.55 * colour[1] + 0.15 * colour[2]
    return bright


@borrower
def expose(seen: Single, when: Float, clock: Float, height: float, tones: Float) -> float:
    """Put a colour into the light of the laser, as ``common.glsl`` does; returns how lit it is."""
    age = (clock[0] - when[0]) * clock[1] - when[3]
    share = min(max(age / DAWN, 0.0), 1.0)
    on = when[1] * share * share * (3.0 - 2.0 * share)
    bright, hot = grey(seen), on / (1.0 + 2.0 * age * age)
    share = on * max(1.0 - FALL * height, LEAST_FALL)
    for k in range(3):
        dark = NIGHT_LOW[k] + bright * (tones[2, k] - NIGHT_LOW[k])
        cool = seen[k] * tones[3, k] * (1.0 - EMBER_SHARE[0] * hot)
        lit = cool + EMBER[k] * hot * (EMBER_SHARE[1] + EMBER_SHARE[2] * bright)
        seen[k] = dark + share * (lit - dark)
    return float(on)


@compiled
def shade(
    ways: Single, hits: NDArray[np.int32], fixed: Float, surfaces: Surfaces, laser: LaserLight
) -> tuple[Single, Single, Single]:
    """Colours (n, 3), one over the depth, and how lit it is, of what rays (n, 3) from an eye see.

    They meet triangles by number (n,), or −1. Fixed are the eye, the pixels of a metre at a
    distance of one, and the air.
    """
    corners, ground, ground_levels, area, tones = surfaces
    eye, focus, thick, clock = fixed[:3], fixed[3], fixed[4], laser.clock
    colours, near = np.empty((len(ways), 3), np.float32), np.zeros(len(ways), np.float32)
    lit = np.ones(len(ways), np.float32)
    value, way, when, tint = np.empty(9), np.empty(3), np.empty(4), np.empty(4)
    first, second, start = np.empty(3), np.empty(3), np.empty(3)
    for n in range(len(ways)):
        seen, hit = colours[n], hits[n]
        way[:] = ways[n]
        if hit >= 0:
            a, b, c = corners[hit, 0], corners[hit, 1], corners[hit, 2]
            first[:], second[:], start[:] = b[:3] - a[:3], c[:3] - a[:3], eye - a[:3]
            # The way of Möller and Trumbore (1997).
            volume = cross_dot(way, second, first)
            u, v = cross_dot(way, second, start) / volume, cross_dot(start, first, way) / volume
            away = cross_dot(start, first, second) / volume
            for k in range(9):
                value[k] = a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k])
            seen[:] = value[3:6]
            wall = value[8]
            sample(laser.times, value[6], value[7], laser.area, when)
            bright, sure = grey(seen), min(2.0 * when[1], 1.0)
            when[1] *= wall
            lit[n] = expose(seen, when, clock, value[2], tones)
            x, y = (value[0], value[1]) if wall > 0.5 else (value[6], value[7])
            sample(laser.tints, x, y, laser.area, tint)
            climbed = (clock[0] - when[2]) * clock[1] * CLIMB - value[2]
            found = min(max(1.5 * climbed + 0.5, 0.0), 1.0) * (1.0 + wall * (sure - 1.0))
            share = found * (ROOF_SHARE + wall * (MAP_SHARE - ROOF_SHARE))
            front = 0.5 * wall * found * min(max(1.0 - climbed / FRONT, 0.0), 1.0)
            for k in range(3):
                light = share * (MAP_LIGHT[0] + MAP_LIGHT[1] * bright) + front
                seen[k] += tint[k] * light - seen[k] * share * tint[3]
        elif way[2] < 0.0:
            away = -eye[2] / way[2]
            x, y = eye[0] + away * way[0], eye[1] + away * way[1]
            u, v = (x - area[0]) / area[2], (y - area[1]) / area[3]
            seen[:] = area[4:]
            if 0.0 <= u < 1.0 and 0.0 <= v < 1.0:
                long = _SLANT * away * max(away / eye[2], 1.0) / focus
                level = level_of(long * ground_levels[0, 1] / area[2], ground_levels)
                begin, wide, high = ground_levels[level]
                texel = begin + 3 * (int(v * high) * wide + int(u * wide))
                for k in range(3):
                    seen[k] = ground[texel + k] / 255.0
            sample(laser.times, x, y, laser.area, when)
            expose(seen, when, clock, 0.0, tones)
        else:
            rise = way[2] / math.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2)
            seen[:] = tones[0] + (1.0 - (1.0 - rise) ** 2.6) * (tones[1] - tones[0])
            continue
        near[n] = 1.0 / max(away, 1e-6)
        far = (away * thick) ** 2
        for k in range(3):
            seen[k] += far / (1.0 + far) * (tones[0, k] - seen[k])
    return colours, near, lit


@compiled
def fill_triangles(rows: Float, behind: bool, solid: bool, colours: Single, near: Single) -> None:
    """Fill triangles (t, 3, 7): x, y [pixels], one over the depth, colour and opacity.

    What is nearer than what is there is drawn, or what is behind it. What is solid hides what comes
    later.
    """
    height, width = near.shape
    for t in range(len(rows)):
        a, b, c = rows[t, 0], rows[t, 1], rows[t, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < 1e-9:
            continue
        low, high = min(a[1], b[1], c[1]), max(a[1], b[1], c[1])
        for row in range(max(int(low - 0.5), 0), min(int(high + 1.5), height)):
            y = row + 0.5
            left, right = float(width), 0.0
            # Where the row crosses the sides of the triangle.
            for p, q in ((a, b), (b, c), (c, a)):
                if (p[1] <= y) != (q[1] <= y):
                    x = p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0])
                    left, right = min(left, x), max(right, x)
            begin, end = max(left - 0.5, 0.0), min(right - 0.5, float(width))
            for column in range(math.ceil(begin), math.ceil(end)):
                x = column + 0.5
                u = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
                v = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
                at = a + u * (b - a) + v * (c - a)
                there = near[row, column]
                if (at[2] > there) if behind else (at[2] < there):
                    continue
                for k in range(3):
                    colours[row, column, k] += at[6] * (at[3 + k] - colours[row, column, k])
                if solid:
                    near[row, column] = at[2]


@compiled
def fill_discs(rows: Float, colours: Single, near: Single) -> None:
    """Draw soft discs (n, 8): x, y, one over the depth, diameter [pixels], colour and opacity."""
    height, width = near.shape
    for n in range(len(rows)):
        x, y, depth, reach = rows[n, 0], rows[n, 1], rows[n, 2], 0.5 * rows[n, 3] + 0.5
        for row in range(max(int(y - reach), 0), min(int(y + reach) + 1, height)):
            for column in range(max(int(x - reach), 0), min(int(x + reach) + 1, width)):
                away = math.hypot(column + 0.5 - x, row + 0.5 - y)
                cover = min(max(reach - away, 0.0), 1.0) * rows[n, 7]
                if depth >= near[row, column]:
                    for k in range(3):
                        under = colours[row, column, k]
                        colours[row, column, k] = under + cover * (rows[n, 4 + k] - under)
