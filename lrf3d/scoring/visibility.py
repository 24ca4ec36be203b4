"""Visibility: the parts of the walls that a run could have mapped."""

import numpy as np

from lrf3d.geometry import Float, Int, directions
from lrf3d.laser import beam_directions
from lrf3d.run import Run

LEAST_VISIBLE = 0.5
"""Length [m] that the visible part of a wall must exceed to count."""


def visible_walls(run: Run) -> tuple[Float, Int]:
    """The part of each wall between the outermost noise-free returns of a run.

    Returns:
        (v, 4) the parts longer than 0.5 m, and (v,) the walls that they lie on, rising.
    """
    poses, angles = run.trajectory.poses, run.lrf.angles
    return visible_parts(run.world.segments, poses, angles, run.truth, run.walls)


def visible_parts(
    segments: Float, poses: Float, angles: Float, truth: Float, walls: Int
) -> tuple[Float, Int]:
    """The part of each segment between the outermost noise-free returns of scans.

    Args:
        segments: (n, 4) the walls.
        poses: (k, 3) poses of the scans, x, y [m], theta [rad].
        angles: (beams,) angles of the beams [rad], 0 ahead.
        truth: (k, beams) noise-free ranges [m].
        walls: (k, beams) the segment that each beam hit, −1 for none.

    Returns:
        (v, 4) the parts longer than 0.5 m, and (v,) the segments that they lie on, rising.
    """
    along = directions(segments)
    low, high = np.full(len(segments), np.inf), np.full(len(segments), -np.inf)
    for pose, ranges, hit in zip(poses, truth, walls, strict=True):
        seen = (hit >= 0) & np.isfinite(ranges)
        wall = hit[seen]
        # From the wall's own end, so that a world far from the origin loses no digits.
        reach = ranges[seen, None] * beam_directions(pose[2], angles[seen])
        place = np.einsum("ij,ij->i", pose[:2] - segments[wall, :2] + reach, along[wall])
        np.minimum.at(low, wall, place)
        np.maximum.at(high, wall, place)
    visible = np.flatnonzero(high - low > LEAST_VISIBLE)
    start, unit = segments[visible, :2], along[visible]
    first = start + low[visible, None] * unit
    return np.hstack([first, start + high[visible, None] * unit]), visible
