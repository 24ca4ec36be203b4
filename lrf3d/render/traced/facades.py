"""The faces of walls and roofs, compiled: the programs ``facade`` and ``walls`` of the shaders."""

import math

from lrf3d.casting.kernels.compiling import inner

# Columns of the table of faces.
NORMAL, OFFSET, ALONG, UP, EXTENT, COLOUR, KIND, UNDER, COLUMNS = 0, 3, 4, 8, 12, 14, 17, 18, 22

BAY, STOREY, CORNICE, NARROW, PLINTH = 2.7, 3.1, 0.45, 1.7, 0.45
"""About the distance between windows and the height of a storey, the band under the roof, the
shortest face with a window, and the height of the darker foot [m]."""


SKYLIGHT = 0.68
"""What is left of the light where others hide the sun."""


@inner
def clamp(value, low, high):
    """A value, kept between two others."""
    return min(max(value, low), high)


@inner
def mix(first, second, share):
    """What lies between two values, at a share of the way."""
    return first + (second - first) * share


@inner
def chance(x, y):
    """A number in 0…1 for a cell."""
    a, b = (x * 0.1031) % 1.0, (y * 0.1137) % 1.0
    more = a * (b + 33.33) + b * (a + 33.33)
    a, b = a + more, b + more
    return ((a + b) * a) % 1.0


@inner
def facade(face, along, up, along_step, up_step):
    """Share of the light, and colour, of a wall with windows; steps are metres a pixel."""
    r, g, b = face[COLOUR], face[COLOUR + 1], face[COLOUR + 2]
    seed = face[KIND] / 0.9
    length, height = face[EXTENT], face[EXTENT + 1]
    bays = max(1.0, math.floor(length / BAY))
    storeys = max(1.0, math.floor((height - CORNICE) / STOREY))
    room_x, room_y = length / bays, (height - CORNICE) / storeys
    cell_x, cell_y = along / room_x, up / room_y
    if length > NARROW and cell_y < storeys:
        pixel_x, pixel_y = max(along_step / room_x, 1e-4), max(up_step / room_y, 1e-4)
        id_x, id_y = math.floor(cell_x), math.floor(cell_y)
        x, y = cell_x - id_x, cell_y - id_y
        door = id_y < 0.5 and bays > 1.5 and id_x == math.floor(seed * 0.999 * bays)
        wide, tall = 0.24 + 0.09 * ((seed * 7.31) % 1.0), 0.25 + 0.07 * ((seed * 3.17) % 1.0)
        middle = 0.53
        if door:
            wide, tall = 0.55 / room_x, 1.1 / room_y
            middle = tall
        inside_x, inside_y = wide - abs(x - 0.5), tall - abs(y - middle)
        # How much of the pixel lies in a box, with soft edges one pixel wide.
        glass = clamp(inside_x / pixel_x + 0.5, 0.0, 1.0) * clamp(
            inside_y / pixel_y + 0.5, 0.0, 1.0
        )
        rim_x, rim_y = inside_x + 0.07 / room_x, inside_y + 0.07 / room_y
        frame = clamp(rim_x / pixel_x + 0.5, 0.0, 1.0) * clamp(rim_y / pixel_y + 0.5, 0.0, 1.0)
        if door:
            dark = (seed * 5.0) % 1.0 >= 0.5
            pane = (0.16, 0.24, 0.22) if dark else (0.30, 0.20, 0.15)
        else:
            # A cross bar, gone where it would be thinner than half a pixel.
            bar = 0.03 / room_x
            cover = clamp((bar - abs(x - 0.5)) / pixel_x + 0.5, 0.0, 1.0)
            glass *= 1.0 - cover * min(2.0 * bar / pixel_x, 1.0) * 0.8
            sky = 0.65 * chance(id_x + seed * 91.0, id_y + seed * 91.0) + 0.35 * y
            pane = (mix(0.20, 0.42, sky), mix(0.27, 0.53, sky), mix(0.38, 0.68, sky))
        # Far away a window is smaller than a pixel; then the wall takes its mean colour.
        blur = clamp(1.6 * max(pixel_x, pixel_y) - 0.5, 0.0, 1.0)
        frame, glass = mix(frame, 0.42, blur), mix(glass, 0.34, blur)
        r = mix(mix(r, 0.55 * r + 0.4185, frame), pane[0], glass)
        g = mix(mix(g, 0.55 * g + 0.4185, frame), pane[1], glass)
        b = mix(mix(b, 0.55 * b + 0.4185, frame), pane[2], glass)
    shade = 1.0 - 0.22 / (1.0 + 1.1 * up * (1.0 + up))
    if cell_y >= storeys:
        shade += 0.10
    if up <= PLINTH:
        shade -= 0.14
    return shade, r, g, b


@inner
def face_colour(face, facing, along, up, along_step, up_step, bright, indoor, shaded):
    """Colour of a face at a place along and up it [m], lit; facing is −1 seen from behind.

    Shaded is how much of the sun others hide, 0…1.
    """
    kind = math.floor(face[KIND])
    light = 0.73 + 0.52 * max(bright, 0.0) + 0.10 * min(bright, 0.0)
    if kind < 0.5:
        if facing < 0.0:
            along = face[EXTENT] - along
        shade, r, g, b = facade(face, along, up, along_step, up_step)
        warm = bright >= 0.0
        red = mix(light * (1.04 if warm else 0.95), SKYLIGHT * 0.95, shaded)
        green = mix(light * (1.01 if warm else 0.98), SKYLIGHT * 0.98, shaded)
        blue = mix(light * (0.96 if warm else 1.06), SKYLIGHT * 1.06, shaded)
        return r * shade * red, g * shade * green, b * shade * blue
    r, g, b = face[COLOUR], face[COLOUR + 1], face[COLOUR + 2]
    if kind < 1.5:
        light = mix(light, 0.90 + 0.16 * bright, indoor)
        light = mix(light, SKYLIGHT, shaded)
        if up <= (0.09 if indoor > 0.5 else 0.0):
            light *= 0.62
        near = 3.5 * up
        light *= 1.0 - 0.16 / (1.0 + near + 0.5 * near * near)
    elif kind < 2.5:
        if indoor > 0.5:
            light = 1.02
        else:
            r, g, b, light = mix(r, 0.52, 0.75), mix(g, 0.52, 0.75), mix(b, 0.53, 0.75), 1.08
            light *= mix(1.0, SKYLIGHT, shaded)
    else:
        light = 0.55 if indoor > 0.5 else 0.85
    return r * light, g * light, b * light
