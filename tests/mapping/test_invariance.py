"""A map does not depend on the frame, on the order of beams and scans, or on what comes later."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from map_objects import map_of, scans_of

from lrf3d import (
    LaserRangeFinder,
    LaserScan,
    LineMapper,
    Pose,
    World,
    follow_route,
    load_scenario,
)
from lrf3d.geometry.lines import lengths

BLOCKS = [(0, 0, 6, 4, 0.1), (12, 1, 5, 5, -0.2), (1, 11, 7, 4, 0.0), (13, 12, 4, 6, 0.3)]
LANES = np.array([[-3, -3], [9, -3], [9.5, 8], [-3, 8], [9.5, 19], [20, 8], [20, -3], [-3, 18]])


def city():
    """Scans of four blocks from the lanes between them."""
    rows, rng = [], np.random.default_rng(0)
    for x, y, width, depth, turn in BLOCKS:
        corners = np.array([[0, 0], [width, 0], [width, depth], [0, depth]], dtype=float)
        corners = Pose(x, y, turn).apply(corners)
        rows.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    places = LANES[rng.integers(0, len(LANES), 60)] + rng.uniform(-0.8, 0.8, (60, 2))
    poses = np.column_stack([places, rng.uniform(-np.pi, np.pi, 60)])
    world = World(np.vstack(rows), np.repeat(np.arange(len(BLOCKS)), 4))
    return scans_of(world, poses, LaserRangeFinder(range_max=40.0), 0.04)


def thin_walls():
    """Scans of a world whose walls are seen from both sides."""
    corridor = load_scenario("corridor")
    drive = follow_route(corridor.route, start=corridor.start, speed=corridor.speed, dt=1.0)
    return scans_of(corridor.world, drive.poses, corridor.lrf, 0.03)


def moved(scan, turn, shift, step=1):
    x, y, theta = scan.pose
    (x, y), theta = Pose(*shift, turn).apply(np.array([[x, y]]))[0], theta + turn
    pose = Pose(float(x), float(y), theta)
    return LaserScan(pose, scan.angles[::step], scan.ranges[::step], range_max=scan.range_max)


SCANS, THIN = city(), thin_walls()
MAP, THIN_MAP = map_of(SCANS), map_of(THIN)
BOTH = pytest.mark.parametrize(
    ("seen", "usual"), [(SCANS, MAP), (THIN, THIN_MAP)], ids=["city", "thin"]
)


def test_the_city_is_found_whole():
    assert len(MAP) == 16 and sorted(np.bincount(MAP.objects)) == [4, 4, 4, 4]


@given(st.floats(-np.pi, np.pi), st.floats(-50, 50), st.floats(-50, 50))
@settings(max_examples=6)
def test_the_map_moves_with_the_world(turn, dx, dy):
    other = map_of([moved(scan, turn, (dx, dy)) for scan in SCANS])
    for one in (lengths(other.segments) - lengths(MAP.segments), other.points - MAP.points):
        assert one == pytest.approx(np.zeros(16), abs=1e-5)
    assert np.array_equal(other.objects, MAP.objects)


@BOTH
@pytest.mark.parametrize("mode", ["robust", "paper"])
def test_an_offset_of_a_million_metres_changes_no_decision(seen, usual, mode):
    near = usual if mode == "robust" else map_of(seen, LineMapper(mode))
    far = map_of([moved(scan, 0.0, (1e6, -1e6)) for scan in seen], LineMapper(mode))
    assert np.array_equal(far.objects, near.objects)
    assert np.array_equal(far.points, near.points)
    assert far.segments - [1e6, -1e6, 1e6, -1e6] == pytest.approx(near.segments, abs=1e-5)


@BOTH
def test_beams_in_reverse_give_the_same_map(seen, usual):
    other = map_of([moved(scan, 0.0, (0.0, 0.0), step=-1) for scan in seen])
    assert other.segments == pytest.approx(usual.segments, abs=1e-9)
    assert np.array_equal(other.objects, usual.objects)


@BOTH
@pytest.mark.parametrize("seed", range(3))
def test_scans_in_any_order_give_as_many_segments(seen, usual, seed):
    other = map_of([seen[k] for k in np.random.default_rng(seed).permutation(len(seen))])
    # Thin walls: no more than other seeds of the noise change them.
    assert abs(len(other) - len(usual)) <= (0.02 if seen is SCANS else 0.05) * len(usual)
    assert other.object_count == usual.object_count or seen is THIN


def test_maps_that_were_handed_out_do_not_change_later():
    mapper, handed = LineMapper(), []
    for scan in SCANS:
        mapper.update(scan)
        handed.append(mapper.map)
    for count in (0, 20, 59):
        assert np.array_equal(handed[count].segments, map_of(SCANS[: count + 1]).segments)
