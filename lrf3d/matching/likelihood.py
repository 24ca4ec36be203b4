"""Likelihood field: how well the hits of scans fit a map of cells, and at which poses.

The log likelihood of a hit in each cell enters, as in Thrun et al. (2005, section 6.4), with hits
in the frame of a robot. The mean over the hits leaves, and poses near guesses where it is highest;
or the sum of coarse scores at all positions of a lattice.
"""

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry.lines import ROUNDING, Float, Records
from lrf3d.matching.surface import placement

# Log likelihoods of a hit in the cells (rows, columns) of a map. The border cells stand for all
# cells beyond the map.
Likelihood = NDArray[np.float32]

# Scores of the coarse cells of a map, sorted by their place between the positions of a lattice with
# a stride: (row % stride, column % stride, row // stride, column // stride). So the cells at one
# offset from all positions of a row are adjacent.
Lattice = NDArray[np.int16]


def some(hits: Records, most: int) -> Records:
    """At most a given number of hits, evenly chosen."""
    chosen = np.linspace(0, len(hits) - 1, min(most, len(hits))).astype(np.int64)
    return hits[chosen]


@compiled
def mean_score(pose: Float, hits: Records, cells: Likelihood, side: float) -> float:
    """The mean score of hits (n,) at a pose (3,) in the frame of the cells."""
    rows, columns = cells.shape
    at = placement(pose)
    total = 0.0
    for i in range(len(hits)):
        x = at.x + at.cos * hits[i].x - at.sin * hits[i].y
        y = at.y + at.sin * hits[i].x + at.cos * hits[i].y
        # The border of the scores stands for all cells beyond.
        column = min(max(int(np.floor(x / side)) + 1, 0), columns - 1)
        row = min(max(int(np.floor(y / side)) + 1, 0), rows - 1)
        total += cells[row, column]
    return total / max(len(hits), 1)


@compiled
def lattice_scores(hits: Records, cells: Lattice, cell: float, headings: Float) -> Lattice:
    """The sums (a, rows, columns) of the scores of hits, for each heading (a,) and position.

    Positions are the middles of the cells whose row and column are multiples of the stride.
    """
    stride, _, rows, columns = cells.shape
    scores = np.zeros((len(headings), rows, columns), np.int16)
    for a in range(len(headings)):
        at = placement(np.array([0.5, 0.5, headings[a]]))
        for hit in hits:
            x = at.x + (at.cos * hit.x - at.sin * hit.y) / cell
            y = at.y + (at.sin * hit.x + at.cos * hit.y) / cell
            right, column = divmod(int(np.floor(x)), stride)
            up, row = divmod(int(np.floor(y)), stride)
            first = max(0, -right)
            last = min(columns, columns - right)
            for r in range(max(0, -up), min(rows, rows - up)):
                sums = scores[a, r, first:last]
                values = cells[row, column, r + up, first + right : last + right]
                for c in range(last - first):
                    sums[c] += values[c]
    return scores


@inner
def _step_up(
    at: Float, best: float, step: Float, hits: Records, cells: Likelihood, side: float
) -> float:
    """Move a pose (3,) to the best of its neighbours at a step (3,); returns the score there."""
    here = at.copy()
    trial = at.copy()
    for n in range(27):
        trial[0] = here[0] + (n // 9 - 1) * step[0]
        trial[1] = here[1] + (n // 3 % 3 - 1) * step[1]
        trial[2] = here[2] + (n % 3 - 1) * step[2]
        score = mean_score(trial, hits, cells, side)
        if score > best + ROUNDING:
            best = score
            at[:] = trial
    return best


@compiled
def climbed(guesses: Float, hits: Records, cells: Likelihood, side: float) -> tuple[Float, Float]:
    """Climb from guesses (k, 3) to the best poses (k, 3) nearby; returns these and scores (k,)."""
    poses = guesses.copy()
    reached = np.empty(len(poses))
    first = 0.16  # First step [m], with a quarter of it in rad; they are halved at each level.
    levels = 6
    most_steps = 12
    for k in range(len(poses)):
        best = mean_score(poses[k], hits, cells, side)
        for level in range(levels):
            step = np.array([first, first, first / 4]) / 2.0**level
            for _ in range(most_steps):
                before = best
                best = _step_up(poses[k], best, step, hits, cells, side)
                if best == before:
                    break
        reached[k] = best
    return poses, reached
