"""Cross-check: the same beams through the plane and through the 3D mesh, compared one by one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lrf3d.casting.embree import EmbreeCaster
from lrf3d.casting.planar import PlanarCaster
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder, LaserScan, beam_directions
from lrf3d.world import World

AGREEMENT = 1e-9
"""Two ranges that differ by no more than this [m] agree."""

EDGE = 1e-4
"""A beam that passes the end of a wall by no more than this [m] is an edge case: float32 holds
the places of a scene of 1 km to about that."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A beam that the two casters see differently.

    Args:
        scan: Index of the pose.
        beam: Index of the beam.
        planar: Range [m] and wall by the planar caster.
        embree: Range [m] and wall by Embree.
        edge: How far the beam passes from the nearest end of the two walls [m].
    """

    scan: int
    beam: int
    planar: tuple[float, int]
    embree: tuple[float, int]
    edge: float

    @property
    def at_edge(self) -> bool:
        """Whether the beam passes so near an end of a wall that float32 may choose either side."""
        return self.edge <= EDGE

    def as_dict(self) -> dict[str, object]:
        """The difference in JSON's types; a range without return is null."""
        return {
            "scan": self.scan,
            "beam": self.beam,
            "planar": {"range": _finite(self.planar[0]), "wall": self.planar[1]},
            "embree": {"range": _finite(self.embree[0]), "wall": self.embree[1]},
            "distance_to_edge": _finite(self.edge),
        }


@dataclass(frozen=True, slots=True)
class CrossCheck:
    """What the comparison of both casters found.

    Args:
        beams: How many beams were cast.
        hits: How many of them the planar caster sees return.
        largest_difference: Largest difference [m] among the beams that agree.
        differences: The beams that do not agree.
    """

    beams: int
    hits: int
    largest_difference: float
    differences: tuple[Difference, ...]

    @property
    def edge_cases(self) -> tuple[Difference, ...]:
        """The differences at the ends of walls."""
        return tuple(one for one in self.differences if one.at_edge)

    @property
    def unexplained(self) -> tuple[Difference, ...]:
        """The differences that no end of a wall explains."""
        return tuple(one for one in self.differences if not one.at_edge)

    def as_dict(self) -> dict[str, object]:
        """The findings in JSON's types."""
        return {
            "beams": self.beams,
            "hits": self.hits,
            "agree": self.beams - len(self.differences),
            "agreement_m": AGREEMENT,
            "largest_difference_m": self.largest_difference,
            "edge_cases": [one.as_dict() for one in self.edge_cases],
            "edge_share": len(self.edge_cases) / max(1, self.beams),
            "unexplained": [one.as_dict() for one in self.unexplained],
        }


def crosscheck(
    world: World,
    lrf: LaserRangeFinder,
    poses: Float,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> CrossCheck:
    """Cast the beams from poses (k, 3) with both casters and compare every range."""
    planar, embree = PlanarCaster(world), EmbreeCaster(world)
    largest, hits = 0.0, 0
    differences: list[Difference] = []
    for index, pose in enumerate(poses):
        flat, solid = planar.cast(lrf, pose), embree.cast(lrf, pose)
        both = flat.hits & solid.hits
        gap = np.zeros(lrf.beams)
        gap[both] = np.abs(flat.ranges[both] - solid.ranges[both])
        same = np.where(both, gap <= AGREEMENT, flat.ranges == solid.ranges)
        largest = max(largest, float(gap[same].max(initial=0.0)))
        hits += int(flat.hits.sum())
        differences += [
            _difference(world, index, int(b), flat, solid) for b in np.nonzero(~same)[0]
        ]
        progress(index + 1, len(poses))
    return CrossCheck(len(poses) * lrf.beams, hits, largest, tuple(differences))


def _difference(
    world: World, scan: int, beam: int, flat: LaserScan, solid: LaserScan
) -> Difference:
    one = (float(flat.ranges[beam]), int(flat.walls[beam]))
    other = (float(solid.ranges[beam]), int(solid.walls[beam]))
    walls = [wall for _, wall in (one, other) if wall >= 0]
    direction = beam_directions(flat.pose.theta, flat.angles[[beam]])[0]
    edge = _distance_to_ends(flat.pose, direction, world.segments[walls])
    return Difference(scan, beam, one, other, edge)


def _distance_to_ends(pose: Sequence[float], direction: Float, segments: Float) -> float:
    """Smallest distance [m] from a beam's line to the ends of segments (n, 4)."""
    ends = segments.reshape(-1, 2) - np.array([pose[0], pose[1]])
    aside = np.abs(direction[0] * ends[:, 1] - direction[1] * ends[:, 0])
    return float(aside.min(initial=np.inf))


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
