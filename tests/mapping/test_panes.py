"""Lines of glass: two that turn out to be one keep what was counted on both."""

import numpy as np
import pytest

from lrf3d.mapping.robust.optics_constants import PANE_GAP, PANE_PIECE, PANE_PIECES
from lrf3d.mapping.robust.panes import Panes

MIDDLE = PANE_PIECES // 2


def returns(low, high, count=21, sigma=0.01):
    """A segment along x with the moments of its points: weight, mean and second moments."""
    x = np.linspace(low, high, count)
    weight = 1.0 / sigma**2
    spread = weight * ((x - x.mean()) ** 2).sum()
    return np.array([low, 0.0, high, 0.0]), np.array(
        [weight * count, x.mean(), 0.0, spread, 0.0, 0.0]
    )


def add(panes, low, high):
    ends, moments = returns(low, high)
    panes.add(ends[None], moments[None])


def counted(panes, row, low, high, times):
    """Count beams between two places [m] of a line, from its anchor, piece by piece."""
    for place in range(round(low / PANE_PIECE), round(high / PANE_PIECE)):
        panes.pieces[row, MIDDLE + place, 0] += times
        panes.reach[row, MIDDLE + place] = place * PANE_PIECE, (place + 1) * PANE_PIECE


@pytest.mark.parametrize("turned", [False, True])
def test_lines_that_turn_out_to_be_one_keep_the_counts_of_both(turned):
    panes, apart = Panes(), PANE_GAP + 2.0
    add(panes, 0.0, 1.0)
    add(panes, apart, 1.0 + apart)
    assert len(panes) == 2
    if turned:
        panes.anchors[1, 2:] *= -1.0
    counted(panes, 0, -0.5, 10.0, 3)
    counted(panes, 1, *((-0.5, 10.0) if turned else (-10.0, 0.5)), 4)
    whole = panes.pieces.sum()
    # What is in the middle belongs to both.
    add(panes, 5.0, apart - 5.0)
    assert len(panes) == 1
    assert panes.pieces.sum() == whole
    assert panes.moments[0, 0] == pytest.approx(3 * returns(0.0, 1.0)[1][0])
    # Pieces of the two need not begin at the same places.
    low, high = panes.reach[0, :, 0].min(), panes.reach[0, :, 1].max()
    assert (low, high) == pytest.approx((-0.5, apart + 0.5), abs=1e-9)
    (point,), (unit,) = panes.lines()
    assert point == pytest.approx([0.5, 0.0]) and unit == pytest.approx([1.0, 0.0])
