"""Pose graph: the poses of key scans that agree best with all relative poses measured between them.

Poses and edges enter; the poses that minimise the sum of squared, robustly weighted edge errors
leave, by Gauss-Newton over SE(2) with sparse normal equations, and their covariances. The error of
an edge from i to j is

    e = (Rᵢᵀ(tⱼ − tᵢ) − z_t, θⱼ − θᵢ − z_θ)
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from lrf3d.geometry import Bool, Float, Int, wrap_angle
from lrf3d.slam.frames import between

ROBUST_SCALE = 3.0
"""Errors of closures beyond this many deviations lose weight (Cauchy's)."""

SETTLED = 1e-5
"""Poses that move by less [m, rad] have settled."""

LEAST_REACH = 20.0
"""Way over the graph [m] within which poses are optimised at first when something has changed."""

RESTING = 1e-3
"""The change has died out where poses move by less [m, rad]."""

PRIOR_RESIDUALS = 30.0
"""Residuals that the deviation of matched points counts as, next to those of closures."""

POINT_DEVIATIONS = 2.4
"""Factor on the distances of matched points to their walls: adjacent points share their errors."""

TOGETHER = 16
"""Poses whose covariances are computed at once: of all, the matrix would be as long as the drive,
squared."""

FIRST = np.zeros(1, np.int64)
"""The pose that is held: a graph of relative poses does not say where it lies."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Relative poses (e, 3) of key scans as seen from others, with their inverse covariances.

    These (e, 3, 3) are along the axes of the first; the prior is the part of them that does not
    come from matching scans. Robust edges may be wrong, as closures may.
    """

    first: Int
    second: Int
    measured: Float
    information: Float
    robust: Bool
    prior: Float

    def __len__(self) -> int:
        return len(self.first)

    @classmethod
    def none(cls) -> "Edges":
        """No edges at all."""
        whole = np.empty(0, np.int64)
        shape = np.empty((0, 3)), np.empty((0, 3, 3))
        return cls(whole, whole, *shape, np.empty(0, np.bool_), np.empty((0, 3, 3)))

    @classmethod
    def joined(cls, parts: "list[Edges]") -> "Edges":
        """Edges of several kinds together."""
        return cls(*(np.concatenate([getattr(part, each.name) for part in parts])
                     for each in fields(cls)))  # fmt: skip

    def part(self, chosen: Bool) -> "Edges":
        """Some of the edges, of a mask (e,)."""
        return Edges(*(getattr(self, each.name)[chosen] for each in fields(self)))

    def errors(self, poses: Float) -> Float:
        """Errors (e, 3) [m, rad] at poses (k, 3)."""
        error = between(poses[self.first], poses[self.second]) - self.measured
        error[:, 2] = wrap_angle(error[:, 2])
        return error

    def squares(self, poses: Float) -> Float:
        """Squared errors (e,) in units of their variance."""
        error = self.errors(poses)
        squares: Float = np.einsum("ei,eij,ej->e", error, self.information, error)
        return squares

    def weights(self, poses: Float) -> Float:
        """Robust weights (e,)."""
        return np.where(self.robust, 1.0 / (1.0 + self.squares(poses) / ROBUST_SCALE**2), 1.0)

    def scaled(self, variance: float) -> "Edges":
        """These edges, their information from matching divided by a variance factor."""
        matching = (self.information - self.prior) / max(variance, 1e-6)
        return replace(self, information=matching + self.prior)


def normal_equations(poses: Float, edges: Edges) -> tuple[csc_array, Float]:
    """Half the Hessian (3k, 3k) and half the gradient (3k,) of the cost at poses (k, 3)."""
    i, j = edges.first, edges.second
    error = edges.errors(poses)
    cos, sin = np.cos(poses[i, 2]), np.sin(poses[i, 2])
    dx, dy = (poses[j, :2] - poses[i, :2]).T
    by_first = np.zeros((len(edges), 3, 3))
    by_second = np.zeros((len(edges), 3, 3))
    by_second[:, 0, 0], by_second[:, 0, 1] = cos, sin
    by_second[:, 1, 0], by_second[:, 1, 1] = -sin, cos
    by_second[:, 2, 2] = 1.0
    by_first[:, :, :2] = -by_second[:, :, :2]
    by_first[:, 0, 2] = -sin * dx + cos * dy
    by_first[:, 1, 2] = -cos * dx - sin * dy
    by_first[:, 2, 2] = -1.0
    weighted = edges.information * edges.weights(poses)[:, None, None]
    gradient = np.zeros((len(poses), 3))
    blocks, rows, columns = [], [], []
    inside = np.zeros((3, 3), np.int64) + np.arange(3)
    for a, derivative_a in ((i, by_first), (j, by_second)):
        left = np.einsum("eki,ekl->eil", derivative_a, weighted)
        np.add.at(gradient, a, np.einsum("eil,el->ei", left, error))
        for b, derivative_b in ((i, by_first), (j, by_second)):
            blocks.append(left @ derivative_b)
            rows.append(3 * a[:, None, None] + inside.T)
            columns.append(3 * b[:, None, None] + inside)
    values, *places = (np.concatenate(parts).ravel() for parts in (blocks, rows, columns))
    shape = (gradient.size, gradient.size)
    return csc_array((values, tuple(places)), shape=shape), gradient.ravel()


def _factor(matrix: csc_array) -> SuperLU:
    """The factors of a symmetric positive definite sparse matrix."""
    return splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                options={"SymmetricMode": True})  # fmt: skip


def _step(poses: Float, edges: Edges, held: Int = FIRST) -> Float:
    """The Gauss-Newton step (k, 3) of poses (k, 3) with some of them held."""
    matrix, gradient = normal_equations(poses, edges)
    moves = np.ones((len(poses), 3), np.bool_)
    moves[held] = False
    rows = np.flatnonzero(moves)
    step = np.zeros(len(gradient))
    step[rows] = _factor(matrix[rows][:, rows]).solve(-gradient[rows])
    return step.reshape(-1, 3)


def optimised(poses: Float, edges: Edges, iterations: int = 10) -> Float:
    """The poses (k, 3) that fit edges best; the first one is held."""
    for _ in range(iterations):
        step = _step(poses, edges)
        poses = poses + step
        poses[:, 2] = wrap_angle(poses[:, 2])
        if np.abs(step).max() < SETTLED:
            break
    return poses


def optimised_around(poses: Float, edges: Edges, paths: Callable[[float], Float]) -> Float:
    """The poses (k, 3) after a Gauss-Newton step where something has changed; the first is held.

    The step is taken around the change alone, with all else held. Where poses half-way to the
    border still move, it reaches twice as far: until the change has died out. ``paths(limit)`` is
    the distance (k,) [m] along the graph from the change to each pose, +inf beyond a limit.
    """
    reach = LEAST_REACH
    while True:
        way = paths(reach)
        free = way <= reach
        used = edges.part(free[edges.first] | free[edges.second])
        nodes = np.unique(np.concatenate([used.first, used.second, FIRST]))
        first, second = (np.searchsorted(nodes, ends) for ends in (used.first, used.second))
        inside = replace(used, first=first, second=second)
        step = _step(poses[nodes], inside, np.flatnonzero(~free[nodes] | (nodes == 0)))
        if free.all() or not (np.abs(step[way[nodes] > 0.5 * reach]) > RESTING).any():
            break
        reach *= 2.0
    moved = poses.copy()
    moved[nodes] += step
    moved[:, 2] = wrap_angle(moved[:, 2])
    return moved


def variance_factor(poses: Float, edges: Edges, deviation: float) -> float:
    """How large closures' squared errors are, in units of the variances that matching gives.

    Matching counts each point with one deviation, whatever the walls and the laser are; closed
    loops show how much more or less it errs. The deviation is the RMS distance of matched points to
    their walls, over what one counts with.
    """
    residuals = 3.0 * float(edges.robust.sum())
    squares = float((edges.weights(poses) * edges.squares(poses)).sum())
    before = PRIOR_RESIDUALS * (POINT_DEVIATIONS * deviation) ** 2
    return (squares + before) / (residuals + PRIOR_RESIDUALS)


def pose_covariances(poses: Float, edges: Edges, numbers: Int) -> Float:
    """Covariances (m, 3, 3) of the poses of some numbers (m,), each by itself; that of 0 is 0."""
    found = np.zeros((len(numbers), 3, 3))
    if len(poses) < 2:
        return found
    # The first pose is held: its rows are left out.
    factor = _factor(normal_equations(poses, edges)[0][3:, 3:])
    for first in range(0, len(numbers), TOGETHER):
        part = numbers[first : first + TOGETHER]
        rows = (3 * part[:, None] + np.arange(3)).ravel()
        units = np.zeros((3 * len(poses), len(rows)))
        units[rows, np.arange(len(rows))] = 1.0
        solved = np.zeros_like(units)
        solved[3:] = factor.solve(units[3:])
        each = np.arange(len(part))
        blocks = solved[rows].reshape(len(part), 3, len(part), 3)
        found[first : first + TOGETHER] = blocks[each, :, each]
    return found
