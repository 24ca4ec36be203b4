"""Panes: where glass stands, from what its beams return.

Glass is seen in three ways. Near its normal it flashes: it returns many times the light of any
diffuse wall. Elsewhere it returns next to nothing, where nothing brighter is behind it, or is
passed. Flashes and dim returns enter; they are fitted to lines, and each beam that crosses one is
counted in pieces along it, as a return of glass, as passing, or as ending on something opaque.
Stretches leave that return light as glass does and that beams pass.

Brightness is relative to what is usual in the scans so far: intensities need no calibration.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions, lengths, principal_direction
from lrf3d.mapping.robust.dim_returns import DimReturns, Line
from lrf3d.mapping.robust.optics_constants import (
    BRIGHTNESSES,
    DIM_SHARE,
    FLASH_COSINE,
    FLASH_DEVIATION,
    FLASH_SHARE,
    LEAST_SHOWN,
    LONGEST_PAIRED,
    OPAQUE_SHARE,
    OPEN_COSINE,
    OPEN_DEVIATION,
    PANE_DEPTH,
    PANE_DEVIATIONS,
    PANE_DISTANCE,
    PANE_GAP,
    PANE_GRAZING_COSINE,
    PANE_PIECE,
    PANE_PIECES,
    SHORTEST_PANE,
    STEPS_AN_OCTAVE,
    USUAL_SHARE,
)
from lrf3d.mapping.segment_table import add_moments

DIM, FLASHED, PASSED, OPAQUE, OPEN, KINDS = 0, 1, 2, 3, 4, 5
"""What a beam that crosses the line of a pane does there: it returns dim light or a flash, passes,
ends on something opaque, or passes where glass would flash; and the number of these."""


class LitBeams(NamedTuple):
    """The beams of a scan with their light, by rising angle.

    Args:
        place: (2,) where the laser is [m].
        units: (n, 2) their unit vectors.
        ranges: (n,) measured ranges [m]; where nothing returned, 0.
        free: (n,) how far [m] each is free at least, from what is known.
        deviations: (n,) standard deviations of the ranges [m].
        intensities: (n,) intensities.
        usual: The usual brightness of a return.
    """

    place: Float
    units: Float
    ranges: Float
    free: Float
    deviations: Float
    intensities: Float
    usual: float

    def brightness(self) -> Float:
        """Their intensities (n,) as if from 1 m."""
        return self.intensities * self.ranges**2

    def returns(self, chosen: Bool) -> Float:
        """Some of the returns as `DimReturns` keeps them (k, 6)."""
        ranges, units = self.ranges[chosen], self.units[chosen]
        bright = self.brightness()[chosen] / self.usual
        places = self.place + ranges[:, None] * units
        return np.column_stack([places, units, self.deviations[chosen] ** 2, bright])

    def classes(self, cosine: Float | float = 1.0) -> tuple[Bool, Bool]:
        """Which beams (…, n) return a flash, and which are dim, beside what is usual.

        Args:
            cosine: That of the incidence, where it is known.
        """
        hit = (self.ranges > 0.0) & (self.intensities > 0.0)
        bright = self.brightness()
        flash, dim = bright > FLASH_SHARE * self.usual, bright < DIM_SHARE * self.usual * cosine
        return hit & flash, hit & dim


class Panes:
    """The lines on which glass may stand.

    Attributes:
        moments: (k, 6) moments of the returns on each line, as those of walls.
        pieces: (k, PANE_PIECES, KINDS) numbers of beams that cross each piece of it, by what they
            do there.
        reach: (k, PANE_PIECES, 2) the first and the last return of glass in each piece [m], along
            the line.
        anchors: (k, 4) where stations along it count from [m], and its direction when it was found.
        brightness: (BRIGHTNESSES,) how many returns had which brightness, by its logarithm.
        looked: (k,) the weight of each line when it last took up single returns.
    """

    def __init__(self) -> None:
        self.moments = np.empty((0, 6))
        self.pieces = np.empty((0, PANE_PIECES, KINDS), np.int64)
        self.reach = np.empty((0, PANE_PIECES, 2))
        self.anchors = np.empty((0, 4))
        self.brightness = np.zeros(BRIGHTNESSES, np.int64)
        self.looked = np.empty(0)

    def __len__(self) -> int:
        return len(self.moments)

    def usual_brightness(self, bright: Float) -> float:
        """The usual brightness of a return, which those of another scan (n,) add to."""
        steps = np.floor(STEPS_AN_OCTAVE * np.log2(bright)) + BRIGHTNESSES // 2
        np.add.at(self.brightness, steps.clip(0, BRIGHTNESSES - 1).astype(np.int64), 1)
        below = np.cumsum(self.brightness)
        step = int(np.searchsorted(below, USUAL_SHARE * below[-1]))
        return float(2.0 ** ((step + 0.5 - BRIGHTNESSES // 2) / STEPS_AN_OCTAVE))

    def add(self, ends: Float, moments: Float) -> None:
        """Add segments (m, 4) [m] that may be glass, with their moments (m, 6)."""
        for segment, moment in zip(ends, moments, strict=True):
            rows = self._match(segment, moment)
            if not rows:
                unit = principal_direction(*moment[3:])
                none = np.zeros((1, PANE_PIECES, KINDS), np.int64)
                empty = np.full((1, PANE_PIECES, 2), (np.inf, -np.inf))
                self.moments = np.vstack([self.moments, moment])
                self.pieces = np.concatenate([self.pieces, none])
                self.reach = np.concatenate([self.reach, empty])
                self.anchors = np.vstack([self.anchors, [*moment[1:3], *unit]])
                self.looked = np.append(self.looked, 0.0)
            else:
                self.moments[rows[0]] = add_moments(self.moments[rows[0]], moment)
                # Others that it fits are the same line only if they fit the first themselves.
                same = [other for other in rows[1:] if rows[0] in self._match(*self._seen(other))]
                for other in same:
                    self._merge(rows[0], other)
                self._keep(np.setdiff1d(np.arange(len(self)), same))

    def take_up(self, dim: DimReturns) -> None:
        """Take up single returns on lines that have become known, or better known."""
        for row in np.flatnonzero(self.moments[:, 0] > self.looked).tolist():
            # Each return that is taken up makes the line better known.
            while True:
                points, units = self.lines()
                low, high = float(self.reach[row, :, 0].min()), float(self.reach[row, :, 1].max())
                spread = float(_spread(self.moments[row : row + 1], units[row : row + 1])[0])
                own, mean = self.moments[row], self.moments[row, 1:3]
                line = Line(
                    points[row], units[row], mean, own[0], spread, min(low, 0.0), max(high, 0.0)
                )
                rows, stations = dim.near(line)
                place = np.floor(stations / PANE_PIECE).astype(np.int64) + PANE_PIECES // 2
                inside = (place >= 0) & (place < PANE_PIECES)
                rows, stations, place = rows[inside], stations[inside], place[inside]
                if not len(rows):
                    break
                for x, y, _, _, variance, _ in dim.returns[rows].tolist():
                    moment = np.array([1.0 / variance, x, y, 0.0, 0.0, 0.0])
                    self.moments[row] = add_moments(self.moments[row], moment)
                flashed = dim.take(rows)[:, 5] > 1.0
                np.add.at(self.pieces[row], (place, np.where(flashed, FLASHED, DIM)), 1)
                np.minimum.at(self.reach[row, :, 0], place, stations)
                np.maximum.at(self.reach[row, :, 1], place, stations)
            self.looked[row] = self.moments[row, 0]

    def lines(self) -> tuple[Float, Float]:
        """A point (k, 2) [m], from which stations count, and the unit direction (k, 2) of each."""
        angles = 0.5 * np.arctan2(2.0 * self.moments[:, 4], self.moments[:, 3] - self.moments[:, 5])
        units = np.column_stack([np.cos(angles), np.sin(angles)])
        units[np.einsum("ij,ij->i", units, self.anchors[:, 2:]) < 0.0] *= -1.0
        means = self.moments[:, 1:3]
        along = np.einsum("ij,ij->i", self.anchors[:, :2] - means, units)
        return means + along[:, None] * units, units

    def _seen(self, row: int) -> tuple[Float, Float]:
        """A line from its first return to its last (4,) [m], and its moments."""
        points, units = self.lines()
        low = min(0.0, float(self.reach[row, :, 0].min()))
        high = max(0.0, float(self.reach[row, :, 1].max()))
        ends = np.concatenate([points[row] + low * units[row], points[row] + high * units[row]])
        return ends, self.moments[row]

    def _merge(self, row: int, other: int) -> None:
        """Add what is known of a line to that of a row; the other one stays as it is."""
        points, units = self.lines()
        offset = float((points[other] - points[row]) @ units[row])
        sign = 1.0 if units[other] @ units[row] > 0.0 else -1.0
        middles = (np.arange(PANE_PIECES) + 0.5 - PANE_PIECES // 2) * PANE_PIECE
        places = np.floor((offset + sign * middles) / PANE_PIECE).astype(np.int64)
        places += PANE_PIECES // 2
        inside = (places >= 0) & (places < PANE_PIECES)
        np.add.at(self.pieces[row], places[inside], self.pieces[other, inside])
        reach = np.sort(offset + sign * self.reach[other], axis=1)
        known = inside & np.isfinite(reach).all(axis=1)
        np.minimum.at(self.reach[row, :, 0], places[known], reach[known, 0])
        np.maximum.at(self.reach[row, :, 1], places[known], reach[known, 1])
        self.moments[row] = add_moments(self.moments[row], self.moments[other])

    def _keep(self, rows: Int) -> None:
        """Keep some of the lines."""
        if len(rows) < len(self):
            self.moments, self.pieces = self.moments[rows], self.pieces[rows]
            self.reach, self.anchors = self.reach[rows], self.anchors[rows]
            self.looked = self.looked[rows]

    def _match(self, segment: Float, moment: Float) -> list[int]:
        """The lines that a segment is a part of, the best first."""
        if not len(self):
            return []
        points, units = self.lines()
        means, spread = self.moments[:, 1:3], _spread(self.moments, units)
        own = principal_direction(*moment[3:])
        turn = np.abs(units[:, 0] * own[1] - units[:, 1] * own[0])
        own_spread = float(_spread(moment[None], own[None])[0])
        allowed = PANE_DEVIATIONS * np.sqrt(1.0 / spread + 1.0 / own_spread)
        fits = turn < np.minimum(allowed, 0.5)
        stations = np.empty((2, len(self)))
        for end in range(2):
            offset = segment[2 * end : 2 * end + 2] - means
            along = np.einsum("ij,ij->i", offset, units)
            aside = np.abs(units[:, 0] * offset[:, 1] - units[:, 1] * offset[:, 0])
            variance = 1.0 / self.moments[:, 0] + along**2 / spread + 1.0 / moment[0]
            fits &= aside < PANE_DISTANCE + np.minimum(PANE_DEVIATIONS * np.sqrt(variance), 0.3)
            stations[end] = np.einsum("ij,ij->i", segment[2 * end : 2 * end + 2] - points, units)
        half = 0.5 * PANE_PIECE * PANE_PIECES
        fits &= np.abs(stations).max(axis=0) < half
        low, high = self.reach[:, :, 0].min(axis=1), self.reach[:, :, 1].max(axis=1)
        low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
        gap = np.maximum(stations.min(axis=0) - high, low - stations.max(axis=0))
        fits &= gap < PANE_GAP
        rows = np.flatnonzero(fits)
        found: list[int] = rows[
            np.argsort(gap.clip(0.0)[rows] + turn[rows], kind="stable")
        ].tolist()
        return found

    def count(self, beams: LitBeams, near: Int) -> Bool:
        """Count the beams (n,) of a scan that cross some lines (m,); which are returns of glass."""
        points, units = (part[near] for part in self.lines())
        crossing, stations, slope = crossings(beams.place, beams.units, points, units)
        flash, dim = beams.classes(slope)
        # What flashes askew is a retro-reflector.
        flash = flash & (slope > FLASH_COSINE)
        sure = _spread(self.moments[near], units) > OPEN_DEVIATION**-2.0
        tolerance = PANE_DISTANCE + 3.0 * beams.deviations * slope
        away = (beams.free - crossing) * slope
        place = np.floor(stations / PANE_PIECE).astype(np.int64) + PANE_PIECES // 2
        inside = (crossing > 0.0) & (place >= 0) & (place < PANE_PIECES)
        hit = inside & (np.abs(away) < tolerance) & (beams.ranges > 0.0)
        passed = inside & (away > tolerance + PANE_DEPTH) & (slope > PANE_GRAZING_COSINE)
        # Views: what is written to them is written to the pieces of all lines.
        pieces, reach = self.pieces.reshape(-1), self.reach.reshape(-1)
        rows = near[:, None] * PANE_PIECES + place
        for kind, chosen in (
            (DIM, hit & dim),
            (FLASHED, hit & flash),
            (PASSED, passed),
            (OPAQUE, hit & ~(dim | flash)),
            (OPEN, passed & (slope > OPEN_COSINE) & sure[:, None]),
        ):
            np.add.at(pieces, KINDS * rows[chosen] + kind, 1)
        chosen = hit & (dim | flash)
        np.minimum.at(reach, 2 * rows[chosen], stations[chosen])
        np.maximum.at(reach, 2 * rows[chosen] + 1, stations[chosen])
        counted: Bool = chosen.any(axis=0)
        return counted

    def segments(self) -> Float:
        """The stretches (s, 4) [m] that are glass."""
        points, units = self.lines()
        found = [
            np.hstack([point + low * unit, point + high * unit])
            for point, unit, pieces, reach in zip(
                points, units, self.pieces, self.reach, strict=True
            )
            for low, high in stretches(pieces, reach)
        ]
        return np.array(found).reshape(-1, 4)

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names; `restore` takes them back."""
        return {f"pane_{name}": values.copy() for name, values in vars(self).items()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what was known."""
        for name in vars(self):
            setattr(self, name, state[f"pane_{name}"].copy())


def grazed(beams: LitBeams, glass: Float) -> Float:
    """How far [m] the beams (n,) go to glass (s, 4) [m] that may turn them; infinity for none.

    Towards grazing incidence glass mirrors more than it lets through.
    """
    if not len(glass):
        return np.full(len(beams.free), np.inf)
    way, stations, slope = crossings(beams.place, beams.units, glass[:, :2], directions(glass))
    turned = (way > 0.0) & (slope < PANE_GRAZING_COSINE) & (beams.free > way + PANE_DEPTH)
    turned &= (stations >= 0.0) & (stations <= lengths(glass)[:, None])
    limits: Float = np.where(turned, way, np.inf).min(axis=0)
    return limits


def flashes(beams: LitBeams, flash: Bool) -> tuple[Float, Float]:
    """Segments (m, 4) and moments (m, 6) of the brightest beams of flashes.

    Each is met at a right angle: it is a point that knows its direction.
    """
    bright = np.where(flash, beams.brightness(), 0.0)
    before, after = np.roll(bright, 1), np.roll(bright, -1)
    peaks = np.flatnonzero(flash & (bright > before) & (bright >= after))
    points = beams.place + beams.ranges[peaks, None] * beams.units[peaks]
    sure = 1.0 / FLASH_DEVIATION**2
    x, y = -beams.units[peaks, 1], beams.units[peaks, 0]
    weight = beams.deviations[peaks] ** -2.0
    moments = np.column_stack([weight, points, sure * x * x, sure * x * y, sure * y * y])
    return np.hstack([points, points]), moments


def pairs(beams: LitBeams, dim: Bool) -> tuple[Float, Float]:
    """Segments (m, 4) and moments (m, 6) of two dim beams each that follow each other.

    Far walls return few beams, too few for a wall of a scan. Long runs are left out: these are.
    """
    edges = np.flatnonzero(np.diff(dim, prepend=False, append=False)).reshape(-1, 2)
    runs = edges[np.diff(edges, axis=1)[:, 0] <= LONGEST_PAIRED]
    first = np.array([k for low, high in runs for k in range(low, high - 1)], np.int64)
    ends = beams.place + beams.ranges[:, None] * beams.units
    one, other = ends[first], ends[first + 1]
    apart = other - one
    across = beams.ranges[first] * np.abs(_cross(beams.units[first], beams.units[first + 1]))
    size = np.hypot(apart[:, 0], apart[:, 1])
    sure = (size > 0.0) & (across > PANE_GRAZING_COSINE * size)
    one, apart = one[sure], apart[sure]
    variance = beams.deviations[first[sure]] ** 2
    weight = 0.5 / variance
    moments = np.column_stack(
        [
            2.0 / variance,
            one + 0.5 * apart,
            weight * apart[:, 0] ** 2,
            weight * apart[:, 0] * apart[:, 1],
            weight * apart[:, 1] ** 2,
        ]
    )
    return np.hstack([one, one + apart]), moments


def _cross(one: Float, other: Float) -> Float:
    """Cross products (m,) of vectors (m, 2)."""
    cross: Float = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return cross


def crossings(
    place: Float, units: Float, points: Float, along: Float
) -> tuple[Float, Float, Float]:
    """Where beams (n,) from a place (2,) cross lines (m,).

    Returns:
        (m, n) how far along the beam [m], where along the line [m], and the cosine of the
        incidence; for beams that go away from a line the first is not above 0.
    """
    x, y = points[:, 0] - place[0], points[:, 1] - place[1]
    across = along[:, :1] * units[:, 1] - along[:, 1:] * units[:, 0]
    safe = np.where(across == 0.0, 1e-300, across)
    way = (along[:, 0] * y - along[:, 1] * x)[:, None] / safe
    way = np.where((across == 0.0) | (way > 1e9), -1.0, way)
    run = along[:, :1] * units[:, 0] + along[:, 1:] * units[:, 1]
    stations = way * run - (along[:, 0] * x + along[:, 1] * y)[:, None]
    return way, stations, np.abs(across)


def stretches(pieces: Int, reach: Float) -> list[tuple[float, float]]:
    """From where to where [m] a line is glass.

    Args:
        pieces: (PANE_PIECES, KINDS) what beams did at each of its pieces.
        reach: (PANE_PIECES, 2) the first and the last return of glass in each.
    """
    shown = pieces[:, DIM] + pieces[:, FLASHED]
    opaque = pieces[:, OPAQUE] > OPAQUE_SHARE * (pieces[:, PASSED] + shown)
    there = np.flatnonzero((shown > 0) & ~opaque)
    barrier = np.concatenate([[0], np.cumsum(opaque | ((pieces[:, OPEN] > 0) & (shown == 0)))])
    found, first = [], 0
    for k in range(len(there)):
        last = there[k]
        ends = k + 1 == len(there)
        if not ends:
            after = there[k + 1]
            wide = (after - last) * PANE_PIECE > PANE_GAP
            ends = wide or barrier[after] - barrier[last + 1] > 0
        if ends:
            run = slice(there[first], last + 1)
            dim, flashed, passed, stopped, _ = pieces[run].sum(axis=0)
            glass = dim + flashed
            low, high = reach[there[first], 0], reach[last, 1]
            if (
                passed + glass >= LEAST_SHOWN
                and stopped < OPAQUE_SHARE * (passed + glass)
                and high - low > SHORTEST_PANE
            ):
                found.append((float(low), float(high)))
            first = k + 1
    return found


def _spread(moments: Float, units: Float) -> Float:
    """Spread (m,) of the returns of moments (m, 6) along directions (m, 2)."""
    x, y = units[:, 0], units[:, 1]
    spread: Float = moments[:, 3] * x * x + 2.0 * moments[:, 4] * x * y + moments[:, 5] * y * y
    return spread
