"""Pose graph: the poses of key scans that agree best with all relative poses measured between them.

Poses and edges enter; the poses that minimise the sum of squared, robustly weighted edge errors
leave, by Gauss-Newton over SE(2) with sparse normal equations. The error of an edge from i to j is

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


FIRST = np.zeros(1, np.int64)
"""The pose that is held: a graph of relative poses does not say where it lies."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Relative poses between key scans.

    Args:
        first: (e,) the key scans that the poses are relative to.
        second: (e,) the key scans whose poses they are.
        measured: (e, 3) the relative poses x, y [m], theta [rad].
        information: (e, 3, 3) their inverse covariances, along the axes of the first.
        robust: (e,) whether an edge may be wrong, as closures may.
        prior: (e, 3, 3) the part of the information that does not come from matching scans.
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

    def cost(self, poses: Float) -> float:
        """The sum that is minimised: Cauchy's of closures, and plain squares of others."""
        squares = self.squares(poses)
        cauchy = ROBUST_SCALE**2 * np.log1p(squares / ROBUST_SCALE**2)
        return float(np.where(self.robust, cauchy, squares).sum())


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Gradient and Gauss-Newton matrix of a cost over the poses of k key scans.

    Args:
        matrix: (3k, 3k) half the Hessian.
        gradient: (3k,) half the gradient.
    """

    matrix: csc_array
    gradient: Float

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        return NormalEquations(self.matrix + other.matrix, self.gradient + other.gradient)

    def step(self, damping: float = 0.0, held: Int = FIRST) -> Float:
        """The step (k, 3) that solves them with some poses held: the first, if not given."""
        step = np.zeros(len(self.gradient))
        moves = np.ones((len(step) // 3, 3), np.bool_)
        moves[held] = False
        rows = np.flatnonzero(moves)
        free = self.matrix[rows][:, rows].tocsc()
        if damping:
            free = free + csc_array(
                (damping * free.diagonal(), (np.arange(free.shape[0]),) * 2), shape=free.shape
            )
        step[rows] = factor(csc_array(free)).solve(-self.gradient[rows])
        return step.reshape(-1, 3)


def factor(matrix: csc_array) -> SuperLU:
    """The factors of a symmetric positive definite sparse matrix."""
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                options={"SymmetricMode": True})  # fmt: skip


def edge_equations(poses: Float, edges: Edges) -> NormalEquations:
    """The normal equations of edges at poses (k, 3)."""
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
    for a, derivative_a in ((i, by_first), (j, by_second)):
        left = np.einsum("eki,ekl->eil", derivative_a, weighted)
        np.add.at(gradient, a, np.einsum("eil,el->ei", left, error))
        for b, derivative_b in ((i, by_first), (j, by_second)):
            blocks.append(left @ derivative_b)
            rows.append(a)
            columns.append(b)
    matrix = block_matrix(
        np.concatenate(blocks), np.concatenate(rows), np.concatenate(columns), len(poses)
    )
    return NormalEquations(matrix, gradient.ravel())


def block_matrix(blocks: Float, rows: Int, columns: Int, count: int) -> csc_array:
    """The sparse matrix (3·count, 3·count) with blocks (b, 3, 3) at rows and columns, summed."""
    inside = np.arange(3)
    at_row = (3 * rows[:, None, None] + inside[None, :, None]) + np.zeros((1, 1, 3), np.int64)
    at_column = (3 * columns[:, None, None] + inside[None, None, :]) + np.zeros((1, 3, 1), np.int64)
    place = (at_row.ravel(), at_column.ravel())
    return csc_array((blocks.ravel(), place), shape=(3 * count, 3 * count))


def optimised(poses: Float, edges: Edges, iterations: int = 10) -> Float:
    """The poses (k, 3) that fit edges best; the first one is held."""
    for _ in range(iterations):
        step = edge_equations(poses, edges).step()
        poses = poses + step
        poses[:, 2] = wrap_angle(poses[:, 2])
        if np.abs(step).max() < SETTLED:
            break
    return poses


def optimised_around(poses: Float, edges: Edges, ways: Callable[[float], Float]) -> Float:
    """The poses (k, 3) after a Gauss-Newton step where something has changed; the first is held.

    The step is taken around the change alone, with all else held. Where poses half-way to the
    border still move, it reaches twice as far: until the change has died out.

    Args:
        poses: The poses before.
        edges: All edges.
        ways: Gives for each pose (k,) the way over the graph from the change [m], +inf beyond a
            limit [m].
    """
    reach = LEAST_REACH
    while True:
        way = ways(reach)
        free = way <= reach
        used = edges.part(free[edges.first] | free[edges.second])
        nodes = np.unique(np.concatenate([used.first, used.second, FIRST]))
        first, second = (np.searchsorted(nodes, ends) for ends in (used.first, used.second))
        inside = replace(used, first=first, second=second)
        held = np.flatnonzero(~free[nodes] | (nodes == 0))
        step = edge_equations(poses[nodes], inside).step(held=held)
        if free.all() or not (np.abs(step[way[nodes] > 0.5 * reach]) > RESTING).any():
            break
        reach *= 2.0
    moved = poses.copy()
    moved[nodes] += step
    moved[:, 2] = wrap_angle(moved[:, 2])
    return moved
