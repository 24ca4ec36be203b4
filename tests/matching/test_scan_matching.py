"""Scan matching: what it finds, and its formula, written with arrays and all pairs of points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import LaserRangeFinder, LaserScan, PlanarCaster, Pose, World
from lrf3d.geometry.pose import between, compose
from lrf3d.matching.scan_matching import (
    ALIGNED,
    FIRST_SCALE,
    LAST_SCALE,
    PRIOR_SCALE,
    STEP,
    Match,
    _matched,
    match_scan,
)
from lrf3d.matching.surface import (
    ALONG,
    CELL,
    LEAST_NOISE,
    SURFACE,
    grid_of,
    moved,
    points_of,
    range_noise,
    surface_of_scan,
    thinned,
)

ROOM = World([[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 2.5, 4], [2.5, 4, 0, 3], [0, 3, 0, 0]])
CORRIDOR = World([[-100, 0, 100, 0], [-100, 2, 100, 2]])
LASER = Pose(0.0, 0.0, 0.0)


def surface_at(world, pose, beams=181, **lrf):
    return surface_of(PlanarCaster(world).cast(LaserRangeFinder(beams=beams, **lrf), pose))


def surface_of(scan, noise=LEAST_NOISE):
    return surface_of_scan(scan, LASER, points_of(scan, LASER), noise)


@pytest.mark.parametrize("beams", [16, 30, 60, 181])
def test_normals_face_the_laser_and_points_lie_on_walls_up_to_their_corners(beams):
    pose = np.array([3.0, 1.5, 0.4])
    surface = surface_at(ROOM, pose, beams=beams)
    assert len(surface) > 0.9 * beams
    assert np.hypot(surface["nx"], surface["ny"]) == pytest.approx(1.0)
    assert (surface["x"] * surface["nx"] + surface["y"] * surface["ny"] < 0.0).all()
    there = moved(surface, pose)
    on_floor = np.abs(there["y"]) < 1e-6
    assert on_floor.sum() > 0.1 * beams
    assert there["ny"][on_floor] == pytest.approx(1.0)


def test_near_walls_are_thinned_but_both_faces_of_a_wall_stay():
    x = np.array([0.0, 0.01, 0.02, 0.06, 1.06, 5.0])
    surface = np.zeros(6, SURFACE)
    surface["x"], surface["ny"] = x, 1.0
    assert thinned(surface)["x"].tolist() == [0.0, 0.06, 1.06, 5.0]
    surface["ny"][1] = -1.0
    assert thinned(surface)["x"][:2].tolist() == [0.0, 0.01]
    assert len(thinned(surface[:0])) == 0


def test_a_point_without_a_straight_neighbourhood_is_left_out():
    scan = LaserScan((0, 0, 0), 0.2 * np.arange(5), [5.0, 1.0, 5.0, 1.0, 5.0])
    assert len(surface_of(scan)) == 0


@pytest.mark.parametrize("sigma", [0.0, 0.05, 0.3])
def test_range_noise_is_estimated_from_a_scan_and_walls_are_found_despite_it(sigma):
    rng = np.random.default_rng(0)
    scan = PlanarCaster(ROOM).cast(LaserRangeFinder(beams=361), (3.0, 1.5, 0.0))
    noisy = LaserScan(scan.pose, scan.angles, scan.ranges + sigma * rng.normal(size=361))
    assert range_noise(noisy) == pytest.approx(sigma, rel=0.2, abs=0.01)
    surface = surface_of(noisy, max(range_noise(noisy), LEAST_NOISE))
    assert len(surface) > (60 if sigma > 0.2 else 250)
    # A point lies on the line through its neighbours, nearer to the wall than it was measured.
    there = moved(surface, np.array([3.0, 1.5, 0.0]))
    off = np.abs(there["y"][np.abs(there["y"]) < 0.5])
    assert np.median(off) < max(0.3 * sigma, 1e-3)


def test_range_noise_is_the_same_for_few_beams_among_posts_as_for_many():
    rng = np.random.default_rng(0)
    posts = [[x, y, x + 0.1, y + 0.1] for x in (0.7, 2.0, 4.3, 5.4) for y in (0.7, 1.9, 3.0)]
    scan = PlanarCaster(World([*ROOM.segments, *posts])).cast(
        LaserRangeFinder(beams=361), (3, 1.5, 0)
    )
    ranges = scan.ranges + 0.01 * rng.normal(size=361)
    uneven = np.flatnonzero(rng.random(361) < 0.4)
    for beams in (np.arange(361), np.arange(0, 361, 4), np.arange(360, 0, -8), uneven):
        few = LaserScan(scan.pose, scan.angles[beams], ranges[beams])
        assert range_noise(few) == pytest.approx(0.01, rel=0.4)


near = st.floats(-0.12, 0.12)


@settings(max_examples=20)
@given(near, near, st.floats(-0.06, 0.06), st.floats(-np.pi, np.pi))
def test_matching_recovers_the_pose_of_a_scan(x, y, turn, heading):
    old = surface_at(ROOM, (3.0, 1.5, heading))
    true = np.array([0.1, -0.05, 0.02])
    new = surface_at(ROOM, compose(np.array([3.0, 1.5, heading]), true))
    match = match_scan(new, grid_of(old), true + np.array([x, y, turn]), 1e-3 * np.eye(3), 25)
    error = between(true, match.pose)
    assert np.hypot(error[0], error[1]) < 0.01 and abs(error[2]) < 0.005
    assert match.explained > 0.8


def test_along_a_corridor_the_guess_stands():
    old = surface_at(CORRIDOR, (0, 1, 0), range_max=10.0)
    guess = np.array([0.3, 0.05, 0.01])
    match = match_scan(old, grid_of(old), guess, np.diag([100.0, 100.0, 400.0]), 15)
    assert match.pose[0] == pytest.approx(0.3, abs=1e-3)
    assert match.pose[1] == pytest.approx(0.0, abs=3e-3)
    assert match.information[0, 0] < 1e-3 * match.information[1, 1]


REACH, SIGMA = 0.15, 0.03


def rows(points):
    """Points and normals (n, 4) as a surface."""
    return np.ascontiguousarray(points).view(SURFACE)[:, 0]


def lines_near(walls, point, normal):
    """Normal, distance and weight of the map's line near a point; None if there is none."""
    apart = point - walls[:, :2]
    square = (apart**2).sum(axis=1)
    facing = walls[:, 2:] @ normal
    off = (apart * walls[:, 2:]).sum(axis=1)
    along = 1.0 - (square - off**2) / ALONG**2
    there = (facing >= ALIGNED) & (along > 0.0) & (np.abs(off) <= REACH)
    weight = np.where(there, along**2 * (1.0 - off**2 / REACH**2) ** 2, 0.0)
    if weight.sum() < 1e-3:
        return None
    mean = weight @ walls[:, 2:]
    return mean / np.hypot(*mean), weight @ off / weight.sum(), min(1.0, weight.sum())


def expected(surface, walls, guess, prior, iterations):
    """The match after some steps of Gauss-Newton."""
    pose = guess.copy()
    for iteration in range(iterations):
        scale = FIRST_SCALE * (LAST_SCALE / FIRST_SCALE) ** (min(iteration, 4) / 4)
        turned = np.array([[np.cos(pose[2]), -np.sin(pose[2])], [np.sin(pose[2]), np.cos(pose[2])]])
        rows, distances, weights = [], [], []
        for each in surface:
            lever, normal = turned @ each[:2], turned @ each[2:]
            found = lines_near(walls, pose[:2] + lever, normal)
            if found is not None:
                line, distance, weight = found
                rows.append([*line, line[1] * lever[0] - line[0] * lever[1]])
                distances.append(distance)
                weights.append(weight / (1.0 + (distance / scale) ** 2) ** 2)
        rows, distances, weights = (np.array(each) for each in (rows, distances, weights))
        rows = rows.reshape(-1, 3)
        information = rows.T @ (weights[:, None] * rows) / SIGMA**2
        gradient = rows.T @ (weights * distances) / SIGMA**2
        total = weights.sum()
        deviation = np.sqrt(weights @ distances**2 / total) if total > 0.0 else np.inf
        off = pose - guess
        trust = 1.0 / (1.0 + off @ prior @ off / PRIOR_SCALE**2)
        step = np.linalg.solve(information + trust * prior, gradient + trust * prior @ off)
        pose = pose - step
        if iteration >= 4 and (np.abs(step) < STEP).all():
            break
    return pose, information, total / len(surface), deviation


def around(rng, count):
    """Points of some straight walls and lone ones, with unit normals."""
    angle = rng.choice(rng.uniform(-np.pi, np.pi, 3), count) + rng.normal(0.0, 0.2, count)
    normals = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.column_stack([rng.uniform((2.0, -3.0), (4.4, -1.0), (count, 2)), normals])


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 3, 5, 8, 12]), st.sampled_from([2, 3, 12]))
def test_a_match_is_that_of_the_formula(seed, iterations, count):
    assert REACH**2 + ALONG**2 < CELL**2
    rng = np.random.default_rng(seed)
    walls = around(rng, 150)
    # Points of the scan lie near those of the map, from a robot that stands elsewhere.
    seen = walls[rng.choice(150, count, replace=False)] + rng.normal(0.0, 0.03, (count, 4))
    # One of them lies outside the map, and some beside its corners.
    seen[-1, :2] += rng.choice([[9.0, 0.0], [-9.0, 0.0], [0.0, 9.0], [0.0, -9.0]])
    corner = walls[:, :2].min(axis=0), walls[:, :2].max(axis=0)
    beside = [
        (corner[x > 0][0] + x, corner[y > 0][1] + y)
        for x in (-9, -0.05, 0.05, 9)
        for y in (-0.05, 0.05)
    ]
    outside = [[*place, 1.0, 0.0] for place in beside]
    # Others see the outermost walls from a little beyond them.
    ends = [*walls[:, :2].argmin(axis=0), *walls[:, :2].argmax(axis=0)]
    beyond = walls[ends] + 0.05 * np.array([[-1, 0], [0, -1], [1, 0], [0, 1]]) @ np.eye(2, 4)
    seen = np.vstack([seen, outside, beyond])
    true = np.array([0.4, -0.3, 0.7])
    turned = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    surface = np.column_stack([(seen[:, :2] - true[:2]) @ turned, seen[:, 2:] @ turned])
    guess = true + rng.normal(0.0, 0.02, 3)
    mixed = rng.normal(size=(3, 3))
    prior = mixed @ mixed.T + np.diag([500.0, 500.0, 900.0])
    grid = grid_of(rows(walls))
    found = Match(*_matched(rows(surface), grid, guess, prior, iterations, REACH, SIGMA))
    pose, information, explained, deviation = expected(surface, walls, guess, prior, iterations)
    assert found.pose == pytest.approx(pose, abs=1e-9)
    assert found.information == pytest.approx(information, rel=1e-6, abs=1e-6)
    assert found.explained == pytest.approx(explained)
    assert found.deviation == pytest.approx(deviation)
    assert count < 12 or found.explained > 0.05


def test_a_match_of_one_point_explains_it_and_one_of_none_has_no_deviation():
    grid = grid_of(rows(np.array([[1.0, 0.0, -1.0, 0.0]])))
    for y, explained, deviation in ((0.0, 1.0, 0.0), (5.0, 0.0, np.inf)):
        point = np.array([[1.0, y, -1.0, 0.0]])
        found = match_scan(rows(point), grid, np.zeros(3), np.eye(3), 5)
        assert (found.explained, found.deviation) == pytest.approx((explained, deviation))
        assert found.pose == pytest.approx(np.zeros(3))
