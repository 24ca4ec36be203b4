import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import LaserRangeFinder, LaserScan
from lrf3d.geometry.lines import fit_line
from lrf3d.mapping.paper import (
    PaperMapper,
    SegmentTable,
    SplitMergeExtractor,
    _merge,
    clusters,
    merges,
    ordered_returns,
    split_and_merge,
    unite,
)


def table_of(ends, points=10):
    count = len(ends)
    return SegmentTable(np.array(ends, np.float64), np.full(count, points), np.arange(count))


@pytest.mark.parametrize(
    ("span", "ranges", "circle", "runs"),
    [
        (0.2, [5, 5, np.inf, 5, np.inf, 5, 5, 9, 9.0], False, [[0, 1], [5, 6], [7, 8]]),
        # Points on one wall all round are one cluster; the last beam looks where the first does.
        (np.pi, [3.0] * 9, True, [list(range(8))]),
    ],
)
def test_a_gap_parts_clusters_and_lone_points_are_dropped(span, ranges, circle, runs):
    angles = LaserRangeFinder(-span, span, beams=9).angles
    scan = LaserScan((0, 0, 0), angles, ranges, range_max=30.0)
    assert ordered_returns(scan)[1] is circle
    assert [run.tolist() for run in clusters(scan, 3.0 if circle else 1.0)] == runs


def test_split_and_merge_finds_a_corner():
    corner = [[x, 0.0] for x in range(11)] + [[10.0, y] for y in range(1, 8)]
    table = split_and_merge(np.array(corner), 0.1)
    expected = [[0, 0, 10, 0], [10, 0, 10, 7]]
    assert table.ends == pytest.approx(np.array(expected, float), abs=1e-9)


def test_neighbours_are_merged_only_if_the_last_of_their_points_lies_on_one_line_too():
    points = np.array([[x, 0.0] for x in range(10)] + [[9.5, 0.9]])
    assert _merge(points, [0, 9, 10], 0.1) == [0, 9, 10]
    # The line is fitted to that point, too, and so passes nearer to it.
    assert _merge(points, [0, 9, 10], 0.75) == [0, 10]
    assert _merge(points[:10], [0, 4, 9], 0.1) == [0, 9]


def eq9(segment, other, length=0.1, distance=0.1):
    return bool(merges(np.array(segment), np.array([other]), length, distance)[0])


def equation_9(one, other, length, distance):
    """Eq. 9 of two segments, condition by condition, as the figure of section 3.1 shows them."""
    (*a_end, bx, by), (*c_end, dx, dy) = one, other
    b_end, d_end = (bx, by), (dx, dy)

    def aside(point, begin, end):
        (px, py), (x1, y1), (x2, y2) = point, begin, end
        area = (x2 - x1) * (py - y1) - (y2 - y1) * (px - x1)
        return abs(area) / math.dist(begin, end)

    a, b = math.dist(a_end, c_end), math.dist(b_end, c_end)
    c, d = math.dist(a_end, d_end), math.dist(b_end, d_end)
    own, its = math.dist(a_end, b_end) + length, math.dist(c_end, d_end) + length
    c1, c2, c3, c4 = a + b < own, c + d < own, a + c < its, b + d < its
    near = [aside(point, a_end, b_end) < distance for point in (c_end, d_end)]
    near += [aside(point, c_end, d_end) < distance for point in (a_end, b_end)]
    return (sum((c1, c2, c3, c4)) >= 2 and all(near)) or (c1 and c2) or (c3 and c4)


@settings(max_examples=300)
@given(
    st.tuples(*[st.floats(-3.0, 3.0)] * 4),
    st.tuples(*[st.floats(-1.0, 1.0)] * 4),
    st.sampled_from([0.02, 0.2, 2.0]),
    st.sampled_from([0.05, 0.5, 5.0]),
)
def test_equation_9_is_its_eight_conditions(one, by, length, distance):
    other = tuple(np.add(one, by).tolist())
    if math.dist(one[:2], one[2:]) < 1e-3 or math.dist(other[:2], other[2:]) < 1e-3:
        return
    assert eq9(one, other, length, distance) is equation_9(one, other, length, distance)


def test_thresholds_of_equation_9_themselves_are_too_far():
    # Sides of 3, 4 and 5 make sums that are exact; of four conditions one is met, three are ties.
    segment, others = [0.0, 0.0, 6.0, 0.0], ([3.0, 4, 3, 0], [3.0, 0, 3, 4])
    assert [eq9(segment, other, 4.0, 5.0) for other in others] == [False, False]
    assert [eq9(segment, other, 4.001, 5.0) for other in others] == [True, True]
    segment, other = [0.0, 0.0, 10.0, 0.0], [5.0, 0.5, 15.0, 0.5]
    assert not eq9(segment, other, 1.0, 0.5) and eq9(segment, other, 1.0, 0.501)


@given(st.floats(-np.pi, np.pi))
def test_a_merged_segment_fits_all_four_ends_and_keeps_its_direction(heading):
    way = np.array([np.cos(heading), np.sin(heading)])
    # The second runs the other way, and a little askew.
    second = [*(15.0 * way), *(9.0 * way + 0.05 * way[::-1] * [-1.0, 1.0])]
    table = table_of([[0.0, 0.0, *(10.0 * way)], second])
    mean, unit = fit_line(table.ends.reshape(-1, 2))
    unite(table, 0, 1)
    offset = table.ends[0].reshape(2, 2) - mean
    assert unit[0] * offset[:, 1] - unit[1] * offset[:, 0] == pytest.approx([0, 0], abs=1e-12)
    assert (offset[1] - offset[0]) @ way == pytest.approx(15.0, abs=0.01)


def united(*scans):
    mapper = PaperMapper(SplitMergeExtractor(2.5, 0.1), 0.1, 0.1, 1)
    for local in scans:
        mapper.add(local)
    return mapper.table


def test_a_chain_of_pieces_becomes_one_segment_in_one_union():
    table = united(table_of([[k, 0.0, k + 1.05, 0.0] for k in range(9)]))
    assert table.points.tolist() == [90]
    assert np.abs(table.ends[0]) == pytest.approx([0, 0, 9.05, 0], abs=1e-6)


def test_merging_unites_the_unions():
    # 0 and 1 are of two unions; the bridge joins them; 2 is of the union of 0 but elsewhere.
    table = table_of([[0, 0, 4, 0], [6, 0, 9, 0], [0, 5, 4, 5]])
    whole = united(table._replace(unions=np.array([0, 1, 0])), table_of([[3, 0, 7, 0]]))
    assert len(whole.ends) == 2 and len(set(whole.unions.tolist())) == 1
