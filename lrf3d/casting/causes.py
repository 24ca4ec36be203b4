"""Causes of the differences between two casters, from the beam and the walls that they report.

Float32 represents positions only to a resolution δ. Within δ of a decision (which side of a wall's
end, which of two walls comes first, above or below the top edge) the result of a float32 caster is
arbitrary. Each cause is such a decision within δ of the beam; a difference without one is
unexplained.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from lrf3d.geometry import Bool, Float, Int, cross
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World

AGREEMENT = 1e-9
"""Largest difference [m] of two ranges that agree."""

GRAZING = 1e-4
"""Angle [rad] between beam and wall below which intersecting a plane in float64 is less accurate
than 1e-9 m; below 1e-5 trimesh misses the wall."""


class Cause(StrEnum):
    """Why two casters differ for a beam."""

    RANGE_LIMIT = "range limit"
    LASER_AT_WALL = "laser at a wall"
    HEIGHT = "height"
    GRAZING = "grazing"
    CORNER_TIE = "corner tie"
    WALL_END = "wall end"
    SEAM = "seam"
    UNEXPLAINED = "unexplained"


MEANING = {
    Cause.RANGE_LIMIT: "the wall is just at the limit of the range",
    Cause.LASER_AT_WALL: "the laser touches a wall, and float32 may put it on either side",
    Cause.HEIGHT: "the beam runs along the top or the foot of a wall",
    Cause.GRAZING: "the beam runs along a wall",
    Cause.CORNER_TIE: "two walls are met at one place, and either may be named",
    Cause.WALL_END: "the beam passes the end of a wall, and float32 may choose either side",
    Cause.SEAM: "the beam slips between the two triangles of a wall",
    Cause.UNEXPLAINED: "no cause is known",
}
"""A description of each cause."""

EDGES = frozenset({Cause.WALL_END, Cause.CORNER_TIE})
"""The causes at the ends of walls."""


@dataclass(frozen=True, slots=True)
class Answers:
    """The answers of a caster: ranges (n,) [m] after REP 117, and walls (n,), −1 for none."""

    ranges: Float
    walls: Int


def resolution(world: World, lrf: LaserRangeFinder) -> float:
    """Bound on the float32 resolution of positions along a beam [m].

    The ends and the laser are rounded relative to the size of the scene; the direction and each
    step of the intersection relative to the distance.
    """
    size = float(
        np.linalg.norm(np.append(np.ptp(world.bounds, axis=0), world.heights.max(initial=0)))
    )
    return 2.0**-24 * (2.0 * size + 16.0 * min(lrf.range_max, size))


def explain(
    world: World, lrf: LaserRangeFinder, origins: Float, directions: Float, a: Answers, b: Answers
) -> list[Cause]:
    """The cause of the difference of each of n beams.

    Args:
        world: The walls.
        lrf: The range finder.
        origins: (n, 2) origins of the beams [m].
        directions: (n, 2) unit vectors.
        a: The answers of one caster.
        b: The answers of the other.
    """
    delta = resolution(world, lrf)
    seen = [_Sight(world, lrf, origins, directions, one.walls, delta) for one in (a, b)]
    least_sine = np.fmin(seen[0].sine, seen[1].sine)
    two_walls = (a.walls >= 0) & (b.walls >= 0) & (a.walls != b.walls)
    with np.errstate(invalid="ignore", divide="ignore"):
        gap = np.abs(a.ranges - b.ranges)
        # Shifting a wall by δ across the beam moves the hit by this distance along it.
        along = AGREEMENT + delta / least_sine
    tests = {
        Cause.RANGE_LIMIT: _at_limit(a.ranges, b.ranges, lrf),
        Cause.LASER_AT_WALL: seen[0].touched | seen[1].touched,
        Cause.HEIGHT: seen[0].level | seen[1].level,
        Cause.GRAZING: least_sine <= GRAZING,
        Cause.CORNER_TIE: two_walls & (gap <= along),
        Cause.WALL_END: np.fmin(seen[0].end, seen[1].end) <= delta,
        Cause.SEAM: np.fmin(seen[0].seam, seen[1].seam) <= delta,
    }
    found = np.select(list(tests.values()), list(range(len(tests))), default=len(tests))
    causes = [*tests, Cause.UNEXPLAINED]
    return [causes[number] for number in found]


class _Sight:
    """How beams lie relative to the walls (n,) that a caster reports; NaN where it has none."""

    def __init__(
        self,
        world: World,
        lrf: LaserRangeFinder,
        origins: Float,
        beams: Float,
        walls: Int,
        delta: float,
    ) -> None:
        met = walls >= 0
        ends = np.full((len(walls), 2, 2), np.nan)
        ends[met] = world.segments[walls[met]].reshape(-1, 2, 2) - origins[met, None]
        heights = np.full(len(walls), np.nan)
        heights[met] = world.heights[walls[met]]
        self._beams = beams
        span = ends[:, 1] - ends[:, 0]
        length = np.hypot(span[:, 0], span[:, 1])
        with np.errstate(invalid="ignore"):
            self.sine = np.abs(cross(beams, span)) / length
            self.end = np.fmin(self._aside(ends[:, 0]), self._aside(ends[:, 1]))
            share = np.clip(-np.einsum("ij,ij->i", ends[:, 0], span) / length**2, 0.0, 1.0)
            nearest = ends[:, 0] + share[:, None] * span
            self.touched: Bool = np.hypot(nearest[:, 0], nearest[:, 1]) <= delta
            self.level: Bool = (np.abs(heights - lrf.height) <= delta) | (
                met & (lrf.height <= delta)
            )
            # The seam rises from the foot of a wall's first end to the top of its second.
            self.seam = self._aside(ends[:, 0] + (lrf.height / heights)[:, None] * span)

    def _aside(self, points: Float) -> Float:
        """Distance (n,) from the line of each beam to a point (n, 2) seen from its origin [m]."""
        return np.abs(cross(self._beams, points))


def _at_limit(a: Float, b: Float, lrf: LaserRangeFinder) -> Bool:
    """Which beams are just within a range limit for one caster and just beyond it for the other."""
    near = np.zeros(len(a), dtype=bool)
    for one, other in ((a, b), (b, a)):
        near |= np.isposinf(one) & (np.abs(other - lrf.range_max) <= AGREEMENT)
        near |= np.isneginf(one) & (np.abs(other - lrf.range_min) <= AGREEMENT)
    return near
