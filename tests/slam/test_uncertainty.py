import numpy as np
import pytest

import lrf3d
from lrf3d.geometry import wrap_angle
from lrf3d.slam.drift import correlated_points, wheel_factors
from lrf3d.slam.frames import between, compose
from lrf3d.slam.map_shares import shared_information
from lrf3d.slam.pose_graph import Edges, optimised
from lrf3d.slam.uncertainty import EdgeErrors, joint_covariance, pose_covariances
from tests.slam.test_slam import drive, rooms, through

WINDOW = 3


def spread(rng, *shape):
    """Random covariances (…, 3, 3)."""
    root = rng.normal(size=(*shape, 3, 3)) * np.array([1.0, 1.0, 0.3])[:, None]
    return root @ root.swapaxes(-1, -2)


def shares_of(rng, *shape):
    """Random shares (…, m, 3, 3) that sum up to the identity."""
    shares = np.eye(3) + 0.2 * rng.normal(size=(*shape, 3, 3))
    return np.linalg.solve(shares.sum(axis=-3)[..., None, :, :], shares)


@pytest.fixture(params=[0, 5])
def graph(request):
    """A way around a circle that closes two loops, and of what its errors are made.

    In one of two a stretch begins at pose 5, after a scan that hung on pose 2.
    """
    begin = request.param
    rng = np.random.default_rng(2)
    angle = np.linspace(0.0, 2.0 * np.pi, 10)
    poses = np.column_stack([4 * np.cos(angle), 4 * np.sin(angle), angle + 0.5 * np.pi])
    poses[:, 2] = wrap_angle(poses[:, 2])
    first = np.array([*range(9), 0, 1])
    first[4] = 2 if begin else 4
    second = np.array([*range(1, 10), 9, 9])
    robust = np.arange(11) >= 9
    information = spread(rng, 11) + 5.0 * np.eye(3)
    edges = Edges(first, second, between(poses[first], poses[second]), information, robust,
                  np.zeros((11, 3, 3)))  # fmt: skip
    shares = np.zeros((10, WINDOW, 3, 3))
    begins = np.where(np.arange(10) < begin, 0, begin)
    for k, count in enumerate(np.minimum(np.arange(10) - begins, WINDOW)):
        if count:
            # Scans before a stretch have a share in its maps, too.
            shares[k, :count] = shares_of(rng, count) * (count / WINDOW if begins[k] else 1.0)
    errors = EdgeErrors(
        0.3 * np.eye(3) + 0.1 * rng.normal(size=(10, 3, 3)),
        shares,
        spread(rng, 10),
        begins,
        spread(rng, 10),
        np.array([[0, 1, 2], [0, 1, 2]]),
        shares_of(rng, 2, 3),
        spread(rng, 2),
    )
    return poses, edges, errors


def followed(poses, edges, errors, new, closing, opening):
    """The poses that come of small new errors (k, 3), (c, 3), (k, 3), by driving and optimising."""
    front = poses.copy()
    for k in range(1, len(poses)):
        if errors.begins[k] == k:
            front[k] = compose(poses[k], new[k])
            continue
        # Where the pose would be on the map that each key scan draws, and by the one before.
        olds = range(max(errors.begins[k], k - WINDOW), k)
        seen = [between(poses[k], compose(front[j], between(poses[j], poses[k]))) for j in olds]
        on_map = sum(errors.shares[k, n] @ each for n, each in enumerate(seen))
        # By the wheels goes on what the pose before is off from the map.
        before = between(poses[k - 1], front[k - 1])
        at_before = between(poses[k - 1], compose(compose(poses[k], on_map),
                                                  between(poses[k], poses[k - 1])))  # fmt: skip
        front[k] = compose(poses[k], on_map + errors.back[k] @ (before - at_before) + new[k])
    i, j = edges.first, edges.second
    measured = between(front[i], front[j])
    for edge in np.flatnonzero((errors.begins[j] == j) & ~edges.robust):
        measured[edge] = between(poses[i[edge]], compose(front[j[edge]], opening[j[edge]]))
    for number, edge in enumerate(np.flatnonzero(edges.robust)):
        old, last = i[edge], j[edge]
        seen = [
            between(poses[last], compose(front[k], between(poses[k], poses[last])))
            for k in errors.olds[number]
        ]
        error = sum(s @ e for s, e in zip(errors.old_shares[number], seen, strict=True))
        placed = compose(poses[last], error + closing[number])
        measured[edge] = between(front[old], placed)
    moved = Edges(i, j, measured, edges.information, edges.robust, edges.prior)
    return optimised(poses, moved, 20)


def test_covariances_are_those_of_poses_that_follow_all_errors(graph):
    poses, edges, errors = graph
    numbers = [2, 6, 9]
    count, small = len(poses), 1e-5
    covariance = np.zeros((9, 9))
    for group, covariances in enumerate((errors.new, errors.closing, errors.opening)):
        for k in range(group != 1, len(covariances)):
            columns = []
            for axis in range(3):
                made = []
                for sign in (small, -small):
                    both = [np.zeros((count, 3)), np.zeros((2, 3)), np.zeros((count, 3))]
                    both[group][k, axis] = sign
                    made.append(followed(poses, edges, errors, *both)[numbers])
                off = made[0] - made[1]
                off[:, 2] = wrap_angle(off[:, 2])
                columns.append(off.ravel() / (2.0 * small))
            effect = np.array(columns).T
            covariance += effect @ covariances[k] @ effect.T
    found = joint_covariance(poses, edges, errors, numbers)
    assert found == pytest.approx(covariance, rel=1e-3, abs=1e-3 * np.abs(covariance).max())
    single = pose_covariances(poses, edges, errors, np.array([0, 6]))
    assert single[0].tolist() == np.zeros((3, 3)).tolist()
    assert single[1] == pytest.approx(found[3:6, 3:6])


def test_a_map_that_all_scans_see_keeps_the_noise_of_each_from_adding_up():
    """A chain of independent edges drifts by the noise of each; one local map averages it."""
    count = 60
    poses = np.zeros((count, 3))
    poses[:, 0] = 0.5 * np.arange(count)
    first = np.arange(count - 1)
    edges = Edges(first, first + 1, between(poses[first], poses[first + 1]),
                  np.tile(np.eye(3), (count - 1, 1, 1)), np.zeros(count - 1, np.bool_),
                  np.zeros((count - 1, 3, 3)))  # fmt: skip
    back, new = np.zeros((count, 3, 3)), np.tile(np.diag([1e-4, 1e-4, 0.0]), (count, 1, 1))
    none = np.empty((0, 3), np.int64), np.empty((0, 3, 3, 3)), np.empty((0, 3, 3))
    variances = []
    for window in (1, 8):
        shares = np.zeros((count, window, 3, 3))
        for k in range(1, count):
            shares[k, : min(k, window)] = np.eye(3) / min(k, window)
        errors = EdgeErrors(back, shares, new, np.zeros(count, np.int64), new, *none)
        variances.append(joint_covariance(poses, edges, errors, [count - 1])[0, 0])
    assert variances[0] == pytest.approx(1e-4 * (count - 1))
    # The mean of eight lies four and a half behind the newest: each step adds that much less.
    assert variances[1] < 2.5 * variances[0] / 4.5**2


def test_shares_are_those_of_what_each_key_scan_shows():
    along = np.linspace(-3.0, 3.0, 61)
    wall = np.column_stack([along, np.full(61, 2.0), np.zeros(61), np.full(61, -1.0)])
    left, right = wall[wall[:, 0] < -1.0], wall[wall[:, 0] > 1.0]
    cloud, owners = np.concatenate([left, right]), np.repeat([0, 1], [len(left), len(right)])
    shown = shared_information(left, cloud, owners, 2, 0.25, 0.06)
    assert np.abs(shown[1]).max() == 0.0
    assert shown[0, 1, 1] > 100.0 and shown[0, 0, 0] == pytest.approx(0.0)
    both = shared_information(wall, cloud, owners, 2, 0.25, 0.06)
    assert both[0, 1, 1] == pytest.approx(both[1, 1, 1])
    # A wall seen to the left fixes a turn together with the place across it.
    assert both[0, 1, 2] == pytest.approx(-both[1, 1, 2])


def test_wheels_are_as_good_as_the_scans_show_them_where_they_show_it():
    rng = np.random.default_rng(0)
    motions = np.tile([0.2, 0.0, 0.1], (4000, 1))
    found = motions + rng.normal(size=motions.shape) * [0.01, 0.01, 0.004]
    variances = np.tile(np.array([0.02, 0.02, 0.02]) ** 2, (4000, 1))
    gains = np.full((4000, 3), 0.2)
    found_there = motions + (found - motions) * 0.8
    factors = wheel_factors(found_there, motions, variances, gains)
    assert factors == pytest.approx([0.25, 0.25, 0.04], rel=0.1)
    # Along a corridor the scans follow the wheels, and show nothing of them.
    gains[:, 0], found_there[:, 0] = 1.0, motions[:, 0]
    assert wheel_factors(found_there, motions, variances, gains) == pytest.approx(factors, rel=0.1)
    gains[:] = 1.0
    assert wheel_factors(motions, motions, variances, gains).tolist() == [1.0, 1.0, 1.0]


def test_points_that_are_near_each_other_share_their_errors():
    dense = np.column_stack([np.arange(0.0, 2.0, 0.05), np.zeros((40, 3))])
    sparse = np.column_stack([np.arange(0.0, 40.0, 1.0), np.zeros((40, 3))])
    assert correlated_points(dense) == pytest.approx(8.0)
    assert correlated_points(sparse) == pytest.approx(3.0)
    assert correlated_points(dense[:1]) == 1.0


def test_the_covariance_is_that_of_the_errors_from_the_beginning_to_the_end():
    """One factor for a whole drive is too cautious at its beginning, and too bold at its end."""
    squares = []
    for seed in range(8):
        scans, wheels, true = drive(rooms(2), through(2), seed=seed)
        slam = lrf3d.Slam(start=true[0])
        steps = [np.zeros(3), *lrf3d.odometry_increments(wheels)]
        marks = np.linspace(20, len(true) - 1, 8).astype(int).tolist()
        row = []
        for number, (scan, step) in enumerate(zip(scans, steps, strict=True)):
            slam.update(scan, step)
            if number in marks:
                error = np.array(slam.pose) - true[number]
                error[2] = wrap_angle(error[2])
                row.append(error @ np.linalg.solve(slam.covariance(), error) / 3.0)
        squares.append(row)
    means = np.mean(squares, axis=0)
    # Means of 24 squares each; the first was 0.13 with one factor.
    assert means.min() > 0.4 and means.max() < 2.0
