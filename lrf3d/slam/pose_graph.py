"""Pose graph: the poses of key scans that agree best with all relative poses measured between them.

Poses and edges enter. The poses that minimise the sum of squared, robustly weighted edge errors
leave; so do their covariances and the shortest paths between them. The solver is Gauss-Newton over
SE(2) with sparse normal equations. The error of an edge from i to j is

    e = (Rᵢᵀ(tⱼ − tᵢ) − z_t, θⱼ − θᵢ − z_θ)
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import SuperLU, splu

from lrf3d.compiling import compiled, record
from lrf3d.geometry.lines import Float, Int, Records, wrap_angle
from lrf3d.geometry.pose import between
from lrf3d.matching.surface import DEVIATIONS

# A relative pose between two key scans.
EDGE = np.dtype(
    [
        ("first", np.int64), ("second", np.int64),  # the numbers of two key scans
        ("measured", float, 3),  # the pose of the second as seen from the first
        ("information", float, (3, 3)),  # of that pose, along the axes of the first
        ("prior", float, (3, 3)),  # the part of the information that is not from matching scans
        ("may_be_wrong", bool),  # whether it may be wrong, as a closure may
    ]
)  # fmt: skip


def edges_of(
    first: ArrayLike, second: ArrayLike, measured: Float, information: Float, prior: Float,
    *, may_be_wrong: ArrayLike = False,
) -> Records:  # fmt: skip
    """Edges (e,) between key scans (e,), of relative poses (e, 3) with information (e, 3, 3)."""
    edges = np.zeros(len(measured), EDGE)
    columns = first, second, measured, information, prior, may_be_wrong
    for name, column in zip(EDGE.names or (), columns, strict=True):
        edges[name] = column
    return edges


def edge_errors(poses: Float, edges: Records) -> Float:
    """Errors (e, 3) [m, rad] of edges at poses (k, 3)."""
    return _errors(between(poses[edges["first"]], poses[edges["second"]]), edges)


def _errors(relative: Float, edges: Records) -> Float:
    """Errors (e, 3) [m, rad] of edges between key scans at relative poses (e, 3)."""
    error = relative - edges["measured"]
    error[:, 2] = wrap_angle(error[:, 2])
    return np.asarray(error)


def edge_squares(error: Float, edges: Records) -> tuple[Float, Float]:
    """Squared errors (e,) of edges in units of their variance, and Cauchy's weights (e,)."""
    squares = np.einsum("ei,eij,ej->e", error, edges["information"], error)
    return squares, np.where(edges["may_be_wrong"], 1.0 / (1.0 + squares / DEVIATIONS**2), 1.0)


def _matrices(rows: Sequence[Sequence[ArrayLike]], count: int) -> Float:
    """Matrices (count, 3, 3) with entries that are arrays (count,) or numbers."""
    matrices = np.empty((count, 3, 3))
    for r, c in np.ndindex(3, 3):
        matrices[:, r, c] = rows[r][c]
    return matrices


def normal_equations(poses: Float, edges: Records) -> tuple[csc_array, Float]:
    """Half the Hessian (3k, 3k) and half the gradient (3k,) of the cost at poses (k, 3)."""
    i = edges["first"]
    j = edges["second"]
    count = len(edges)
    relative = between(poses[i], poses[j])
    error = _errors(relative, edges)
    x, y, _ = relative.T
    cos = np.cos(poses[i, 2])
    sin = np.sin(poses[i, 2])
    by_first = _matrices([[-cos, -sin, y], [sin, -cos, -x], [0, 0, -1.0]], count)
    by_second = _matrices([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1.0]], count)
    blocks = np.stack([by_first, by_second], axis=1).reshape(-1, 3, 3)
    each = np.arange(count + 1)
    ends = np.column_stack([i, j]).ravel()
    derivative = bsr_array((blocks, ends, 2 * each), shape=(3 * count, poses.size))
    _, weights = edge_squares(error, edges)
    weighted = edges["information"] * weights[:, None, None]
    left = derivative.T @ bsr_array((weighted, each[:-1], each), shape=(3 * count, 3 * count))
    return csc_array(left @ derivative), left @ error.ravel()


def _factor(matrix: csc_array) -> SuperLU:
    """The factors of a symmetric positive definite sparse matrix."""
    # Few columns of a pose graph have the same rows: large panels take a third longer.
    return splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                options={"SymmetricMode": True})  # fmt: skip


def optimised(poses: Float, edges: Records, iterations: int = 20) -> Float:
    """The poses (k, 3) that fit the edges best; the first is held, as all edges are relative."""
    poses = poses.copy()
    settled = 1e-5  # Poses that move by less [m, rad] have converged.
    for _ in range(iterations):
        matrix, gradient = normal_equations(poses, edges)
        step = _factor(matrix[3:, 3:]).solve(-gradient[3:]).reshape(-1, 3)
        poses[1:] += step
        poses[:, 2] = wrap_angle(poses[:, 2])
        if np.abs(step).max() < settled:
            break
    return poses


def variance_factor(poses: Float, edges: Records, deviation: float) -> float:
    """The ratio of the squared errors of closures to the variances that matching gives.

    Matching assumes one standard deviation for all points, walls and lasers; closed loops show the
    true size of its errors. The deviation is the RMS distance of matched points to their walls, in
    units of the assumed one.
    """
    squares, weights = edge_squares(edge_errors(poses, edges), edges)
    prior_residuals = 30  # Number of residuals of closures that the deviation counts as.
    # Factor on the distances of matched points to their walls: adjacent points share their errors.
    point_deviations = 2.4
    before = prior_residuals * (point_deviations * deviation) ** 2
    residuals = 3 * int(edges["may_be_wrong"].sum()) + prior_residuals
    return (float((weights * squares).sum()) + before) / residuals


def pose_covariances(poses: Float, edges: Records, numbers: Int, variance: float = 1.0) -> Float:
    """Covariances (m, 3, 3) of some poses by number (m,); that of the first pose is 0.

    The information from matching is divided by a variance factor.
    """
    found = np.zeros((len(numbers), 3, 3))
    if len(poses) < 2:
        return found
    scaled = edges.copy()
    matching = (edges["information"] - edges["prior"]) / max(variance, 1e-6)
    scaled["information"] = matching + edges["prior"]
    # The first pose is held: its rows are left out.
    factor = _factor(normal_equations(poses, scaled)[0][3:, 3:])
    for row, number in enumerate(numbers.tolist()):
        units = np.zeros((3 * len(poses), 3))
        units[3 * number : 3 * number + 3] = np.eye(3)
        if number:
            found[row] = factor.solve(units[3:])[3 * number - 3 : 3 * number]
    return found


# A link between two key scans, the older one first, and its length [m].
LINK = record(first=int, second=int, length=float)


class GraphPaths:
    """Shortest paths over the links of the graph, each of which adds an error of its own.

    The covariance of a pose along the shortest path alone is an upper bound of the graph's own, at
    a hundredth of the time.
    """

    def __init__(self) -> None:
        self._links = np.empty(0, LINK)
        self._covariances = np.empty((0, 3, 3))

    def link(self, first: int, second: int, length: float, covariance: Float) -> None:
        """Link two key scans, the older one first, by a length [m].

        The covariance (3, 3) is that of the second as seen from the first, along its axes. Of links
        between the same two the shortest counts.
        """
        self._links = np.append(self._links, np.array((first, second, length), LINK))
        self._covariances = np.concatenate([self._covariances, covariance[None]])

    def lengths(self, source: int, limit: float) -> Float:
        """Lengths (k,) [m] of the paths from a key scan to all, +inf beyond a limit [m]."""
        return _shortest(self._links, source, limit)[0]

    def spreads(self, source: int, poses: Float) -> tuple[Float, Float]:
        """Lengths (k,) [m] of paths to a key scan, and its covariances (k, 3, 3) by these paths.

        Each covariance is that of the pose of the source if the key scan at the other end of the
        path is held, along the axes of the map. The poses (k, 3) are those of all key scans.
        """
        lengths, last = _shortest(self._links, source, np.inf)
        reached = np.flatnonzero(last >= 0)
        before = np.full(len(last), source)
        links = self._links[last[reached]]
        covariances = self._covariances[last[reached]]
        first = links["first"]
        second = links["second"]
        # The other end of the link.
        before[reached] = first + second - reached
        cos = np.cos(poses[first, 2])
        sin = np.sin(poses[first, 2])
        x, y, _ = poses[second].T
        # As twists about the origin, the errors of the links of a path add up.
        twist = _matrices([[cos, -sin, y], [sin, cos, -x], [0, 0, 1.0]], len(reached))
        sums = np.zeros((len(lengths), 3, 3))
        sums[reached] = twist @ covariances @ twist.transpose(0, 2, 1)
        # Pointer doubling: each sum covers a part of its path, and adds the sum of the vertex where
        # that part ends, so that the parts double in each pass.
        while (before != source).any():
            sums = sums + sums[before]
            before = before[before]
        x, y, _ = poses[source]
        lever = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
        return lengths, np.asarray(lever @ sums @ lever.T)


@compiled
def _shortest(links: Records, source: int, limit: float) -> tuple[Float, Int]:
    """Lengths (k,) of the shortest paths from a key scan, and their last links (k,), or −1.

    All links are relaxed forwards and backwards until nothing changes (Bellman-Ford). They are in
    the order of the drive, so that a path along it takes one pass.
    """
    count = source + 1
    for link in links:
        count = max(count, link.second + 1)
    lengths = np.full(count, np.inf)
    last = np.full(count, -1)
    lengths[source] = 0.0
    changed = True
    while changed:
        changed = False
        for turn in range(2 * len(links)):
            number = min(turn, 2 * len(links) - 1 - turn)
            link = links[number]
            for here, there in ((link.first, link.second), (link.second, link.first)):
                length = lengths[here] + link.length
                if length < lengths[there] and length <= limit:
                    lengths[there] = length
                    last[there] = number
                    changed = True
    return lengths, last
