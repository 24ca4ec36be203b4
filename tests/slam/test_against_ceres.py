"""The back end against an independent solver, to which the lines of walls are unknowns."""

import numpy as np
import pytest
from ceres import Problem

from lrf3d.slam.frames import between
from lrf3d.slam.line_adjustment import WallSystem, minimised
from lrf3d.slam.pose_graph import ROBUST_SCALE, Edges, optimised
from lrf3d.slam.walls import pieces_of_keys, wall_numbers

ROOM = (((-8, 8), (1, 0)), ((8, 8), (0, -1)), ((-8, -7), (0.9, 0.1)))
"""Start and direction of three walls."""


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def ring(count):
    """Poses around a circle of 5 m."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), angle + 0.5 * np.pi])


def edges_of(poses, pairs, rng, noise, robust=False):
    """Edges with noise, whose information is full and differs from one to the next."""
    first, second = np.array(pairs).T
    measured = between(poses[first], poses[second]) + noise * rng.normal(size=(len(first), 3))
    roots = rng.normal(size=(len(first), 3, 3)) * [3.0, 3.0, 5.0]
    information = roots @ roots.transpose(0, 2, 1) + np.diag([400.0, 300.0, 900.0])
    return Edges(
        first, second, measured, information, np.full(len(first), robust), 0.0 * information
    )


def test_a_pose_graph_with_a_false_closure_has_the_least_sum(rng):
    true = ring(60)
    driven = edges_of(true, [(k, k + 1) for k in range(59)], rng, 0.01)
    closed = edges_of(true, [(59, 0), (58, 1), (57, 2), (30, 3)], rng, 0.01, robust=True)
    closed.measured[-1] += [2.0, -1.0, 0.4]
    edges = Edges.joined([driven, closed])
    start = true + 0.02 * rng.normal(size=true.shape)
    start[0] = true[0]
    problem = Problem(start)
    problem.add_edges(edges, ROBUST_SCALE)
    found = edges.cost(optimised(start, edges, 200))
    assert found > 1.0 and found == pytest.approx(problem.least(), rel=1e-9)


def test_line_adjustment_has_the_least_sum_over_all_points_poses_and_lines(rng):
    true = ring(12)
    surfaces, points = [], []
    for pose in true:
        turn = np.array([[np.cos(pose[2]), -np.sin(pose[2])], [np.sin(pose[2]), np.cos(pose[2])]])
        rows = []
        for start, way in ROOM:
            along = np.array(way) / np.hypot(*way)
            normal = np.array([-along[1], along[0]])
            normal = normal * np.sign((pose[:2] - start) @ normal)
            world = np.array(start) + np.linspace(1, 14, 40)[:, None] * along
            world = world + 0.005 * rng.normal(size=(40, 1)) * normal
            seen = np.column_stack([(world - pose[:2]) @ turn, np.tile(normal @ turn, (40, 1))])
            rows.append(seen)
        surfaces.append(np.concatenate(rows))
        points.append([part[:, :2] for part in rows])
    driven = edges_of(true, [(k, k + 1) for k in range(11)], rng, 0.01)
    pieces = pieces_of_keys(surfaces)
    assert np.bincount(pieces.keys).tolist() == [3] * 12
    numbers = wall_numbers(pieces, true, np.argsort(-pieces.lines[:, 4], kind="stable"))
    assert np.bincount(numbers).tolist() == [12] * 3
    system = WallSystem(pieces.keys, numbers, 400.0 * pieces.moments)
    start = true + 0.01 * rng.normal(size=true.shape)
    start[0] = true[0]
    found = minimised(start, driven, system, 100)

    middle, normal, _ = system.lines(true)
    lines = np.column_stack([np.arctan2(normal[:, 1], normal[:, 0]), (middle * normal).sum(axis=1)])
    problem = Problem(start, lines)
    problem.add_edges(driven, ROBUST_SCALE)
    for piece, (key, wall) in enumerate(zip(system.keys.tolist(), numbers.tolist(), strict=True)):
        problem.add_points(key, wall, points[key][piece % 3], 20.0)
    least = problem.least()
    assert least > 1.0 and driven.cost(found) + system.cost(found) == pytest.approx(least, rel=1e-9)
