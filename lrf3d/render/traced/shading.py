"""What a ray from the eye sees, compiled: faces, the ground and the sky, with the haze between.

The triangles of all that moves get their colours here, too, as their fragment shaders give them.

A camera is a row of twelve numbers: the eye, and the direction of the ray through a pixel's place
(x, y), which is linear in both: at (0, 0), and what x and y add. Directions have a length of 1
along the axis of the camera, so that a distance along a ray is a depth.

Light is a row of twelve: direction to the sun, colour of the haze and one over its reach, indoor,
colour of the ground past its pictures and width of the change [m].

Grounds are rows of ten, one for each picture of the ground, the last of which is of all: where it
is drawn (least x and y, largest x and y), its corner and one over its size, and which of the levels
are its own: the first, and how many. A level is a copy of a picture, half as fine as the one
before: where its texels start, its width and its height.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.render.traced.textures import clamp, mix, painted_at, picture_colour
from lrf3d.scene.look import (
    FAN_COLOUR,
    FAN_CURVE,
    GLOW,
    GROUND_SHARPNESS,
    SHADOW_COLOUR,
    SHADOW_RIM,
    TRAIL_COLOUR,
    TRAIL_OLD,
    ZENITH,
    ZENITH_INDOOR,
)

NORMAL, OFFSET, ALONG, UP, UNDER, COLOUR, LIGHT, SHADE, LAYER, COLUMNS = (
    0, 3, 4, 8, 12, 16, 19, 31, 43, 44,
)  # fmt: skip
"""Columns of the table of faces."""

FLAT, FAN, LINE, TRAIL, BLOB, ROBOT, BAND = range(7)
"""Programs, named like the files in ``render/shaders``."""

MOST = 9
"""The most numbers that a program interpolates."""

GROUND, SKY = -1, -2
"""What a pixel sees that sees no face; faces are numbered from 0."""

SUN, HAZE, INDOOR, BEYOND = 0, 3, 7, 8
"""Columns of the light."""

LEAST_LIT = 100.0
"""How far a face without shadow is lit [m]."""

SHARPER = -GROUND_SHARPNESS
"""By how much coarser copies of the ground are taken."""

SUN_RIM = SHADOW_RIM
"""Width of the edge of the sun's light [m]."""


class RayScene(NamedTuple):
    """All that a ray can see, and the light on it.

    Attributes:
        faces: (f, COLUMNS) walls and roofs, see :func:`~lrf3d.render.traced.surfaces.face_table`.
        painted: (t,) all copies of the texture of walls, one after the other.
        painted_levels: (n, 3) where each copy starts, its width and height.
        texels: (u,) all copies of the pictures of the ground, one after the other.
        levels: (l, 3) where each copy starts, its width and height.
        grounds: (g, 10) the pictures of the ground.
        paints: (4,) how bright bare ground is, and what marks, kerbs and pavements add.
        light: (12,) sun, haze and land.
    """

    faces: Float
    painted: NDArray[np.uint8]
    painted_levels: Int
    texels: NDArray[np.uint8]
    levels: Int
    grounds: Float
    paints: Float
    light: Float


@inner
def along_face(face: Float, column: int, x: float, y: float, z: float) -> float:
    """A value that changes evenly over a face, at a place or, less its constant, over a way."""
    value: float = face[column] * x + face[column + 1] * y + face[column + 2] * z
    return value


@inner
def face_light(
    face: Float, column: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Light that changes evenly over a face, at a place."""
    return (
        along_face(face, column, x, y, z) + face[column + 3],
        along_face(face, column + 4, x, y, z) + face[column + 7],
        along_face(face, column + 8, x, y, z) + face[column + 11],
    )


@inner
def hazed(
    r: float, g: float, b: float, dx: float, dy: float, dz: float, light: Float
) -> tuple[float, float, float]:
    """A colour seen over a way (dx, dy, dz) [m] through the haze."""
    far = (dx * dx + dy * dy + dz * dz) * light[HAZE + 3] * light[HAZE + 3]
    share = far / (1.0 + far)
    return (
        mix(r, light[HAZE], share),
        mix(g, light[HAZE + 1], share),
        mix(b, light[HAZE + 2], share),
    )


@inner
def sky_colour(dx: float, dy: float, dz: float, light: Float) -> tuple[float, float, float]:
    """The sky in a direction."""
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx / length, dy / length, dz / length
    indoor = light[INDOOR]
    share = 1.0 - math.pow(1.0 - clamp(dz, 0.0, 1.0), 2.6)
    glow = max(dx * light[SUN] + dy * light[SUN + 1] + dz * light[SUN + 2], 0.0)
    glow *= glow
    glow = 0.16 * (1.0 - indoor) * glow * (glow * glow) * (glow * glow)
    r = mix(light[HAZE], mix(ZENITH[0], ZENITH_INDOOR[0], indoor), share) + GLOW[0] * glow
    g = mix(light[HAZE + 1], mix(ZENITH[1], ZENITH_INDOOR[1], indoor), share) + GLOW[1] * glow
    b = mix(light[HAZE + 2], mix(ZENITH[2], ZENITH_INDOOR[2], indoor), share) + GLOW[2] * glow
    return r, g, b


@inner
def ground_colour(x: float, y: float, step: float, scenery: RayScene) -> tuple[float, float, float]:
    """The ground at a place; step is the square of the metres a pixel, along the longer way."""
    texels, levels = scenery.texels, scenery.levels
    grounds, light = scenery.grounds, scenery.light
    for number in range(len(grounds)):
        ground = grounds[number]
        if ground[0] <= x <= ground[2] and ground[1] <= y <= ground[3]:
            seen = picture_colour(x, y, step, SHARPER, texels, levels, ground)
            texel = 1.0 / (ground[6] * levels[int(ground[8]), 1])
            sharp = clamp(texel / math.sqrt(max(step, 1e-12)), 1.0, 32.0)
            return painted_ground(seen, sharp, scenery.paints)
    ground = grounds[len(grounds) - 1]
    u, v = (x - ground[4]) * ground[6], (y - ground[5]) * ground[7]
    past = max(abs(u - 0.5) - 0.5, 0.0) / ground[6] + max(abs(v - 0.5) - 0.5, 0.0) / ground[7]
    share = min(past / light[BEYOND + 3], 1.0)
    seen = picture_colour(x, y, step, 4.0 * min(16.0 * share, 1.0), texels, levels, ground)
    r, g, b = painted_ground(seen, 1.0, scenery.paints)
    return (
        mix(r, light[BEYOND], share),
        mix(g, light[BEYOND + 1], share),
        mix(b, light[BEYOND + 2], share),
    )


@inner
def painted_ground(
    seen: tuple[float, float, float, float], sharp: float, paints: Float
) -> tuple[float, float, float]:
    """The colour of the ground by its picture, whose edges are magnified so many times."""
    cover = 3.0 * seen[3] - 1.0
    mark = clamp((-cover - 0.5) * sharp + 0.5, 0.0, 1.0)
    kerb = clamp((cover - 0.5) * sharp + 0.5, 0.0, 1.0)
    pave = clamp((cover - 1.5) * sharp + 0.5, 0.0, 1.0)
    paint = paints[0] + mark * paints[1] + kerb * paints[2] + pave * paints[3]
    return seen[0] * paint, seen[1] * paint, seen[2] * paint


@inner
def see(
    px: float, py: float, hit: int, camera: Float, scenery: RayScene
) -> tuple[float, float, float, float, int]:
    """Colour, one over the depth, and what is seen at a place (px, py) of the picture [pixels]."""
    light = scenery.light
    dx = camera[3] + px * camera[6] + py * camera[9]
    dy = camera[4] + px * camera[7] + py * camera[10]
    dz = camera[5] + px * camera[8] + py * camera[11]
    down = -camera[2] / dz if dz * camera[2] < 0.0 else np.inf
    if hit >= 0:
        face = scenery.faces[hit]
        nx, ny, nz = face[NORMAL], face[NORMAL + 1], face[NORMAL + 2]
        slope = nx * dx + ny * dy + nz * dz
        gap = face[OFFSET] - nx * camera[0] - ny * camera[1] - nz * camera[2]
        depth = gap / slope if slope != 0.0 else np.inf
        if 0.0 < depth <= down * 1.000001:
            x, y, z = depth * dx, depth * dy, depth * dz
            wx, wy, wz = camera[0] + x, camera[1] + y, camera[2] + z
            along = along_face(face, ALONG, wx, wy, wz) + face[ALONG + 3]
            up = along_face(face, UP, wx, wy, wz) + face[UP + 3]
            under = along_face(face, UNDER, wx, wy, wz) + face[UNDER + 3]
            along_step = up_step = under_step = 0.0
            for way in (6, 9):
                turn = (nx * camera[way] + ny * camera[way + 1] + nz * camera[way + 2]) / slope
                sx = depth * (camera[way] - turn * dx)
                sy = depth * (camera[way + 1] - turn * dy)
                sz = depth * (camera[way + 2] - turn * dz)
                along_step += abs(along_face(face, ALONG, sx, sy, sz))
                up_step += abs(along_face(face, UP, sx, sy, sz))
                under_step += abs(along_face(face, UNDER, sx, sy, sz))
            r, g, b, wall = painted_at(
                along,
                up,
                along_step,
                up_step,
                int(face[LAYER]),
                scenery.painted,
                scenery.painted_levels,
            )
            shadowed = 0.0
            if under > -LEAST_LIT:
                shadowed = clamp(under / (under_step + SUN_RIM) + 0.5, 0.0, 1.0)
            lit, shade = face_light(face, LIGHT, wx, wy, wz), face_light(face, SHADE, wx, wy, wz)
            r = (r + face[COLOUR] * wall) * mix(lit[0], shade[0], shadowed)
            g = (g + face[COLOUR + 1] * wall) * mix(lit[1], shade[1], shadowed)
            b = (b + face[COLOUR + 2] * wall) * mix(lit[2], shade[2], shadowed)
            r, g, b = hazed(r, g, b, x, y, z, light)
            return r, g, b, 1.0 / depth, hit
    if np.isfinite(down):
        x, y, z = down * dx, down * dy, down * dz
        x_step = y_step = 0.0
        turn = camera[8] / dz
        sx, sy = down * (camera[6] - turn * dx), down * (camera[7] - turn * dy)
        x_step = sx * sx + sy * sy
        turn = camera[11] / dz
        sx, sy = down * (camera[9] - turn * dx), down * (camera[10] - turn * dy)
        y_step = sx * sx + sy * sy
        step = max(x_step, y_step)
        r, g, b = ground_colour(camera[0] + x, camera[1] + y, step, scenery)
        r, g, b = hazed(r, g, b, x, y, z, light)
        return r, g, b, 1.0 / down, GROUND
    r, g, b = sky_colour(dx, dy, dz, light)
    return r, g, b, 0.0, SKY


@inner
def as_byte(value: float) -> np.uint8:
    """A colour value of 0…1 as 0…255."""
    return np.uint8(clamp(value, 0.0, 1.0) * 255.0 + 0.5)


@compiled
def aim_pixels(
    camera: Float, width: int, origins: NDArray[np.float32], directions: NDArray[np.float32]
) -> None:
    """Fill the rays (n, 3) through the middles of the pixels of a picture."""
    for k in range(len(origins)):
        x, y = k % width + 0.5, k // width + 0.5
        for axis in range(3):
            origins[k, axis] = camera[axis]
            directions[k, axis] = camera[3 + axis] + x * camera[6 + axis] + y * camera[9 + axis]


@compiled
def shade_pixels(
    camera: Float,
    hits: NDArray[np.int32],
    scenery: RayScene,
    colours: NDArray[np.uint8],
    near: NDArray[np.float32],
    seen: NDArray[np.int32],
) -> None:
    """Shade all pixels: colours (h, w, s, 3), one over depths (h, w, s), what is seen (h, w)."""
    height, width, samples = near.shape
    for row in range(height):
        for column in range(width):
            hit = hits[row * width + column]
            r, g, b, inverse, what = see(column + 0.5, row + 0.5, hit, camera, scenery)
            seen[row, column] = what
            red, green, blue = as_byte(r), as_byte(g), as_byte(b)
            for sample in range(samples):
                colours[row, column, sample, 0] = red
                colours[row, column, sample, 1] = green
                colours[row, column, sample, 2] = blue
                near[row, column, sample] = inverse


@inner
def fragment(
    program: int, at: Float, w: float, fixed: Float, eye: Float, light: Float
) -> tuple[float, float, float, float]:
    """Colour and opacity of a triangle's pixel, as its shader has them; no opacity is nothing.

    w is one over the depth: what is to be even in the picture comes in multiplied by the depth.
    """
    if program == FLAT:
        return at[0], at[1], at[2], at[3]
    if program == FAN:
        left = clamp(1.0 - at[0] / fixed[0], 0.0, 1.0)
        alpha = fixed[1] * at[1] * math.pow(left, FAN_CURVE)
        return FAN_COLOUR[0], FAN_COLOUR[1], FAN_COLOUR[2], alpha
    if program == LINE:
        cover = clamp(0.5 * fixed[0] + 0.5 - abs(at[4] * w), 0.0, 1.0)
        return at[0], at[1], at[2], at[3] * cover
    if program == TRAIL:
        if at[0] > fixed[0]:
            return 0.0, 0.0, 0.0, 0.0
        r, g, b = TRAIL_COLOUR
        r, g, b = hazed(r, g, b, at[1] - eye[0], at[2] - eye[1], at[3] - eye[2], light)
        old = min((fixed[0] - at[0]) * fixed[1], 1.0)
        return r, g, b, mix(0.95, TRAIL_OLD, old * (2.0 - old))
    if program == BLOB:
        share = clamp((math.hypot(at[0], at[1]) - 0.45) / 0.55, 0.0, 1.0)
        r, g, b = SHADOW_COLOUR
        return r, g, b, fixed[0] * (1.0 - share * share * (3.0 - 2.0 * share))
    if program == BAND:
        dx, dy, dz = at[4] - eye[0], at[5] - eye[1], at[6] - eye[2]
        r, g, b = hazed(at[0], at[1], at[2], dx, dy, dz, light)
        return r, g, b, at[3]
    # The robot: place, normal, colour.
    x, y, z = eye[0] - at[0], eye[1] - at[1], eye[2] - at[2]
    away = 1.0 / math.sqrt(x * x + y * y + z * z)
    long = 1.0 / math.sqrt(at[3] * at[3] + at[4] * at[4] + at[5] * at[5])
    nx, ny, nz = at[3] * long, at[4] * long, at[5] * long
    sx, sy, sz = light[SUN], light[SUN + 1], light[SUN + 2]
    hx, hy, hz = sx + x * away, sy + y * away, sz + z * away
    half = 1.0 / math.sqrt(hx * hx + hy * hy + hz * hz)
    lit = 0.56 + 0.36 * max(nx * sx + ny * sy + nz * sz, 0.0) + 0.06 * nz
    shine = max((nx * hx + ny * hy + nz * hz) * half, 0.0) ** 32
    rim = 1.0 - clamp((nx * x + ny * y + nz * z) * away, 0.0, 1.0)
    plus = 0.22 * shine + 0.07 * rim * rim * rim
    r, g, b = hazed(at[6] * lit + plus, at[7] * lit + plus, at[8] * lit + plus, -x, -y, -z, light)
    return r, g, b, 1.0
