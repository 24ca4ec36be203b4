"""Passing: how many beams have passed a link between two walls, and how deep, compiled."""

import numpy as np
from numba import njit

from lrf3d.geometry import Float
from lrf3d.mapping.evidence import PIECE, SIGMAS, beams_between
from lrf3d.mapping.scan_archive import Beams

END = 0.5 * PIECE
"""How far [m] a link's ends are left out: no end of a wall is known better than half a piece, and
beams that pass by it go on as far as they like."""


@njit(cache=True, nogil=True)
def passed(
    link: Float, beams: Beams, floor: float, growth: float, depth: float, spare: int
) -> bool:  # pragma: no cover
    """Whether more beams than are to spare have passed a link (4,) and gone on by a depth [m]."""
    x1, y1, x2, y2 = link
    length = np.hypot(x2 - x1, y2 - y1)
    if length == 0.0:
        return False
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    end = min(END, 0.25 * length)
    x1, y1, x2, y2 = x1 + end * ux, y1 + end * uy, x2 - end * ux, y2 - end * uy
    length -= 2.0 * end
    for scan in range(len(beams.places)):
        ox, oy = beams.places[scan]
        ax, ay, bx, by = x1 - ox, y1 - oy, x2 - ox, y2 - oy
        aside = ax * uy - ay * ux
        if abs(aside) < 1e-9 or ax * ax + ay * ay > (beams.reaches[scan] + length) ** 2:
            continue
        one = np.arctan2(ay, ax)
        turned = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
        start = one if turned > 0.0 else one + turned
        for turn in range(2):
            low, high = beams_between(beams, scan, start, abs(turned), turn)
            for beam in range(low, high):
                incidence = beams.units[beam, 0] * uy - beams.units[beam, 1] * ux
                if incidence * aside <= 0.0:
                    continue
                reach = aside / incidence
                deviation = np.sqrt(floor * floor + (growth * reach) ** 2)
                if abs(beams.ranges[beam]) - reach > depth + SIGMAS * deviation:
                    spare -= 1
                    if spare < 0:
                        return True
    return False
