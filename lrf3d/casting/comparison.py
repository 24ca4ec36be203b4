"""Cross-check: bare Embree on the extruded walls against the exact plane, beam by beam.

Embree works in float32, which represents positions only to a resolution δ. Within δ of a decision
(on which side of a wall's end, which of two walls first, above or below the top edge) its result is
arbitrary. Each cause of a difference is such a decision within δ of the beam; a difference without
one is unexplained.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import expect
from lrf3d.base.interrupts import Progress, silent
from lrf3d.casting.caster import PlanarCaster
from lrf3d.casting.triangle_rays import require_embreex
from lrf3d.geometry.lines import Float, Int, cross
from lrf3d.geometry.pose import as_poses
from lrf3d.laser import LaserRangeFinder
from lrf3d.laser.range_finder import within_limits
from lrf3d.world import World
from lrf3d.world.mesh import extrude

if TYPE_CHECKING:
    from trimesh import Trimesh

# Largest difference [m] of two ranges that agree.
AGREEMENT = 1e-9

# Sine of the angle between beam and wall below which intersecting a plane in float64 is less
# accurate than 1e-9 m; below 1e-5 trimesh misses the wall.
GRAZING = 1e-4

UNEXPLAINED = "unexplained"

# Why the two differ for a beam, and what that means; of several the first counts.
CAUSES = {
    "range limit": "the wall is just at the limit of the range",
    "laser at a wall": "the laser touches a wall, and float32 may put it on either side",
    "height": "the beam runs along the top or the foot of a wall",
    "grazing": "the beam runs along a wall",
    "corner tie": "two walls are met at one place, and either may be named",
    "wall end": "the beam passes the end of a wall, and float32 may choose either side",
    "seam": "the beam slips between the two triangles of a wall",
    UNEXPLAINED: "no cause is known",
}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CrossCheck:
    """The result of comparing bare Embree with the exact plane, beam by beam.

    Hits are those of the exact ranges. Beams that agree differ by at most the largest difference
    [m]; the resolution [m] bounds that of positions in float32. Of those (m,) that differ it has
    scan, beam, the ranges (m, 2) [m] and walls (m, 2) of both, the exact first, and the cause.
    """

    beams: int
    hits: int
    largest_difference: float
    resolution: float
    scan: Int
    beam: Int
    ranges: Float
    walls: Int
    causes: tuple[str, ...]

    def __repr__(self) -> str:
        causes = ", ".join(f"{count} {cause}" for cause, count in self.counts.items())
        return f"CrossCheck({self.beams:,} beams, {causes or 'all agree'})"

    @property
    def counts(self) -> dict[str, int]:
        """Number of beams that differ, by cause."""
        return {cause: self.causes.count(cause) for cause in CAUSES if cause in self.causes}

    @property
    def largest_error(self) -> float:
        """Largest difference [m] between the two ranges of any beam."""
        both = self.ranges[np.isfinite(self.ranges).all(axis=1)]
        gap = float(np.abs(both[:, 0] - both[:, 1]).max(initial=0.0))
        return max(self.largest_difference, gap)

    def as_dict(self) -> dict[str, object]:
        """The findings in JSON's types; the range of a beam without return is null."""
        answers = np.stack([self.ranges, self.walls], axis=2).tolist()
        named = zip(self.scan.tolist(), self.beam.tolist(), answers, self.causes, strict=True)
        differences = [
            {"scan": scan, "beam": beam, "planar": _answer(planar), "embree": _answer(embree),
             "cause": cause}
            for scan, beam, (planar, embree), cause in named
        ]  # fmt: skip
        return {
            "beams": self.beams,
            "hits": self.hits,
            "agree": self.beams - len(differences),
            "agreement_m": AGREEMENT,
            "largest_difference_m": self.largest_difference,
            "largest_error_m": self.largest_error,
            "causes": self.counts,
            "differences": differences,
            "unexplained": [one for one in differences if one["cause"] == UNEXPLAINED],
        }


def crosscheck(
    world: World, lrf: LaserRangeFinder, poses: ArrayLike, progress: Progress = silent
) -> CrossCheck:
    """Compare bare Embree on the extruded walls with the exact plane, for beams from poses (k, 3).

    Materials are left out: bare Embree ends at mirrors and glass. Progress is called with the
    number of scans that are done, and of all.

    Raises:
        MissingLibraryError: Embree is not installed.

    Examples:
        >>> import lrf3d
        >>> world = lrf3d.load_world("paper_room")
        >>> result = lrf3d.crosscheck(world, lrf3d.LaserRangeFinder(), [(1, 1, 0), (2, 1, 0.5)])
        >>> result.beams, result.causes
        (362, ())
    """
    require_embreex("a cross-check")
    expect(world, World, "world")
    expect(lrf, LaserRangeFinder, "range finder")
    expect(progress, Callable, "progress")
    poses = as_poses(poses)
    world = World(world.segments, world.objects, world.heights)
    planar = PlanarCaster(world)
    mesh = extrude(world)
    largest = 0.0
    hits = 0
    found = [(np.empty((0, 2), np.int64), np.empty((0, 2)), np.empty((0, 2), np.int64))]
    # With 181 beams trimesh's arrays for 256 poses take 20 MB.
    for start in range(0, len(poses), 256):
        part = poses[start : start + 256]
        both = planar.scan_batch(lrf, part), bare_scans(world, mesh, lrf, part)
        ranges, walls = (np.stack(answers, axis=2) for answers in zip(*both, strict=True))
        with np.errstate(invalid="ignore"):
            gap = np.abs(ranges[..., 0] - ranges[..., 1])
        same = np.where(
            np.isfinite(ranges).all(axis=2),
            (gap <= AGREEMENT) & (walls[..., 0] == walls[..., 1]),
            ranges[..., 0] == ranges[..., 1],
        )
        largest = max(largest, float(gap[same & np.isfinite(gap)].max(initial=0.0)))
        hits += int(np.isfinite(ranges[..., 0]).sum())
        found.append((np.add(np.argwhere(~same), [start, 0]), ranges[~same], walls[~same]))
        progress(start + len(part), len(poses))
    places, ranges, walls = (np.concatenate(parts) for parts in zip(*found, strict=True))
    scan, beam = places.T
    delta = resolution(world, lrf)
    causes = _explain(world, lrf, poses[scan], beam, ranges, walls, delta)
    return CrossCheck(
        len(poses) * lrf.beams, hits, largest, delta, scan, beam, ranges, walls, causes
    )


def bare_scans(
    world: World, mesh: Trimesh, lrf: LaserRangeFinder, poses: Float
) -> tuple[Float, Int]:
    """Ranges and walls (k, beams) from poses (k, 3), at the mesh of the extruded walls of a world.

    They are those of trimesh's ``intersects_location``, over Embree.
    """
    shape = len(poses), lrf.beams
    rays = np.zeros((2, *shape, 3))
    rays[0, ..., :2] = (poses[:, :2] - world.origin)[:, None]
    rays[0, ..., 2] = lrf.height
    for row, pose in zip(rays[1], poses, strict=True):
        row[:, :2] = lrf.directions(pose)
    start, way = rays.reshape(2, -1, 3)
    ranges = np.full(len(start), np.inf)
    walls = np.full(len(start), -1)
    if len(mesh.faces):
        places, ray, triangle = mesh.ray.intersects_location(start, way, multiple_hits=False)
        ranges[ray] = np.einsum("ij,ij->i", places - start[ray], way[ray])
        walls[ray] = triangle // 2
    ranges = within_limits(ranges, lrf.range_min, lrf.range_max)
    return ranges.reshape(shape), np.where(np.isfinite(ranges), walls, -1).reshape(shape)


def resolution(world: World, lrf: LaserRangeFinder) -> float:
    """Bound on the float32 resolution of positions along a beam [m]."""
    # The ends and the laser are rounded relative to the size of the scene; the direction and each
    # step of the intersection relative to the distance.
    spans = np.append(np.ptp(world.bounds, axis=0), world.heights.max(initial=0.0))
    size = float(np.linalg.norm(spans))
    return 2.0**-24 * (2.0 * size + 16.0 * min(lrf.range_max, size))


def _explain(
    world: World, lrf: LaserRangeFinder, poses: Float, beam: Int, ranges: Float, walls: Int,
    delta: float,
) -> tuple[str, ...]:  # fmt: skip
    """The causes of the differences of m beams from poses (m, 3)."""
    beams = np.array([lrf.directions(pose)[i] for pose, i in zip(poses, beam, strict=True)])
    beams = beams.reshape(-1, 1, 2)
    # How a beam lies relative to each of the two walls that are named; NaN where there is none.
    met = walls >= 0
    ends = np.full((*walls.shape, 2, 2), np.nan)
    places = np.broadcast_to(poses[:, None, None, :2], ends.shape)
    ends[met] = world.segments[walls[met]].reshape(-1, 2, 2) - places[met]
    heights = np.full(walls.shape, np.nan)
    heights[met] = world.heights[walls[met]]

    span = ends[:, :, 1] - ends[:, :, 0]
    length = np.hypot(span[..., 0], span[..., 1])
    one, other = ranges.T
    with np.errstate(invalid="ignore", divide="ignore"):
        sine = np.fmin.reduce(np.abs(cross(beams, span)) / length, axis=1)
        share = np.clip(-np.einsum("...j,...j", ends[:, :, 0], span) / length**2, 0.0, 1.0)
        nearest = ends[:, :, 0] + share[..., None] * span
        # The seam rises from the foot of a wall's first end to the top of its second.
        seam = ends[:, :, 0] + (lrf.height / heights)[..., None] * span
        limits = np.where(ranges[:, ::-1] > 0.0, lrf.range_max, lrf.range_min)
        at_limit = np.isinf(ranges[:, ::-1]) & (np.abs(ranges - limits) <= AGREEMENT)
        tests = {
            "range limit": at_limit.any(axis=1),
            "laser at a wall": (np.hypot(nearest[..., 0], nearest[..., 1]) <= delta).any(axis=1),
            "height": (np.abs(heights - lrf.height) <= delta).any(axis=1)
            | (met.any(axis=1) & (lrf.height <= delta)),
            "grazing": sine <= GRAZING,
            # Shifting a wall by δ across the beam moves the hit by δ / sine along it.
            "corner tie": met.all(axis=1)
            & (walls[:, 0] != walls[:, 1])
            & (np.abs(one - other) <= AGREEMENT + delta / sine),
            "wall end": (np.abs(cross(beams[:, None], ends)) <= delta).any(axis=(1, 2)),
            "seam": (np.abs(cross(beams, seam)) <= delta).any(axis=1),
        }
    first = np.select(list(tests.values()), list(range(len(tests))), default=len(tests))
    return tuple([*tests, UNEXPLAINED][number] for number in first)


def _answer(found: list[float]) -> dict[str, object]:
    """A range and its wall in JSON's types."""
    return {"range": found[0] if np.isfinite(found[0]) else None, "wall": int(found[1])}
