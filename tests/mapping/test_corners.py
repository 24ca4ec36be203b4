import numpy as np
import pytest

from lrf3d.mapping.grid import Grid, Search, insert_rows, remove
from lrf3d.mapping.robust.constants import MERGE_CELL
from lrf3d.mapping.robust.corners import close_corners
from lrf3d.mapping.robust.walls import Walls


def closed_of(ends, objects):
    """All walls with closed corners, and what closes them."""
    rows = np.arange(len(ends))
    grid, search = Grid.of_size(1 << 10), Search.of_size(len(ends))
    assert insert_rows(grid, rows, 0, ends, MERGE_CELL) == len(ends)
    closed, points = ends.copy(), np.ones(len(ends), np.int64)
    walls, marks = Walls(ends, np.zeros((len(ends), 6)), points), np.zeros(len(ends), np.bool_)
    close_corners(rows, walls, objects, grid, search, closed, marks)
    assert not marks.any()
    return closed, walls, grid, search


def test_ends_that_all_but_meet_are_moved_to_where_the_lines_cross():
    ends = np.array([[0.0, 0, 3.9, 0], [4, 0.2, 4, 3], [0.2, 0.1, 0, 2.0]])
    one = np.zeros(3, np.int64)
    closed, *_ = closed_of(ends, one)
    assert closed[0, 2:] == pytest.approx([4, 0]) == closed[1, :2]
    # Walls of other objects do not meet.
    apart, *_ = closed_of(ends, np.arange(3))
    assert np.array_equal(apart, ends)


def test_an_end_meets_the_one_that_is_nearest_to_it():
    ends = np.array([[0.0, 0, 3.95, 0], [4, 0.05, 4, 3], [4.2, -0.1, 4.2, -3]])
    closed, *_ = closed_of(ends, np.zeros(3, np.int64))
    assert closed[0, 2:] == pytest.approx([4, 0])
    assert np.array_equal(closed[2], ends[2])


@pytest.mark.parametrize("seed", range(4))
def test_what_an_update_closes_is_what_closing_all_corners_gives(seed):
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 6, (80, 2))
    ends = np.hstack([places, places + rng.uniform(-1.5, 1.5, (80, 2))])
    objects = rng.integers(0, 3, 80)
    closed, walls, grid, search = closed_of(ends, objects)
    moved = np.sort(rng.choice(80, 9, replace=False))
    for row in moved:
        remove(grid, row, ends[row], MERGE_CELL)
    ends[moved] += rng.uniform(-0.4, 0.4, (9, 4))
    assert insert_rows(grid, moved, 0, ends, MERGE_CELL) == 9
    marks = np.zeros(80, np.bool_)
    close_corners(moved, walls, objects, grid, search, closed, marks)
    assert closed == pytest.approx(closed_of(ends, objects)[0], abs=1e-12)
