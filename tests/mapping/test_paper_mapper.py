import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import LaserRangeFinder, LaserScan
from lrf3d.geometry import fit_line, lengths
from lrf3d.mapping.paper import (
    PaperMapper,
    SegmentTable,
    SplitMergeExtractor,
    clusters,
    merges,
    ordered_returns,
    split_and_merge,
    unite,
)

CIRCLE = LaserRangeFinder(angle_min=-np.pi, angle_max=np.pi, beams=361, range_max=30.0)


def table_of(ends, points=10):
    count = len(ends)
    return SegmentTable(np.array(ends, np.float64), np.full(count, points), np.arange(count))


def scan_of(ranges, lrf=CIRCLE):
    return LaserScan((0, 0, 0), lrf.angles, ranges, range_max=30.0)


def test_lone_points_are_dropped_and_a_gap_parts_clusters():
    lrf = LaserRangeFinder(beams=9, angle_min=-0.2, angle_max=0.2)
    scan = scan_of([5, 5, np.inf, 5, np.inf, 5, 5, 9, 9.0], lrf)
    assert not ordered_returns(scan)[1]
    runs = list(clusters(scan, 1.0))
    assert [run.tolist() for run in runs] == [[0, 1], [5, 6], [7, 8]]


def test_points_on_one_wall_all_round_are_one_cluster():
    scan = scan_of(np.full(361, 3.0))
    order, circle = ordered_returns(scan)
    assert circle and len(order) == 360
    assert [len(run) for run in clusters(scan, 1.0)] == [360]


def test_split_and_merge_finds_a_corner():
    corner = np.vstack(
        [np.column_stack([np.arange(11.0), np.zeros(11)]), [[10, y] for y in range(1, 8)]]
    )
    table = split_and_merge(corner, 0.1)
    assert len(table.ends) == 2
    assert table.ends[0] == pytest.approx([0, 0, 10, 0], abs=1e-9)
    assert table.ends[1] == pytest.approx([10, 0, 10, 7], abs=1e-9)


def eq9(segment, other, length=0.1, distance=0.1):
    return bool(merges(np.array(segment), np.array([other]), length, distance)[0])


def merged(table, row=0, other=1):
    unite(table, row, other)
    return table.ends[row]


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


@pytest.mark.parametrize("heading", [0.3, 1.2, 2.5, -0.7, -2.0, -3.0])
def test_a_merged_segment_keeps_its_direction_at_any_heading(heading):
    way = np.array([np.cos(heading), np.sin(heading)])
    aside = np.array([-way[1], way[0]])
    first = [*(0.0 * way), *(10.0 * way)]
    # The second runs the other way, and a little askew.
    second = [*(15.0 * way), *(9.0 * way + 0.05 * aside)]
    ends = merged(table_of([first, second]))
    assert (ends[2:] - ends[:2]) @ way == pytest.approx(15.0, abs=0.01)


def test_merging_end_points_fits_all_four():
    table = table_of([[0, 0, 10, 0], [5, 0.05, 15, 0.05]])
    corners = table.ends.reshape(-1, 2).copy()
    ends = merged(table)
    mean, unit = fit_line(corners)
    offset = ends.reshape(2, 2) - mean
    assert unit[0] * offset[:, 1] - unit[1] * offset[:, 0] == pytest.approx([0, 0], abs=1e-12)
    assert lengths(ends[None])[0] == pytest.approx(15.0, abs=0.01)


def united(*scans):
    mapper = PaperMapper(SplitMergeExtractor(2.5, 0.1), 0.1, 0.1, 1)
    for local in scans:
        mapper.add(local)
    return mapper.table


def test_a_chain_of_pieces_becomes_one_segment_in_one_union():
    table = united(table_of([[k, 0.0, k + 1.05, 0.0] for k in range(9)]))
    assert len(table.ends) == 1 and table.points.sum() == 90
    assert np.abs(table.ends[0]) == pytest.approx([0, 0, 9.05, 0], abs=1e-6)


def test_merging_unites_the_unions():
    # 0 and 1 are of two unions; 2 bridges them; 3 is of the union of 0 but elsewhere.
    table = table_of([[0, 0, 4, 0], [6, 0, 9, 0], [0, 5, 4, 5]])
    table = table._replace(unions=np.array([0, 1, 0]))
    bridge = table_of([[3, 0, 7, 0]])
    whole = united(table, bridge)
    assert len(whole.ends) == 2 and len(set(whole.unions.tolist())) == 1
