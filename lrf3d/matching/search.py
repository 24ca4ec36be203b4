"""Search: the places in a window from which a scan fits into a map, by all that its beams met.

Key scans and their poses enter, as a `Submap`. A cell that one of their beams hit is a wall, one
that beams passed is free, and the others are unknown. The poses of a window at which the hits of
another scan meet most walls, and few free cells, are matched with the map (Olson 2009), and leave.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled
from lrf3d.geometry.lines import Float, Int, Records
from lrf3d.geometry.pose import between
from lrf3d.matching.key_scans import BEHIND, Fans, Key, all_fans, evidence, same_place
from lrf3d.matching.scan_matching import Match, match_scan
from lrf3d.matching.surface import SurfaceGrid, concatenated, grid_of, moved, placement

# Side of a cell [m]: matching converges from one and a half of them.
CELL = 0.15

# Size of a window in standard deviations to each side.
DEVIATIONS = 3.0

# Score of a hit in the cell of a wall, and in a free one. It falls by one for each cell away from a
# wall, which therefore reaches `WALL` cells to each side.
WALL = 2
FREE = -2

# Prior of the refinement of a peak: 0.5 m and 0.2 rad, which hardly constrain it.
LOOSE = np.diag([4.0, 4.0, 25.0])

# Prior of a peak that would slide away: 1 mm and 0.3 mrad.
HELD = np.diag([1e6, 1e6, 1e7])

# Margin of the evidence by which a place must beat all others elsewhere.
CLEARLY = 0.8


class Field(NamedTuple):
    """Scores of the cells (rows, columns) of a map from its lower left corner [m]."""

    cells: NDArray[np.int8]
    left: float
    low: float


def field_of(keys: Sequence[Key], poses: Float, fans: Fans) -> Field:
    """The field that key scans with some fans show from poses (k, 3)."""
    reach = max(float(np.abs([key.hits["x"], key.hits["y"]]).max(initial=0.0)) for key in keys)
    farthest = 50.0  # Largest range of the cells around key scans [m].
    around = 1.5 * min(reach, farthest) + WALL * CELL
    low = poses[:, :2].min(axis=0) - around
    high = poses[:, :2].max(axis=0) + around
    columns, rows = ((high - low) / CELL).astype(np.int64).tolist()
    field = Field(np.zeros((rows, columns), np.int8), *low.tolist())
    _clear(field, poses, fans)
    for key, pose in zip(keys, poses, strict=True):
        _mark(field, pose, key.hits)
    return field


@compiled
def _clear(field: Field, poses: Float, fans: Fans) -> None:
    """Mark the cells free that the beams of key scans at poses (k, 3) passed."""
    high, wide = field.cells.shape
    ranges = fans.ranges
    for number, key in enumerate(fans.keys):
        at = placement(poses[key])
        heading = poses[key, 2]
        behind = BEHIND + 3.0 * fans.noise[number]
        x = fans.x[number]
        y = fans.y[number]
        column = (at.x + at.cos * x - at.sin * y - field.left) / CELL
        row = (at.y + at.sin * x + at.cos * y - field.low) / CELL
        for k in range(fans.first[number] + 1, fans.first[number + 1] - 1):
            least = min(ranges[k - 1], ranges[k], ranges[k + 1])
            if not (least > 0.0 and np.isfinite(least)):
                continue
            along = np.cos(heading + fans.angles[k])
            up = np.sin(heading + fans.angles[k])
            for step in range(int((least - behind) / CELL)):
                c = int(column + step * along)
                r = int(row + step * up)
                if c < 0 or c >= wide or r < 0 or r >= high:
                    break
                field.cells[r, c] = FREE


@compiled
def _mark(field: Field, pose: Float, hits: Records) -> None:
    """Mark the cells of the hits of a scan from a pose (3,) as walls, and those around."""
    high, wide = field.cells.shape
    at = placement(pose)
    for i in range(len(hits)):
        x = at.x + at.cos * hits[i].x - at.sin * hits[i].y - field.left
        y = at.y + at.sin * hits[i].x + at.cos * hits[i].y - field.low
        column = int(x / CELL)
        row = int(y / CELL)
        if not (WALL <= column < wide - WALL and WALL <= row < high - WALL):
            continue
        for r in range(row - WALL + 1, row + WALL):
            for c in range(column - WALL + 1, column + WALL):
                here = WALL - max(abs(r - row), abs(c - column))
                field.cells[r, c] = max(field.cells[r, c], here)


@compiled
def shifts_within(guess: Float, spread: Float, near: float) -> Int:
    """Shifts (s, 2) of a window in cells: of its ellipse, as far as they are near the origin."""
    # A step more, so that the least window has neighbours to each side.
    wide = (CELL / DEVIATIONS) ** 2
    xx = spread[0, 0] + wide
    xy = spread[0, 1]
    yy = spread[1, 1] + wide
    right = int(np.ceil(DEVIATIONS * np.sqrt(xx) / CELL))
    up = int(np.ceil(DEVIATIONS * np.sqrt(yy) / CELL))
    shifts = np.empty(((2 * right + 1) * (2 * up + 1), 2), np.int64)
    count = 0
    for row in range(-up, up + 1):
        for column in range(-right, right + 1):
            x = CELL * column
            y = CELL * row
            square = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
            if np.hypot(guess[0] + x, guess[1] + y) < near and square <= DEVIATIONS**2:
                shifts[count] = column, row
                count += 1
    return shifts[:count]


@compiled
def window_scores(
    points: Records, field: Field, centre: Float, shifts: Int, angles: Float
) -> Float:
    """The scores (a, s) of points in the field, for each heading and shift [cells]."""
    high, wide = field.cells.shape
    scores = np.zeros((len(angles), len(shifts)))
    turned = centre.copy()
    for a in range(len(angles)):
        turned[2] = centre[2] + angles[a]
        at = placement(turned)
        for point in points:
            x = at.x + at.cos * point.x - at.sin * point.y
            y = at.y + at.sin * point.x + at.cos * point.y
            column = int(np.floor((x - field.left) / CELL))
            row = int(np.floor((y - field.low) / CELL))
            for s in range(len(shifts)):
                c = column + shifts[s, 0]
                r = row + shifts[s, 1]
                if c >= 0 and c < wide and r >= 0 and r < high:
                    scores[a, s] += field.cells[r, c]
    return scores


@compiled
def _peaks(scores: Float, shifts: Int, close: float, most: int) -> Int:
    """The heading and the shift (p, 2), by number, of at most some peaks of scores (a, s).

    Their scores are positive, and at least close to the best, as a share of it. Those around a
    peak, which lead to the same place, are set to 0.
    """
    peaks = np.empty((most, 2), np.int64)
    least = max(close * scores.max(), 0.0)
    for number in range(most):
        a, s = divmod(scores.argmax(), len(shifts))
        if scores[a, s] <= least:
            return peaks[:number]
        peaks[number] = a, s
        for other in range(len(shifts)):
            dx = shifts[other, 0] - shifts[s, 0]
            dy = shifts[other, 1] - shifts[s, 1]
            if max(abs(dx), abs(dy)) <= 2:
                scores[max(a - 2, 0) : a + 3, other] = 0.0
    return peaks


class Place(NamedTuple):
    """A match of a scan with a map, and the evidence for it."""

    match: Match
    evidence: float


class Submap:
    """Key scans at poses (k, 3), as the map that another scan is matched with."""

    def __init__(self, keys: Sequence[Key], poses: Float) -> None:
        self.keys = keys
        self.poses = poses

    @cached_property
    def fans(self) -> Fans:
        """The fans of all key scans."""
        return all_fans(key.fans for key in self.keys)

    @cached_property
    def field(self) -> Field:
        """The field of all key scans."""
        return field_of(self.keys, self.poses, self.fans)

    @cached_property
    def grid(self) -> SurfaceGrid | None:
        """The walls of all key scans; None if there are none."""
        parts = zip(self.keys, self.poses, strict=True)
        walls = concatenated(moved(key.walls, at) for key, at in parts)
        return grid_of(walls) if len(walls) else None

    def seen_from(self, pose: Float) -> Float:
        """Poses (k, 3) of a robot at a pose (3,) as seen from each key scan."""
        return between(self.poses, pose)

    def match(self, scan: Key, guess: Float, prior: Float) -> Match | None:
        """The match of a scan from a guess (3,) on; None if either of them shows no walls."""
        if self.grid is None or not len(scan.surface):
            return None
        match = match_scan(scan.surface, self.grid, guess, prior)
        return match if np.isfinite(match.pose).all() else None

    def place(self, scan: Key, match: Match) -> Place:
        """A match with the evidence for it."""
        poses = self.seen_from(match.pose)
        return Place(match, evidence(scan.hits, match.explained, poses, self.fans))

    def places(self, scan: Key, guess: Float, spread: Float, near: float = np.inf) -> list[Place]:
        """The places in a window where a scan lies on the map, those first whose hits fit best.

        The window has a covariance (3, 3), its spread, around a guess (3,); places farther than a
        distance [m] from the map's origin are left out.
        """
        shifts = shifts_within(guess, spread, near)
        surface = scan.surface
        hits = scan.hits
        if self.grid is None or not len(surface) or not len(shifts):
            return []
        far = float(np.quantile(np.hypot(hits["x"], hits["y"]), 0.8))
        # Bounds of the step of the heading [rad]; it moves far-off points by a cell.
        angle_steps = 0.01, 0.03
        step = float(np.clip(CELL / max(far, 1e-3), *angle_steps))
        *_, turn = np.sqrt(spread.diagonal())
        turns = max(1, int(np.ceil(DEVIATIONS * turn / step)))
        angles: Float = step * np.arange(-turns, turns + 1, dtype=np.float64)
        sample = thin(surface)
        scores = window_scores(thin(hits), self.field, guess, shifts, angles)
        found: list[tuple[Float, Float]] = []
        # Least score of a peak, as a share of the best, and peaks that are refined.
        close = 0.7
        most_matched = 6
        for a, s in _peaks(scores, shifts, close, most_matched).tolist():
            peak = guess + np.array([*(CELL * shifts[s]), angles[a]])
            place = match_scan(sample, self.grid, peak, LOOSE).pose
            prior = LOOSE
            if not (np.isfinite(place).all() and same_place(place, peak, 0.5)):
                # It slid away, as along a corridor: that is another place.
                place = peak
                prior = HELD
            if not any(same_place(place, other) for other, _ in found):
                found.append((place, prior))
        matches = [match_scan(surface, self.grid, place, prior) for place, prior in found]
        return [self.place(scan, match) for match in matches]


def thin(points: Records) -> Records:
    """A subsample of many points that is enough to find a place."""
    coarse_points = 80  # Points of a scan that a window is searched with.
    return np.ascontiguousarray(points[:: 1 + len(points) // coarse_points])


def clearest(places: Sequence[Float], worth: Sequence[float]) -> int | None:
    """The index of the place (3,) whose evidence clearly beats all others elsewhere, if any."""
    if not places:
        return None
    best = int(np.argmax(worth))
    others = [
        value
        for place, value in zip(places, worth, strict=True)
        if not same_place(place, places[best], tolerance=2.0)
    ]
    return best if worth[best] - max(others, default=-np.inf) > CLEARLY else None
