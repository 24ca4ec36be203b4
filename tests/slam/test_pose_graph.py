import numpy as np
import pytest
from scipy.optimize import minimize

from lrf3d.geometry.pose import between
from lrf3d.matching.surface import DEVIATIONS
from lrf3d.slam.pose_graph import (
    GraphPaths,
    edge_errors,
    edge_squares,
    edges_of,
    optimised,
    pose_covariances,
    variance_factor,
)

INFORMATION = np.diag([400.0, 300.0, 900.0])


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def ring(count):
    """Poses around a circle of 5 m."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), angle + 0.5 * np.pi])


def measured(poses, pairs, rng, noise=0.0, robust=False):
    first, second = np.array(pairs).T
    relative = between(poses[first], poses[second])
    relative = relative + noise * rng.normal(size=relative.shape)
    return edges_of(first, second, relative, INFORMATION, 0.0 * INFORMATION, may_be_wrong=robust)


def cost(edges, poses):
    """What is minimised: Cauchy's sum of closures, and plain squares of others."""
    squares, _ = edge_squares(edge_errors(poses, edges), edges)
    cauchy = DEVIATIONS**2 * np.log1p(squares / DEVIATIONS**2)
    return np.where(edges["may_be_wrong"], cauchy, squares).sum()


def test_the_sum_is_the_least_that_a_general_solver_finds(rng):
    true = ring(8)
    driven = measured(true, [(k, k + 1) for k in range(7)], rng, noise=0.05)
    closed = measured(true, [(7, 0), (5, 1)], rng, noise=0.3, robust=True)
    edges = np.concatenate([driven, closed])
    found = optimised(true, edges, 50)

    def total(free):
        return cost(edges, np.vstack([true[:1], free.reshape(-1, 3)]))

    nudged = found[1:].ravel() + 0.01 * rng.normal(size=21)
    assert cost(edges, found) == pytest.approx(minimize(total, nudged, tol=1e-9).fun, rel=1e-6)


def test_the_covariance_of_a_chain_is_that_of_its_steps(rng):
    """Each step is independent: variances of headings add, and places grow by their levers.

    A variance factor of the matching leaves alone what wheels measure.
    """
    true = np.column_stack([np.arange(4.0), np.zeros(4), np.zeros(4)])
    edges = measured(true, [(0, 1), (1, 2), (2, 3)], rng)
    edges["prior"] = 0.5 * INFORMATION
    first, covariance = pose_covariances(true, edges, np.array([0, 3]))
    assert not first.any()
    assert covariance[0, 0] == pytest.approx(3 / 400)
    assert covariance[2, 2] == pytest.approx(3 / 900)
    assert covariance[1, 1] == pytest.approx(3 / 300 + (2**2 + 1**2) / 900)
    half = pose_covariances(true, edges, np.array([3]), 0.25)[0]
    assert half == pytest.approx(covariance / 2.5)


def test_along_a_chain_paths_have_its_lengths_and_the_graph_s_own_covariances(rng):
    true, paths = ring(7), GraphPaths()
    edges = measured(true, [(k, k + 1) for k in range(6)], rng)
    covariance = np.linalg.inv(INFORMATION)
    for k in range(6):
        paths.link(k, k + 1, 1.0 + k, covariance)
        # The graph is asked before it has grown, and a longer link beside a known one is none.
        assert paths.lengths(k + 1, 100.0)[0] == pytest.approx(sum(range(1, k + 2)))
        paths.link(k, k + 1, 50.0, 9.0 * covariance)
    assert paths.lengths(0, 6.5).tolist() == [0.0, 1.0, 3.0, 6.0, np.inf, np.inf, np.inf]
    lengths, spreads = paths.spreads(6, true)
    assert lengths.tolist() == [21.0, 20.0, 18.0, 15.0, 11.0, 6.0, 0.0] and not spreads[6].any()
    assert spreads[0] == pytest.approx(pose_covariances(true, edges, np.array([6]))[0])
    paths.link(0, 6, 2.0, 0.5 * covariance)
    assert paths.lengths(6, 100.0)[0] == 2.0


def test_one_false_closure_among_true_ones_is_outvoted(rng):
    true = ring(40)
    driven = measured(true, [(k, k + 1) for k in range(39)], rng, noise=0.003)
    closed = measured(true, [(39, 0), (38, 1), (37, 0)], rng, robust=True)
    false = measured(true, [(5, 20)], rng, robust=True)
    false["measured"] = 0.0
    found = optimised(true, np.concatenate([driven, closed, false]), 30)
    # It is off by 10 m; half of its weight would move the poses by metres.
    assert np.abs(between(true, found)[:, :2]).max() < 0.1


def test_ten_closures_weigh_as_much_as_the_matched_points(rng):
    true = ring(12)
    closed = measured(true, [(k, k + 2) for k in range(10)], rng, robust=True)
    alone = variance_factor(true, closed[:0], 0.5)
    assert variance_factor(true, closed, 0.5) == pytest.approx(0.5 * alone)
    assert variance_factor(true, closed[:0], 1.0) == pytest.approx(4.0 * alone)
