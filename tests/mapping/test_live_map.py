"""The map as a value: current after each update, and never changed once it is handed out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import (
    LaserRangeFinder,
    LaserScan,
    LineMapper,
    PlanarCaster,
    ProportionalNoise,
    World,
)
from lrf3d.mapping.live_map import LEAST_ROWS, MOST_COPIES, MOST_WAITING, LiveMap, Placement
from lrf3d.mapping.paper.growing import GrowingMap
from lrf3d.mapping.paper.mapper import EndPointMerging
from lrf3d.mapping.segment_table import SegmentTable

WORLD = World(
    [[4, -3, 4, 3], [4, 3, -4, 3], [-4, 3, -4, -3], [1, -1, 2, -1], [2, -1, 2, 0], [-2, 0, -2, 1]]
)
LRF = LaserRangeFinder(angle_min=-np.pi, angle_max=np.pi, beams=181, range_max=30.0)
OWN = (0.37, 0.41)
PLACEMENT = Placement(0.0, 0.0, 0.0, *OWN)


def scans(count):
    rng, caster = np.random.default_rng(0), PlanarCaster(WORLD)
    places = rng.uniform(-0.8, 0.8, (count, 2))
    poses = np.column_stack([places, rng.uniform(-3.0, 3.0, count)])
    return [ProportionalNoise(0.02)(caster.cast(LRF, pose), rng) for pose in poses]


def columns(line_map):
    return [line_map.segments.copy(), line_map.objects.copy(), line_map.points.copy()]


def is_same(line_map, kept):
    return all(map(np.array_equal, columns(line_map), kept))


@pytest.mark.parametrize("held", [1, 2, MOST_COPIES + MOST_WAITING + 3])
def test_a_map_that_somebody_holds_never_changes(held):
    mapper = LineMapper()
    maps = []
    for scan in scans(40):
        mapper.update(scan)
        maps = [*maps, (mapper.map, columns(mapper.map))][-held:]
        assert all(is_same(line_map, kept) for line_map, kept in maps)


def test_part_of_an_array_of_a_map_never_changes():
    mapper = LineMapper()
    parts = []
    for scan in scans(30):
        mapper.update(scan)
        view = mapper.map.segments[1::2].T
        parts.append((view, view.copy()))
        parts = parts[-5:]
        assert all(np.array_equal(view, kept) for view, kept in parts)


def test_the_map_is_the_same_however_often_it_is_looked_at():
    always, once, held = LineMapper(), LineMapper(), LineMapper()
    maps = []
    for scan in scans(40):
        for mapper in (always, once, held):
            mapper.update(scan)
        assert len(always.map) >= 0
        maps.append(held.map)
    kept = columns(once.map)
    assert is_same(always.map, kept) and is_same(held.map, kept)


def test_a_map_cannot_be_written():
    mapper = LineMapper()
    mapper.update(scans(1)[0])
    with pytest.raises(ValueError, match="read-only"):
        mapper.map.segments[0, 0] = 1.0
    with pytest.raises(ValueError, match="WRITEABLE"):
        mapper.map.segments.setflags(write=True)


def test_objects_are_numbered_without_gaps_while_segments_come_and_go():
    rng, live = np.random.default_rng(1), LiveMap()
    ends = rng.uniform(-9.0, 9.0, (60, 4))
    points, labels = np.zeros(60, np.int64), np.zeros(60, np.int64)
    for _ in range(200):
        rows = rng.choice(60, 9, replace=False)
        points[rows], labels[rows] = rng.integers(0, 3, 9), rng.integers(0, 12, 9)
        ends[rows] += 0.1
        # One whose ends are one place is not shown.
        ends[rows[0], 2:] = ends[rows[0], :2]
        live.update(rows, ends, points, labels, PLACEMENT)
        line_map = live.value()
        shown = np.flatnonzero((points > 0) & (ends[:, :2] != ends[:, 2:]).any(axis=1))
        place = {tuple(row): k for k, row in enumerate(line_map.segments + np.tile(OWN, 2))}
        order = [
            min(range(len(line_map)), key=lambda k: np.abs(ends[row] - list(place)[k]).max())
            for row in shown
        ]
        assert len(line_map) == len(shown) and sorted(order) == list(range(len(shown)))
        assert np.array_equal(line_map.points[order], points[shown])
        same = labels[shown][:, None] == labels[shown]
        objects = line_map.objects[order]
        assert np.array_equal(objects[:, None] == objects, same)
        assert set(objects.tolist()) == set(range(len(set(labels[shown].tolist()))))


def test_an_object_that_grows_keeps_its_number():
    live = LiveMap()
    ends = np.arange(24.0).reshape(6, 4)
    points, labels = np.array([5, 5, 5, 0, 0, 0]), np.array([0, 1, 2, 2, 1, 0])
    live.update(np.arange(3), ends, points, labels, PLACEMENT)
    before = live.value().objects.tolist()
    points[3:] = 5
    live.update(np.arange(3, 6), ends, points, labels, PLACEMENT)
    assert before == [0, 1, 2] and live.value().objects.tolist() == [0, 1, 2, 2, 1, 0]


def test_a_restored_mapper_has_the_same_map_in_the_same_order():
    mapper, again = LineMapper(), LineMapper()
    drive = scans(60)
    for scan in drive[:40]:
        mapper.update(scan)
    again.restore(mapper.state())
    assert is_same(again.map, columns(mapper.map))
    for scan in drive[40:]:
        mapper.update(scan)
        again.update(scan)
    assert is_same(again.map, columns(mapper.map))


def test_a_map_that_was_larger_for_a_while_is_right_again():
    # Segments beyond the room of a copy were written beside it.
    live, count = LiveMap(), 2 * LEAST_ROWS
    ends = np.random.default_rng(3).uniform(-9.0, 9.0, (count, 4))
    points, labels = np.full(count, 7), np.arange(count)
    few, more = np.arange(LEAST_ROWS // 2), np.arange(LEAST_ROWS // 2, count)
    room = slice(LEAST_ROWS)
    live.update(few, ends[room], points[room], labels[room], PLACEMENT)
    kept = columns(live.value())
    live.update(more, ends, points, labels, PLACEMENT)
    points[more] = 0
    live.update(more[::-1].copy(), ends, points, labels, PLACEMENT)
    assert is_same(live.value(), kept)


def as_set(line_map):
    """The segments and points of a map, grouped into objects, in no order."""
    objects = {}
    rows = zip(line_map.segments.tolist(), line_map.points.tolist(), strict=True)
    for number, (ends, points) in zip(line_map.objects.tolist(), rows, strict=True):
        objects.setdefault(number, set()).add((*ends, points))
    assert set(objects) == set(range(len(objects)))
    return set(map(frozenset, objects.values()))


def worked_out(growing):
    """The paper's map from the whole of its table."""
    table = growing.table()
    table = table.take(np.flatnonzero(table.points >= growing._least))
    return table.as_map(growing._origin)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    least=st.sampled_from([0, 2, 12, 40]),
    size=st.sampled_from([4.0, 12.0, 60.0]),
    place=st.sampled_from([(0.0, 0.0), (1e6 + 0.3, -2e6 - 0.2)]),
)
def test_a_map_of_the_paper_is_that_of_its_whole_table(seed, least, size, place):
    rng = np.random.default_rng(seed)
    always, seldom = (GrowingMap(EndPointMerging(0.1, 0.12), least) for _ in range(2))
    held = []
    for _ in range(30):
        count, robot = int(rng.integers(0, 50)), np.array(place) + rng.uniform(-3.0, 3.0, 2)
        angle = rng.integers(0, 2, count) * np.pi / 2.0 + rng.normal(0.0, 0.01, count)
        half = rng.exponential(0.6, count)[:, None] + 0.01
        half = half * np.column_stack([np.cos(angle), np.sin(angle)])
        middle = np.round(rng.uniform(-size, size, (count, 2)))
        ends, points = np.hstack([middle - half, middle + half]), rng.integers(2, 20, count)
        # Numbers of unions may be left out.
        unions = np.sort(2 * rng.integers(0, 9, count))
        local = SegmentTable(ends, np.ones((count, 6)), points, unions)
        always.add(local, robot)
        seldom.add(local, robot)
        assert as_set(always.map) == as_set(worked_out(always))
        held = [*held, (always.map, columns(always.map))][-4:]
        assert all(is_same(line_map, kept) for line_map, kept in held)
        if rng.random() < 0.2:
            state, always = always.state(), GrowingMap(EndPointMerging(0.1, 0.12), least)
            always.restore(state)
            assert is_same(always.map, held[-1][1])
    assert is_same(seldom.map, columns(always.map))


def test_a_map_of_the_paper_is_the_same_object_until_the_next_update():
    mapper, drive = LineMapper("paper"), scans(2)
    mapper.update(drive[0])
    first = mapper.map
    assert mapper.map is first
    mapper.update(drive[1])
    assert mapper.map is not first


def test_the_state_after_an_interrupted_update_of_the_paper_shows_all_that_changed(monkeypatch):
    caster = PlanarCaster(World([[-3, -2, 3, -2], [3, -2, 3, 2], [3, 2, -3, 2.0]]))
    mapper = LineMapper("paper")
    mapper.update(caster.cast(LaserRangeFinder(beams=91), (0, 0, 0)))

    def interrupted(_):
        raise KeyboardInterrupt

    with monkeypatch.context() as stopped:
        stopped.setattr(GrowingMap, "_publish", interrupted)
        with pytest.raises(KeyboardInterrupt):
            mapper.update(caster.cast(LaserRangeFinder(beams=91), (0, 0, np.pi)))
    other = LineMapper("paper")
    other.restore(mapper.state())
    assert np.array_equal(other.map.segments, mapper.map.segments)
    assert len(other.map) == 3


@pytest.mark.parametrize(("mode", "count"), [("paper", 1), ("robust", 0)])
def test_two_beams_are_a_wall_of_the_paper_and_too_few_for_the_default(mode, count):
    mapper = LineMapper(mode)
    mapper.update(LaserScan((0, 0, 0), [0.0, 0.01], [3.0, 3.0]))
    assert len(mapper.map) == count
