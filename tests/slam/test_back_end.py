import numpy as np
import pytest
from scipy.optimize import least_squares

from lrf3d.slam import line_adjustment
from lrf3d.slam.frames import between, compose
from lrf3d.slam.line_adjustment import WallSystem, adjusted, minimised, wall_system
from lrf3d.slam.pose_graph import Edges, edge_equations, optimised, optimised_around
from lrf3d.slam.uncertainty import EdgeErrors, joint_covariance, relative_covariance
from lrf3d.slam.walls import pieces_of, pieces_of_keys, wall_numbers


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def ring(count):
    """Poses around a circle of 5 m."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), angle + 0.5 * np.pi])


def edges_of(poses, pairs, rng, noise=0.0, robust=False):
    first, second = np.array(pairs).T
    measured = between(poses[first], poses[second])
    measured = measured + noise * rng.normal(size=measured.shape)
    information = np.repeat(np.diag([400.0, 300.0, 900.0])[None], len(first), axis=0)
    return Edges(
        first, second, measured, information, np.full(len(first), robust), 0.0 * information
    )


def test_exact_edges_bring_poses_back(rng):
    true = ring(30)
    pairs = [(k, k + 1) for k in range(29)] + [(29, 0)]
    drifted = true + 0.1 * rng.normal(size=true.shape)
    drifted[0] = true[0]
    found = optimised(drifted, edges_of(true, pairs, rng), 30)
    assert np.abs(between(true, found)).max() < 1e-6


def test_the_gradient_of_edges_is_that_of_their_cost(rng):
    true = ring(6)
    edges = edges_of(true, [(0, 1), (1, 2), (2, 5), (3, 4)], rng, noise=0.1)
    poses = true + 0.1 * rng.normal(size=true.shape)
    gradient = edge_equations(poses, edges).gradient
    for k in range(18):
        step = np.zeros(18)
        step[k] = 1e-6
        there, back = poses + step.reshape(-1, 3), poses - step.reshape(-1, 3)
        slope = (edges.cost(there) - edges.cost(back)) / 2e-6
        assert 2.0 * gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-4)


def test_the_covariance_of_a_chain_is_that_of_its_steps(rng):
    """Each step is independent: variances of headings add, and places grow by their levers."""
    true = np.column_stack([np.arange(4.0), np.zeros(4), np.zeros(4)])
    edges = edges_of(true, [(0, 1), (1, 2), (2, 3)], rng)
    covariances = np.linalg.inv(np.tile(edges.information[0], (4, 1, 1)))
    # All goes on by the wheels: as seen a metre on, a turn is an error of the place, too.
    on = np.tile([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]], (4, 1, 1))
    none = np.empty((0, 1), np.int64), np.empty((0, 1, 3, 3)), np.empty((0, 3, 3))
    errors = EdgeErrors(on, np.zeros((4, 1, 3, 3)), covariances, np.zeros(4, np.int64), on, *none)
    covariance = joint_covariance(true, edges, errors, [3])
    assert covariance[0, 0] == pytest.approx(3 / 400)
    assert covariance[2, 2] == pytest.approx(3 / 900)
    assert covariance[1, 1] == pytest.approx(3 / 300 + (2**2 + 1**2) / 900)
    seen = relative_covariance(true, edges, errors, 1, 3)
    assert seen[2, 2] == pytest.approx(2 / 900)
    assert seen[1, 1] == pytest.approx(2 / 300 + 1 / 900)


def test_one_false_closure_among_true_ones_is_outvoted(rng):
    true = ring(40)
    driven = edges_of(true, [(k, k + 1) for k in range(39)], rng, noise=0.003)
    closed = edges_of(true, [(39, 0), (38, 1), (37, 0)], rng, robust=True)
    false = Edges(np.array([5]), np.array([20]), np.zeros((1, 3)), closed.information[:1],
                  np.array([True]), closed.prior[:1])  # fmt: skip
    found = optimised(true, Edges.joined([driven, closed, false]), 30)
    # It is off by 10 m; half of its say would move the poses by metres.
    assert np.abs(between(true, found)[:, :2]).max() < 0.1


def ways_on_a_line(count, start, step=0.5):
    """Ways over the graph of poses in a row [m], as `optimised_around` asks for them."""

    def ways(limit):
        way = step * np.abs(np.arange(count) - start)
        return np.where(way <= limit, way, np.inf)

    return ways


def test_a_change_that_dies_out_is_optimised_where_it_is(rng):
    true = np.column_stack([0.5 * np.arange(400.0), np.zeros(400), np.zeros(400)])
    driven = edges_of(true, [(k, k + 1) for k in range(399)], rng)
    closed = edges_of(true, [(k, k + 4) for k in range(0, 395, 2)], rng, robust=True)
    new = edges_of(true, [(380, 390)], rng, robust=True)
    new.measured[0, 1] += 0.02
    edges = Edges.joined([driven, closed, new])
    found = optimised_around(true, edges, ways_on_a_line(400, 390))
    everything = optimised(true, edges, 1)
    assert np.abs(everything - true).max() > 2e-3
    assert found[:300].tolist() == true[:300].tolist()
    assert np.abs(found - everything).max() < 1e-3


def test_a_change_of_everything_is_optimised_as_a_whole(rng):
    true = ring(120)
    drifted = true + np.column_stack([np.zeros((120, 2)), 1e-3 * np.arange(120)])
    edges = edges_of(true, [*((k, k + 1) for k in range(119)), (119, 0)], rng)
    found = optimised_around(drifted, edges, ways_on_a_line(120, 119))
    assert found == pytest.approx(optimised(drifted, edges, 1), abs=1e-9)
    assert found[0].tolist() == drifted[0].tolist()


def views(poses, rng, noise=0.0):
    """What each pose sees of three walls of a room, as surfaces in its own frame."""
    surfaces = []
    for pose in poses:
        rows = []
        for start, way, normal in (
            ((-8, 8), (1, 0), (0, -1)),
            ((8, 8), (0, -1), (-1, 0)),
            ((-8, -7), (0.9, 0.1), None),
        ):
            way = np.array(way) / np.hypot(*way)
            normal = np.array([-way[1], way[0]]) if normal is None else np.array(normal)
            along = np.linspace(1, 14, 40)
            points = np.array(start) + along[:, None] * way
            points = points + noise * rng.normal(size=(40, 1)) * normal
            rows.append(np.column_stack([points, np.tile(normal, (40, 1))]))
        world = np.concatenate(rows)
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        back = np.array([[cos, -sin], [sin, cos]])
        surfaces.append(np.column_stack([(world[:, :2] - pose[:2]) @ back, world[:, 2:] @ back]))
    return surfaces


def test_pieces_are_the_straight_parts_of_a_surface(rng):
    moments, lines = pieces_of(views(ring(1), rng)[0])
    assert len(lines) == 3
    assert moments[:, 2, 2].tolist() == [40.0, 40.0, 40.0]
    assert lines[:, 4] == pytest.approx(6.5)


def test_pieces_of_one_line_are_one_wall_from_wherever_they_are_seen(rng):
    poses = ring(12)
    pieces = pieces_of_keys(views(poses, rng, 0.005))
    order = np.argsort(-pieces.lines[:, 4], kind="stable")
    numbers = wall_numbers(pieces, poses, order)
    assert sorted(np.bincount(numbers)) == [12, 12, 12]


def test_the_gradient_of_walls_is_that_of_their_cost(rng):
    poses = ring(5)
    system = wall_system(pieces_of_keys(views(poses, rng, 0.01)), poses)
    poses = poses + 0.02 * rng.normal(size=poses.shape)
    gradient = system.equations(poses).gradient
    for k in range(15):
        step = np.zeros(15)
        step[k] = 1e-6
        there, back = poses + step.reshape(-1, 3), poses - step.reshape(-1, 3)
        slope = (system.cost(there) - system.cost(back)) / 2e-6
        assert 2.0 * gradient[k] == pytest.approx(slope, rel=1e-4, abs=1e-2)


def test_the_minimum_is_that_of_a_solver_that_knows_every_point(rng):
    true = ring(5)
    surfaces = views(true, rng, 0.005)
    driven = edges_of(true, [(k, k + 1) for k in range(4)], rng, noise=0.01)
    pieces = pieces_of_keys(surfaces)
    assert np.bincount(pieces.keys).tolist() == [3] * 5
    order = np.argsort(-pieces.lines[:, 4], kind="stable")
    system = WallSystem(pieces.keys, wall_numbers(pieces, true, order), 400.0 * pieces.moments)
    start = true + 0.01 * rng.normal(size=true.shape)
    start[0] = true[0]
    found = minimised(start, driven, system, 60)

    # All points, and the lines as unknowns of their own, which nothing eliminates.
    root = np.linalg.cholesky(driven.information).transpose(0, 2, 1)

    def residuals(unknown):
        poses = np.vstack([true[:1], unknown[:12].reshape(-1, 3)])
        lines = unknown[12:].reshape(-1, 2)
        parts = [np.einsum("eij,ej->ei", root, driven.errors(poses)).ravel()]
        for piece, (key, wall) in enumerate(zip(system.keys, system.walls, strict=True)):
            points = surfaces[key][40 * (piece % 3) : 40 * (piece % 3) + 40, :2]
            angle, offset = lines[wall]
            placed = compose(poses[key], np.column_stack([points, np.zeros(40)]))
            parts.append(20.0 * (placed[:, :2] @ [np.cos(angle), np.sin(angle)] - offset))
        return np.concatenate(parts)

    middle, normal, _ = system.lines(found)
    lines = np.column_stack([np.arctan2(normal[:, 1], normal[:, 0]), (middle * normal).sum(axis=1)])
    guess = np.concatenate([start[1:].ravel(), lines.ravel()])
    best = least_squares(residuals, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    cost = driven.cost(found) + system.cost(found)
    assert cost == pytest.approx(2.0 * best.cost, rel=1e-9)


def drifted(rng):
    """Poses of a ring, the same after the wheels, what was seen from them, and the edges."""
    true = ring(10)
    surfaces = views(true, rng, 0.005)
    drift = np.cumsum(0.01 * rng.normal(size=true.shape), axis=0)
    drift[0] = 0.0
    poses = true + drift
    return true, poses, surfaces, edges_of(poses, [(k, k + 1) for k in range(9)], rng)


def test_walls_pull_drifted_poses_straight(rng):
    true, poses, surfaces, driven = drifted(rng)
    found = adjusted(poses, driven, surfaces)
    before, after = np.abs((poses - true)[:, :2]).max(), np.abs(between(true, found)[:, :2]).max()
    assert after < 0.3 * before


def test_rounds_and_steps_end_where_they_are_told_to(rng, monkeypatch):
    true, poses, surfaces, driven = drifted(rng)
    whole = adjusted(poses, driven, surfaces)
    monkeypatch.setattr(line_adjustment, "ROUNDS", 1)
    first = adjusted(poses, driven, surfaces)
    system = wall_system(pieces_of_keys(surfaces), poses)
    assert first.tolist() == minimised(poses, driven, system, line_adjustment.STEPS).tolist()
    assert (first != whole).any()
    # At the minimum a step may raise the cost by rounding: it is shortened only so far.
    stopped = 0
    for _ in range(8):
        found = minimised(true + 0.1 * rng.normal(size=true.shape), driven, system, 60)
        with monkeypatch.context() as patched:
            patched.setattr(line_adjustment, "MOST_DAMPING", 1e-6)
            again = minimised(found, driven, system, 60)
        assert again == pytest.approx(found, abs=1e-6)
        stopped += again is found
    assert stopped


def test_poses_without_walls_stay_where_they_are(rng):
    poses = ring(4)
    driven = edges_of(poses, [(0, 1), (1, 2), (2, 3)], rng)
    assert adjusted(poses, driven, [np.empty((0, 4))] * 4) is poses


@pytest.mark.parametrize("seed", range(4))
def test_a_step_that_would_raise_the_cost_is_not_taken(seed):
    rng = np.random.default_rng(seed)
    true = ring(5)
    driven = edges_of(true, [(k, k + 1) for k in range(4)], rng)
    system = wall_system(pieces_of_keys(views(true, rng, 0.005)), true)
    start = true + rng.normal(size=true.shape) * [2.0, 2.0, 1.5]
    start[0] = true[0]
    found = minimised(start, driven, system, 30)
    farther = minimised(found, driven, system, 300)
    costs = [driven.cost(poses) + system.cost(poses) for poses in (start, found, farther)]
    assert costs[0] > costs[1] >= costs[2]
    assert (farther[0] == true[0]).all()


def test_walls_that_one_key_scan_alone_has_seen_adjust_nothing(rng):
    pose = ring(1)
    surfaces = views(pose, rng, 0.005)
    assert wall_system(pieces_of_keys(surfaces), pose) is None
    no_edges = edges_of(ring(2), [(0, 1)], rng).part(np.zeros(1, bool))
    assert (adjusted(pose, no_edges, surfaces) == pose).all()
