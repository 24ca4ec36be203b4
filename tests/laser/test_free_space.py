import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import lrf3d
import lrf3d.geometry.lines
from lrf3d.laser.free_space import DRIVEN, MARGIN, SIGHT, distinct_poses, free_cells

LRF = lrf3d.LaserRangeFinder()


def middles(free):
    """The middles (n, 2) of the free cells."""
    rows, columns = np.nonzero(free.cells)
    return np.array(free.origin[:2]) + free.resolution * (np.column_stack([columns, rows]) + 0.5)


@settings(max_examples=30)
@given(
    st.tuples(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5), st.floats(-10.0, 10.0)),
    st.lists(st.floats(0.1, 30.0) | st.just(np.inf) | st.just(-np.inf), min_size=19, max_size=19),
)
def test_no_cell_behind_a_return_is_free_and_cells_well_before_are(pose, ranges):
    angles = np.linspace(-1.5, 1.5, 19)
    free = free_cells([lrf3d.LaserScan(pose, angles, np.array(ranges))])
    places = middles(free) - pose[:2]
    away = np.hypot(*places.T)
    bearing = lrf3d.geometry.lines.wrap_angle(np.arctan2(places[:, 1], places[:, 0]) - pose[2])
    known = np.array(ranges)
    shown = np.minimum(known[:-1], known[1:])
    # A beam frees the cells that it goes through, also beside it.
    beside = 1.5 * free.resolution / np.maximum(away, DRIVEN)
    between = (bearing + beside >= angles[:-1, None]) & (bearing - beside <= angles[1:, None])
    least = np.where(between & np.isfinite(shown)[:, None], shown[:, None], 0.0).max(axis=0)
    assert (away + MARGIN <= least)[away > DRIVEN + free.resolution].all()
    # Along the middle between two beams that went on, all is free.
    for k in range(18):
        least = min(known[k], known[k + 1], SIGHT)
        if np.isfinite(known[[k, k + 1]]).all() and least > 1.0:
            heading = pose[2] + 0.5 * (angles[k] + angles[k + 1])
            places = np.arange(0.6, least - 0.4, 0.1)[:, None] * [np.cos(heading), np.sin(heading)]
            wide = places[np.hypot(*places.T) * (angles[1] - angles[0]) > 0.4]
            assert free.contain(wide + pose[:2]).all()


def test_a_scanner_that_turns_the_other_way_sees_the_same():
    ranges = np.linspace(2.0, 6.0, 181)
    scan = lrf3d.LaserScan((1, 2, 0.5), LRF.angles, ranges)
    turned = lrf3d.LaserScan((1, 2, 0.5), LRF.angles[::-1], ranges[::-1])
    assert (free_cells([scan]).cells == free_cells([turned]).cells).all()


def test_beams_may_be_closer_together_on_one_side():
    """What is free between two beams does not depend on where all the others are."""
    wide = np.linspace(-1.5, 1.5, 31)
    for more in (np.linspace(-1.5, -1.3, 40), np.linspace(1.3, 1.5, 40)):
        angles = np.unique(np.concatenate([wide, more]))
        even = lrf3d.LaserScan((5, 5, 0.3), wide, np.full(31, 4.0))
        crowded = lrf3d.LaserScan((5, 5, 0.3), angles, np.full(len(angles), 4.0))
        cells = free_cells([even]), free_cells([crowded])
        places = np.column_stack([part.ravel() for part in np.mgrid[2:9:0.11, 2:9:0.11]])
        bearing = np.abs(np.arctan2(places[:, 1] - 5, places[:, 0] - 5) - 0.3)
        places = places[bearing < 1.1]
        assert (cells[0].contain(places) == cells[1].contain(places)).all()
        assert cells[0].contain(places).sum() > 300


def test_of_scans_from_one_place_and_heading_the_first_counts():
    poses = np.array([[0.1, 0.1, 0.0], [0.2, 0.2, 0.0], [0.1, 0.1, 1.0], [0.6, 0.1, 0.0]])
    assert distinct_poses(poses).tolist() == [0, 2, 3]


def test_a_huge_drive_has_no_more_cells_than_a_grid_may_have():
    assert not free_cells([]).cells.any()
    for far in (30_000.0, 5e6):
        scans = [lrf3d.LaserScan((x, x, 0), LRF.angles, np.full(181, 5.0)) for x in (0.0, far)]
        assert 0 < free_cells(scans).cells.size <= 4_100_000


def test_a_single_beam_shows_only_where_the_robot_stood():
    free = free_cells([lrf3d.LaserScan((0, 0, 0), [0.0], [5.0])])
    assert free.contain(np.array([[0.05, 0.05], [2.0, 0.0]])).tolist() == [True, False]
