"""The colours of triangles' pixels, compiled: the fragment shaders of all that moves."""

import math

from lrf3d.casting.kernels.compiling import inner
from lrf3d.render.traced.facades import clamp
from lrf3d.render.traced.shading import SUN, hazed

FLAT, FAN, LINE, TRAIL, BLOB, ROBOT = range(6)
"""Programs, named like the files in ``render/shaders``."""

MOST = 9
"""The most numbers that a program interpolates."""


@inner
def fragment(program, at, w, fixed, eye, light):
    """Colour and opacity of a triangle's pixel, as its shader has them; no opacity is nothing.

    w is one over the depth: what is to be even in the picture comes in multiplied by the depth.
    """
    if program == FLAT:
        return at[0], at[1], at[2], at[3]
    if program == FAN:
        left = clamp(1.0 - at[0] / fixed[0], 0.0, 1.0)
        return 0.98, 0.25, 0.18, fixed[1] * left * math.sqrt(left)
    if program == LINE:
        cover = clamp(0.5 * fixed[0] + 0.5 - abs(at[4] * w), 0.0, 1.0)
        return at[0], at[1], at[2], at[3] * cover
    if program == TRAIL:
        if at[0] > fixed[0]:
            return 0.0, 0.0, 0.0, 0.0
        r, g, b = hazed(0.14, 0.48, 0.90, at[1] - eye[0], at[2] - eye[1], at[3] - eye[2], light)
        return r, g, b, 0.95
    if program == BLOB:
        share = clamp((math.hypot(at[0], at[1]) - 0.45) / 0.55, 0.0, 1.0)
        return 0.02, 0.03, 0.05, fixed[0] * (1.0 - share * share * (3.0 - 2.0 * share))
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
