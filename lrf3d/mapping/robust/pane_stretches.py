"""Which stretches of a line are glass, from what beams did at its pieces.

Numbers of beams by piece and kind enter, and where walls meet the line; stretches leave.
"""

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.optics_constants import (
    FRAME_DISTANCE,
    FRAME_SINE,
    LEAST_SHOWN,
    OPAQUE_SHARE,
    SHORTEST_PANE,
)

DIM, FLASHED, PASSED, OPAQUE, OPEN, KINDS = 0, 1, 2, 3, 4, 5
"""What a beam that crosses the line of a pane does there: it returns dim light or a flash, passes,
ends on something opaque, or passes where glass would flash; and the number of these."""


def frames(point: Float, unit: Float, walls: Float) -> Float:
    """Stations [m] along a line, from a point (2,), at which walls (w, 4) end on it or cross it.

    Walls along the line are left out: they may be returns of the glass itself.
    """
    offset = walls.reshape(-1, 2, 2) - point
    along = offset @ unit
    aside = offset[:, :, 1] * unit[0] - offset[:, :, 0] * unit[1]
    rise = aside[:, 1] - aside[:, 0]
    upright = np.abs(rise) > FRAME_SINE * np.hypot(rise, along[:, 1] - along[:, 0])
    meets = upright & (
        (np.abs(aside).min(axis=1) < FRAME_DISTANCE) | (aside[:, 0] * aside[:, 1] < 0.0)
    )
    share = np.clip(-aside[meets, 0] / rise[meets], 0.0, 1.0)
    stations: Float = along[meets, 0] + share * (along[meets, 1] - along[meets, 0])
    return stations


def stretches(pieces: Int, reach: Float, ends: Float) -> list[tuple[float, float]]:
    """From where to where [m] a line is glass.

    Glass ends at something. Between two of its returns it goes on, however far they are apart, if
    beams pass there and no wall ends there; an opening between two panes has walls beside it.

    Args:
        pieces: (PANE_PIECES, KINDS) what beams did at each of its pieces.
        reach: (PANE_PIECES, 2) the first and the last return of glass in each.
        ends: Stations at which walls meet the line.
    """
    shown = pieces[:, DIM] + pieces[:, FLASHED]
    opaque = pieces[:, OPAQUE] > OPAQUE_SHARE * (pieces[:, PASSED] + shown)
    there = np.flatnonzero((shown > 0) & ~opaque)
    # One beam may end on what stands before a pane or beside it; a wall ends several.
    around = np.lib.stride_tricks.sliding_window_view(np.pad(pieces, ((1, 1), (0, 0))), 3, axis=0)
    dim, flashed, passed, stopped, _ = around.sum(axis=2).T
    filled = opaque & (stopped >= LEAST_SHOWN) & (stopped > OPAQUE_SHARE * (passed + dim + flashed))
    barrier = np.concatenate([[0], np.cumsum(filled | ((pieces[:, OPEN] > 0) & (shown == 0)))])
    found, first = [], 0
    for k in range(len(there)):
        last = there[k]
        stop = k + 1 == len(there)
        if not stop:
            after = there[k + 1]
            gap = reach[last, 1] + FRAME_DISTANCE, reach[after, 0] - FRAME_DISTANCE
            framed = bool(((ends > gap[0]) & (ends < gap[1])).any())
            stop = framed or barrier[after] - barrier[last + 1] > 0
        if stop:
            run = slice(there[first], last + 1)
            dim, flashed, passed, stopped, _ = pieces[run].sum(axis=0)
            glass = dim + flashed
            low, high = reach[there[first], 0], reach[last, 1]
            if (
                passed + glass >= LEAST_SHOWN
                and stopped < OPAQUE_SHARE * (passed + glass)
                and high - low > SHORTEST_PANE
            ):
                found.append((float(low), float(high)))
            first = k + 1
    return found
