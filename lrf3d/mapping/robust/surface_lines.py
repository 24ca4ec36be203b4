"""Surface lines: which lines may be glass or mirrors, and what is found when they are looked at.

A wall of a scan and a segment of the map define the line that mirrors one into the other; a flash
is a return of a line across its beam. Most of these lines are nothing, since walls of rooms mirror
each other: `surfaces` decides.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.ground import DEPTH
from lrf3d.mapping.robust.light import BRIGHT, RANGE, UY
from lrf3d.mapping.robust.surfaces import (
    COUNTS,
    FLASH,
    PIECE,
    PIECES,
    belied_pieces,
    count_beams,
    glass_pieces,
    mirror_pieces,
    runs,
)

MOST_LINES = 256
"""[lines] Those that no scan has spoken for the longest are forgotten."""

LINES_A_SCAN, MOST_A_SCAN = 8, 64
"""[lines] How many lines of images of a scan count, those first that most of its walls agree on."""

LEAST_VOTES, MOST_VOTES, LOOK_AGAIN = 2, 50, 1.0 / 16.0
"""[votes] A line is looked at when so many scans speak for it, and with each new, the one first
that most speak for since; so many former ones count where a line is averaged; and what each look
adds to lines with glass or mirrors, of which no images are left that could speak for them."""

SHORTEST = 0.6
"""[m] Length of a pane or a mirror from which on it is found."""

PARALLEL_SINE = 0.2
"""[sine] Twice the sine of half the angle between two walls of which one may be the other's image:
walls at right angles to the mirror go on in theirs, and do not say where it is."""

IMAGE_DISTANCE = 0.15
"""[m] How far off a wall an image may lie when it is mirrored back."""

SAME_ANGLE, SAME_DISTANCE = np.radians(2.0), 0.1
"""[rad, m] Two lines nearer than this are one: the faces of a thin wall are two."""


class SurfaceLines:
    """The lines of glass and of mirrors, and the stretches of them that were found.

    `surfaces` (s, 5) are those [m], and whether each is a mirror.
    """

    def __init__(self) -> None:
        # Of each line: its unit normal, distance and middle, see `count_beams`; the votes for it,
        # in all and since it was looked at, and the number of the last one; and which pieces of it
        # are glass, or a mirror.
        self._lines = np.zeros((MOST_LINES, 4))
        self._votes, self._new_votes, self._last_votes = np.zeros((3, MOST_LINES))
        self._vote_count = 0
        self._pieces = np.zeros((MOST_LINES, PIECES), np.bool_)
        self._mirrors = np.zeros(MOST_LINES, np.bool_)
        self.surfaces = np.empty((0, 5))

    def add(self, place: Float, rays: Float, walls: Float, segments: Float) -> None:
        """Add the lines that rays (n, 9) and walls (w, 4) [m] of a scan speak for.

        These may be images of segments (m, 4) of the map.
        """
        lines, weights = np.empty((MOST_A_SCAN, 3)), np.empty(MOST_A_SCAN)
        count = find_lines(place, walls, segments, lines, weights)
        images = lines[np.argsort(-weights[:count], kind="stable")[:LINES_A_SCAN]]
        bright = rays[:, BRIGHT]
        peaks = (bright > FLASH) & (bright > np.roll(bright, 1)) & (bright >= np.roll(bright, -1))
        normals = -rays[peaks, : UY + 1]
        flashes = np.column_stack([normals, normals @ place - rays[peaks, RANGE]])
        for line in np.concatenate([flashes, images]):
            self._vote(place, line)

    def _vote(self, place: Float, line: Float) -> None:
        """Let a scan from a place (2,) speak for a line (3,)."""
        row = same_line(place, self._lines, line)
        if row < 0:
            # A free row, or that of the line last spoken for the longest ago.
            there = self._pieces.any(axis=1)
            row = int(np.argmin(np.where(there, np.inf, self._last_votes)))
            self._votes[row] = self._new_votes[row] = 0.0
            self._lines[row] = *line, line[1] * place[0] - line[0] * place[1]
        elif not self._mirrors[row]:
            own, votes = self._lines[row, :3], min(self._votes[row], MOST_VOTES)
            own *= votes
            own += line * np.sign(own[:2] @ line[:2])
            own /= np.hypot(own[0], own[1])
        self._vote_count += 1
        self._votes[row] += 1.0
        self._new_votes[row] += 1.0
        self._last_votes[row] = self._vote_count

    def look(self, places: Float, rays: Float, cells: Cells, ground: Float) -> bool:
        """Decide which pieces of the line with most new votes are glass, or a mirror.

        Returns whether that has changed anything.
        """
        self._new_votes[self._pieces.any(axis=1)] += LOOK_AGAIN
        due = np.where(self._votes >= LEAST_VOTES, self._new_votes, 0.0)
        row = int(np.argmax(due))
        if due[row] < 1.0:
            return False
        self._new_votes[row] = 0.0
        counts, former = np.zeros((PIECES, len(COUNTS))), self._pieces[row].copy()
        count_beams(self._lines[row], places, rays, cells, ground, counts)
        # What is seen through glass is darker as well.
        found, mirror = glass_pieces(counts), bool(self._mirrors[row])
        if mirror or not (found.any() or former.any()):
            found, mirror = mirror_pieces(counts), True
        self._pieces[row] = found | (former & ~belied_pieces(counts, mirror))
        self._mirrors[row] = mirror and self._pieces[row].any()
        if np.array_equal(former, self._pieces[row]):
            return False
        rows = np.flatnonzero(self._pieces.any(axis=1))
        self.surfaces = np.array([own for each in rows for own in self._stretches(int(each))])
        self.surfaces = self.surfaces.reshape(-1, 5)
        return True

    def _stretches(self, row: int) -> list[Float]:
        """The stretches x1 y1 x2 y2 [m] of a line, each with whether it is a mirror."""
        nx, ny, distance, middle = self._lines[row]
        foot, unit = distance * np.array([nx, ny]), np.array([ny, -nx])
        found, mirror = [], self._mirrors[row]
        # A pane ends anywhere in the last piece that showed it; at that of a mirror most beams did.
        inside = 0.0 if mirror else 0.5
        for first, last in runs(self._pieces[row]):
            low = middle + PIECE * (first + inside - PIECES // 2)
            high = middle + PIECE * (last - inside - PIECES // 2)
            if high - low > SHORTEST:
                found.append(np.array([*(foot + low * unit), *(foot + high * unit), mirror]))
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


@compiled
def find_lines(place: Float, walls: Float, segments: Float, lines: Float, weights: Float) -> int:
    """Find lines that mirror segments (m, 4) of a map into walls (w, 4) of a scan, and count them.

    Lines (k, 3) are filled with unit normals towards the laser and distances from the origin [m],
    weights (k,) with the lengths [m] that are shared.
    """
    count, line = 0, np.empty(3)
    for wall in range(len(walls)):
        for row in range(len(segments)):
            shared = image_line(place, walls[wall], segments[row], line)
            if shared <= 0.0:
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
        if abs(cos) > np.cos(SAME_ANGLE) and apart < least:
            least, found = apart, row
    return found
