"""Surface lines: which lines may be glass or mirrors, when beams are counted there, and what is.

A wall of a scan and a segment of the map define the line that mirrors one into the other; flashes
define lines of glass. Most lines of images are no mirrors, since walls of rooms mirror each other:
what beams do there decides; see `surfaces`.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float
from lrf3d.mapping.robust.flashes import Flashes
from lrf3d.mapping.robust.ground import DEPTH, Ground
from lrf3d.mapping.robust.light import LitScans
from lrf3d.mapping.robust.surfaces import (
    COLUMNS,
    PIECE,
    PIECES,
    count_beams,
    glass_pieces,
    mirror_pieces,
    pieces_at,
    stretches,
)

MOST_LINES = 256
"""[lines] Those that fewest scans speak for are forgotten."""

LINES_A_SCAN, MOST_A_SCAN = 8, 64
"""[lines] How many lines of images of a scan count, those first that most of its walls agree on."""

LEAST_VOTES = 3
"""[scans] A line is looked at when so many scans, or flashes, speak for it."""

LOOKS, LOOK_AGAIN = 2, 16
"""[lines, scans] Lines that are looked at with each kept scan; one with glass or a mirror is after
so many again."""

FRAME_DISTANCE, FRAME_SINE = 0.3, 0.3
"""[m, sine] A wall ends a pane whose line it reaches so nearly or crosses, no flatter."""

PARALLEL_SINE = 0.2
"""[sine] Twice the sine of half the angle between two walls of which one may be the other's image:
walls at right angles to the mirror go on in theirs, and do not say where it is."""

IMAGE_DISTANCE = 0.15
"""[m] How far off a wall an image may lie when it is mirrored back."""

SAME_ANGLE, SAME_DISTANCE = np.radians(2.0), 0.1
"""[rad, m] Two lines nearer than this are one: the faces of a thin wall are two."""


class SurfaceLines:
    """The lines of glass and of mirrors.

    Attributes:
        glass: (g, 5) the panes [m], and the line of each.
        mirrors: (m, 5) the mirrors [m], seen from their left, and the line of each.
    """

    def __init__(self) -> None:
        self._lines, self._mirrors = (
            np.zeros((MOST_LINES, 3)),
            np.zeros(MOST_LINES, np.bool_),
        )
        # How many scans or flashes speak for each line, and the scans when the last one did and
        # when it was looked at; its number among the lines of flashes; and what was found there.
        self._votes, self._voted, self._looked = np.zeros((3, MOST_LINES))
        self._flash_lines = np.full(MOST_LINES, -1)
        self._found = [np.empty((0, 4))] * MOST_LINES
        self.glass = self.mirrors = np.empty((0, 5))

    def add_images(self, number: int, place: Float, walls: Float, segments: Float) -> None:
        """Add the lines that mirror segments (m, 4) of the map into walls (w, 4) of a scan [m]."""
        lines, weights = np.empty((MOST_A_SCAN, 3)), np.empty(MOST_A_SCAN)
        count = find_lines(place, walls, segments, lines, weights)
        for choice in np.argsort(-weights[:count], kind="stable")[:LINES_A_SCAN].tolist():
            known = np.where(self._mirrors[:, None], self._lines, 0.0)
            row = same_line(place, known, lines[choice])
            if row < 0:
                row = self._new_row()
                self._mirrors[row], self._lines[row] = True, lines[choice]
            else:
                votes = min(self._votes[row], 50.0)
                mixed = votes * self._lines[row] + lines[choice]
                self._lines[row] = mixed / np.hypot(mixed[0], mixed[1])
            self._votes[row] += 1.0
            self._voted[row] = number

    def _new_row(self) -> int:
        """A free row; where there is none, that of the line that least speaks for."""
        kept = np.array([len(found) > 0 for found in self._found])
        row = int(np.argmin(np.where(kept, np.inf, self._votes)))
        self._votes[row] = self._looked[row] = self._lines[row] = 0.0
        self._mirrors[row], self._flash_lines[row] = False, -1
        return row

    def _add_flashes(self, number: int, flashes: Flashes) -> None:
        """Add the lines of flashes."""
        numbers, counts = np.unique(flashes.line_of, return_counts=True)
        for row in np.flatnonzero(self._flash_lines >= 0).tolist():
            if self._flash_lines[row] not in numbers:
                self._found[row], self._votes[row] = np.empty((0, 4)), 0.0
                self._flash_lines[row] = -1
        for name, count in zip(numbers.tolist(), counts.tolist(), strict=True):
            if count >= LEAST_VOTES:
                rows = np.flatnonzero(self._flash_lines == name)
                row = int(rows[0]) if len(rows) else self._new_row()
                if count > self._votes[row]:
                    self._flash_lines[row], self._votes[row], self._voted[row] = (
                        name,
                        count,
                        number,
                    )

    def look(self, scans: LitScans, flashes: Flashes, walls: Float, ground: Ground) -> bool:
        """Look at the lines that are due through all kept scans; returns whether mirrors changed.

        Args:
            scans: The kept scans.
            flashes: The flashes of glass.
            walls: (w, 4) the segments of the map [m].
            ground: What is known to be where.
        """
        self._add_flashes(scans.count, flashes)
        former = self.mirrors
        age = scans.count - self._looked
        there = np.array([len(found) > 0 for found in self._found])
        due = (self._voted > self._looked) & (self._votes >= LEAST_VOTES)
        due |= there & (age > LOOK_AGAIN)
        for row in np.argsort(-(due * self._votes * age), kind="stable")[:LOOKS].tolist():
            if due[row]:
                self._looked[row] = scans.count
                self._look(row, scans, flashes, walls, ground)
        return not np.array_equal(former, self.mirrors)

    def _look(
        self, row: int, scans: LitScans, flashes: Flashes, walls: Float, ground: Ground
    ) -> None:
        """Decide which stretches of a line are glass, or a mirror."""
        flashed = np.empty((0, 2))
        place = scans.newest_place
        if not self._mirrors[row]:
            place, unit, flashed = flashes.line(int(self._flash_lines[row]))
            self._lines[row] = (
                -unit[1],
                unit[0],
                unit[0] * place[1] - unit[1] * place[0],
            )
        line, mirror = self._lines[row], bool(self._mirrors[row])
        middle = float(line[1] * place[0] - line[0] * place[1])
        pieces, reach = (
            np.zeros((PIECES, COLUMNS)),
            np.full((PIECES, 2), (np.inf, -np.inf)),
        )
        blocking = np.concatenate([self.glass, self.mirrors])
        kept = scans.rows(newest=False)[:2]
        count_beams(line, middle, float(row), mirror, kept, blocking, ground, pieces, reach)
        if mirror:
            found = mirror_pieces(pieces) & (not self._is_glass(place, line))
        else:
            stations = flashed @ [line[1], -line[0]] - middle
            stations = stations[np.abs(stations) < 0.5 * PIECE * PIECES]
            # Scans that were not kept may have shown the flashes that reach farthest.
            np.minimum.at(reach[:, 0], pieces_at(stations), stations)
            np.maximum.at(reach[:, 1], pieces_at(stations), stations)
            found = glass_pieces(pieces, stations, frames(line, middle, walls))
        self._found[row] = stretches(line, middle, pieces, reach, found, self._found[row])
        self._collect()

    def _is_glass(self, place: Float, line: Float) -> bool:
        """Whether flashes lie on a line (3,): what is seen through glass is darker as well."""
        glass = self._lines[self._flash_lines >= 0]
        side = np.sign(glass[:, :2] @ place - glass[:, 2])
        return same_line(place, glass * side[:, None], line) >= 0

    def _collect(self) -> None:
        """The panes and the mirrors of all lines."""
        rows = np.repeat(np.arange(MOST_LINES), [len(found) for found in self._found])
        all_found = np.column_stack([np.concatenate(self._found), rows])
        mirror = self._mirrors[rows]
        self.glass, self.mirrors = all_found[~mirror], all_found[mirror]


def frames(line: Float, middle: float, walls: Float) -> Float:
    """Stations [m] along a line (3,), from its middle, at which walls (w, 4) end on it or cross it.

    Walls along the line are left out: they may be returns of the glass itself.
    """
    nx, ny, distance = line
    ends = walls.reshape(-1, 2, 2)
    along = ends @ [ny, -nx] - middle
    aside = ends @ [nx, ny] - distance
    rise = aside[:, 1] - aside[:, 0]
    upright = np.abs(rise) > FRAME_SINE * np.hypot(rise, along[:, 1] - along[:, 0])
    meets = upright & (
        (np.abs(aside).min(axis=1) < FRAME_DISTANCE) | (aside[:, 0] * aside[:, 1] < 0.0)
    )
    share = np.clip(-aside[meets, 0] / rise[meets], 0.0, 1.0)
    stations: Float = along[meets, 0] + share * (along[meets, 1] - along[meets, 0])
    return stations


@inner
def image_line(place: Float, wall: Float, real: Float, line: Float) -> float:
    """Write the line (3,) that mirrors a segment (4,) of the map into a wall (4,) of a scan.

    Returns:
        The length [m] that the mirrored wall and the segment share, 0 where there is no such line.
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
    """Find lines that mirror segments (m, 4) of a map into walls (w, 4) of a scan.

    Args:
        place: Where the laser is [m].
        walls: The walls [m].
        segments: The segments [m].
        lines: (k, 3) is filled: unit normals towards the laser, and distances from the origin [m].
        weights: (k,) is filled with the lengths [m] that are shared.

    Returns:
        The number of lines.
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
        if cos > np.cos(SAME_ANGLE) and apart < least:
            least, found = apart, row
    return found
