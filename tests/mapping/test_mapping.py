import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from map_objects import map_of, scans_of

import lrf3d
from lrf3d import (
    InputError,
    LaserRangeFinder,
    LaserScan,
    LineMap,
    LineMapper,
    PlanarCaster,
    World,
    load_map,
    save_map,
)
from lrf3d.geometry.lines import lengths
from lrf3d.laser.free_space import free_cells
from lrf3d.mapping.robust.beams import Beams, widen
from lrf3d.mapping.robust.extraction import SPAN, segment_cluster
from lrf3d.mapping.robust.pieces import PIECE
from lrf3d.mapping.robust.refitting import _misfit
from lrf3d.mapping.robust.walls import FIT

SQUARE = np.array([[4, 0, 8, 0], [8, 0, 8, 4], [8, 4, 4, 4], [4, 4, 4, 0.0]])
ROOM = np.array([[-6, -5, 12, -5], [12, -5, 12, 9], [12, 9, -6, 9], [-6, 9, -6, -5.0]])
WORLD = World(np.vstack([SQUARE, ROOM]), [0] * 4 + [1] * 4)
AROUND = [(1, 2, 0), (6, -2.5, 1.5), (10, 2, 3.1), (6, 6.5, -1.6)]
CORNER, LRF = World([[3, -5, 3, 5], [3, 5, -3, 5]]), LaserRangeFinder()
BOTH = pytest.mark.parametrize("mode", ["robust", "paper"])


@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.3])
def test_a_room_with_a_block_becomes_eight_walls_in_two_objects(sigma):
    line_map = map_of(scans_of(WORLD, AROUND, sigma=sigma), LineMapper(sigma=sigma))
    assert sorted(np.bincount(line_map.objects)) == [4, 4]
    found = np.sort(lengths(line_map.segments))
    assert found == pytest.approx([4, 4, 4, 4, 14, 14, 18, 18], abs=0.3)
    paper = map_of(scans_of(WORLD, AROUND), LineMapper("paper", sigma=0.0, min_points=11))
    assert np.sort(lengths(paper.segments)) == pytest.approx(found, abs=0.6)


@BOTH
def test_scans_without_extent_make_no_segment(mode, tmp_path):
    mapper = LineMapper(mode)
    assert len(mapper.map) == 0
    for distance in (np.inf, 0.0, 1e-310, 1e-12):
        mapper.update(LaserScan((7, 8, 1), LRF.angles, np.full(181, distance), range_max=30.0))
    save_map(mapper.map, tmp_path / "map.geojson")
    assert len(mapper.map) == 0 and "NaN" not in (tmp_path / "map.geojson").read_text()


@pytest.mark.parametrize("theta", [0.3, 0.0])
def test_a_full_circle_has_no_seam(theta):
    line_map = map_of(scans_of(World(ROOM), [(0, 0, theta)]))
    assert len(line_map) == 4 and line_map.object_count == 1


def divide(angles, ranges, deviation):
    units = np.column_stack([np.cos(angles), np.sin(angles)])
    spans = np.empty(len(angles), SPAN)
    found = spans[: segment_cluster(Beams(units, ranges, np.full(len(angles), deviation)), spans)]
    return np.column_stack([found["first"], found["last"]])


@pytest.mark.parametrize("sigma", [0.01, 0.05, 0.2])
def test_noise_divides_a_wall_less_than_once_in_a_thousand_times(sigma):
    angles, divided = np.linspace(-0.8, 0.8, 91), 0
    for seed in range(5000):
        noise = np.random.default_rng(seed).normal(0, sigma, 91)
        walls = divide(angles, 5.0 / np.cos(angles) + noise, sigma)
        divided += (walls[:, 1] - walls[:, 0] > 10).sum() != 1
    assert divided < 5


def test_a_corner_is_divided_at_its_place_and_a_stray_point_is_on_no_wall():
    angles = np.linspace(-0.7, 0.7, 81)
    ranges = np.minimum(5.0 / np.cos(angles), 2.0 / np.maximum(np.sin(angles), 1e-9))
    ranges[20] = 4.0
    (_, end), (first, last), (begin, _) = divide(angles, ranges, 0.01)
    corner = int(np.searchsorted(angles, np.arctan2(2.0, 5.0)))
    assert (end, first) == (19, 21)
    assert last in (corner - 1, corner) and begin in (corner, corner + 1)


@BOTH
def test_a_segment_is_shown_with_as_many_points_as_are_asked_for(mode):
    scans = scans_of(World([[5, -1, 5, 1.0]]), [(0, 0, 0)], LRF)
    points = int(scans[0].hits.sum())
    for least, count in ((points, 1), (points + 1, 0)):
        assert len(map_of(scans, LineMapper(mode, min_points=least))) == count


@BOTH
def test_a_robot_that_stands_changes_no_wall(mode):
    mapper, still = LineMapper(mode), scans_of(WORLD, AROUND[:1], sigma=0.03)
    before, after = map_of(still * 2, mapper), map_of(still * 60, mapper)
    # A third of the noise.
    assert after.segments == pytest.approx(before.segments, abs=0.01)
    assert np.array_equal(after.objects, before.objects)


# Files, and what is no map


def test_a_map_is_written_as_geojson_and_read_back_or_refused_by_name(tmp_path):
    path, line_map = tmp_path / "map.geojson", map_of(scans_of(WORLD, AROUND))
    save_map(line_map, path)
    features = json.loads(path.read_text())["features"]
    assert set(features[0]["properties"]) == {"object", "alpha", "p", "points"}
    assert features[0]["properties"]["alpha"] == line_map.lines[0, 0]
    back = load_map(path)
    for name in ("segments", "objects", "points"):
        assert np.array_equal(getattr(back, name), getattr(line_map, name))
    save_map(LineMap([[0, 0, 1, 0]], [0], [9]), path)
    far = path.read_text().replace("1.0, 0.0", "1e300, 0.0")
    for text, message in ((far, "map: segment 0 is .* of at most 1e.09 m"), ("{}", "not a map")):
        path.write_text(text)
        with pytest.raises(InputError, match=rf"map\.geojson: {message}"):
            load_map(path)
    with pytest.raises(InputError, match=r"map\.yaml: a map is written as \.geojson"):
        save_map(LineMap.empty(), tmp_path / "map.yaml")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("segments", "objects", "message"),
    [
        ([[0, 0, 1]], [0], r"segments \(1, 3\), objects \(1,\)"),
        ([[0, 0, 1, 0]], [0, 1], r"objects \(2,\) and points \(1,\): expected shapes"),
        ([[0, 0, 1, 0], [0, 0, np.inf, 1]], [0, 1], r"segment 1 is \[.*inf.*\], expected numbers"),
        ([[0, 0, 1.1e9, 0]], [0], r"segment 0 is .* of at most 1e\+09 m"),
    ],
)
def test_an_invalid_map_is_refused(segments, objects, message):
    with pytest.raises(InputError, match=message):
        LineMap(segments, objects, [9] * len(segments))


# What no range finder measures and no user means costs nothing, or is refused in one line


@BOTH
@pytest.mark.parametrize("reach", [3.4028234663852886e38, 1e20, 2000.0])
def test_a_reach_beyond_what_beams_hit_means_no_return(mode, reach):
    ranges = PlanarCaster(CORNER).cast(LRF, (0, 0, 0)).ranges
    far, usual = (
        map_of([LaserScan((0, 0, 0), LRF.angles, ranges, range_max=most)], LineMapper(mode))
        for most in (reach, 80.0)
    )
    assert np.allclose(far.segments, usual.segments, atol=1e-3) and len(far) == 2


def test_a_very_large_noise_still_makes_a_map():
    scans = scans_of(CORNER, [(0.1 * k, 0, 0) for k in range(12)], LRF, 20.0)
    assert np.isfinite(map_of(scans, LineMapper(sigma=20.0, gap=5e3, split=5e3)).segments).all()


@pytest.mark.parametrize(
    "settings",
    [
        {"merge_length": 1e9}, {"sigma": "a"}, {"min_points": 2.5}, {"gap": 0.0}, {"split": -1.0},
        {"merge_length": np.nan}, {"mode": "best"}, {"merge_length": 101.0},
        {"merge_distance": 11.0}, {"sigma": 1001.0}, {"gap": 1e7},
    ],
)  # fmt: skip
def test_settings_out_of_reason_are_refused_in_one_line(settings):
    with pytest.raises(InputError, match=next(iter(settings))) as caught:
        LineMapper(**settings)
    assert "\n" not in str(caught.value)


@BOTH
@pytest.mark.parametrize("scan", [None, 3.0, "scan"])
def test_what_is_no_scan_is_refused_in_one_line(mode, scan):
    with pytest.raises(InputError, match="LaserScan"):
        LineMapper(mode).update(scan)


def test_poses_far_apart_make_a_map_and_free_cells_and_walls_too_far_are_left_out():
    scans = []
    for x, y in [(0.0, 0.0), *[(447_500.0 + 0.5 * k, 5_800_000.0) for k in range(3)]]:
        scans += scans_of(World(CORNER.segments + np.tile([x, y], 2)), [(x, y, 0.0)], LRF)
    cells, found = free_cells(scans), map_of(scans).segments
    assert cells.resolution == pytest.approx(0.1)
    assert cells.contain(np.array([[447_502.0, 5_800_000.0], [2.0, 0.0]])).tolist() == [True, False]
    assert (np.abs(found[:, 0]) < 10.0).any() and (found[:, 0] > 447_000.0).any()
    edge = LaserScan((1e9, 0, 0), LRF.angles, np.full(181, 5.0), range_max=20.0)
    for mode in ("paper", "robust"):
        assert (np.abs(map_of([edge], LineMapper(mode)).segments) <= 1e9).all()


def test_corners_do_not_tilt_walls_and_no_segment_is_left_of_what_others_took_the_hits_of():
    score = lrf3d.score_run(lrf3d.load_scenario("corridor").run(rng=0, snapshots=1))
    # The noise of a range is 1 to 4 mm here, and each wall has hundreds of them.
    assert score.perpendicular_rms < 0.0008 and score.length_precision == 1.0


@pytest.mark.parametrize("tilt", [0.0, 0.3, -1.2])
def test_pieces_misfit_by_what_they_lie_off_their_best_line_wherever_and_however_it_runs(tilt):
    rng = np.random.default_rng(3)
    x, weights = rng.uniform(4.0, 9.0, 40), rng.uniform(0.5, 2.0, 40)
    y = 2.0 + tilt * x + rng.normal(0.0, 0.1, 40)
    sums = np.zeros(2, PIECE)
    names = "weight", "along", "aside", "along_along", "along_aside", "aside_aside"
    for name, values in zip(names, (1.0, x, y, x * x, x * y, y * y), strict=True):
        # What came before the first of them changes nothing.
        sums[name] = [3.0, 3.0 + (weights * values).sum()]
    due = weights @ (y - np.polyval(np.polyfit(x, y, 1, w=np.sqrt(weights)), x)) ** 2
    assert _misfit.py_func(*sums) == pytest.approx(due, rel=1e-6)


@pytest.mark.parametrize("mode", ["robust", "paper"])
def test_the_local_map_of_a_scan_lies_in_the_world(mode):
    [scan] = scans_of(WORLD, [(10, 2, 3.1)])
    local = LineMapper(mode).local_map(scan)
    whole = shapely.multilinestrings(WORLD.segments.reshape(-1, 2, 2))
    places = shapely.points(local.segments.reshape(-1, 2))
    assert len(local) == 4 and shapely.distance(places, whole).max() < 0.02


def test_a_fit_weighs_no_more_than_the_pose_of_its_scan_is_known():
    [scan] = scans_of(WORLD, [(10, 2, 0.0)])
    fits = np.zeros(2, FIT)
    fits["weight"], fits["x"], fits["y"], fits["yy"] = [100.0, 400.0], [3.0, 0.0], [4.0, 0.0], 8.0
    before = fits.copy()
    widen(fits, scan)
    assert np.array_equal(fits, before)
    widen(fits, replace(scan, pose_covariance=np.diag([0.02, 0.04, 0.001])))
    less = np.array([1.0 + 100.0 * (0.03 + 0.001 * 25.0), 1.0 + 400.0 * 0.03])
    assert fits["weight"] == pytest.approx(before["weight"] / less)
    assert fits["yy"] == pytest.approx(8.0 / less)
