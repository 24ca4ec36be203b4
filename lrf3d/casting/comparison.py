"""Cross-check: the same beams, cast in the plane and in the 3D mesh, compared one by one.

Both casters of lrf3d are exact, so they agree on every beam. With ``raw`` the ranges of bare
Embree, in float32, are compared with the exact ones, which shows what the proof is worth.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.casting.causes import AGREEMENT, EDGES, Answers, Cause, explain, resolution
from lrf3d.casting.embree import EmbreeCaster
from lrf3d.casting.embree_library import require_embreex
from lrf3d.casting.planar import PlanarCaster
from lrf3d.casting.raw_embree import RawEmbreeCaster
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.pose import as_poses
from lrf3d.progress import Progress, silent
from lrf3d.world import World

POSES_COMPARED = 512
"""Poses that are cast and compared at a time: few enough for a progress bar to move."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A beam for which the two casters differ.

    Args:
        scan: Index of the pose.
        beam: Index of the beam.
        planar: Range [m] and wall of the planar caster.
        embree: Range [m] and wall of Embree.
        cause: The cause of the difference.
        chains: The walls on the way of each caster's beam, mirrors and glass before the last.
    """

    scan: int
    beam: int
    planar: tuple[float, int]
    embree: tuple[float, int]
    cause: Cause
    chains: tuple[tuple[int, ...], tuple[int, ...]] = ((), ())

    def as_dict(self) -> dict[str, object]:
        """The difference in JSON's types; the range of a beam without return is null."""
        return {
            "scan": self.scan,
            "beam": self.beam,
            "planar": _answer(self.planar, self.chains[0]),
            "embree": _answer(self.embree, self.chains[1]),
            "cause": str(self.cause),
        }


@dataclass(frozen=True, slots=True)
class CrossCheck:
    """The result of comparing both casters.

    Args:
        beams: Number of beams.
        hits: Number of beams that return, according to the planar caster.
        largest_difference: Largest difference of the ranges [m] among the beams that agree.
        differences: The beams whose range or wall differs.
        raw: Whether bare Embree was compared.
        resolution: Bound on the float32 resolution of positions in this world [m].
    """

    beams: int
    hits: int
    largest_difference: float
    differences: tuple[Difference, ...]
    raw: bool = False
    resolution: float = 0.0

    @property
    def causes(self) -> dict[Cause, int]:
        """Number of beams that differ, by cause."""
        counted = Counter(one.cause for one in self.differences)
        return {cause: counted[cause] for cause in Cause if counted[cause]}

    @property
    def edge_cases(self) -> tuple[Difference, ...]:
        """The differences at the ends of walls."""
        return tuple(one for one in self.differences if one.cause in EDGES)

    @property
    def unexplained(self) -> tuple[Difference, ...]:
        """The differences without a known cause."""
        return tuple(one for one in self.differences if one.cause is Cause.UNEXPLAINED)

    @property
    def largest_error(self) -> float:
        """Largest difference [m] between the two ranges of any beam."""
        gaps = [abs(one.planar[0] - one.embree[0]) for one in self.differences]
        return max([self.largest_difference, *(gap for gap in gaps if np.isfinite(gap))])

    def as_dict(self) -> dict[str, object]:
        """The findings in JSON's types."""
        return {
            "compared_with": "raw" if self.raw else "embree",
            "beams": self.beams,
            "hits": self.hits,
            "agree": self.beams - len(self.differences),
            "agreement_m": AGREEMENT,
            "largest_difference_m": self.largest_difference,
            "largest_error_m": self.largest_error,
            "causes": {str(cause): count for cause, count in self.causes.items()},
            "differences": [one.as_dict() for one in self.differences],
            "edge_cases": [one.as_dict() for one in self.edge_cases],
            "edge_share": len(self.edge_cases) / max(1, self.beams),
            "unexplained": [one.as_dict() for one in self.unexplained],
        }


def crosscheck(
    world: World,
    lrf: LaserRangeFinder,
    poses: ArrayLike,
    progress: Progress = silent,
    *,
    raw: bool = False,
) -> CrossCheck:
    """Cast the beams from poses (k, 3) with both casters, and compare every range and wall.

    In a world of mirrors and glass every wall of each way is compared.

    Args:
        world: The walls.
        lrf: The range finder.
        poses: (k, 3) poses to scan from.
        progress: Called with the number of scans that are done, and of all.
        raw: Compare with trimesh and bare Embree in float32, not with ``EmbreeCaster``.

    Raises:
        MissingLibraryError: Embree is not installed.

    Examples:
        >>> import lrf3d
        >>> world = lrf3d.load_world("paper_room")
        >>> result = lrf3d.crosscheck(world, lrf3d.LaserRangeFinder(), [(1, 1, 0), (2, 1, 0.5)])
        >>> result.beams, len(result.differences)
        (362, 0)
    """
    require_embreex("a cross-check")
    poses = as_poses(poses)
    if raw and world.materials:
        # Bare Embree ends at mirrors and glass.
        world = World(world.segments, world.objects, world.heights)
    planar = PlanarCaster(world)
    other = RawEmbreeCaster(world) if raw else EmbreeCaster(world)
    largest, hits = 0.0, 0
    differences: list[Difference] = []
    for start in range(0, len(poses), POSES_COMPARED):
        part = poses[start : start + POSES_COMPARED]
        chains = np.empty((2, 0, 0, 0), np.int64)
        if isinstance(other, EmbreeCaster):
            (first, ways), (second, others) = (
                caster.chain_batch(lrf, part) for caster in (planar, other)
            )
            chains = np.stack([ways, others])
            a, b = Answers(first, _last(ways)), Answers(second, _last(others))
        else:
            a, b = Answers(*planar.scan_batch(lrf, part)), Answers(*other.scan_batch(lrf, part))
        same, gap = _compared(a, b)
        same &= (chains[0] == chains[1]).all(axis=2) if chains.size else True
        largest = max(largest, float(gap[same].max(initial=0.0)))
        hits += int(np.isfinite(a.ranges).sum())
        differences += _differences(world, lrf, part, start, (a, b), chains, same)
        progress(min(start + POSES_COMPARED, len(poses)), len(poses))
    return CrossCheck(
        len(poses) * lrf.beams, hits, largest, tuple(differences), raw, resolution(world, lrf)
    )


def _compared(a: Answers, b: Answers) -> tuple[Bool, Float]:
    """Which beams (k, beams) agree on wall and range, and the differences of their ranges [m]."""
    both = np.isfinite(a.ranges) & np.isfinite(b.ranges)
    gap = np.zeros(a.ranges.shape)
    gap[both] = np.abs(a.ranges[both] - b.ranges[both])
    same = np.where(both, (gap <= AGREEMENT) & (a.walls == b.walls), a.ranges == b.ranges)
    return same, gap


def _differences(
    world: World,
    lrf: LaserRangeFinder,
    poses: Float,
    first: int,
    answers: tuple[Answers, Answers],
    chains: Int,
    same: Bool,
) -> list[Difference]:
    """The beams that differ, with their causes; the first scan has the number ``first``."""
    scans, beams = np.nonzero(~same)
    if not len(scans):
        return []
    directions = np.array(
        [lrf.directions(poses[scan])[beam] for scan, beam in zip(scans, beams, strict=True)]
    )
    a, b = (Answers(one.ranges[scans, beams], one.walls[scans, beams]) for one in answers)
    causes = explain(world, lrf, poses[scans, :2], directions, a, b)
    return [
        Difference(
            first + int(scans[i]),
            int(beams[i]),
            (float(a.ranges[i]), int(a.walls[i])),
            (float(b.ranges[i]), int(b.walls[i])),
            cause,
            (_way(chains[0, scans[i], beams[i]]), _way(chains[1, scans[i], beams[i]]))
            if chains.size
            else ((), ()),
        )
        for i, cause in enumerate(causes)
    ]


def _last(chains: Int) -> Int:
    """The last walls (k, beams) of chains (k, beams, n); −1 where there is none."""
    count = (chains >= 0).sum(axis=2)
    found: Int = np.take_along_axis(chains, np.maximum(count - 1, 0)[..., None], 2)[..., 0]
    return found


def _way(chain: Int) -> tuple[int, ...]:
    """The walls of a chain that −1 fills up."""
    return tuple(chain[chain >= 0].tolist())


def _answer(found: tuple[float, int], chain: tuple[int, ...]) -> dict[str, object]:
    """A range, its wall and, where there is more than that, the walls on the way."""
    answer: dict[str, object] = {"range": _finite(found[0]), "wall": found[1]}
    return {**answer, "chain": list(chain)} if len(chain) > 1 else answer


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
