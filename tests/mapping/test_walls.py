import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lrf3d.geometry import lengths
from lrf3d.mapping.grid import Grid, Search, find
from lrf3d.mapping.robust.wall_store import WallStore
from lrf3d.mapping.robust.walls import Rule, Walls, misfit, partner
from lrf3d.mapping.segment_table import add_moments, fit_ends, measure_moments

RULE = Rule(0.5, 0.1, 0.04, 1.0)


def local_walls(rng, count, size=12.0):
    """Random walls that often lie on few common lines, so that many of them merge."""
    angle = rng.choice([0.0, 0.5 * np.pi, np.pi, 0.7], count) + rng.normal(0.0, 0.01, count)
    start = rng.integers(0, 6, (count, 2)) * size / 6 + rng.normal(0.0, 0.02, (count, 2))
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    ends = np.hstack([start, start + rng.uniform(0.5, 4.0, (count, 1)) * unit])
    return ends, *described(ends, rng.integers(3, 30, count))


def described(ends, points, deviation=0.02):
    moments = []
    for row, number in zip(ends, points, strict=True):
        along = np.linspace(0.0, 1.0, number)[:, None]
        weights = np.full(number, deviation**-2)
        moments.append(measure_moments(row[:2] + along * (row[2:] - row[:2]), weights))
    return np.array(moments).reshape(-1, 6), np.asarray(points)


class PairwiseStore:
    """The same loop in plain Python: every wall that waits is compared with every other."""

    def __init__(self):
        self.ends, self.moments, self.points = [], [], []
        self.free = []

    def add(self, ends, moments, points):
        rows = self.free[len(self.free) - min(len(ends), len(self.free)) :]
        del self.free[len(self.free) - len(rows) :]
        rows += range(len(self.points), len(self.points) + len(ends) - len(rows))
        for row, end, moment, count in zip(rows, ends, moments, points, strict=True):
            if row == len(self.points):
                for column in (self.ends, self.moments, self.points):
                    column.append(None)
            self.ends[row], self.moments[row], self.points[row] = end, moment, int(count)
        # Which of two rows is kept, and so when it has its turn, goes by their numbers: freed rows
        # are used again in the order in which an update met them.
        waiting, met = list(rows), list(rows)
        while waiting:
            row = waiting.pop(0)
            if not self.points[row]:
                continue
            walls = Walls(np.array(self.ends), np.array(self.moments), np.array(self.points))
            other = partner(walls, row, np.arange(len(self.points)), RULE)
            if other < 0:
                continue
            kept, gone = min(row, other), max(row, other)
            moments = add_moments(self.moments[kept], self.moments[gone])
            ends = np.array([self.ends[kept], self.ends[gone]])
            self.ends[kept], self.moments[kept] = fit_ends(moments, ends), moments
            self.points[kept] += self.points[gone]
            self.points[gone] = 0
            met += [kept, gone]
            waiting.append(kept)
        self.free += [row for row in dict.fromkeys(met) if not self.points[row]]

    def table(self):
        rows = np.flatnonzero(self.points)
        return np.array(self.ends)[rows], np.array(self.points)[rows]


def sorted_rows(ends, points):
    order = np.lexsort(np.round(ends, 6).T)
    return ends[order], points[order]


@given(st.integers(0, 10_000))
@example(3432)  # Freed rows were used again in another order than the store's.
@example(167)  # A wall that grew was found by the next only after its turn.
@settings(max_examples=25, deadline=None)
def test_the_grid_finds_what_comparing_all_pairs_finds(seed):
    rng = np.random.default_rng(seed)
    store, plain = WallStore(RULE, cell=float(rng.uniform(0.7, 6.0))), PairwiseStore()
    for _ in range(5):
        ends, moments, points = local_walls(rng, int(rng.integers(1, 16)))
        store.add(ends, moments, points, (0.0, 0.0))
        plain.add(ends, moments, points)
    table = store.table()
    one, other = sorted_rows(table.ends, table.points), sorted_rows(*plain.table())
    assert np.array_equal(one[1], other[1])
    assert one[0] == pytest.approx(other[0], abs=1e-9)


@pytest.mark.parametrize("entries", [16, 32, 64])
@pytest.mark.parametrize("cell", np.linspace(0.05, 0.3, 11).tolist())
def test_a_merged_wall_is_found_in_the_gap_that_it_closes(cell, entries):
    # Also where the grid has to grow for the cells of the gap.
    store = WallStore(RULE, cell=cell)
    store._grid = Grid.of_size(entries)
    sides = np.array([[0, 0.02, 1, 0.02], [1.45, 0.02, 2.45, 0.02]])
    store.add(sides, *described(sides, [20, 20]), (0.0, 0.0))
    assert len(store.table()) == 1
    search = Search.of_size(len(store.walls.points))
    gap = np.array([1.2, 0.02, 1.25, 0.02])
    assert find(store.grid, gap, 0.0, cell, search.stamps, 1, search.found) == 1


def test_a_map_that_outgrows_its_arrays_stays_the_same():
    rng = np.random.default_rng(1)
    ends = np.column_stack([rng.uniform(0, 4000, (3000, 2)), np.zeros((3000, 2))])
    ends[:, 2:] = ends[:, :2] + rng.normal(0.0, 3.0, (3000, 2))
    moments, points = described(ends, np.full(3000, 5))
    at_once, in_turn = WallStore(RULE), WallStore(RULE)
    at_once.add(ends, moments, points, (0.0, 0.0))
    for first in range(0, 3000, 100):
        part = slice(first, first + 100)
        in_turn.add(ends[part], moments[part], points[part], (0.0, 0.0))
    one, other = at_once.table(), in_turn.table()
    assert len(one) == len(other) > 2500
    assert lengths(one.ends).sum() == pytest.approx(lengths(other.ends).sum())


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_a_table_that_was_handed_out_does_not_change_later(seed):
    rng = np.random.default_rng(seed)
    store, kept = WallStore(RULE), []
    for _ in range(8):
        store.add(*local_walls(rng, int(rng.integers(0, 12))), (0.0, 0.0))
        table = store.table()
        columns = table.ends, table.moments, table.points
        kept.append((columns, [column.copy() for column in columns]))
    for table, copy in kept:
        assert all(np.array_equal(one, other) for one, other in zip(table, copy, strict=True))


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_uniting_keeps_every_point_and_the_exact_fit(seed):
    rng = np.random.default_rng(seed)
    ends, moments, points = local_walls(rng, 20)
    store = WallStore(RULE)
    store.add(ends, moments, points, (0.0, 0.0))
    table = store.table()
    assert table.points.sum() == points.sum()
    assert table.moments[:, 0].sum() == pytest.approx(moments[:, 0].sum())
    whole, united = moments[0], table.moments[0]
    for row in moments[1:]:
        whole = add_moments(whole, row)
    for row in table.moments[1:]:
        united = add_moments(united, row)
    assert united == pytest.approx(whole, rel=1e-9)


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_no_two_walls_are_left_that_the_rule_merges(seed):
    rng = np.random.default_rng(seed)
    store = WallStore(RULE)
    for _ in range(4):
        store.add(*local_walls(rng, 10), (0.0, 0.0))
    table = store.table()
    for i in range(len(table)):
        for k in range(i):
            pair = table.ends[i], table.moments[i], table.ends[k], table.moments[k]
            assert misfit(*pair, RULE) >= 1.0


def apart(other, deviation=0.005):
    ends = np.array([[0.0, 0.0, 10.0, 0.0], other])
    moments, _ = described(ends, [50, 20], deviation)
    return misfit(ends[0], moments[0], ends[1], moments[1], RULE)


def test_what_stands_beside_a_wall_is_another():
    assert apart([5.0, 0.05, 7.0, 0.05]) < 1.0
    assert apart([5.0, 0.7, 5.4, 0.7]) >= 1.0


def test_a_wall_goes_on_straighter_than_two_views_of_it_agree():
    assert apart([5.0, 0.08, 8.0, 0.08]) < 1.0
    assert apart([10.2, 0.08, 13.2, 0.08]) >= 1.0


def test_a_gap_wider_than_the_rule_says_parts_two_walls():
    assert apart([10.4, 0.0, 13.0, 0.0]) < 1.0
    assert apart([10.6, 0.0, 13.0, 0.0]) >= 1.0


def test_walls_that_face_opposite_ways_are_two():
    assert apart([7.0, 0.0, 5.0, 0.0]) == np.inf
