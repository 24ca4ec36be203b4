"""Returns: what a scan's beams brought back, in order, and which hang together, compiled.

The gap that parts two returns knows the spacing of the beams and the noise: a wall that is met at
no less than a grazing angle never falls apart, however far it is.
"""

import numpy as np
from numba import njit

from lrf3d.geometry import Bool, Float

GRAZING = np.radians(8.0)
"""Walls met at a smaller angle than this [rad] are not told from a gap any more."""


@njit(cache=True, nogil=True)
def sorted_returns(
    theta: float,
    angles: Float,
    ranges: Float,
    range_max: float,
    floor: float,
    growth: float,
    gap: float,
) -> tuple[Float, Float, Float, Bool]:  # pragma: no cover
    """Beams, ranges and deviations of the returns by rising angle, and which hang together.

    The last of the returns hangs together with the first only where the scan closes a circle.
    """
    count = len(angles)
    rising = True
    for i in range(count - 1):
        if angles[i + 1] < angles[i]:
            rising = False
            break
    order = np.arange(count) if rising else np.argsort(angles, kind="mergesort")
    circle = False
    if count >= 3:
        # A scan of 360° whose last beam looks where its first does gives that beam once.
        span = angles[order[-1]] - angles[order[0]]
        step = span / (count - 1)
        left = 2.0 * np.pi - span
        circle = left < 1.5 * step
        if left < 0.5 * step:
            order = order[:-1]
            count -= 1
    beams = np.empty((count, 2))
    reaches = np.empty(count)
    deviations = np.empty(count)
    turns = np.empty(count)
    places = np.empty(count, np.int64)
    kept = 0
    for place in range(count):
        i = order[place]
        reach = ranges[i]
        if reach > 0.0 and reach <= range_max and reach < np.inf:
            angle = theta + angles[i]
            beams[kept, 0] = np.cos(angle)
            beams[kept, 1] = np.sin(angle)
            reaches[kept] = reach
            deviations[kept] = np.sqrt(floor * floor + (growth * reach) ** 2)
            turns[kept] = angles[i]
            places[kept] = place
            kept += 1
    joined = np.zeros(kept, np.bool_)
    for i in range(kept):
        k = (i + 1) % kept
        if k == i or (k == 0 and not circle):
            continue
        if (places[i] + 1) % count != places[k]:
            continue
        turn = abs(turns[k] - turns[i])
        turn = min(turn, 2.0 * np.pi - turn)
        near, far = min(reaches[i], reaches[k]), max(reaches[i], reaches[k])
        step = np.sqrt(max(near * near + far * far - 2.0 * near * far * np.cos(turn), 0.0))
        # On a wall met at no less than the grazing angle two beams return points no farther
        # apart than this; noise adds to it. A wider gap than the given one always parts.
        reach = gap
        if turn < GRAZING:
            reach = min(gap, near * np.sin(turn) / np.sin(GRAZING - turn))
        noise = 4.0 * np.sqrt(deviations[i] ** 2 + deviations[k] ** 2)
        joined[i] = step <= reach + noise
    return beams[:kept], reaches[:kept], deviations[:kept], joined
