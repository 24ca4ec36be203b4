"""What a ray from the eye sees, compiled: faces, the ground and the sky, with the haze between.

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

import numpy as np

from lrf3d.casting.kernels.compiling import compiled, inner
from lrf3d.render.traced.facades import (
    ALONG,
    KIND,
    NORMAL,
    OFFSET,
    UNDER,
    UP,
    clamp,
    face_colour,
    mix,
)

GROUND, SKY = -1, -2
"""What a pixel sees that sees no face; faces are numbered from 0."""

SUN, HAZE, INDOOR, BEYOND = 0, 3, 7, 8
"""Columns of the light."""

RIM, LEAST_LIT = 0.04, 100.0
"""Width of the edge of sunlight on a face [m], and how far a face without shadow is lit."""

SHARPER = -0.6
"""By how much finer copies of the ground are taken: streets are seen at a slant."""


@inner
def hazed(r, g, b, dx, dy, dz, light):
    """A colour seen over a way (dx, dy, dz) [m] through the haze."""
    far = (dx * dx + dy * dy + dz * dz) * light[HAZE + 3] * light[HAZE + 3]
    share = far / (1.0 + far)
    return (
        mix(r, light[HAZE], share),
        mix(g, light[HAZE + 1], share),
        mix(b, light[HAZE + 2], share),
    )


@inner
def sky_colour(dx, dy, dz, light):
    """The sky in a direction."""
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx / length, dy / length, dz / length
    indoor = light[INDOOR]
    share = 1.0 - math.pow(1.0 - clamp(dz, 0.0, 1.0), 2.6)
    glow = max(dx * light[SUN] + dy * light[SUN + 1] + dz * light[SUN + 2], 0.0)
    glow *= glow
    glow = 0.16 * (1.0 - indoor) * glow * (glow * glow) * (glow * glow)
    r = mix(light[HAZE], mix(0.33, 0.60, indoor), share) + glow
    g = mix(light[HAZE + 1], mix(0.53, 0.66, indoor), share) + 0.93 * glow
    b = mix(light[HAZE + 2], mix(0.85, 0.74, indoor), share) + 0.80 * glow
    return r, g, b


@inner
def ground_colour(x, y, step, texels, levels, grounds, light):
    """The ground at a place; step is the square of the metres a pixel, along the longer way."""
    for number in range(len(grounds)):
        ground = grounds[number]
        if ground[0] <= x <= ground[2] and ground[1] <= y <= ground[3]:
            return picture_colour(x, y, step, SHARPER, texels, levels, ground)
    ground = grounds[len(grounds) - 1]
    u, v = (x - ground[4]) * ground[6], (y - ground[5]) * ground[7]
    past = max(abs(u - 0.5) - 0.5, 0.0) / ground[6] + max(abs(v - 0.5) - 0.5, 0.0) / ground[7]
    share = min(past / light[BEYOND + 3], 1.0)
    r, g, b = picture_colour(x, y, step, 4.0 * min(16.0 * share, 1.0), texels, levels, ground)
    return (
        mix(r, light[BEYOND], share),
        mix(g, light[BEYOND + 1], share),
        mix(b, light[BEYOND + 2], share),
    )


@inner
def picture_colour(x, y, step, sharper, texels, levels, ground):
    """A picture of the ground at a place, from the copy whose texels are as large as pixels."""
    u, v = (x - ground[4]) * ground[6], (y - ground[5]) * ground[7]
    first, count = int(ground[8]), int(ground[9])
    level = first
    texel_size = 1.0 / (ground[6] * levels[first, 1])
    if step > texel_size * texel_size or (sharper > 0.0 and step > 0.0):
        finer = 0.5 * math.log2(step / (texel_size * texel_size)) + sharper
        level += min(max(int(finer + 0.5), 0), count - 1)
    start, width, height = levels[level, 0], levels[level, 1], levels[level, 2]
    # Between the four nearest texels.
    x = clamp(u * width - 0.5, 0.0, width - 1.0)
    y = clamp(v * height - 0.5, 0.0, height - 1.0)
    left, top = int(x), int(y)
    x, y = x - left, y - top
    here = start + 3 * (top * width + left)
    right = 3 if left < width - 1 else 0
    below = 3 * width if top < height - 1 else 0
    upper_left, upper_right = (1.0 - x) * (1.0 - y) / 255.0, x * (1.0 - y) / 255.0
    lower_left, lower_right = (1.0 - x) * y / 255.0, x * y / 255.0
    r = upper_left * texels[here] + upper_right * texels[here + right]
    g = upper_left * texels[here + 1] + upper_right * texels[here + right + 1]
    b = upper_left * texels[here + 2] + upper_right * texels[here + right + 2]
    here += below
    r += lower_left * texels[here] + lower_right * texels[here + right]
    g += lower_left * texels[here + 1] + lower_right * texels[here + right + 1]
    b += lower_left * texels[here + 2] + lower_right * texels[here + right + 2]
    return r, g, b


@inner
def see(px, py, hit, camera, faces, texels, levels, grounds, light):
    """Colour, one over the depth, and what is seen at a place (px, py) of the picture [pixels]."""
    dx = camera[3] + px * camera[6] + py * camera[9]
    dy = camera[4] + px * camera[7] + py * camera[10]
    dz = camera[5] + px * camera[8] + py * camera[11]
    down = -camera[2] / dz if dz * camera[2] < 0.0 else np.inf
    if hit >= 0:
        face = faces[hit]
        nx, ny, nz = face[NORMAL], face[NORMAL + 1], face[NORMAL + 2]
        slope = nx * dx + ny * dy + nz * dz
        gap = face[OFFSET] - nx * camera[0] - ny * camera[1] - nz * camera[2]
        depth = gap / slope if slope != 0.0 else np.inf
        if 0.0 < depth <= down * 1.000001:
            facing = 1.0 if slope < 0.0 else -1.0
            x, y, z = depth * dx, depth * dy, depth * dz
            along = face[ALONG] * (camera[0] + x) + face[ALONG + 1] * (camera[1] + y)
            along += face[ALONG + 2] * (camera[2] + z) + face[ALONG + 3]
            up = face[UP] * (camera[0] + x) + face[UP + 1] * (camera[1] + y)
            up += face[UP + 2] * (camera[2] + z) + face[UP + 3]
            under = face[UNDER] * (camera[0] + x) + face[UNDER + 1] * (camera[1] + y)
            under += face[UNDER + 2] * (camera[2] + z) + face[UNDER + 3]
            along_step = up_step = under_step = 0.0
            if face[KIND] < 1.0 or under > -LEAST_LIT:
                for way in (6, 9):
                    turn = (nx * camera[way] + ny * camera[way + 1] + nz * camera[way + 2]) / slope
                    sx = depth * (camera[way] - turn * dx)
                    sy = depth * (camera[way + 1] - turn * dy)
                    sz = depth * (camera[way + 2] - turn * dz)
                    along_step += abs(
                        face[ALONG] * sx + face[ALONG + 1] * sy + face[ALONG + 2] * sz
                    )
                    up_step += abs(face[UP] * sx + face[UP + 1] * sy + face[UP + 2] * sz)
                    under_step += abs(
                        face[UNDER] * sx + face[UNDER + 1] * sy + face[UNDER + 2] * sz
                    )
            shaded = clamp(under / (under_step + RIM) + 0.5, 0.0, 1.0)
            bright = nx * light[SUN] + ny * light[SUN + 1] + nz * light[SUN + 2]
            r, g, b = face_colour(
                face, facing, along, up, along_step, up_step, facing * bright, light[INDOOR], shaded
            )
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
        r, g, b = ground_colour(camera[0] + x, camera[1] + y, step, texels, levels, grounds, light)
        r, g, b = hazed(r, g, b, x, y, z, light)
        return r, g, b, 1.0 / down, GROUND
    r, g, b = sky_colour(dx, dy, dz, light)
    return r, g, b, 0.0, SKY


@inner
def as_byte(value):
    """A colour value of 0…1 as 0…255."""
    return np.uint8(clamp(value, 0.0, 1.0) * 255.0 + 0.5)


@compiled
def aim_pixels(camera, width, origins, directions):
    """Fill the rays (n, 3) through the middles of the pixels of a picture."""
    for k in range(len(origins)):
        x, y = k % width + 0.5, k // width + 0.5
        for axis in range(3):
            origins[k, axis] = camera[axis]
            directions[k, axis] = camera[3 + axis] + x * camera[6 + axis] + y * camera[9 + axis]


@compiled
def shade_pixels(camera, hits, faces, texels, levels, grounds, light, colours, near, seen):
    """Shade all pixels: colours (h, w, s, 3), one over depths (h, w, s), what is seen (h, w)."""
    height, width, samples = near.shape
    for row in range(height):
        for column in range(width):
            hit = hits[row * width + column]
            r, g, b, inverse, what = see(
                column + 0.5, row + 0.5, hit, camera, faces, texels, levels, grounds, light
            )
            seen[row, column] = what
            red, green, blue = as_byte(r), as_byte(g), as_byte(b)
            for sample in range(samples):
                colours[row, column, sample, 0] = red
                colours[row, column, sample, 1] = green
                colours[row, column, sample, 2] = blue
                near[row, column, sample] = inverse
