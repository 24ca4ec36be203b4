"""Glass: where panes stand, from what their beams return.

Near its normal glass flashes: it returns many times the light of any diffuse wall, and the beams
next to the flash pass it, or return next to nothing. Three flashes that lie on each other's lines
show a line of glass. It is glass as far as beams pass it from a flash on.
"""

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Bool, Float, Int, cross
from lrf3d.mapping.robust.lit_scans import (
    BRIGHT,
    DEVIATION,
    FREE,
    PIECE,
    PIECES,
    RANGE,
    SHORTEST,
    UX,
    UY,
    LitScan,
    LitScans,
    runs,
    stretches,
    way_to_first,
)

FLASH, DIM = 5.0, 0.04
"""[usual brightness] A return is a flash above the one and dim below the other. Diffuse walls reach
about 3 at most, glass some hundreds and, askew, about a hundredth."""

BESIDE = np.radians(1.5), np.radians(20.0)
"""[rad] How far off a flash beams show what stands next to it."""

LEAST_SHOWN, MOST_OPAQUE = 3, 0.3
"""[beams, share] A flash is of glass if so many of these pass or are dim, and fewer than this part
of them return from the line of the flash as from a wall: metal and retro-reflectors do."""

ON_LINE, DEVIATIONS = 0.1, 3.0
"""[m, deviations] How far off a line a return of it may lie, and beside this by the noise."""

PASSED = 0.1
"""[m] A beam passes a line if it goes on by more than this and the former."""

FLASH_ANGLE = 0.04
"""[rad] How much the normals of two flashes of a pane differ at most: the lobe, and beams."""

LOOSE, STEADY, FARTHEST = 0.015, 0.005, 0.3
"""[rad, rad, m] How far off a line other flashes may lie by its direction, that of one flash and
that of several, and at most."""

LONGEST_GAP = 8.0
"""[m] Between two flashes of a pane."""

LEAST_FLASHES, NEAREST_FLASH = 3, 0.05
"""[flashes, m] A line is looked at from so many flashes on. Nearer to one that is known another one
shows nothing."""

GRAZING = 0.26
"""[cosine] Beams at 75° and more from the normal are mirrored as much as they pass."""

FLASHING = np.cos(np.radians(0.55))
"""[cosine] A beam that passes so near the normal shows that no glass is there: it would flash."""

PASSED_SHARE = 0.6
"""[share] Beams pass so many of the pieces of a pane: it is seen through."""

FRAME_DISTANCE, FRAME_SINE = 0.3, 0.3
"""[m, sine] A wall ends a pane whose line it reaches so nearly or crosses, no flatter."""

LOOK_AGAIN = 8
"""[scans] After so many more kept scans a line is looked at again."""


@compiled
def count_at_line(
    places: Float, rays: Float, point: Float, unit: Float, mirrors: Float, pieces: Float,
    reach: Float,
) -> None:  # fmt: skip
    """Count what beams did at each piece of a line.

    Args:
        places: (k, 2) where scans were taken [m].
        rays: (k, n, 7) their rays.
        point: (2,) the middle of the line's pieces [m].
        unit: (2,) its direction.
        mirrors: (m, 4) segments that turn beams [m]: beyond they show nothing.
        pieces: (PIECES, 5) is added to: returns as of glass, beams that passed, returns as of a
            wall, beams that passed where glass would have flashed, and those that were turned.
        reach: (PIECES, 2) is widened to the stations [m] of the returns of glass.
    """
    half = 0.5 * PIECE * PIECES
    for scan in range(len(places)):
        x, y = point[0] - places[scan, 0], point[1] - places[scan, 1]
        away = unit[0] * y - unit[1] * x
        middle = unit[0] * x + unit[1] * y
        for beam in range(rays.shape[1]):
            ray = rays[scan, beam]
            across = unit[0] * ray[UY] - unit[1] * ray[UX]
            if across == 0.0 or away / across <= 0.0:
                continue
            way, cos = away / across, abs(across)
            tolerance = ON_LINE + DEVIATIONS * ray[DEVIATION] * cos
            farther = (ray[FREE] - way) * cos
            station = way * (unit[0] * ray[UX] + unit[1] * ray[UY]) - middle
            if farther < -tolerance or abs(station) >= half:
                continue
            piece = int(np.floor((station + half) / PIECE))
            if len(mirrors) and way_to_first(places[scan], ray, mirrors) < way:
                pieces[piece, 4] += 1.0
                continue
            if farther < tolerance:
                if ray[RANGE] <= 0.0:
                    continue
                if ray[BRIGHT] < DIM * cos or (ray[BRIGHT] > FLASH and cos > 1.0 - FLASH_ANGLE**2):
                    pieces[piece, 0] += 1.0
                    reach[piece, 0] = min(reach[piece, 0], station)
                    reach[piece, 1] = max(reach[piece, 1], station)
                else:
                    pieces[piece, 2] += 1.0
            elif farther > tolerance + PASSED and cos > GRAZING:
                pieces[piece, 1] += 1.0
                pieces[piece, 3] += cos > FLASHING


class Glass:
    """Lines of flashes, and where they are glass.

    Attributes:
        segments: (s, 4) the panes [m].
    """

    def __init__(self) -> None:
        # Of each flash its place, the direction of its beam, and the deviation of its range.
        self._flashes = np.empty((0, 5))
        self._line_of: Int = np.empty(0, np.int64)
        self._panes: dict[int, Float] = {}
        self._looked: dict[int, int] = {}
        self.segments = np.empty((0, 4))

    def add(self, scan: LitScan) -> None:
        """Add the flashes of a scan."""
        bright = scan.rays[:, BRIGHT]
        peak = (bright > FLASH) & (bright > np.roll(bright, 1)) & (bright >= np.roll(bright, -1))
        peaks = np.flatnonzero(peak)
        if not len(peaks):
            return
        units, rays = scan.rays[:, [UX, UY]], scan.rays
        cos = units[peaks] @ units.T
        beside = (cos < np.cos(BESIDE[0])) & (cos > np.cos(BESIDE[1]))
        way = rays[peaks, RANGE, None] / np.maximum(cos, np.cos(BESIDE[1]))
        tolerance = ON_LINE + DEVIATIONS * rays[peaks, DEVIATION, None]
        on = beside & (rays[:, RANGE] > 0.0) & (np.abs(rays[:, RANGE] - way) * cos < tolerance)
        dim = on & (bright < DIM)
        passed = beside & (rays[:, FREE] > way + tolerance + PASSED)
        glass = np.zeros(len(peaks), np.bool_)
        # One side is enough: at the end of a pane a wall may follow.
        left = cross(units[peaks][:, None], units[None]) > 0.0
        for side in (left, ~left):
            shown = ((dim | passed) & side).sum(axis=1)
            opaque = (on & ~dim & side).sum(axis=1)
            glass |= (shown >= LEAST_SHOWN) & (opaque < MOST_OPAQUE * shown)
        for row in peaks[glass].tolist():
            self._add(np.array([*scan.ends[row], *units[row], rays[row, DEVIATION]]))

    def _add(self, flash: Float) -> None:
        """Add a flash to the line that it lies on, or begin another one."""
        apart = np.hypot(*(self._flashes[:, :2] - flash[:2]).T)
        if apart.min(initial=np.inf) < NEAREST_FLASH:
            return
        own = int(self._line_of.max(initial=-1)) + 1
        self._flashes = np.vstack([self._flashes, flash])
        self._line_of = np.append(self._line_of, own)
        for other in np.unique(self._line_of[:-1]).tolist():
            if self._on(other)[-1]:
                own = other
                break
        self._line_of[-1] = own
        # Others that lie on it now, as it is better known, are of the same line.
        taken = self._on(own)
        for other in np.unique(self._line_of[taken]).tolist():
            if other != own and taken[self._line_of == other].all():
                self._line_of[self._line_of == other] = own
                self._panes.pop(other, None)
        self._looked.pop(own, None)

    def line(self, number: int) -> tuple[Float, Float, float]:
        """A point (2,) of a line, its direction (2,), and how far its flashes reach [m]."""
        own = self._flashes[self._line_of == number]
        point = own[:, :2].mean(axis=0)
        unit = np.array([-own[0, 3], own[0, 2]])
        extent = float(np.ptp((own[:, :2] - point) @ unit))
        if extent > SHORTEST:
            unit = np.linalg.eigh(np.cov((own[:, :2] - point).T))[1][:, 1]
        return point, unit, extent

    def _on(self, number: int) -> Bool:
        """Which flashes (f,) lie on a line."""
        point, unit, extent = self.line(number)
        offset = self._flashes[:, :2] - point
        along = offset @ unit
        aside = np.abs(offset[:, 1] * unit[0] - offset[:, 0] * unit[1])
        own = along[self._line_of == number]
        turn = STEADY if extent > SHORTEST else LOOSE
        allowed = ON_LINE + DEVIATIONS * self._flashes[:, 4]
        allowed = allowed + np.minimum(turn * np.abs(along), FARTHEST)
        near = np.maximum(along - own.max(), own.min() - along) < LONGEST_GAP
        on: Bool = (aside < allowed) & near
        return on & (np.abs(self._flashes[:, 2:4] @ unit) < FLASH_ANGLE)

    def look(self, scans: LitScans, walls: Float, mirrors: Float) -> None:
        """Look at the line that was not looked at for longest through all kept scans.

        Args:
            scans: The kept scans.
            walls: (w, 4) the segments of the map [m].
            mirrors: (m, 4) the mirrors [m].
        """
        numbers, counts = np.unique(self._line_of, return_counts=True)
        due = {
            number: self._looked.get(number, 0)
            for number in numbers[counts >= LEAST_FLASHES].tolist()
            if self._looked.get(number, -LOOK_AGAIN) + LOOK_AGAIN <= scans.count
        }
        if not due:
            return
        number = min(due, key=due.__getitem__)
        self._looked[number] = scans.count
        point, unit, extent = self.line(number)
        if extent <= SHORTEST:
            return
        pieces, reach = np.zeros((PIECES, 5)), np.full((PIECES, 2), (np.inf, -np.inf))
        count_at_line(scans.places, scans.rays, point, unit, mirrors, pieces, reach)
        flashed = (self._flashes[self._line_of == number, :2] - point) @ unit
        # Scans that were not kept may have shown the flashes that reach farthest.
        places = np.floor(flashed / PIECE).astype(np.int64) + PIECES // 2
        inside = (places >= 0) & (places < PIECES)
        np.minimum.at(reach[:, 0], places[inside], flashed[inside])
        np.maximum.at(reach[:, 1], places[inside], flashed[inside])
        found = glass_pieces(pieces, flashed, frames(point, unit, walls))
        former = self._panes.get(number, np.empty((0, 4)))
        beams = pieces.sum(axis=1)
        self._panes[number] = stretches(found, reach, beams, former, point, unit)
        self.segments = np.concatenate([np.empty((0, 4)), *self._panes.values()])


def glass_pieces(pieces: Float, flashed: Float, ends: Float) -> Bool:
    """Which pieces (PIECES,) of a line are glass.

    Args:
        pieces: (PIECES, 5) what beams did at them, see `count_at_line`.
        flashed: Stations of flashes [m].
        ends: Stations at which walls meet the line: glass ends there.
    """
    shown, passed, opaque, missing, _ = pieces.T
    seeds, barriers = np.zeros((2, PIECES), np.bool_)
    for stations, chosen in ((flashed, seeds), (ends, barriers)):
        places = np.floor(stations / PIECE).astype(np.int64) + PIECES // 2
        chosen[places[(places >= 0) & (places < PIECES)]] = True
    good = (shown + passed > 0) & (opaque <= MOST_OPAQUE * (shown + passed))
    good &= (missing == 0) | (shown > 0)
    good |= seeds
    # What walls part are several runs.
    part, found = np.cumsum(barriers), np.zeros(PIECES, np.bool_)
    for number in np.unique(part[good]).tolist():
        for first, last in runs(good & (part == number)):
            lit = first + np.flatnonzero((shown > 0)[first:last] | seeds[first:last])
            if not seeds[first:last].any():
                continue
            own = slice(lit[0], lit[-1] + 1)
            if (passed[own] > 0).mean() >= PASSED_SHARE and passed[own].sum() >= LEAST_SHOWN:
                found[own] = True
    return found


def frames(point: Float, unit: Float, walls: Float) -> Float:
    """Stations [m] along a line, from a point (2,), at which walls (w, 4) end on it or cross it.

    Walls along the line are left out: they may be returns of the glass itself.
    """
    offset = walls.reshape(-1, 2, 2) - point
    along = offset @ unit
    aside = offset[:, :, 1] * unit[0] - offset[:, :, 0] * unit[1]
    rise = aside[:, 1] - aside[:, 0]
    upright = np.abs(rise) > FRAME_SINE * np.hypot(rise, along[:, 1] - along[:, 0])
    meets = upright & (
        (np.abs(aside).min(axis=1) < FRAME_DISTANCE) | (aside[:, 0] * aside[:, 1] < 0.0)
    )
    share = np.clip(-aside[meets, 0] / rise[meets], 0.0, 1.0)
    stations: Float = along[meets, 0] + share * (along[meets, 1] - along[meets, 0])
    return stations
