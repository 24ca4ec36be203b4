import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from map_objects import map_of

from lrf3d import (
    LaserRangeFinder,
    LaserScan,
    LineMapper,
    PlanarCaster,
    Pose,
    ProportionalNoise,
    World,
    follow_route,
    load_scenario,
)
from lrf3d.geometry import lengths

BLOCKS = [(0, 0, 6, 4, 0.1), (12, 1, 5, 5, -0.2), (1, 11, 7, 4, 0.0), (13, 12, 4, 6, 0.3)]
LRF = LaserRangeFinder(range_max=40.0)


def city():
    rows = []
    for x, y, width, depth, turn in BLOCKS:
        corners = np.array([[0, 0], [width, 0], [width, depth], [0, depth]], dtype=float)
        cos, sin = np.cos(turn), np.sin(turn)
        corners = corners @ np.array([[cos, sin], [-sin, cos]]) + [x, y]
        rows.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    return World(np.vstack(rows), np.repeat(np.arange(len(BLOCKS)), 4))


def tour(count, seed=0):
    rng = np.random.default_rng(seed)
    lanes = np.array([[-3, -3], [9, -3], [9.5, 8], [-3, 8], [9.5, 19], [20, 8], [20, -3], [-3, 18]])
    places = lanes[rng.integers(0, len(lanes), count)] + rng.uniform(-0.8, 0.8, (count, 2))
    return np.column_stack([places, rng.uniform(-np.pi, np.pi, count)])


def scans(sigma=0.04, seed=0):
    caster, rng = PlanarCaster(city()), np.random.default_rng(seed)
    return [ProportionalNoise(sigma)(caster.cast(LRF, pose), rng) for pose in tour(60, seed)]


def thin_walls():
    """Scans of a world whose walls are seen from both sides."""
    corridor = load_scenario("corridor")
    drive = follow_route(corridor.route, start=corridor.start, speed=corridor.speed, dt=1.0)
    caster, rng = PlanarCaster(corridor.world), np.random.default_rng(0)
    return [ProportionalNoise(0.03)(caster.cast(corridor.lrf, pose), rng) for pose in drive.poses]


def mapped(all_scans, sigma=0.04, **settings_):
    return map_of(all_scans, LineMapper(sigma=sigma, **settings_))


def moved(scan, turn, shift, step=1):
    x = np.cos(turn) * scan.pose.x - np.sin(turn) * scan.pose.y
    y = np.sin(turn) * scan.pose.x + np.cos(turn) * scan.pose.y
    pose = Pose(x + shift[0], y + shift[1], scan.pose.theta + turn)
    return LaserScan(pose, scan.angles[::step], scan.ranges[::step], range_max=scan.range_max)


SCANS, THIN = scans(), thin_walls()
MAP, THIN_MAP = mapped(SCANS), mapped(THIN)
BOTH = pytest.mark.parametrize(
    ("seen", "usual"), [(SCANS, MAP), (THIN, THIN_MAP)], ids=["city", "thin"]
)


def ordered(line_map):
    """The map's numbers that no motion changes, in an order of their own."""
    rows = np.column_stack([lengths(line_map.segments), line_map.points, line_map.objects])
    return rows[np.argsort(rows[:, 0])]


def test_the_city_is_found_whole():
    assert len(MAP) == 16 and MAP.object_count == 4
    assert sorted(np.bincount(MAP.objects)) == [4, 4, 4, 4]


@given(st.floats(-np.pi, np.pi), st.floats(-50, 50), st.floats(-50, 50))
@settings(max_examples=6, deadline=None)
def test_the_map_moves_with_the_world(turn, dx, dy):
    other = mapped([moved(scan, turn, (dx, dy)) for scan in SCANS])
    assert ordered(other)[:, :2] == pytest.approx(ordered(MAP)[:, :2], abs=1e-5)
    assert other.object_count == MAP.object_count


@BOTH
@pytest.mark.parametrize("mode", ["robust", "paper"])
def test_an_offset_of_a_million_metres_changes_no_decision(seen, usual, mode):
    near = usual if mode == "robust" else mapped(seen, mode=mode)
    far = mapped([moved(scan, 0.0, (1e6, -1e6)) for scan in seen], mode=mode)
    assert np.array_equal(far.objects, near.objects)
    assert np.array_equal(far.points, near.points)
    assert far.segments - [1e6, -1e6, 1e6, -1e6] == pytest.approx(near.segments, abs=1e-5)


@BOTH
def test_beams_in_reverse_give_the_same_map(seen, usual):
    other = mapped([moved(scan, 0.0, (0.0, 0.0), step=-1) for scan in seen])
    assert other.segments == pytest.approx(usual.segments, abs=1e-9)
    assert np.array_equal(other.objects, usual.objects)


@BOTH
@pytest.mark.parametrize("seed", range(3))
def test_scans_in_any_order_give_as_many_segments(seen, usual, seed):
    order = np.random.default_rng(seed).permutation(len(seen))
    other = mapped([seen[index] for index in order])
    # Thin walls: no more than other seeds of the noise change them.
    assert abs(len(other) - len(usual)) <= (0.02 if seen is SCANS else 0.05) * len(usual)
    assert other.object_count == usual.object_count or seen is THIN


@pytest.mark.parametrize("sigma", [0.04, 0.3])
def test_a_scan_seen_twice_changes_no_segment(sigma):
    all_scans = scans(sigma=sigma)
    once = mapped(all_scans, sigma)
    again = mapped([*all_scans, all_scans[-1], all_scans[7]], sigma)
    assert len(again) == len(once)
    assert again.segments == pytest.approx(once.segments, abs=0.02)
    assert np.array_equal(again.objects, once.objects)


def test_maps_that_were_handed_out_do_not_change_later():
    mapper = LineMapper()
    handed = []
    for scan in SCANS:
        mapper.update(scan)
        handed.append(mapper.map)
    kept = [mapped(SCANS[: count + 1]).segments for count in (0, 20, 59)]
    for count, segments in zip((0, 20, 59), kept, strict=True):
        assert np.array_equal(handed[count].segments, segments)
