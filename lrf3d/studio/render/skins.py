"""Details of lit walls in the plain renderer, compiled; the same as in ``walls.glsl``."""

import math

from lrf3d.compiling import borrower
from lrf3d.geometry.lines import Single
from lrf3d.studio.scene.look import GREY, SHELF, STOREY


@borrower
def strip(off: float, half_width: float, pixel: float) -> float:
    """The share of a pixel that lies within half a width of the middle of a strip [m]."""
    return min(max(0.5 + (half_width - abs(off)) / pixel, 0.0), 1.0)


@borrower
def fraction(value: float) -> float:
    """The fractional part of a number."""
    return value - math.floor(value)


@borrower
def facade(day: Single, place: tuple[float, float], wall: Single, pixel: float) -> float:
    """Storeys with windows, a door on each side of a house, and shops in some houses."""
    along, height = place
    own = fraction(wall[2])
    storeys = math.floor((wall[1] + 0.5) / STOREY)
    level = math.floor(height / STOREY)
    v = height - level * STOREY
    bays = math.floor(wall[0] / (2.5 + own) + 0.35)
    if bays < 1 or storeys < 1:
        return 1.0
    bay = wall[0] / bays
    number = math.floor(along / bay)
    u = along - (number + 0.5) * bay
    near = min(max(1.6 - 2.2 * pixel / min(bay, STOREY), 0.0), 1.0)
    light = 1.0 + 0.10 * strip(height - wall[1], 0.30, pixel)
    keeps = 1.0
    if level < storeys:
        low = level < 1
        door = low and number == math.floor(fraction(own * 7.3 + 0.37) * bays)
        shop = low and own > 0.5
        wide = min(0.40 + 0.35 * own, 0.5 * bay - 0.3)
        base = 0.95
        top = 2.42
        if door:
            wide = 0.52
            base = 0.0
            top = 2.15
        elif shop:
            wide = 0.5 * bay - 0.35
            base = 0.55
        middle = v - 0.5 * (base + top)
        high = 0.5 * (top - base)
        frame = strip(u, wide + 0.12, pixel) * strip(middle, high + 0.12, pixel)
        pane = strip(u, wide, pixel) * strip(middle, high, pixel)
        keeps = 1.0 - 0.25 * pane * near
        light *= 1.0 + 0.10 * frame * near
        dark = (0.22, 0.27, 0.34)
        if door:
            dark = (0.44, 0.33, 0.25)
        else:
            bar = strip(u, 0.035, pixel) * min(0.05 / pixel, 1.0)
            pane *= 1.0 - 0.75 * bar
        for k in range(3):
            day[k] *= 1.0 + pane * (dark[k] - 1.0)
    for k in range(3):
        day[k] *= light
    return keeps


@borrower
def room_wall(day: Single, place: tuple[float, float], wall: Single, pixel: float) -> float:
    """A skirting board, and frames at the free ends of a wall."""
    along, height = place
    kind = math.floor(wall[2])
    off = 9.0
    if kind in (3, 5):
        off = along
    if kind > 3:
        off = min(off, wall[0] - along)
    frame = min(max(0.5 + (0.09 - off) / pixel, 0.0), 1.0)
    board = min(max(0.5 + (0.085 - height) / pixel, 0.0), 1.0)
    boards = (0.60, 0.55, 0.50)
    frames = (0.62, 0.48, 0.36)
    for k in range(3):
        day[k] *= (1.0 + board * (boards[k] - 1.0)) * (1.0 + frame * (frames[k] - 1.0))
    return 1.0 - 0.7 * frame


@borrower
def rack(day: Single, place: tuple[float, float], wall: Single, pixel: float) -> float:
    """Posts, shelves, and boxes on pallets, each of its own width and height."""
    along, height = place
    bay = wall[0] / math.floor(wall[0] / 1.35 + 0.5)
    number = math.floor(along / bay)
    u = along - (number + 0.5) * bay
    level = math.floor(height / SHELF)
    v = height - level * SHELF
    chance = fraction(math.sin(number * 12.99 + (level + 7.0 * fraction(wall[2])) * 78.23) * 4375.5)
    wide = 0.5 * bay * (0.62 + 0.28 * chance)
    high = SHELF * (0.55 + 0.33 * fraction(7.0 * chance))
    box = strip(u, wide, pixel) * strip(v - 0.5 * high - 0.05, 0.5 * high - 0.05, pixel)
    if chance < 0.12:
        box = 0.0
    near = min(max(1.6 - 2.2 * pixel / min(bay, SHELF), 0.0), 1.0)
    bright = 0.2 + 1.6 * (GREY[0] * day[0] + GREY[1] * day[1] + GREY[2] * day[2])
    tint = (0.75 + 0.4 * fraction(3.0 * chance)) * bright
    seam = 1.0 - 0.15 * strip(u, 0.03, pixel) * box
    steel = max(strip(v, 0.055, pixel), strip(abs(u) - 0.5 * bay, 0.045, pixel))
    card = (0.62, 0.50, 0.36)
    for k in range(3):
        filled = (day[k] * 0.30 + box * (card[k] * tint - day[k] * 0.30)) * seam
        whole = filled + steel * (day[k] * 1.05 - filled)
        day[k] = day[k] * 0.8 + near * (whole - day[k] * 0.8)
    return float(1.0 - 0.85 * near * box * (1.0 - steel))


@borrower
def cupboard(
    day: Single, place: tuple[float, float], wall: Single, pixel: float, top: float
) -> None:
    """A base, doors, and a top that protrudes."""
    along, height = place
    part = wall[0] / max(1.0, math.floor(wall[0] / 0.62))
    u = along - (math.floor(along / part) + 0.5) * part
    joint = strip(abs(u) - 0.5 * part, 0.008, pixel)
    joint = max(joint, strip(height - 0.55 * wall[1], 0.008, pixel))
    board = min(max(0.5 + (height - top + 0.05) / pixel, 0.0), 1.0)
    foot = min(max(0.5 + (0.09 - height) / pixel, 0.0), 1.0)
    light = (1.0 - 0.45 * foot) * (1.0 - 0.4 * joint * (1.0 - board)) * (1.0 + 0.12 * board)
    for k in range(3):
        day[k] *= light


@borrower
def dress(day: Single, place: tuple[float, float], wall: Single, pixel: float, cut: float) -> float:
    """Add details that give scale to a wall's colour; returns its share of the map's colour.

    The place is the distance along the wall and the height [m]; the wall is its length, its height
    [m] and what it shows: see :class:`lrf3d.studio.scene.shapes.Painted`.
    """
    if wall[2] < 1.0:
        return 1.0
    house = wall[2] < 2.0
    low = min(max(1.0 - place[1] / (0.9 if house else 0.22), 0.0), 1.0)
    for k in range(3):
        day[k] *= 1.0 - 0.42 * low * low
    if house:
        return facade(day, place, wall, pixel)
    if wall[2] < 6.0:
        return room_wall(day, place, wall, pixel)
    if wall[1] > 1.3 and wall[0] > 3.5:
        return rack(day, place, wall, pixel)
    if wall[0] > 0.5:
        cupboard(day, place, wall, pixel, min(wall[1], cut))
    return 1.0
