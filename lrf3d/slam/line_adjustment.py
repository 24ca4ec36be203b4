"""Line adjustment: poses of key scans and walls together, so that all pieces lie on their walls.

Poses, the edges of the odometry and the front end, and the pieces of the key scans enter; poses
leave that minimise

    Σ eᵀ Ω e + Σ_walls min over (n, c) of Σ_pieces w Σ_points (n·(R p + t) − c)² / σ²

The points of a piece enter by their moments M alone. At the pose of its key scan they are V M Vᵀ,
with V = [R t; 0 1]; a wall's sum G of these gives its best line in closed form, by the smaller
eigenvalue of its centred part, and derivatives by the poses and by the line. The line is then
eliminated from the normal equations by its Schur complement, so that only poses are left. Source of
the elimination: Lu and Milios 1997 for poses, Ferrer 2019 for planes (eigen-factors).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array

from lrf3d.geometry import Float, Int, wrap_angle
from lrf3d.slam.pose_graph import Edges, NormalEquations, block_matrix, edge_equations
from lrf3d.slam.resolution import DENSE
from lrf3d.slam.walls import Pieces, pieces_of_keys, wall_numbers

POINT_SIGMA = DENSE.sigma
"""Standard deviation [m] that a point counts with: see `lrf3d.slam.resolution`."""

PIECE_SCALE = 0.03
"""RMS distance [m] of a piece to its wall from which on its weight falls (Cauchy's)."""

ROUNDS = 6
"""How often pieces are assigned to walls, at most."""

STEPS = 1
"""Gauss-Newton steps after each assignment: more lower the cost of walls that the next replaces."""

SETTLED = 2e-4
"""Poses that move by less [m, rad] have settled."""

MOST_DAMPING = 1e6
"""Where even this damping does not lower the cost, it is at its minimum up to rounding."""


@dataclass(frozen=True, eq=False)
class WallSystem:
    """Pieces on their walls, with weights that stay while the poses move.

    Args:
        keys: (p,) the key scan of each piece.
        walls: (p,) its wall, from 0 and without gaps.
        moments: (p, 3, 3) its moments, times weight over σ².
    """

    keys: Int
    walls: Int
    moments: Float

    def lines(self, poses: Float) -> tuple[Float, Float, Float]:
        """The best line of each wall: a point on it (w, 2), its normal (w, 2), and the cost (w,).

        The point is the mean of the wall's points, about which all sums are taken: far from the
        origin they would lose their digits otherwise.
        """
        count = int(self.walls.max()) + 1
        here = _summed(self._placed(poses, np.zeros((count, 2))), self.walls, count)
        middle = here[:, :2, 2] / here[:, 2, 2][:, None]
        about = _summed(self._placed(poses, middle), self.walls, count)
        scatter = about[:, :2, :2] - (
            about[:, :2, 2, None] * about[:, None, :2, 2] / about[:, 2, 2][:, None, None]
        )
        values, vectors = np.linalg.eigh(scatter)
        mean = middle + about[:, :2, 2] / about[:, 2, 2][:, None]
        return mean, vectors[:, :, 0], np.maximum(values[:, 0], 0.0)

    def cost(self, poses: Float) -> float:
        """The sum that is minimised, at poses (k, 3)."""
        return float(self.lines(poses)[2].sum())

    def equations(self, poses: Float) -> NormalEquations:
        """The normal equations over the poses (k, 3), with all lines eliminated."""
        middle, normal, _ = self.lines(poses)
        nx, ny = normal[self.walls].T
        theta = poses[self.keys, 2]
        cos, sin = np.cos(theta), np.sin(theta)
        tx, ty = (poses[self.keys, :2] - middle[self.walls]).T
        zero, one = np.zeros(len(nx)), np.ones(len(nx))
        # The distance of a point p is q·(p, 1), with q from the line and the pose.
        q = np.stack([nx * cos + ny * sin, ny * cos - nx * sin, nx * tx + ny * ty], axis=1)
        by_pose = np.stack(
            [
                np.stack([zero, zero, q[:, 1]], axis=1),
                np.stack([zero, zero, -q[:, 0]], axis=1),
                np.stack([nx, ny, zero], axis=1),
            ],
            axis=1,
        )
        # By the turn of the normal, and by the offset of the line along it.
        by_line = np.stack(
            [
                np.stack([-ny * cos + nx * sin, zero], axis=1),
                np.stack([nx * cos + ny * sin, zero], axis=1),
                np.stack([nx * ty - ny * tx, -one], axis=1),
            ],
            axis=1,
        )
        weighted = np.einsum("pki,pkl->pil", by_pose, self.moments)
        count, walls = len(poses), int(self.walls.max()) + 1
        gradient = np.zeros((count, 3))
        np.add.at(gradient, self.keys, np.einsum("pil,pl->pi", weighted, q))
        pose_pose = block_matrix(weighted @ by_pose, self.keys, self.keys, count)
        pose_line = _blocks(weighted @ by_line, self.keys, self.walls, (count, walls))
        line_line = _summed(
            np.einsum("pki,pkl,plj->pij", by_line, self.moments, by_line), self.walls, walls
        )
        inverted = np.asarray(np.linalg.inv(line_line), dtype=np.float64)
        inverse = _blocks(inverted, np.arange(walls), np.arange(walls), (walls, walls))
        eliminated = pose_line @ inverse @ pose_line.T
        return NormalEquations(csc_array(pose_pose - eliminated), gradient.ravel())

    def _placed(self, poses: Float, about: Float) -> Float:
        """The moments (p, 3, 3) of the pieces at poses, about a point (w, 2) for each wall."""
        theta = poses[self.keys, 2]
        frame = np.zeros((len(self.keys), 3, 3))
        frame[:, 0, 0] = frame[:, 1, 1] = np.cos(theta)
        frame[:, 1, 0] = np.sin(theta)
        frame[:, 0, 1] = -frame[:, 1, 0]
        frame[:, :2, 2] = poses[self.keys, :2] - about[self.walls]
        frame[:, 2, 2] = 1.0
        return np.asarray(frame @ self.moments @ frame.transpose(0, 2, 1))


def _summed(blocks: Float, numbers: Int, count: int) -> Float:
    """Sums (count, …) of blocks (p, …) with the same number."""
    total = np.zeros((count, *blocks.shape[1:]))
    np.add.at(total, numbers, blocks)
    return total


def _blocks(blocks: Float, rows: Int, columns: Int, shape: tuple[int, int]) -> csc_array:
    """The sparse matrix of blocks (b, h, w) at rows and columns of blocks, summed."""
    high, wide = blocks.shape[1:]
    at_row = high * rows[:, None, None] + np.arange(high)[None, :, None]
    at_column = wide * columns[:, None, None] + np.arange(wide)[None, None, :]
    place = [np.broadcast_to(part, blocks.shape).ravel() for part in (at_row, at_column)]
    size = high * shape[0], wide * shape[1]
    return csc_array((blocks.ravel(), (place[0], place[1])), shape=size)


def adjusted(poses: Float, edges: Edges, surfaces: list[Float]) -> Float:
    """Poses (k, 3) of key scans, adjusted to the walls that they show.

    Args:
        poses: Where they are by the pose graph, closures and all.
        edges: The edges that stay: those of odometry and front end.
        surfaces: For each key scan what it saw, in the frame of the robot.
    """
    pieces = pieces_of_keys(surfaces)
    if not len(pieces.keys):
        return poses
    for _ in range(ROUNDS):
        system = wall_system(pieces, poses)
        if system is None:
            return poses
        moved = minimised(poses, edges, system, STEPS)
        change = np.abs(moved - poses).max()
        poses = moved
        if change < SETTLED:
            break
    return poses


def wall_system(pieces: Pieces, poses: Float) -> WallSystem | None:
    """Pieces on the walls that they show at poses (k, 3), weighted; None if no wall is shared."""
    numbers = wall_numbers(pieces, poses, np.argsort(-pieces.lines[:, 4], kind="stable"))
    on = numbers >= 0
    if not on.any():
        return None
    plain = WallSystem(pieces.keys[on], numbers[on], pieces.moments[on])
    middle, normal, _ = plain.lines(poses)
    placed = plain._placed(poses, middle)
    n = normal[plain.walls]
    squares = np.einsum("pi,pij,pj->p", n, placed[:, :2, :2], n) / plain.moments[:, 2, 2]
    weights = 1.0 / (1.0 + squares / PIECE_SCALE**2) / POINT_SIGMA**2
    return WallSystem(plain.keys, plain.walls, plain.moments * weights[:, None, None])


def minimised(poses: Float, edges: Edges, system: WallSystem, steps: int) -> Float:
    """Poses (k, 3) after at most a number of damped Gauss-Newton steps; the first is held."""
    cost = edges.cost(poses) + system.cost(poses)
    damping = 1e-6
    for _ in range(steps):
        equations = edge_equations(poses, edges) + system.equations(poses)
        while True:
            step = equations.step(damping)
            moved = poses + step
            moved[:, 2] = wrap_angle(moved[:, 2])
            lower = edges.cost(moved) + system.cost(moved)
            if lower <= cost:
                break
            damping *= 10.0
            if damping > MOST_DAMPING:
                return poses
        poses, cost, damping = moved, lower, max(0.1 * damping, 1e-9)
        if np.abs(step).max() < SETTLED * 1e-3:
            break
    return poses
