"""PlanarCaster: beams against line segments in the plane, by determinants (section 2.3)."""

from collections.abc import Sequence

import numpy as np

from lrf3d.casting.scans import limit_ranges, make_scan
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.pose import as_poses
from lrf3d.world import World

CHUNK = 1_000_000
"""How many pairs of beam and wall are intersected at once: some 50 MB of determinants."""


class PlanarCaster:
    """Casts beams in the plane in float64; walls lower than the beams are passed over."""

    def __init__(self, world: World) -> None:
        self.world = world

    def cast(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> LaserScan:
        """The true scan from a pose."""
        distances, walls = self._cast(lrf, pose)
        return make_scan(lrf, pose, distances, walls)

    def cast_batch(self, lrf: LaserRangeFinder, poses: Float) -> Float:
        """Ranges (k, beams) from poses (k, 3)."""
        return np.array(
            [limit_ranges(self._cast(lrf, pose)[0], lrf) for pose in as_poses(poses)]
        ).reshape(-1, lrf.beams)

    def _cast(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> tuple[Float, Int]:
        beams = lrf.directions(pose)
        tall = np.flatnonzero(self.world.heights >= lrf.height)
        starts = self.world.segments[tall, :2] - np.array([pose[0], pose[1]])
        spans = self.world.segments[tall, 2:] - self.world.segments[tall, :2]
        distances = np.full(lrf.beams, np.inf)
        walls = np.full(lrf.beams, -1)
        for first in range(0, len(tall), max(1, CHUNK // lrf.beams)):
            part = slice(first, first + max(1, CHUNK // lrf.beams))
            hits = intersect(beams, starts[part], spans[part])
            nearest = np.argmin(hits, axis=1)
            reached = hits[np.arange(lrf.beams), nearest]
            nearer = reached < distances
            distances[nearer] = reached[nearer]
            walls[nearer] = tall[part][nearest[nearer]]
        return distances, walls


def intersect(beams: Float, starts: Float, spans: Float) -> Float:
    """Distances (b, n) from the origin along unit beams (b, 2) to segments, +inf where missed.

    The segments run from starts (n, 2) along spans (n, 2), seen from the laser. With the
    determinants det(beam, span), det(start, span) and det(start, beam), the beam meets the line
    at t = det(start, span) / det(beam, span), at the part u = det(start, beam) / det(beam, span)
    of the segment. A beam along a segment ends at its nearest point.
    """
    across = np.outer(beams[:, 0], spans[:, 1]) - np.outer(beams[:, 1], spans[:, 0])
    ahead = starts[:, 0] * spans[:, 1] - starts[:, 1] * spans[:, 0]
    aside = np.outer(beams[:, 1], starts[:, 0]) - np.outer(beams[:, 0], starts[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = ahead / across
        place = aside / across
    missed = ~((distance >= 0.0) & (place >= 0.0) & (place <= 1.0))
    distance[missed] = np.inf
    beam, wall = np.nonzero((across == 0.0) & (aside == 0.0))
    if len(beam):
        first = np.einsum("ik,ik->i", beams[beam], starts[wall])
        last = np.einsum("ik,ik->i", beams[beam], starts[wall] + spans[wall])
        nearest = np.minimum(first, last)
        along = np.where(nearest >= 0.0, nearest, np.where(np.maximum(first, last) >= 0, 0, np.inf))
        distance[beam, wall] = along
    return distance
