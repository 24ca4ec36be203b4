"""Vertex moves: vertices leave the beams for where the squared range errors are least."""

import numpy as np

from lrf3d.geometry import Float, Int

ROUNDS = 30
"""How often the vertices are moved at most; a dozen times is usual."""


def move_vertices(
    place: Float, reach: Float, angles: Float, ranges: Float, *, closed: bool
) -> tuple[Float, Float]:
    """Vertices (v,), their angles [rad] and distances [m], at the least squared range errors.

    Levenberg-Marquardt steps; the ends of an open polyline stay on their beams, so that it goes
    on explaining the same ones.
    """
    best, damping = _errors(place, reach, angles, ranges), 1e-3
    for _ in range(ROUNDS):
        matrix, vector = _normal_equations(place, reach, angles, ranges, closed=closed)
        scaled = matrix + damping * np.diag(np.diag(matrix) + 1e-12)
        step = np.linalg.solve(scaled, vector).reshape(-1, 2)
        if closed:
            step = np.vstack([step, step[:1]])
        moved = place + step[:, 0], reach + step[:, 1]
        fits = (np.diff(moved[0]) > 1e-6).all() and (moved[1] > 0.0).all()
        error = _errors(*moved, angles, ranges) if fits else np.inf
        if error < best:
            gain = best - error
            (place, reach), best, damping = moved, error, 0.3 * damping
            if gain < 1e-6 * best:
                break
        else:
            damping *= 10.0
            if damping > 1e6:
                break
    return place, reach


def _predicted(place: Float, reach: Float, angles: Float) -> tuple[Float, Int, Float, Float, Float]:
    """Ranges of beams to a polyline, the edge of each, and what they are made of."""
    turn = 2.0 * np.pi
    # A closed polyline begins anywhere: beams before its first vertex look at its last edge.
    angles = np.where(angles < place[0] - 1e-12, angles + turn, angles)
    angles = np.where(angles > place[-1] + 1e-12, angles - turn, angles)
    edge = np.clip(np.searchsorted(place, angles, side="right") - 1, 0, len(place) - 2)
    ahead = reach[edge + 1] * np.sin(place[edge + 1] - angles)
    back = reach[edge] * np.sin(angles - place[edge])
    across = reach[edge] * reach[edge + 1] * np.sin(place[edge + 1] - place[edge])
    return across / (ahead + back), edge, angles, ahead + back, across


def _errors(place: Float, reach: Float, angles: Float, ranges: Float) -> float:
    predicted = _predicted(place, reach, angles)[0]
    if not (predicted > 0.0).all():
        return np.inf
    return float(((ranges - predicted) ** 2).sum())


def _normal_equations(
    place: Float, reach: Float, angles: Float, ranges: Float, *, closed: bool
) -> tuple[Float, Float]:
    predicted, edge, angles, below, across = _predicted(place, reach, angles)
    one, two = place[edge], place[edge + 1]
    near, far = reach[edge], reach[edge + 1]
    slopes = np.zeros((len(angles), len(place), 2))
    rows = np.arange(len(angles))
    cosine = near * far * np.cos(two - one)
    slopes[rows, edge, 0] = (-cosine + predicted * near * np.cos(angles - one)) / below
    slopes[rows, edge + 1, 0] = (cosine - predicted * far * np.cos(two - angles)) / below
    slopes[rows, edge, 1] = (across / near - predicted * np.sin(angles - one)) / below
    slopes[rows, edge + 1, 1] = (across / far - predicted * np.sin(two - angles)) / below
    if closed:
        slopes[:, 0] += slopes[:, -1]
        slopes = slopes[:, :-1]
    else:
        slopes[:, [0, -1], 0] = 0.0
    flat = slopes.reshape(len(angles), -1)
    matrix = flat.T @ flat
    # Directions that no beam tells anything about stay as they are.
    idle = np.diag(matrix) <= 0.0
    matrix[idle, idle] = 1.0
    return matrix, flat.T @ (ranges - predicted)
