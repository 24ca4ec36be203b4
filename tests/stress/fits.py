"""The cases of fits and merges: lines far from the origin, against sums of rationals.

Errors are counted in units of the last place of the coordinates, at the ends of the wall: nothing
that is stored in these coordinates can be better than half of one.
"""

from fractions import Fraction

import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float, fit_line, lengths, normal_lines, principal_direction
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.mapping.mapper import MODES
from lrf3d.mapping.paper import unite
from lrf3d.mapping.robust.walls import Walls, merge
from lrf3d.mapping.segment_table import SegmentTable, add_moments, measure_moments
from lrf3d.world import World
from stress.cases import check
from stress.rational import fitted

ULP = "ulp of the coordinates"

FARTHEST = 7.0
"""Power of ten of the farthest place [m]."""

MOVE = 2.0**20
"""How far worlds are moved [m]: a power of two, so that moving them rounds little."""


def wall_points(rng: np.random.Generator, count: int) -> tuple[Float, float]:
    """Noisy points (n, 2) along a wall anywhere up to 1e7 m away, and how long it is [m]."""
    length = 10.0 ** rng.uniform(-1.0, 2.0)
    along = np.linspace(-0.5, 0.5, count) * length
    aside = rng.normal(size=count) * length * 10.0 ** rng.uniform(-6.0, -1.5)
    turn = rng.choice([rng.uniform(-np.pi, np.pi), *np.arange(-2, 3) * 0.5 * np.pi])
    place = rng.choice([-1.0, 1.0], 2) * 10.0 ** rng.uniform(0.0, FARTHEST, 2)
    x = place[0] + along * np.cos(turn) - aside * np.sin(turn)
    y = place[1] + along * np.sin(turn) + aside * np.cos(turn)
    return np.column_stack([x, y]), length


def off_line(mean: Float, unit: Float, points: Float, weights: Float, length: float) -> float:
    """How far the ends of a wall are off the exact fit to points, in ulp of the coordinates."""
    x, y, angle = fitted(points, weights.tolist())
    cos, sin = np.cos(angle), np.sin(angle)
    gap = [float(Fraction(float(m)) - exact) for m, exact in zip(mean, (x, y), strict=True)]
    aside = abs(gap[1] * cos - gap[0] * sin)
    turned = abs(unit[1] * cos - unit[0] * sin) * 0.5 * length
    return float((aside + turned) / np.spacing(np.abs(points).max()))


def fits(rng: np.random.Generator) -> Float:
    """A line through points."""
    points, length = wall_points(rng, int(rng.integers(3, 60)))
    mean, unit = fit_line(points)
    return np.array([off_line(mean, unit, points, np.ones(len(points)), length)])


def _runs(rng: np.random.Generator) -> tuple[Float, Float, float, list[Float]]:
    """Points of a wall with weights, its length, and the moments of parts of it."""
    points, length = wall_points(rng, int(rng.integers(18, 60)))
    weights = 10.0 ** rng.uniform(-1.0, 1.0, len(points))
    cuts = np.sort(rng.choice(np.arange(3, len(points) - 3, 3), 3, replace=False))
    parts = zip(np.split(points, cuts), np.split(weights, cuts), strict=True)
    return points, weights, length, [measure_moments(*part) for part in parts]


def moments(rng: np.random.Generator) -> Float:
    """Moments of parts of a wall, added up in any order."""
    points, weights, length, parts = _runs(rng)
    order = rng.permutation(len(parts))
    total = parts[order[0]]
    for k in order[1:]:
        total = add_moments(total, parts[k])
    unit = principal_direction(total[3], total[4], total[5])
    return np.array([off_line(total[1:3], unit, points, weights, length)])


def walls(rng: np.random.Generator) -> Float:
    """Walls of the robust mapper, merged in its rows."""
    points, weights, length, parts = _runs(rng)
    rows = Walls.of_size(len(parts))
    rows.moments[:] = parts
    rows.ends[:] = np.concatenate([points[0], points[-1]])
    rows.points[:] = 3
    for gone in 1 + rng.permutation(len(parts) - 1):
        merge(rows, 0, int(gone))
    total = rows.moments[0]
    unit = rows.ends[0, 2:] - rows.ends[0, :2]
    return np.array([off_line(total[1:3], unit / np.hypot(*unit), points, weights, length)])


def end_points(rng: np.random.Generator) -> Float:
    """The paper's merging of two segments by their four ends."""
    points, length = wall_points(rng, 4)
    ends = points[rng.permutation(4)].reshape(2, 4)
    table = SegmentTable(
        ends,
        np.array([measure_moments(row.reshape(2, 2), np.ones(2)) for row in ends]),
        np.array([2, 2]),
        np.array([0, 1]),
    )
    unite(table, 0, 1)
    merged = table.ends[0]
    middle, along = 0.5 * (merged[:2] + merged[2:]), merged[2:] - merged[:2]
    return np.array([off_line(middle, along / np.hypot(*along), points, np.ones(4), length)])


def lines(rng: np.random.Generator) -> Float:
    """Eq. 3's alpha and p of segments: both ends lie on the line, within (−π, π] and p ≥ 0."""
    segments = np.empty((50, 4))
    for row in segments:
        points, _ = wall_points(rng, 2)
        row[:] = points.ravel()
    found = normal_lines(segments)
    errors = np.empty(len(segments))
    size = np.spacing(np.abs(segments).max(axis=1))
    for k, ((alpha, p), ends) in enumerate(zip(found.tolist(), segments.tolist(), strict=True)):
        x1, y1, x2, y2 = map(Fraction, ends)
        dx, dy = x2 - x1, y2 - y1
        length = float(np.hypot(float(dx), float(dy)))
        exact = abs(float(x1 * dy - y1 * dx)) / length
        # The normal is square to the segment; along the wall a turn moves its ends.
        turned = abs(float(dx) * np.cos(alpha) + float(dy) * np.sin(alpha))
        errors[k] = (abs(p - exact) + turned) / size[k]
        if not (-np.pi < alpha <= np.pi and p >= 0.0):
            errors[k] = np.inf
    return errors


def moved_maps(rng: np.random.Generator) -> Float:
    """Maps of one room at the origin and 1,048,576 m away, where they must be the same."""
    corners = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 7.0], [0.0, 7.0]])
    room = np.column_stack([corners, np.roll(corners, -1, axis=0)])
    posts = np.round(rng.uniform(1.0, 6.0, (3, 2)), 1)
    room = np.vstack([room, np.column_stack([posts, posts + np.array([0.5, 0.25])])])
    poses = np.column_stack([rng.uniform(0.5, 6.5, (6, 2)), rng.uniform(-np.pi, np.pi, 6)])
    # Whole steps of 2⁻¹² m stay what they are however far they are moved.
    room, poses[:, :2] = (np.round(part * 4096.0) / 4096.0 for part in (room, poses[:, :2]))
    lrf, mode, seed = LaserRangeFinder(), str(rng.choice(MODES)), int(rng.integers(2**31))
    maps = []
    for move in (0.0, MOVE):
        caster, noise = PlanarCaster(World(room + move)), ProportionalNoise(0.04)
        mapper, luck = LineMapper(mode), np.random.default_rng(seed)
        for pose in poses + np.array([move, move, 0.0]):
            mapper.update(noise(caster.cast(lrf, pose), luck))
        maps.append(mapper.map)
    here, there = maps
    if len(here) != len(there) or (here.objects != there.objects).any():
        return np.array([np.inf])
    off = np.abs(there.segments - MOVE - here.segments).max(axis=1)
    return np.asarray(off[lengths(here.segments) > 0.0] / np.spacing(MOVE))


FITS = (
    check("lines", "fits up to 1e7 m away", fits, bound=8.0, unit=ULP, tries=4_000, each=500),
    check("lines", "sums of moments there", moments, bound=8.0, unit=ULP, tries=4_000, each=500),
    check("lines", "merged walls there", walls, bound=8.0, unit=ULP, tries=4_000, each=500),
    check("lines", "merged end points there", end_points, bound=8.0, unit=ULP, tries=8_000,
          each=1_000),
    check("lines", "alpha and p there", lines, bound=8.0, unit=ULP, tries=50_000, each=5_000),
    check("lines", "maps moved by 1,048,576 m", moved_maps, bound=8.0, unit=ULP, tries=2_000,
          each=100),
)  # fmt: skip
"""The cases of fits and merges."""
