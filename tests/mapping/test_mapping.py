import json

import numpy as np
import pytest

from lrf3d import (
    InputError,
    LaserRangeFinder,
    LaserScan,
    LineMapper,
    PlanarCaster,
    ProportionalNoise,
    World,
    load_map,
    save_map,
)
from lrf3d.geometry import lengths
from lrf3d.mapping.robust.beams import Beams
from lrf3d.mapping.robust.extraction import SPAN, segment_cluster

SQUARE = np.array([[4, 0, 8, 0], [8, 0, 8, 4], [8, 4, 4, 4], [4, 4, 4, 0.0]])
ROOM = np.array([[-6, -5, 12, -5], [12, -5, 12, 9], [12, 9, -6, 9], [-6, 9, -6, -5.0]])
WORLD = World(np.vstack([SQUARE, ROOM]), [0] * 4 + [1] * 4)
AROUND = [(1, 2, 0), (6, -2.5, 1.5), (10, 2, 3.1), (6, 6.5, -1.6)]
CIRCLE = LaserRangeFinder(angle_min=-np.pi, angle_max=np.pi, beams=361, range_max=30.0)


def build(mapper, sigma=0.0, poses=AROUND, seed=0, shift=(0.0, 0.0), lrf=CIRCLE):
    world = World(WORLD.segments + np.tile(shift, 2), WORLD.objects)
    caster, rng = PlanarCaster(world), np.random.default_rng(seed)
    for x, y, theta in poses:
        scan = caster.cast(lrf, (x + shift[0], y + shift[1], theta))
        mapper.update(ProportionalNoise(sigma)(scan, rng))
    return mapper.map


@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.3])
def test_a_room_with_a_block_becomes_eight_walls_in_two_objects(sigma):
    line_map = build(LineMapper(sigma=sigma), sigma)
    assert len(line_map) == 8
    assert line_map.object_count == 2
    assert sorted(np.bincount(line_map.objects)) == [4, 4]
    found = np.sort(lengths(line_map.segments))
    assert found == pytest.approx([4, 4, 4, 4, 14, 14, 18, 18], abs=0.3)


def test_paper_mode_finds_the_eight_walls_too():
    line_map = build(LineMapper("paper", sigma=0.0, min_points=11))
    found = np.sort(lengths(line_map.segments))
    assert found == pytest.approx([4, 4, 4, 4, 14, 14, 18, 18], abs=0.3)


@pytest.mark.parametrize("mode", ["robust", "paper"])
def test_an_empty_scan_leaves_the_map_empty(mode):
    mapper = LineMapper(mode)
    assert len(mapper.map) == 0
    scan = LaserScan((0, 0, 0), CIRCLE.angles, np.full(361, np.inf), range_max=30.0)
    mapper.update(scan)
    assert len(mapper.map) == 0 and mapper.map.object_count == 0


def test_the_map_is_written_as_geojson_and_read_back(tmp_path):
    line_map = build(LineMapper())
    save_map(line_map, tmp_path / "map.geojson")
    features = json.loads((tmp_path / "map.geojson").read_text())["features"]
    assert len(features) == len(line_map)
    assert set(features[0]["properties"]) == {"object", "alpha", "p", "points"}
    assert features[0]["properties"]["alpha"] == line_map.lines[0, 0]
    back = load_map(tmp_path / "map.geojson")
    assert np.array_equal(back.segments, line_map.segments)
    assert np.array_equal(back.objects, line_map.objects)
    assert np.array_equal(back.points, line_map.points)


def test_what_is_no_map_is_refused_by_name(tmp_path):
    (tmp_path / "map.geojson").write_text("{}")
    with pytest.raises(InputError, match=r"map\.geojson"):
        load_map(tmp_path / "map.geojson")


def test_a_full_circle_has_no_seam():
    mapper = LineMapper()
    mapper.update(PlanarCaster(World(ROOM)).cast(CIRCLE, (0, 0, 0.3)))
    line_map = mapper.map
    assert len(line_map) == 4 and line_map.object_count == 1
    straight_behind = LineMapper()
    straight_behind.update(PlanarCaster(World(ROOM)).cast(CIRCLE, (0, 0, 0.0)))
    assert len(straight_behind.map) == 4


def divide(angles, ranges, deviations):
    beams = Beams(np.column_stack([np.cos(angles), np.sin(angles)]), ranges, deviations)
    spans = np.empty(len(angles), SPAN)
    found = spans[: segment_cluster(beams, spans)]
    return np.column_stack([found["first"], found["last"]])


def noisy_wall(seed, sigma):
    rng = np.random.default_rng(seed)
    angles = np.linspace(-0.8, 0.8, 91)
    return angles, 5.0 / np.cos(angles) + rng.normal(0, sigma, 91), np.full(91, sigma)


@pytest.mark.parametrize("sigma", [0.01, 0.05, 0.2])
def test_noise_divides_a_wall_less_than_once_in_a_thousand_times(sigma):
    divided = 0
    for seed in range(5000):
        walls = divide(*noisy_wall(seed, sigma))
        divided += (walls[:, 1] - walls[:, 0] > 10).sum() != 1
    assert divided < 5


def test_a_corner_is_divided_at_its_place():
    angles = np.linspace(-0.7, 0.7, 81)
    ranges = np.minimum(5.0 / np.cos(angles), 2.0 / np.maximum(np.sin(angles), 1e-9))
    walls = divide(angles, ranges, np.full(81, 0.01))
    corner = int(np.searchsorted(angles, np.arctan2(2.0, 5.0)))
    assert len(walls) == 2
    assert walls[0, 1] in (corner - 1, corner) and walls[1, 0] in (corner, corner + 1)


def test_a_stray_point_is_on_no_wall():
    angles = np.linspace(-0.5, 0.5, 41)
    ranges = 5.0 / np.cos(angles)
    ranges[20] = 4.0
    walls = divide(angles, ranges, np.full(41, 0.02))
    on_wall = np.concatenate([np.arange(a, b + 1) for a, b in walls])
    assert 20 not in on_wall and len(on_wall) >= 38


@pytest.mark.parametrize("mode", ["paper", "robust"])
def test_a_segment_is_shown_with_as_many_points_as_are_asked_for(mode):
    world = World([[5, -1, 5, 1.0]])
    scan = PlanarCaster(world).cast(LaserRangeFinder(beams=181), (0, 0, 0))
    points = int(scan.hits.sum())
    for least, count in ((points, 1), (points + 1, 0)):
        mapper = LineMapper(mode, min_points=least)
        mapper.update(scan)
        assert len(mapper.map) == count


@pytest.mark.parametrize("mode", ["robust", "paper"])
def test_a_robot_that_stands_changes_no_wall(mode):
    mapper, rng = LineMapper(mode=mode), np.random.default_rng(1)
    still = ProportionalNoise(0.03)(PlanarCaster(WORLD).cast(CIRCLE, AROUND[0]), rng)
    mapper.update(still)
    mapper.update(still)
    before = mapper.map
    for _ in range(60):
        mapper.update(still)
    # A third of the noise.
    assert mapper.map.segments == pytest.approx(before.segments, abs=0.01)
    assert np.array_equal(mapper.map.objects, before.objects)


@pytest.mark.parametrize("mode", ["paper", "robust"])
@pytest.mark.parametrize("distance", [0.0, 1e-310, 1e-12])
def test_returns_from_one_place_make_no_segment(mode, distance, tmp_path):
    lrf = LaserRangeFinder(beams=31)
    mapper = LineMapper(mode)
    for _ in range(3):
        mapper.update(LaserScan((7, 8, 1), lrf.angles, np.full(31, distance)))
    save_map(mapper.map, tmp_path / "map.geojson")
    assert len(mapper.map) == 0 and "NaN" not in (tmp_path / "map.geojson").read_text()
