"""What panes mirror is taken back from the map when the pane becomes known later."""

import numpy as np
import pytest

import lrf3d
from lrf3d import LaserRangeFinder, LineMapper, ProportionalNoise, World
from lrf3d.geometry import directions, lengths
from lrf3d.mapping.robust.lit_beams import LitBeams
from lrf3d.mapping.robust.pane_images import BESIDE, PaneImages, beside

LRF = LaserRangeFinder(-np.pi, np.pi, beams=721, range_max=40.0)
PANE = [0.0, 0.0, 10.0, 0.0]
BRICK = [
    [10.0, 0.0, 16.0, 0.0],
    [16.0, 0.0, 16.0, 5.0],
    [16.0, 5.0, -20.0, 5.0],
    [-20.0, 5.0, -20.0, 0.4],
]
GRAZING = np.column_stack([np.linspace(-16.0, -12.0, 10), np.full(10, 0.8), np.zeros(10)])
FACING = np.column_stack([np.linspace(0.5, 9.5, 30), np.full(30, 2.5), np.zeros(30)])


def behind(line_map):
    """How much of a map [m] lies behind the pane."""
    share = (np.arange(100) + 0.5) / 100
    y = line_map.segments[:, 1:2] + share * (line_map.segments[:, 3:] - line_map.segments[:, 1:2])
    size = np.hypot(*(line_map.segments[:, 2:] - line_map.segments[:, :2]).T)
    return float(size @ (y < -0.3).mean(axis=1))


def mapped(*drives, pane="glass"):
    world = World([PANE, *BRICK], range(5), materials=[pane, *["brick"] * 4])
    mapper, found = LineMapper(), []
    for number, poses in enumerate(drives):
        lrf3d.simulate(
            world, poses, LRF, caster="planar", noise=ProportionalNoise(0.02), mapper=mapper,
            rng=number,
        )  # fmt: skip
        found.append(mapper.map)
    return found


def test_images_are_taken_back_when_the_pane_that_showed_them_becomes_known():
    before, after = mapped(GRAZING, FACING)
    assert behind(before) > 0.5
    assert "glass" in after.kinds
    assert behind(after) == 0.0
    # The walls that were mirrored stay.
    walls = after.segments[after.kinds == "wall"]
    assert np.hypot(*(walls[:, 2:] - walls[:, :2]).T).sum() == pytest.approx(45.6, abs=0.5)


def test_the_order_of_the_drives_does_not_matter():
    after = mapped(FACING, GRAZING)[-1]
    assert "glass" in after.kinds
    assert behind(after) == 0.0


def test_a_room_behind_a_pane_stays():
    room = World(
        [PANE, *BRICK, [10.0, 0.0, 10.0, -4.0], [10.0, -4.0, 0.0, -4.0], [0.0, -4.0, 0.0, 0.0]],
        range(8),
        materials=["glass", *["brick"] * 7],
    )
    mapper = LineMapper()
    poses = np.vstack([GRAZING, FACING])
    lrf3d.simulate(
        room, poses, LRF, caster="planar", noise=ProportionalNoise(0.02), mapper=mapper, rng=0
    )
    # One of its walls is seen from both sides.
    assert behind(mapper.map) > 4.0 + 10.0 + 4.0 - 1.2


def beams(place, angles, ranges, intensities):
    units = np.column_stack([np.cos(angles), np.sin(angles)])
    ranges = np.asarray(ranges, float)
    return LitBeams(
        np.array(place), units, ranges, ranges, np.full(len(ranges), 0.01),
        np.asarray(intensities, float), 1.0,
    )  # fmt: skip


def test_the_brightest_return_of_a_cell_is_kept():
    images = PaneImages()
    images.add(beams([0.0, 0.0], [0.0, 0.001, 1.0], [2.1, 2.1, 3.0], [0.1, 0.2, 0.0]))
    assert images.returns[:, 4] == pytest.approx([0.2 * 2.1**2])
    images.add(beams([0.0, 1.0], [-0.442], [np.hypot(2.1, 1.0)], [0.01]))
    images.add(beams([1.0, 0.0], [0.0, 0.0], [1.1, 2.2], [0.1, 0.3]))
    assert len(images.cells) == 2 and (np.diff(images.cells) > 0).all()
    rows = images.returns[np.argsort(images.returns[:, 0])]
    assert rows[:, 4] == pytest.approx([0.2 * 2.1**2, 0.3 * 2.2**2])
    assert rows[:, 2:4].tolist() == [[0.0, 0.0], [1.0, 0.0]]


def test_segments_end_where_only_images_go_on():
    images = PaneImages()
    places = np.column_stack([np.arange(0.05, 6.0, 0.5), np.zeros(12)])
    rays = np.hstack([places, places + np.array([1.0, 2.0])])
    images.returns = np.column_stack([rays, np.ones(12), np.zeros(12)])
    segments = np.array([[0.0, 0.0, 5.6, 0.0], [0.0, 3.0, 5.6, 3.0]])
    found = places[:, 0] > 3.0
    kept, rows = images.without(segments, found, rays, 0.5, 5.0)
    assert rows.tolist() == [0, 1]
    assert kept == pytest.approx(np.array([[0, 0, 2.8, 0], [0, 3, 5.6, 3]]))
    # Between two real parts a wall goes on.
    inner = (places[:, 0] > 2.0) & (places[:, 0] < 3.0)
    assert images.without(segments, inner, rays, 0.5, 5.0)[0].tolist() == segments.tolist()
    assert images.without(segments, ~np.zeros(12, bool), rays, 0.5, 5.0)[1].tolist() == [1]


def test_returns_brighter_than_a_segment_at_their_incidence_are_not_of_it():
    images = PaneImages()
    places = np.column_stack([np.arange(0.05, 3.0, 0.5), np.zeros(6)])
    rays = np.hstack([places, places + np.array([1.0, 2.0])])
    rays[2:4, 2:] = rays[2:4, :2] + [-9.0, 0.1]
    images.returns = np.column_stack([rays, np.ones(6), np.zeros(6)])
    segments = np.array([[0.0, 0.0, 2.6, 0.0]])
    found = ~np.isin(np.arange(6), [2, 3])
    assert not len(images.without(segments, found, rays, 0.5, 5.0)[0])
    assert len(images.without(segments, found, rays, 0.5, np.inf)[0])


def test_points_lie_by_segments_as_distances_say():
    rng = np.random.default_rng(0)
    points, segments = rng.uniform(-3.0, 3.0, (300, 2)), rng.uniform(-3.0, 3.0, (20, 4))
    unit = directions(segments)
    offset = points[:, None] - segments[:, :2]
    along = (offset * unit).sum(axis=2)
    aside = np.abs(offset[..., 1] * unit[:, 0] - offset[..., 0] * unit[:, 1])
    near = (aside < BESIDE) & (along > -BESIDE) & (along < lengths(segments) + BESIDE)
    of, row = beside(points, segments)
    assert (np.diff(row) >= 0).all()
    assert sorted(zip(of, row, strict=True)) == sorted(zip(*np.nonzero(near), strict=True))
    assert not len(beside(points, segments[:0])[0]) and not len(beside(points[:0], segments)[0])
