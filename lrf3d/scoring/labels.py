"""Adjusted Rand index: do two labelings put the same things together?"""

import numpy as np

from lrf3d.geometry import Float, Int


def adjusted_rand_index(first: Int, second: Int) -> float:
    """Agreement of two labelings (n,) of the same things (Hubert and Arabie, 1985).

    1 says that they group alike, whatever the labels are called; 0 is what chance gives. Where
    chance leaves no room (fewer than two things, all things apart in both, all things together
    in both) the two agree, and the index is 1.
    """
    _, row = np.unique(first, return_inverse=True)
    _, column = np.unique(second, return_inverse=True)
    # Only cells of the contingency table that are not empty are kept: it may be large.
    _, cells = np.unique(np.column_stack([row, column]), axis=0, return_counts=True)
    together = _pairs(cells)
    in_first, in_second = _pairs(np.bincount(row)), _pairs(np.bincount(column))
    everything = _pairs(np.array([len(row)]))
    expected = in_first * in_second / everything if everything else 0.0
    room = 0.5 * (in_first + in_second) - expected
    return float((together - expected) / room) if room else 1.0


def _pairs(counts: Int) -> float:
    """How many pairs can be drawn from groups of the given sizes."""
    sizes: Float = counts.astype(np.float64)
    return float((0.5 * sizes * (sizes - 1.0)).sum())
