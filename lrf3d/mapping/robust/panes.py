"""Panes: where glass stands, from what its beams return.

Glass is seen in three ways. Near its normal it flashes: it returns many times the light of any
diffuse wall. Elsewhere it returns next to nothing, where nothing brighter is behind it, or is
passed. Flashes and dim returns enter; they are fitted to lines, and each beam that crosses one is
counted in pieces along it, as a return of glass, as passing, or as ending on something opaque.
Stretches leave that return light as glass does and that beams pass.

Brightness is relative to what is usual in the scans so far: intensities need no calibration.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions, lengths, principal_direction
from lrf3d.mapping.robust.dim_returns import DimReturns, Line
from lrf3d.mapping.robust.lit_beams import LitBeams, crossings
from lrf3d.mapping.robust.optics_constants import (
    BRIGHTNESSES,
    FLASH_COSINE,
    OPEN_COSINE,
    OPEN_DEVIATION,
    PANE_DEPTH,
    PANE_DEVIATIONS,
    PANE_DISTANCE,
    PANE_GAP,
    PANE_GRAZING_COSINE,
    PANE_PIECE,
    PANE_PIECES,
    STEPS_AN_OCTAVE,
    USUAL_SHARE,
)
from lrf3d.mapping.robust.pane_stretches import (
    DIM,
    FLASHED,
    KINDS,
    OPAQUE,
    OPEN,
    PASSED,
    frames,
    stretches,
)
from lrf3d.mapping.segment_table import add_moments


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
        return self.usual()

    def usual(self) -> float:
        """The usual brightness of a return so far."""
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
                spread = float(spreads(self.moments[row : row + 1], units[row : row + 1])[0])
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
        means, spread = self.moments[:, 1:3], spreads(self.moments, units)
        own = principal_direction(*moment[3:])
        turn = np.abs(units[:, 0] * own[1] - units[:, 1] * own[0])
        own_spread = float(spreads(moment[None], own[None])[0])
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
        sure = spreads(self.moments[near], units) > OPEN_DEVIATION**-2.0
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

    def segments(self, walls: Float) -> Float:
        """The stretches (s, 4) [m] that are glass, between walls (w, 4) that meet its line."""
        points, units = self.lines()
        found = [
            np.hstack([point + low * unit, point + high * unit])
            for point, unit, pieces, reach in zip(
                points, units, self.pieces, self.reach, strict=True
            )
            for low, high in stretches(pieces, reach, frames(point, unit, walls))
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


def spreads(moments: Float, units: Float) -> Float:
    """Spread (m,) of the returns of moments (m, 6) along directions (m, 2)."""
    x, y = units[:, 0], units[:, 1]
    spread: Float = moments[:, 3] * x * x + 2.0 * moments[:, 4] * x * y + moments[:, 5] * y * y
    return spread
