import numpy as np
import pytest

from lrf3d import LaserRangeFinder, LaserScan, PlanarCaster, Pose, World
from lrf3d.geometry.pose import between
from lrf3d.matching import key_scans
from lrf3d.matching.key_scans import HIDDEN, HIT, PASSED, ScanConverter, evidence, fan_of, views_of
from lrf3d.matching.surface import SURFACE, thinned
from lrf3d.slam.front_end import FrontEnd
from lrf3d.slam.motion import Prediction

HERE, AHEAD = Pose(0, 0, 0), np.linspace(-0.5, 0.5, 11)


def seen_by(ranges, points, angles=AHEAD):
    """How a key scan sees points and normals (n, 4)."""
    rows = np.ascontiguousarray(points, dtype=float).view(SURFACE)[:, 0]
    return views_of(
        rows, np.zeros((1, 3)), fan_of(LaserScan(HERE, angles, ranges), HERE, 0.01)
    ).tolist()


def test_points_are_passed_hidden_out_of_view_or_hit():
    points = np.array([[2.0, 0.0], [4.2, 0.0], [3.8, 0.3], [2.0, 30.0], [4.0, 0.1]])
    posts = np.pad(points, ((0, 0), (0, 2)))
    assert seen_by(np.full(11, 4.0), posts) == [[2, 1, 1, 0, 3]]


def test_the_beam_nearest_to_a_point_counts_however_beams_are_spread():
    """As those of two lasers whose fields of view overlap, taken together."""
    angles = np.concatenate([np.linspace(-0.5, -0.01, 30), np.linspace(0.05, 0.5, 10)])
    points = [[6.0 * np.cos(angle), 6.0 * np.sin(angle), 0.0, 0.0] for angle in (-0.1, 0.1)]
    assert seen_by(np.where(angles < 0.0, 4.0, 9.0), points, angles) == [[HIDDEN, PASSED]]


def test_a_wall_that_beams_run_along_is_out_of_view():
    """Where the laser stands in the plane of a thin wall, its beams pass beside the wall."""
    along, across, post = [4.0, 0.1, 0.0, 1.0], [4.0, 0.1, -1.0, 0.0], [4.0, 0.1, 0.0, 0.0]
    assert seen_by(np.full(11, 9.0), [along, across, post]) == [[0, 2, 2]]


def test_evidence_is_highest_at_the_right_place_even_where_little_is_explained():
    """Of trunks and bushes matching explains nothing."""
    rng = np.random.default_rng(0)
    trunks = rng.uniform([2.0, -6.0], [12.0, 6.0], (30, 2))
    world = World(np.hstack([trunks, trunks + np.array([0.0, 0.1])]))
    converter, lrf = ScanConverter(), LaserRangeFinder(beams=721)
    poses = np.array([[0.0, 0.0, 0.0], [0.5, 0.2, 0.3]])
    old, new = (converter.candidate(PlanarCaster(world).cast(lrf, tuple(pose))) for pose in poses)
    true = between(poses[0], poses[1])
    right = evidence(new.hits, 0.0, true[None], old.fans)
    for off in ([0.4, 0.0, 0.0], [0.0, -0.4, 0.0], [0.0, 0.0, 0.15], [-1.0, 1.0, -0.3]):
        assert right > evidence(new.hits, 0.0, (true + off)[None], old.fans) + 1.0


WORLD = World([[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 0, 4], [0, 4, 0, 0], [50, 0, 50, 9]])


def test_a_lost_scan_adds_what_it_saw_itself_to_the_local_map():
    """It is not where the map shows anything: the next scan can be matched with it alone."""
    front, lrf = FrontEnd(Pose(0, 0, 0)), LaserRangeFinder(range_max=10)
    poses = (3.0, 2.0, 0.0), (3.2, 2.0, 0.0), (44.0, 4.0, 0.0)
    scans = [ScanConverter().candidate(PlanarCaster(WORLD).cast(lrf, pose)) for pose in poses]
    steps = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [40.8, 2.0, 0.0]])
    for scan, step in zip(scans, steps, strict=True):
        placed = front.track(scan, step)
        if scan is not scans[1]:
            key = front.add_key(scan)
    assert not placed.matched
    assert np.array_equal(key.walls, thinned(scans[2].surface))


def test_far_points_are_those_of_an_obstacle_only_where_the_heading_is_known():
    """Somebody stands 2 m ahead, where two key scans saw the wall behind."""
    front, lrf, pose = FrontEnd(Pose(0, 0, 0)), LaserRangeFinder(range_max=10), (3.0, 2.0, 0.0)
    for _ in range(2):
        scan = ScanConverter().candidate(PlanarCaster(WORLD).cast(lrf, pose))
        front.track(scan, np.zeros(3))
        front.add_key(scan)
    person = World([*WORLD.segments, [5, 1.8, 5, 2.2]])
    points = ScanConverter().candidate(PlanarCaster(person).cast(lrf, pose)).surface
    near = np.hypot(points["x"] - 2.0, points["y"]) < 0.3
    assert near.sum() > 5
    for turn, kept in ((1e-3, ~near), (0.1, near | True)):
        uncertain = np.diag([1e-3, 1e-3, turn]) ** 2
        expected = Prediction(np.zeros(3), uncertain, uncertain, np.ones(3))
        assert np.array_equal(front._standing(points, expected), points[kept])


def test_beams_that_cross_half_a_turn_see_points_on_its_other_side():
    # The laser looks back: its beams go from 115° over 180° to 230°.
    angle = -2.8
    place = 2.0 * np.array([[np.cos(angle), np.sin(angle), 0.0, 0.0]])
    assert seen_by(np.full(11, 4.0), place, np.linspace(2.0, 4.0, 11)) == [[2]]


def test_a_wall_is_flat_up_to_its_end_where_another_stands_behind_it():
    edge = World([[3, -4, 3, 0], [4, 0, 4, 5]])
    scan = PlanarCaster(edge).cast(LaserRangeFinder(beams=361, range_max=10), (0, 0, 0))
    surface = ScanConverter().candidate(scan).surface
    wall = surface[np.abs(surface["x"] - 3.0) < 1e-6]
    assert wall["y"].max() > -0.05
    assert np.abs(wall["nx"]) == pytest.approx(1.0)


def test_mixed_pixels_are_counted_over_all_key_scans_and_double_what_beams_may_pass(monkeypatch):
    mixed, key = key_scans.MixedPixelModel(), key_scans.Key(0, np.zeros(3), *[None] * 4)
    passed = iter([(30, 400), (90, 800), (239, 1000), (241, 1000)])
    monkeypatch.setattr(key_scans, "seen_through_both", lambda *_: next(passed))
    for olds, rate in (([], 0.0), ([key], 0.03), ([key], 0.1)):
        mixed.learn(olds, key)
        assert mixed.rate == pytest.approx(rate)
    assert [mixed.contradict([key], key, np.zeros((1, 3))) for _ in "ab"] == [False, True]


@pytest.mark.parametrize(
    ("x", "turn", "tolerance", "same"),
    [
        (0.29, 0.09, 1.0, True), (0.31, 0.0, 1.0, False), (0.0, 0.11, 1.0, False),
        (0.55, 0.19, 2.0, True), (0.2, 0.0, 0.5, False), (0.0, 2.0 * np.pi - 0.05, 1.0, True),
    ],
)  # fmt: skip
def test_poses_are_one_place_if_they_are_near_with_similar_headings(x, turn, tolerance, same):
    first = np.array([5.0, 3.0, 1.0])
    assert (
        key_scans.same_place(first, first + np.array([0.8 * x, -0.6 * x, turn]), tolerance) == same
    )


def test_new_points_count_a_tenth_of_passed_ones(monkeypatch):
    views = np.array([[HIT] * 4 + [PASSED] * 3 + [HIDDEN] * 3])
    monkeypatch.setattr(key_scans, "views_of", lambda *_: views)
    found = evidence(np.zeros(10, SURFACE), 0.5, np.zeros((1, 3)), None)
    against = 0.3 + 0.1 * 0.3, 0.3 + 0.1 * 0.2
    due = np.log(0.45 / (against[0] + 0.05)) + np.log(0.55 / (against[1] + 0.05))
    assert found == pytest.approx(due)
