"""What a map takes to store, as in section 4 of the paper."""

import numpy as np
import pytest
from synthetic_run import around, make_run, make_world, ring

from benchmarks.storage import held_polylines, storage
from lrf3d.laser import LaserRangeFinder
from lrf3d.mapping import LineMap

FULL = np.array([(0.0, 0), (10, 0), (10, 6), (0, 6)])


def local_map(corners):
    """The local map of a scan that shows a chain of walls."""
    lines = np.hstack([corners[:-1], corners[1:]])
    return LineMap(lines, np.zeros(len(lines)), np.full(len(lines), 9))


def test_an_object_of_six_walls_takes_fewer_numbers_than_its_views_as_polylines_or_a_grid():
    walls = ring([(0, 0), (6, 0), (6, 3), (3, 3), (3, 6), (0, 6)])
    run = make_run(make_world(walls), around(3, 3, 8, 8), LaserRangeFinder(-np.pi, np.pi, 721))
    views = [[(0, 6), (0, 0), (6, 0)], [(0, 0), (6, 0), (6, 3), (3, 3)],
             [(6, 0), (6, 3), (3, 3), (3, 6), (0, 6)], [(3, 6), (0, 6), (0, 0)]]  # fmt: skip
    count = storage(run, [local_map(np.array(view, float)) for view in views])
    # The view from below left is shown by the others; corner walls are stored twice.
    assert (count.union_numbers, count.polyline_numbers) == (30, 24)
    assert count.grid_cells > 50 * count.polyline_numbers
    assert storage(run, []).polyline_numbers == 0


@pytest.mark.parametrize(
    ("views", "held"),
    [
        ([[FULL[:3]], [FULL[:3] * 0.95 + [0.4, 0.05]]], 1),  # nothing new
        ([[FULL[:3]], [FULL[1:]]], 2),  # around the corner
        ([[FULL[:2], FULL[1:3]], [FULL]], 1),  # all that others show
    ],
)
def test_a_view_is_held_that_shows_what_the_others_do_not(views, held):
    assert len(held_polylines(views, 0.1)) == held
