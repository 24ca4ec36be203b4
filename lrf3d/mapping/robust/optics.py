"""Optics: glass and mirrors in a map, from the light of scans with intensities.

Scans enter with their intensities; what leaves are scans without what mirrors show, and a map in
which glass and mirrors stand in place of what beams, most of which pass or are turned, left of
them. Scans without intensities, or whose intensities are no light, change nothing here.
"""

from dataclasses import replace

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import GLASS, MIRROR, WALL, LineMap
from lrf3d.mapping.robust.beams import Frame
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.ground import DEPTH, PATCHES, SQUARES, find_real_parts, turn_beams
from lrf3d.mapping.robust.light import LitScans
from lrf3d.mapping.robust.surface_lines import NO_SURFACES, SurfaceLines
from lrf3d.mapping.robust.surfaces import GRAZING

ABSORBED, ABSORBED_DISTANCE, ABSORBED_SINE = 0.5, 0.12, 0.15
"""[share, m, sine] A segment of the map is a part of a pane or a mirror where so much of its length
lies by it, no farther off and no more askew."""

LOOKS = 2
"""[lines] Lines that are looked at with each kept scan."""

JOINS = 0.4
"""[m] A pane or a mirror is of the object of a wall whose end it reaches so nearly."""


class Optics:
    """What the scans so far have shown of glass and mirrors."""

    def __init__(self) -> None:
        self._scans, self._lines = LitScans(), SurfaceLines()
        self._ground = np.zeros((0, SQUARES + 1))

    def without_images(
        self, scan: LaserScan, place: tuple[float, float], heading: float
    ) -> LaserScan:
        """A scan from a place [m] with a heading [rad] in the map's frame, without images."""
        surfaces = self._lines.surfaces
        if scan.intensities is None or not len(surfaces):
            return scan
        turned = np.zeros(len(scan.angles), np.bool_)
        find_turned(np.array(place), scan.angles + heading, np.array(scan.ranges), surfaces, turned)
        if not turned.any():
            return scan
        return replace(
            scan, ranges=np.where(turned, -np.inf, scan.ranges), walls=np.full(len(turned), -1),
            intensities=None, echoes=None, echo_intensities=None,
        )  # fmt: skip

    def update(
        self, scan: LaserScan, pose: tuple[float, float, float], noise: RangeNoise, walls: Float,
        segments: Float, cells: Cells,
    ) -> None:  # fmt: skip
        """Learn from a scan, its walls (w, 4) around the laser, and segments (m, 4) of the map."""
        if not self._scans.keep(scan, pose, noise, walls):
            return
        missing = len(cells.passes) * PATCHES - len(self._ground)
        if missing > 0:
            self._ground = np.pad(self._ground, ((0, missing), (0, 0)))
        places, rays = self._scans.rows(newest=True)
        self._lines.add_flashes(places[0], rays[0])
        walls = np.column_stack([walls + np.tile(places[0], 2), self._scans.reflectances])
        self._lines.add_images(places[0], walls, segments, cells, self._ground)
        turn_beams(places, rays, NO_SURFACES, self._lines.surfaces, cells, self._ground)
        places, rays = self._scans.rows(newest=False)
        for _ in range(LOOKS):
            changed = self._lines.look(self._scans, cells, self._ground)
            if len(changed):
                turn_beams(places, rays, changed, self._lines.surfaces, cells, self._ground)

    def show(self, line_map: LineMap, frame: Frame, cells: Cells) -> LineMap:
        """A map in the world with what is known to be glass or a mirror in it."""
        surfaces = self._lines.surfaces
        if not len(surfaces):
            return line_map
        segments, rows = line_map.segments, np.arange(len(line_map))
        mirrors = surfaces[:, 4] > 0.0
        if mirrors.any():
            segments, rows = self._real_parts(segments, frame, cells)
        special, owners = frame.in_world(surfaces[:, :4]), np.full(len(surfaces), -1)
        kept = np.full(len(rows), True)
        absorb(special, np.array(segments), kept, owners)
        objects = line_map.objects[rows]
        new = int(objects.max(initial=-1)) + 1 + np.arange(len(special))
        objects = np.concatenate([objects[kept], np.where(owners < 0, new, objects[owners])])
        return LineMap(
            np.concatenate([segments[kept], special]),
            np.unique(objects, return_inverse=True)[1],
            np.concatenate([line_map.points[rows[kept]], np.full(len(special), 2)]),
            np.concatenate([np.full(kept.sum(), WALL), np.where(mirrors, MIRROR, GLASS)]),
        )

    def _real_parts(self, segments: Float, frame: Frame, cells: Cells) -> tuple[Float, Int]:
        """The parts (n, 4) of segments (m, 4) that not only mirrors show, and of which each is."""
        ends = frame.of_world(segments.reshape(-1, 2)).reshape(-1, 4)
        parts = np.empty((2 * len(segments) + 99, 3))
        parts = parts[: find_real_parts(cells, self._ground, ends, parts)]
        rows, shares = parts[:, 0].astype(np.int64), parts[:, 1:, None]
        whole = segments[rows].reshape(-1, 2, 2)
        return (whole[:, :1] + shares * (whole[:, 1:] - whole[:, :1])).reshape(-1, 4), rows


@compiled
def find_turned(
    place: Float, headings: Float, ranges: Float, surfaces: Float, turned: Bool
) -> None:
    """Mark the beams (n,) that go on behind mirrors of surfaces (s, 5), or graze and pass glass."""
    for x1, y1, x2, y2, mirror in surfaces:
        dx, dy = x2 - x1, y2 - y1
        size, x, y = np.hypot(dx, dy), x1 - place[0], y1 - place[1]
        for beam in range(len(headings)):
            ux, uy = np.cos(headings[beam]), np.sin(headings[beam])
            across = ux * dy - uy * dx
            if across == 0.0 or (mirror == 0.0 and abs(across) > GRAZING * size):
                continue
            way, share = (x * dy - y * dx) / across, (x * uy - y * ux) / across
            turned[beam] |= 0.0 < way < ranges[beam] - DEPTH and 0.0 <= share <= 1.0


@compiled
def absorb(stretches: Float, segments: Float, kept: Bool, owners: Int) -> None:
    """Take segments (m, 4) of a map that lie on stretches (g, 4) of glass or a mirror for parts.

    Stretches become as long as what they take in; what is kept (m,) is not of them. The owner (g,)
    of a stretch is the kept segment nearest to one of its ends, where one is near.
    """
    for row in range(len(stretches)):
        x, y = stretches[row, 0], stretches[row, 1]
        ux, uy = stretches[row, 2] - x, stretches[row, 3] - y
        size = np.hypot(ux, uy)
        ux, uy = ux / size, uy / size
        low, high = 0.0, size
        for other in range(len(segments)):
            x1, y1, x2, y2 = segments[other]
            aside = (y1 - y) * ux - (x1 - x) * uy, (y2 - y) * ux - (x2 - x) * uy
            along = (x1 - x) * ux + (y1 - y) * uy, (x2 - x) * ux + (y2 - y) * uy
            if not kept[other] or max(abs(aside[0]), abs(aside[1])) >= ABSORBED_DISTANCE:
                continue
            length = np.hypot(x2 - x1, y2 - y1)
            shared = min(max(along[0], along[1]), size) - max(min(along[0], along[1]), 0.0)
            if shared > ABSORBED * length and abs(aside[1] - aside[0]) < ABSORBED_SINE * length:
                kept[other] = False
                low, high = min(low, along[0], along[1]), max(high, along[0], along[1])
        stretches[row, 0], stretches[row, 1] = x + low * ux, y + low * uy
        stretches[row, 2], stretches[row, 3] = x + high * ux, y + high * uy
    for row in range(len(stretches)):
        least = JOINS * JOINS
        for other in range(len(segments)):
            for ends in range(4 if kept[other] else 0):
                one, two = 2 * (ends // 2), 2 * (ends % 2)
                x = segments[other, one] - stretches[row, two]
                y = segments[other, one + 1] - stretches[row, two + 1]
                apart = x * x + y * y
                if apart < least:
                    least, owners[row] = apart, other
