"""Section 2.3 of Teslić et al. to the letter: every beam against every wall, by determinants.

It is what most simulators of small worlds do, in NumPy and float64, and the yardstick for what
an index and compiled code save.
"""

import numpy as np

from lrf3d.geometry import Float, Int

CHUNK = 1_000_000
"""Pairs of beam and wall that are intersected at once: some 50 MB of determinants."""


def cast_determinants(segments: Float, origin: Float, beams: Float) -> tuple[Float, Int]:
    """Distances (b,) [m] and walls (b,) that unit beams (b, 2) from an origin (2,) meet."""
    starts, spans = segments[:, :2] - origin, segments[:, 2:] - segments[:, :2]
    distances = np.full(len(beams), np.inf)
    walls = np.full(len(beams), -1)
    size = max(1, CHUNK // max(1, len(beams)))
    for first in range(0, len(segments), size):
        hits = intersect(beams, starts[first : first + size], spans[first : first + size])
        nearest = hits.argmin(axis=1)
        reached = hits[np.arange(len(beams)), nearest]
        nearer = reached < distances
        distances[nearer] = reached[nearer]
        walls[nearer] = first + nearest[nearer]
    return distances, walls


def intersect(beams: Float, starts: Float, spans: Float) -> Float:
    """Distances (b, n) from the origin along unit beams (b, 2) to segments, +inf where missed.

    The segments run from starts (n, 2) along spans (n, 2), seen from the laser. With the
    determinants det(beam, span), det(start, span) and det(start, beam), the beam meets the line
    at t = det(start, span) / det(beam, span), at the part u = det(start, beam) / det(beam, span)
    of the segment. A beam along a segment is left out.
    """
    across = np.outer(beams[:, 0], spans[:, 1]) - np.outer(beams[:, 1], spans[:, 0])
    ahead = starts[:, 0] * spans[:, 1] - starts[:, 1] * spans[:, 0]
    aside = np.outer(beams[:, 1], starts[:, 0]) - np.outer(beams[:, 0], starts[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance: Float = ahead / across
        place = aside / across
    distance[~((distance >= 0.0) & (place >= 0.0) & (place <= 1.0))] = np.inf
    return distance
