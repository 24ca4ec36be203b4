"""Pane images: what panes mirror, taken back from the map when a pane becomes known later.

A pane mirrors little, except at grazing incidence, but where nothing else returns light this little
is measured, and drawn until the pane is known. Enter the returns of scans; of each cell of the
ground the brightest is kept, with the place from where it was seen. It is an image where it lies
behind the line of a pane as a wall of the map lies before it, and is as dark as Fresnel's equations
say. What leaves are segments without the parts where all returns are images.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Bool, Float, Int, cross, directions, lengths
from lrf3d.laser.light import shares
from lrf3d.mapping.robust.lit_beams import LitBeams
from lrf3d.mapping.robust.mirrors import LEAST_LEFT, Reflectance, cells_of, nearest_segments
from lrf3d.mapping.robust.optics_constants import (
    FLASH_SHARE,
    IMAGE_DISTANCE,
    IMAGE_LIGHT,
    PANE_DEPTH,
    PANE_GAP,
    PANE_INDEX,
)
from lrf3d.mapping.robust.panes import Panes, spreads

BESIDE = 2.0 * IMAGE_DISTANCE
"""[m] Farthest that a return lies off a segment which it is of, and off its ends."""

MOST_BLUR = 0.5
"""[m] Farthest that an image lies off because the line of its pane is not known better."""

DARKEST = 0.05
"""[share] Images of walls darker than this part of what is usual are not looked for."""

SHORTEST_LEFT = 0.5
"""[m] What is left of a segment beside its images stays from this length on."""

COSINES = np.linspace(0.0, 1.0, 1001)
"""Cosines of the incidence at which the shares are worked out that panes mirror."""

MIRRORED = np.array([shares(float(cos), 0.0, 0.0, 0.0, PANE_INDEX)[0] for cos in COSINES])
"""The share that a pane mirrors at each of these."""


class PaneImages:
    """The brightest return in each cell.

    Attributes:
        cells: (c,) the cells, in ascending order.
        returns: (c, 6) the place of each [m], where the laser was [m], its brightness and the
            standard deviation of its range [m].
    """

    def __init__(self) -> None:
        self.cells, self.returns = np.empty(0, np.int64), np.empty((0, 6))

    def add(self, beams: LitBeams) -> None:
        """Add the returns of a scan."""
        hit = np.flatnonzero((beams.ranges > 0.0) & (beams.intensities > 0.0))
        bright = beams.brightness()
        hit = hit[np.argsort(-bright[hit], kind="stable")]
        points = beams.place + beams.ranges[hit, None] * beams.units[hit]
        cells, first = np.unique(cells_of(points), return_index=True)
        hit, points = hit[first], points[first]
        lasers = np.broadcast_to(beams.place, points.shape)
        rows = np.column_stack([points, lasers, bright[hit], beams.deviations[hit]])
        places = np.searchsorted(self.cells, cells)
        known = places < len(self.cells)
        known[known] = self.cells[places[known]] == cells[known]
        brighter = known.copy()
        brighter[known] = rows[known, 4] > self.returns[places[known], 4]
        self.returns[places[brighter]] = rows[brighter]
        self.cells = np.insert(self.cells, places[~known], cells[~known])
        self.returns = np.insert(self.returns, places[~known], rows[~known], axis=0)

    def images(self, panes: Panes, walls: Float, known: Reflectance) -> Bool:
        """Which returns (c,) are images of walls (w, 4) [m] of which the reflectance is known."""
        found = np.zeros(len(self.cells), np.bool_)
        if not len(panes) or not len(walls):
            return found
        usual = panes.usual()
        places, lasers, bright = self.returns[:, :2], self.returns[:, 2:4], self.returns[:, 4]
        points, units = panes.lines()
        weight, spread = panes.moments[:, 0], spreads(panes.moments, units)
        brightest, darkest = IMAGE_LIGHT * FLASH_SHARE * usual, DARKEST * usual / IMAGE_LIGHT
        for row, (point, unit) in enumerate(zip(points, units, strict=True)):
            normal = np.array([-unit[1], unit[0]])
            before, behind = (lasers - point) @ normal, (places - point) @ normal
            rows = np.flatnonzero(before * behind < 0.0)
            before, behind = before[rows], behind[rows]
            way = places[rows] - lasers[rows]
            size = np.hypot(way[:, 0], way[:, 1])
            share, slope = before / (before - behind), np.abs(behind - before) / size
            stations = (lasers[rows] + share[:, None] * way - point) @ unit
            low = min(0.0, float(panes.reach[row, :, 0].min())) - PANE_GAP
            high = max(0.0, float(panes.reach[row, :, 1].max())) + PANE_GAP
            near = (stations > low) & (stations < high) & ((1.0 - share) * size > PANE_DEPTH)
            rows, slope, behind = rows[near], slope[near], behind[near]
            way = way[near] / size[near, None]
            image = places[rows] - 2.0 * behind[:, None] * normal
            mirrored = np.interp(slope, COSINES, MIRRORED) ** 2
            # Where the pane is known from elsewhere on its line, the image is twice as far off.
            along = stations[near] - (panes.moments[row, 1:3] - point) @ unit
            blur = np.minimum(2.0 * np.sqrt(1.0 / weight[row] + along**2 / spread[row]), MOST_BLUR)
            able = (bright[rows] < mirrored * brightest) & (bright[rows] > mirrored * darkest)
            rows, image, mirrored, blur = rows[able], image[able], mirrored[able], blur[able]
            turned = way[able] - 2.0 * (way[able] @ normal)[:, None] * normal
            apart, wall, cosine = nearest_segments(image, turned, walls)
            same = apart < IMAGE_DISTANCE + self.returns[rows, 5] + blur
            rows, image, wall = rows[same], image[same], walls[wall[same]]
            foot = np.einsum("ij,ij->i", image - wall[:, :2], directions(wall))
            foot = foot.clip(0.0, lengths(wall))[:, None] * directions(wall) + wall[:, :2]
            light = known.at(foot)
            expected = mirrored[same] * cosine[same] * np.where(np.isfinite(light), light, usual)
            ratio = bright[rows] / expected
            same = (ratio < IMAGE_LIGHT) & (ratio > 1.0 / IMAGE_LIGHT)
            found[rows[same]] = True
        return found

    def without(
        self, segments: Float, found: Bool, rays: Float, least: float, most: float
    ) -> tuple[Float, Int]:
        """Segments (m, 4) [m] without ends at which all returns are images.

        Args:
            segments: The segments, in the frame of the rays.
            found: (c,) which returns are images.
            rays: (c, 4) where the returns are and where the laser was [m].
            least: Other returns count from this brightness on …
            most: … up to this one, times the cosine of the incidence: brighter ones are of
                something else, as where beams meet a wall across along the segment.

        Returns:
            What (n, 4) is left, and of which segment each is.
        """
        sure = found | (self.returns[:, 4] > least)
        places, beams = rays[sure, :2], directions(rays[sure])
        found, bright = found[sure], self.returns[sure, 4]
        kept = segments.copy()
        of, by = beside(places, segments)
        unit = directions(segments)
        cosine = np.abs(cross(beams[of], unit[by]))
        own = found[of] | (cosine > bright[of] / most)
        of, by = of[own], by[own]
        left = np.ones(len(segments), np.bool_)
        for row in np.unique(by[found[of]]).tolist():
            segment, mine = segments[row], of[by == row]
            stations, image = (places[mine] - segment[:2]) @ unit[row], found[mine]
            order = np.argsort(stations, kind="stable")
            stations, real = stations[order], np.flatnonzero(~image[order])
            size = float(lengths(segment[None])[0])
            low, high = 0.0, 0.0
            if len(real):
                first, last = real[0], real[-1]
                # An end is as long as the returns there are images; the next one is of the wall.
                low = 0.5 * float(stations[first - 1] + stations[first]) if first else 0.0
                after = last + 1 < len(stations)
                high = 0.5 * float(stations[last] + stations[last + 1]) if after else size
                low, high = max(low, 0.0), min(high, size)
            left[row] = high - low >= min(LEAST_LEFT * size, SHORTEST_LEFT)
            way = segment[2:] - segment[:2]
            kept[row] = np.concatenate(
                [segment[:2] + low / size * way, segment[:2] + high / size * way]
            )
        return kept[left], np.flatnonzero(left)

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names; `restore` takes them back."""
        return {"bright_cells": self.cells.copy(), "bright_returns": self.returns.copy()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what was known."""
        self.cells, self.returns = state["bright_cells"].copy(), state["bright_returns"].copy()


def beside(points: Float, segments: Float) -> tuple[Int, Int]:
    """Which points (n, 2) lie by which segments (m, 4) [m]: rows of points, by rising segment."""
    order = np.argsort(points[:, 0], kind="stable")
    x, reach = points[order, 0], 2.0 * BESIDE
    first = np.searchsorted(x, segments[:, [0, 2]].min(axis=1) - reach)
    count = np.searchsorted(x, segments[:, [0, 2]].max(axis=1) + reach) - first
    row = np.repeat(np.arange(len(segments)), count)
    of = order[np.arange(len(row)) + np.repeat(first - np.cumsum(count) + count, count)]
    unit, offset = directions(segments)[row], points[of] - segments[row, :2]
    along = np.einsum("ij,ij->i", offset, unit)
    near = np.abs(cross(unit, offset)) < BESIDE
    near &= (along > -BESIDE) & (along < lengths(segments)[row] + BESIDE)
    return of[near], row[near]
