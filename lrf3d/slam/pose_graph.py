"""Pose graph: the poses of key scans that agree best with all relative poses measured between them.

Poses and edges enter; the poses that minimise the sum of squared, robustly weighted edge errors
leave, by Gauss-Newton over SE(2) with sparse normal equations, their covariances, and the shortest
paths between them. The error of an edge from i to j is

    e = (Rᵢᵀ(tⱼ − tᵢ) − z_t, θⱼ − θᵢ − z_θ)
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.sparse import bsr_array, coo_array, csc_array
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import SuperLU, splu

from lrf3d.geometry import Bool, Float, Int, wrap_angle
from lrf3d.pose import between

ROBUST_SCALE = 3.0
"""Errors of closures beyond this many deviations lose weight (Cauchy's)."""

SETTLED = 1e-5
"""Poses that move by less [m, rad] have settled."""

PRIOR_RESIDUALS = 30.0
"""Residuals that the deviation of matched points counts as, next to those of closures."""

POINT_DEVIATIONS = 2.4
"""Factor on the distances of matched points to their walls: adjacent points share their errors."""

TOGETHER = 16
"""Poses whose covariances are computed at once: of all, the matrix would be as long as the drive,
squared."""


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

    def shifted(self, count: int) -> "Edges":
        """These edges, of poses that others stand before, by their number."""
        return replace(self, first=self.first + count, second=self.second + count)

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
    local = between(poses[i], poses[j])
    by_first = np.zeros((len(edges), 3, 3))
    by_second = np.zeros((len(edges), 3, 3))
    by_second[:, 0, 0], by_second[:, 0, 1] = cos, sin
    by_second[:, 1, 0], by_second[:, 1, 1] = -sin, cos
    by_second[:, 2, 2] = 1.0
    by_first[:, :, :2] = -by_second[:, :, :2]
    by_first[:, 0, 2], by_first[:, 1, 2] = local[:, 1], -local[:, 0]
    by_first[:, 2, 2] = -1.0
    blocks, each = np.stack([by_first, by_second], axis=1).reshape(-1, 3, 3), np.arange(len(i) + 1)
    ends = np.column_stack([i, j]).ravel()
    derivative = bsr_array((blocks, ends, 2 * each), shape=(3 * len(i), poses.size))
    weighted = edges.information * edges.weights(poses)[:, None, None]
    weights = bsr_array((weighted, each[:-1], each), shape=(3 * len(i), 3 * len(i)))
    left = derivative.T @ weights
    return csc_array(left @ derivative), left @ error.ravel()


def _factor(matrix: csc_array) -> SuperLU:
    """The factors of a symmetric positive definite sparse matrix."""
    return splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                options={"SymmetricMode": True})  # fmt: skip


def optimised(poses: Float, edges: Edges, iterations: int = 10) -> Float:
    """The poses (k, 3) that fit edges best; the first one is held.

    A graph of relative poses does not say where it lies.
    """
    poses = poses.copy()
    for _ in range(iterations):
        matrix, gradient = normal_equations(poses, edges)
        step = _factor(matrix[3:, 3:]).solve(-gradient[3:]).reshape(-1, 3)
        poses[1:] += step
        poses[:, 2] = wrap_angle(poses[:, 2])
        if np.abs(step).max() < SETTLED:
            break
    return poses


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


class GraphPaths:
    """The links of the graph, each with the error that a step over it adds, and paths over them.

    The covariance of a pose along the shortest path alone is an upper bound of the graph's own, at
    a hundredth of the time.
    """

    def __init__(self) -> None:
        self._rows: dict[tuple[int, int], int] = {}
        self._ends = np.empty((0, 2), np.int64)
        self._lengths = np.empty(0)
        self._covariances = np.empty((0, 3, 3))

    def link(self, first: int, second: int, length: float, covariance: Float) -> None:
        """Join two key scans, the older one first, by a link of a length [m].

        The covariance (3, 3) is that of the second as seen from the first, along its axes. Of two
        links of the same key scans the shorter one counts.
        """
        row = self._rows.setdefault((first, second), len(self._rows))
        if row == len(self._lengths):
            self._ends = np.vstack([self._ends, [(first, second)]])
            self._lengths = np.append(self._lengths, np.inf)
            self._covariances = np.concatenate([self._covariances, covariance[None]])
        if length < self._lengths[row]:
            self._lengths[row], self._covariances[row] = length, covariance

    def lengths(self, source: int, limit: float) -> Float:
        """Lengths (k,) [m] of the paths from a key scan to all, +inf beyond a limit [m]."""
        return self._shortest(source, limit)[0]

    def _shortest(self, source: int, limit: float = np.inf) -> tuple[Float, Int]:
        """Lengths (k,) of the shortest paths from a key scan, and the vertices (k,) before last."""
        count = max(source, int(self._ends.max(initial=0))) + 1
        graph = coo_array((self._lengths, tuple(self._ends.T)), shape=(count, count))
        found: tuple[Float, Int] = dijkstra(  # type: ignore[call-overload]
            graph.tocsr(), directed=False, indices=source, limit=limit, return_predecessors=True
        )
        return found[0], found[1].astype(np.int64)

    def spreads(self, source: int, poses: Float) -> tuple[Float, Float]:
        """Lengths (k,) of paths [m], and covariances (k, 3, 3) of a pose with each other one held.

        The poses (k, 3) are those of all key scans; covariances are along the axes of the map.
        """
        lengths, before = self._shortest(source)
        reached = np.flatnonzero(before >= 0)
        pairs = np.sort(np.column_stack([before[reached], reached]), axis=1)
        links = np.array([self._rows[first, second] for first, second in pairs.tolist()], np.int64)
        first, second = poses[pairs[:, 0]], poses[pairs[:, 1]]
        # Errors as twists about the origin: those of the links of a path add up.
        twist = np.zeros((len(links), 3, 3))
        cos, sin = np.cos(first[:, 2]), np.sin(first[:, 2])
        twist[:, 0, 0], twist[:, 0, 1], twist[:, 0, 2] = cos, -sin, second[:, 1]
        twist[:, 1, 0], twist[:, 1, 1], twist[:, 1, 2] = sin, cos, -second[:, 0]
        twist[:, 2, 2] = 1.0
        sums = np.zeros((len(lengths), 3, 3))
        sums[reached] = twist @ self._covariances[links] @ twist.transpose(0, 2, 1)
        # Each sum takes in that of the vertex where it ends, and so doubles the path it covers.
        before[before < 0] = source
        while (before != source).any():
            sums, before = sums + sums[before], before[before]
        lever = np.array([[1.0, 0.0, -poses[source, 1]], [0.0, 1.0, poses[source, 0]], [0, 0, 1.0]])
        return lengths, np.asarray(lever @ sums @ lever.T)
