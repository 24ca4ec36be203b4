"""Surface lines: which lines may be glass or mirrors, when they are looked at, and what is found.

A wall of a scan and a segment of the map define the line that mirrors one into the other. Near its
normal glass flashes: it returns many times the light of any diffuse wall, and the beams next to the
flash pass it, or return next to nothing; flashes on each other's lines define one of glass. Most
lines of images are no mirrors, since walls of rooms mirror each other: `surfaces` decides.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int, cross
from lrf3d.mapping.robust.ground import DEPTH, Ground
from lrf3d.mapping.robust.light import BRIGHT, DEVIATION, FREE, RANGE, UX, UY, LitScan, LitScans
from lrf3d.mapping.robust.surfaces import (
    COLUMNS,
    DEVIATIONS,
    DIM,
    FLASH,
    FLASH_ANGLE,
    MOST_OPAQUE,
    ON_LINE,
    PASSED_BY,
    PIECE,
    PIECES,
    SHORTEST,
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

LOOKS, LOOK_AGAIN = 1, 16
"""[lines, scans] Lines that are looked at with each kept scan; one with glass or a mirror is after
so many again."""

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

NEAREST_FLASH = 0.05
"""[m] Nearer to one that is known another one shows nothing."""

FRAME_DISTANCE, FRAME_SINE = 0.3, 0.3
"""[m, sine] A wall ends a pane whose line it reaches so nearly or crosses, no flatter."""

PARALLEL_SINE = 0.2
"""[sine] Twice the sine of half the angle between two walls of which one may be the other's image:
walls at right angles to the mirror go on in theirs, and do not say where it is."""

IMAGE_DISTANCE = 0.15
"""[m] How far off a wall an image may lie when it is mirrored back."""

SAME_ANGLE, SAME_DISTANCE = np.radians(2.0), 0.1
"""[rad, m] Two lines nearer than this are one: the faces of a thin wall are two."""


class Flashes:
    """All flashes of glass so far, and the number of the line of each, `line_of` (f,)."""

    def __init__(self) -> None:
        # Of each its place, the direction of its beam, and the deviation of its range.
        self._flashes = np.empty((0, 5))
        self.line_of: Int = np.empty(0, np.int64)
        self._fits: dict[int, tuple[Float, Float, Float]] = {}

    def add(self, scan: LitScan) -> None:
        """Add the flashes of a scan."""
        rays, bright = scan.rays, scan.rays[:, BRIGHT]
        peak = (bright > FLASH) & (bright > np.roll(bright, 1)) & (bright >= np.roll(bright, -1))
        units = rays[:, [UX, UY]]
        places = scan.place + rays[:, RANGE, None] * units
        # Nearer to a flash that is known another one shows nothing.
        peaks = np.array(
            [row for row in np.flatnonzero(peak).tolist() if self._is_new(places[row])]
        )
        if not len(peaks):
            return
        cos = units[peaks] @ units.T
        beside = (cos < np.cos(BESIDE[0])) & (cos > np.cos(BESIDE[1]))
        way = rays[peaks, RANGE, None] / np.maximum(cos, np.cos(BESIDE[1]))
        tolerance = ON_LINE + DEVIATIONS * rays[peaks, DEVIATION, None]
        on = beside & (rays[:, RANGE] > 0.0) & (np.abs(rays[:, RANGE] - way) * cos < tolerance)
        dim = on & (bright < DIM)
        passed = beside & (rays[:, FREE] > way + tolerance + PASSED_BY)
        glass = np.zeros(len(peaks), np.bool_)
        # One side is enough: at the end of a pane a wall may follow.
        left = cross(units[peaks][:, None], units[None]) > 0.0
        for side in (left, ~left):
            shown = ((dim | passed) & side).sum(axis=1)
            opaque = (on & ~dim & side).sum(axis=1)
            glass |= (shown >= LEAST_SHOWN) & (opaque < MOST_OPAQUE * shown)
        for row in peaks[glass].tolist():
            if self._is_new(places[row]):
                self._add(np.array([*places[row], *units[row], rays[row, DEVIATION]]))

    def _is_new(self, place: Float) -> bool:
        apart = self._flashes[:, :2] - place
        return bool(((apart * apart).sum(axis=1) > NEAREST_FLASH**2).all())

    def _add(self, flash: Float) -> None:
        """Add a flash to the line that it lies on, or begin another one."""
        own = int(self.line_of.max(initial=-1)) + 1
        self._flashes = np.vstack([self._flashes, flash])
        self.line_of = np.append(self.line_of, own)
        for other in np.unique(self.line_of[:-1]).tolist():
            if self._on(other, slice(-1, None)).any():
                own = other
                break
        self.line_of[-1] = own
        self._fits.pop(own, None)
        # Others that lie on it now, as it is better known, are of the same line.
        taken = self._on(own)
        for other in np.unique(self.line_of[taken]).tolist():
            if other != own and taken[self.line_of == other].all():
                self.line_of[self.line_of == other] = own
                self._fits.pop(own, None)

    def line(self, number: int) -> tuple[Float, Float, Float]:
        """A point (2,) of a line, its direction (2,), and the places (f, 2) of its flashes [m]."""
        if number not in self._fits:
            own = self._flashes[self.line_of == number]
            point = own[:, :2].mean(axis=0)
            unit = np.array([-own[0, 3], own[0, 2]])
            if np.ptp((own[:, :2] - point) @ unit) > SHORTEST:
                unit = np.linalg.eigh(np.cov((own[:, :2] - point).T))[1][:, 1]
            self._fits[number] = point, unit, own[:, :2]
        return self._fits[number]

    def _on(self, number: int, rows: slice = slice(None)) -> Bool:
        """Which flashes (f,), of some, lie on a line."""
        point, unit, places = self.line(number)
        flashes = self._flashes[rows]
        offset, own = flashes[:, :2] - point, (places - point) @ unit
        along = offset @ unit
        aside = np.abs(cross(unit, offset))
        turn = STEADY if np.ptp(own) > SHORTEST else LOOSE
        allowed = ON_LINE + DEVIATIONS * flashes[:, 4]
        allowed = allowed + np.minimum(turn * np.abs(along), FARTHEST)
        near = np.maximum(along - own.max(), own.min() - along) < LONGEST_GAP
        on: Bool = (aside < allowed) & near
        return on & (np.abs(flashes[:, 2:4] @ unit) < FLASH_ANGLE)


class SurfaceLines:
    """The lines of glass and of mirrors.

    `glass` (g, 5) and `mirrors` (m, 5), seen from their left, are found [m]; the fifth is the line.
    """

    def __init__(self) -> None:
        self._lines, self._mirrors = np.zeros((MOST_LINES, 3)), np.zeros(MOST_LINES, np.bool_)
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
        self._found[row] = np.empty((0, 4))
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
        """Look at lines that are due through all kept scans; returns whether mirrors changed."""
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
        if cos > np.cos(SAME_ANGLE) and apart < least:
            least, found = apart, row
    return found
