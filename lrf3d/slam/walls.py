"""Walls: straight pieces of the key scans' surfaces, and which of them lie on one line.

The surface of a key scan enters and is cut into straight pieces, each with its moments: all that a
line needs to know of the piece's points. Pieces at the poses of their key scans enter, and walls
leave: sets of pieces of several key scans that lie on one line and overlap along it.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int

CONNECTED = 0.5
"""Following points of a piece are at most this far apart [m]."""

STRAIGHT = 0.03
"""A point that lies farther off the line of its piece than this [m] begins another."""

BEND = 0.12
"""A point whose normal is turned by more than this [rad] begins another piece."""

LEAST_PIECE_POINTS = 5
"""A piece has at least as many points."""

PARALLEL = 0.06
"""Pieces of one wall differ in direction by at most this [rad]."""

BESIDE = 0.10
"""A piece lies at most this far off the line of its wall [m]: the backs of doors stand farther."""

MARGIN = 0.2
"""A piece of a wall reaches to within this of the wall's longest piece [m]."""


class Pieces(NamedTuple):
    """Straight pieces of surfaces.

    Args:
        keys: (p,) the key scan of each.
        moments: (p, 3, 3) sums of (x, y, 1)ᵀ(x, y, 1) over the points, in the robot's frame.
        lines: (p, 5) their middle x, y [m], their normal, and half their length [m].
    """

    keys: Int
    moments: Float
    lines: Float


@compiled
def pieces_of(surface: Float) -> tuple[Float, Float]:
    """The moments (p, 3, 3) and lines (p, 5) of the straight pieces of a surface (m, 4)."""
    most = len(surface) // LEAST_PIECE_POINTS + 1
    moments = np.zeros((most, 3, 3))
    lines = np.zeros((most, 5))
    found = 0
    first = 0
    while first < len(surface):
        total = np.zeros((3, 3))
        nx = ny = 0.0
        end = first
        while end < len(surface):
            x, y = surface[end, 0], surface[end, 1]
            if end > first:
                dx, dy = x - surface[end - 1, 0], y - surface[end - 1, 1]
                length = np.sqrt(nx * nx + ny * ny)
                count = float(end - first)
                off = nx * (x - total[0, 2] / count) + ny * (y - total[1, 2] / count)
                turn = nx * surface[end, 3] - ny * surface[end, 2]
                facing = nx * surface[end, 2] + ny * surface[end, 3]
                if (
                    dx * dx + dy * dy > CONNECTED * CONNECTED
                    or abs(off) > STRAIGHT * length
                    or abs(turn) > BEND * length
                    or facing < 0.0
                ):
                    break
            nx += surface[end, 2]
            ny += surface[end, 3]
            total[0, 0] += x * x
            total[0, 1] += x * y
            total[1, 1] += y * y
            total[0, 2] += x
            total[1, 2] += y
            total[2, 2] += 1.0
            end += 1
        if end - first >= LEAST_PIECE_POINTS:
            total[1, 0], total[2, 0], total[2, 1] = total[0, 1], total[0, 2], total[1, 2]
            length = np.sqrt(nx * nx + ny * ny)
            nx, ny = nx / length, ny / length
            low = high = -ny * surface[first, 0] + nx * surface[first, 1]
            for k in range(first, end):
                along = -ny * surface[k, 0] + nx * surface[k, 1]
                low, high = min(low, along), max(high, along)
            off = (nx * total[0, 2] + ny * total[1, 2]) / total[2, 2]
            middle = 0.5 * (low + high)
            moments[found] = total
            lines[found, 0] = off * nx - middle * ny
            lines[found, 1] = off * ny + middle * nx
            lines[found, 2], lines[found, 3] = nx, ny
            lines[found, 4] = 0.5 * (high - low)
            found += 1
        first = end
    return moments[:found], lines[:found]


def pieces_of_keys(surfaces: list[Float]) -> Pieces:
    """The straight pieces of the surfaces of all key scans."""
    parts = [pieces_of(surface) for surface in surfaces]
    counts = [len(lines) for _, lines in parts]
    return Pieces(
        np.repeat(np.arange(len(surfaces)), counts),
        np.concatenate([moments for moments, _ in parts]),
        np.concatenate([lines for _, lines in parts]),
    )


@compiled
def wall_numbers(pieces: Pieces, poses: Float, order: Int) -> Int:
    """For each piece (p,) the wall that it is of, from 0 and without gaps; −1 for those of none.

    The longest piece begins a wall and takes in all that lie on its line beside it; then the
    longest of the rest begins the next. So a wall is no longer than what one scan has shown to be
    straight, and a chain of small steps does not join two.

    Args:
        pieces: The pieces.
        poses: (k, 3) poses of the key scans.
        order: (p,) the pieces from the longest to the shortest.
    """
    count = len(pieces.keys)
    placed = np.empty((count, 5))
    for p in range(count):
        x, y, theta = poses[pieces.keys[p]]
        cos, sin = np.cos(theta), np.sin(theta)
        line = pieces.lines[p]
        placed[p, 0] = x + cos * line[0] - sin * line[1]
        placed[p, 1] = y + sin * line[0] + cos * line[1]
        placed[p, 2] = cos * line[2] - sin * line[3]
        placed[p, 3] = sin * line[2] + cos * line[3]
        placed[p, 4] = line[4]
    numbers = np.full(count, -1, np.int64)
    members = np.empty(count, np.int64)
    walls = 0
    for place in range(count):
        seed = order[place]
        if numbers[seed] >= 0:
            continue
        sx, sy, nx, ny, half = placed[seed]
        taken = 0
        other_key = False
        for later in range(place, count):
            p = order[later]
            if numbers[p] >= 0:
                continue
            dx, dy = placed[p, 0] - sx, placed[p, 1] - sy
            along = -ny * dx + nx * dy
            if abs(along) > half + placed[p, 4] + MARGIN:
                continue
            if abs(nx * dx + ny * dy) > BESIDE:
                continue
            if nx * placed[p, 2] + ny * placed[p, 3] < 0.0:
                continue
            if abs(nx * placed[p, 3] - ny * placed[p, 2]) > PARALLEL:
                continue
            members[taken] = p
            taken += 1
            other_key = other_key or pieces.keys[p] != pieces.keys[seed]
        # What one key scan alone has seen says nothing of how key scans lie to each other.
        if other_key:
            for k in range(taken):
                numbers[members[k]] = walls
            walls += 1
    return numbers
