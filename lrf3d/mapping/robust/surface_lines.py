"""Surface lines: which lines may be glass or mirrors, and what is found when they are looked at.

A wall of a scan and a segment of the map define the line that mirrors one into the other. Near its
normal glass flashes: it returns many times the light of any diffuse wall, and the beams next to the
flash pass it, or return next to nothing; flashes on each other's lines define one of glass. Most
lines of images are no mirrors, since walls of rooms mirror each other: `surfaces` decides.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.ground import DEPTH, reflectance_at
from lrf3d.mapping.robust.light import BRIGHT, DEVIATION, FREE, RANGE, UX, UY, LitScans
from lrf3d.mapping.robust.surfaces import (
    COUNTS,
    DEVIATIONS,
    DIM,
    DIMMED,
    FLASH,
    FLASH_ANGLE,
    MOST_OPAQUE,
    ON_LINE,
    PASSED_BY,
    PIECES,
    SHORTEST,
    count_beams,
    stretches,
)

MOST_LINES = 256
"""[lines] Those that no scan has spoken for the longest are forgotten."""

LINES_A_SCAN, MOST_A_SCAN = 8, 64
"""[lines] How many lines of images of a scan count, those first that most of its walls agree on."""

LEAST_VOTES, MOST_VOTES, LOOK_AGAIN = 3, 50, 1.0 / 16.0
"""[votes] A line is looked at when so many scans, or a flash less, speak for it, and with each new,
the one first that most speak for since; so many former ones count where a line of images is
averaged; and what each look adds to lines with glass or mirrors, of which no images are left that
could speak for them."""

BESIDE = np.radians(1.5), np.radians(20.0)
"""[rad] How far off a flash beams show what stands next to it."""

LEAST_SHOWN = 3
"""[beams] A flash is of glass if on one side so many of these pass or are dim, and few of them
return from the line of the flash as from a wall: metal and retro-reflectors do."""

LOOSE, STEADY, FARTHEST = 0.015, 0.005, 0.3
"""[rad, rad, m] How far off a line other flashes may lie by its direction, that of one flash and
that of several, and at most."""

LONGEST_GAP = 8.0
"""[m] Between two flashes of a pane."""

PARALLEL_SINE = 0.2
"""[sine] Twice the sine of half the angle between two walls of which one may be the other's image:
walls at right angles to the mirror go on in theirs, and do not say where it is."""

IMAGE_DISTANCE = 0.15
"""[m] How far off a wall an image may lie when it is mirrored back."""

SAMPLES = 8
"""Places along a wall at which it is compared how bright it is."""

SAME_ANGLE, SAME_DISTANCE = np.radians(2.0), 0.1
"""[rad, m] Two lines nearer than this are one: the faces of a thin wall are two."""

NO_POINTS, NO_SURFACES = np.empty((0, 2)), np.empty((0, 5))


class SurfaceLines:
    """The lines of glass and of mirrors, and the stretches of them that were found.

    `surfaces` (s, 5) are those [m], mirrors seen from their left, and whether each is a mirror.
    """

    def __init__(self) -> None:
        # Of each line: its unit normal, distance and middle, see `count_beams`; the votes for it,
        # in all and since it was looked at, and the number of the last one; its flashes, none where
        # it is of images; how far these are from the middle; and its stretches.
        self._lines, self._extents = np.zeros((MOST_LINES, 4)), np.zeros(MOST_LINES)
        self._votes, self._new_votes, self._last_votes = np.zeros((3, MOST_LINES))
        self._vote_count = 0
        self._flashes, self._found = [NO_POINTS] * MOST_LINES, [NO_SURFACES] * MOST_LINES
        self._flashed, self._there = np.zeros((2, MOST_LINES), np.bool_)
        self.surfaces = NO_SURFACES

    def add_images(
        self, place: Float, walls: Float, segments: Float, cells: Cells, ground: Float
    ) -> None:
        """Add the lines that mirror segments (m, 4) of the map into walls (w, 5) of a scan [m].

        The fifth is how reflective each wall is.
        """
        lines, weights = np.empty((MOST_A_SCAN, 3)), np.empty(MOST_A_SCAN)
        count = find_lines(place, walls, segments, cells, ground, lines, weights)
        for choice in np.argsort(-weights[:count], kind="stable")[:LINES_A_SCAN].tolist():
            row = same_line(place, self._lines * ~self._flashed[:, None], lines[choice])
            if row < 0:
                row = self._new_row()
            if self._there[row]:
                # Its images are not extracted any more: these are of something else.
                continue
            line = min(self._votes[row], MOST_VOTES) * self._lines[row, :3] + lines[choice]
            nx, ny, distance = line / np.hypot(line[0], line[1])
            self._lines[row] = nx, ny, distance, ny * place[0] - nx * place[1]
            self._vote(row)

    def add_flashes(self, place: Float, rays: Float) -> None:
        """Add the flashes of a scan to the lines that they lie on, or begin others."""
        flashes = np.empty((len(rays), 5))
        for flash in flashes[: find_flashes(place, rays, flashes)]:
            point, unit, deviation = flash[:2], flash[2:4], flash[4]
            nx, ny, distance, middle = self._lines.T
            along = np.abs(ny * point[0] - nx * point[1] - middle)
            turn = np.where(self._extents > SHORTEST, STEADY, LOOSE)
            allowed = ON_LINE + DEVIATIONS * deviation + np.minimum(turn * along, FARTHEST)
            aside = np.abs(nx * point[0] + ny * point[1] - distance)
            on = self._flashed & (aside < allowed) & (along < self._extents + LONGEST_GAP)
            on &= np.abs(nx * unit[0] + ny * unit[1]) > np.cos(FLASH_ANGLE)
            row = int(np.argmax(on * self._votes)) if on.any() else self._new_row()
            points = self._flashes[row] = np.vstack([self._flashes[row], point])
            mean, normal = points.mean(axis=0), self._lines[row, :2] if on.any() else unit
            if np.ptp(points @ [normal[1], -normal[0]]) > SHORTEST:
                normal = np.linalg.eigh(np.cov((points - mean).T))[1][:, 0]
            across = np.array([normal[1], -normal[0]])
            self._lines[row] = *normal, normal @ mean, across @ mean
            self._extents[row] = np.abs((points - mean) @ across).max()
            self._flashed[row] = True
            self._vote(row)

    def _vote(self, row: int) -> None:
        self._vote_count += 1
        self._votes[row] += 1.0
        self._new_votes[row] += 1.0
        self._last_votes[row] = self._vote_count

    def _new_row(self) -> int:
        """A free row; where there is none, that of the line last spoken for the longest ago."""
        row = int(np.argmin(np.where(self._there, np.inf, self._last_votes)))
        self._votes[row] = self._new_votes[row] = self._lines[row] = self._extents[row] = 0.0
        self._flashes[row], self._found[row] = NO_POINTS, NO_SURFACES
        self._flashed[row] = False
        return row

    def look(self, scans: LitScans, cells: Cells, ground: Float) -> Float:
        """Decide which stretches of the line with most new votes are glass, or a mirror.

        Returns the stretches (c, 5) that were there before or are now; none if nothing changed.
        """
        self._new_votes[self._there] += LOOK_AGAIN
        due = np.where(self._votes >= LEAST_VOTES - self._flashed, self._new_votes, 0.0)
        row = int(np.argmax(due))
        if due[row] < 1.0:
            return NO_SURFACES
        self._new_votes[row] = 0.0
        line, glass, former = self._lines[row], bool(self._flashed[row]), self._found[row]
        pieces = np.zeros((PIECES, len(COUNTS)))
        reach = np.full((PIECES, 2), (np.inf, -np.inf))
        count_beams(line, not glass, scans.rows(newest=False), cells, ground, pieces, reach)
        ends = stretches(line, not glass, pieces, reach, former[:, :4])
        if self._is_known_glass(row):
            ends = ends[:0]
        self._found[row] = np.column_stack([ends, np.full(len(ends), float(not glass))])
        self._there[row] = len(ends) > 0
        if np.array_equal(former, self._found[row]):
            return NO_SURFACES
        self.surfaces = np.concatenate(self._found)
        return np.concatenate([former, self._found[row]])

    def _is_known_glass(self, row: int) -> bool:
        """Whether a line is that of a pane: what is seen through glass is darker as well."""
        line = self._lines[row]
        place = line[2] * line[:2] + line[3] * np.array([line[1], -line[0]])
        panes = self._flashed & self._there & (self._votes > self._votes[row] * self._flashed[row])
        sides = np.sign(self._lines[:, :2] @ line[:2])
        return same_line(place, self._lines * (sides * panes)[:, None], line) >= 0


@compiled
def find_flashes(place: Float, rays: Float, flashes: Float) -> int:
    """Find the flashes of glass in the rays (n, 9) of a scan; returns their number.

    Flashes (n, 5) are filled with their places, the units of their beams, and the deviations of
    their ranges [m].
    """
    found, (nearest, farthest) = 0, BESIDE
    for row in range(len(rays)):
        ray, bright = rays[row], rays[row, BRIGHT]
        if bright < FLASH or bright <= rays[row - 1, BRIGHT]:
            continue
        if bright < rays[(row + 1) % len(rays), BRIGHT]:
            continue
        tolerance = ON_LINE + DEVIATIONS * ray[DEVIATION]
        shown, opaque = np.zeros(2), np.zeros(2)
        for other in rays:
            cos = ray[UX] * other[UX] + ray[UY] * other[UY]
            if not np.cos(farthest) < cos < np.cos(nearest):
                continue
            side = int(ray[UX] * other[UY] > ray[UY] * other[UX])
            way = ray[RANGE] / cos
            if other[FREE] > way + tolerance + PASSED_BY:
                shown[side] += 1.0
            elif other[RANGE] > 0.0 and abs(other[RANGE] - way) * cos < tolerance:
                dim = other[BRIGHT] < DIM
                shown[side] += dim
                opaque[side] += not dim
        # One side is enough: at the end of a pane a wall may follow.
        if ((shown >= LEAST_SHOWN) & (opaque < MOST_OPAQUE * shown)).any():
            flashes[found, :2] = place + ray[RANGE] * ray[: UY + 1]
            flashes[found, 2:4], flashes[found, 4] = ray[: UY + 1], ray[DEVIATION]
            found += 1
    return found


@inner
def image_line(place: Float, wall: Float, real: Float, line: Float) -> float:
    """Write the line (3,) that mirrors a segment (4,) of the map into a wall (4,) of a scan.

    Returns the length [m] that they share, 0 where there is no such line.
    """
    ax, ay = wall[2] - wall[0], wall[3] - wall[1]
    bx, by = real[2] - real[0], real[3] - real[1]
    length, size = np.hypot(ax, ay), np.hypot(bx, by)
    if not (length > 0.0 and size > 0.0):
        return 0.0
    ax, ay, bx, by = ax / length, ay / length, bx / size, by / size
    # The normals of the two walls, (−y, x): a mirror turns both directions and sides.
    nx, ny = ay - by, bx - ax
    turn = np.hypot(nx, ny)
    if turn < PARALLEL_SINE:
        return 0.0
    nx, ny = nx / turn, ny / turn
    own = ax * wall[1] - ay * wall[0]
    other = bx * real[1] - by * real[0]
    distance = (own - other) / (2.0 * (ax * ny - ay * nx))
    ahead = nx * place[0] + ny * place[1] - distance
    if ahead < 0.0:
        nx, ny, distance, ahead = -nx, -ny, -distance, -ahead
    if ahead < DEPTH:
        return 0.0
    low, high = np.inf, -np.inf
    for end in range(2):
        x, y = wall[2 * end], wall[2 * end + 1]
        behind = nx * x + ny * y - distance
        x, y = x - 2.0 * behind * nx - real[0], y - 2.0 * behind * ny - real[1]
        if behind > DEPTH or abs(bx * y - by * x) > IMAGE_DISTANCE:
            return 0.0
        low, high = min(low, bx * x + by * y), max(high, bx * x + by * y)
    shared = min(high, size) - max(low, 0.0)
    line[0], line[1], line[2] = nx, ny, distance
    return shared if shared > 0.5 * length else 0.0


@inner
def _may_be_image(wall: Float, line: Float, cells: Cells, ground: Float) -> bool:
    """Whether a wall (5,) is as bright as an image in a line (3,), as far as that is known."""
    known = alike = 0
    for sample in range(SAMPLES):
        share = (sample + 0.5) / SAMPLES
        x, y = wall[0] + share * (wall[2] - wall[0]), wall[1] + share * (wall[3] - wall[1])
        behind = 2.0 * (line[0] * x + line[1] * y - line[2])
        own = reflectance_at(cells, ground, x - behind * line[0], y - behind * line[1])
        if own > 0.0:
            known += 1
            alike += DIMMED[0] * own < wall[4] < DIMMED[1] * own
    return 2 * alike >= known


@compiled
def find_lines(
    place: Float, walls: Float, segments: Float, cells: Cells, ground: Float, lines: Float,
    weights: Float,
) -> int:  # fmt: skip
    """Find lines that mirror segments (m, 4) of a map into walls (w, 5) of a scan, and count them.

    Lines (k, 3) are filled with unit normals towards the laser and distances from the origin [m],
    weights (k,) with the lengths [m] that are shared.
    """
    count, line = 0, np.empty(3)
    for wall in range(len(walls)):
        for row in range(len(segments)):
            shared = image_line(place, walls[wall], segments[row], line)
            if shared <= 0.0 or not _may_be_image(walls[wall], line, cells, ground):
                continue
            own = same_line(place, lines[:count], line)
            if own < 0:
                if count == len(lines):
                    continue
                own, count = count, count + 1
                lines[own] = line
                weights[own] = 0.0
            weights[own] += shared
    return count


@compiled
def same_line(place: Float, lines: Float, line: Float) -> int:
    """Which of lines (k, 3) is another one (3,), as seen from a place (2,): the nearest, or −1."""
    ahead = line[0] * place[0] + line[1] * place[1] - line[2]
    x, y = place[0] - ahead * line[0], place[1] - ahead * line[1]
    least, found = SAME_DISTANCE, -1
    for row in range(len(lines)):
        cos = lines[row, 0] * line[0] + lines[row, 1] * line[1]
        apart = abs(lines[row, 0] * x + lines[row, 1] * y - lines[row, 2])
        if cos > np.cos(SAME_ANGLE) and apart < least:
            least, found = apart, row
    return found
