"""Optics: glass and mirrors in a map, from the light of scans with intensities.

Scans enter with their intensities; what leaves are scans without what mirrors show, and a map in
which glass and mirrors stand in place of what beams, most of which pass or are turned, left of
them. Scans without intensities, or whose intensities are no light, change nothing here.
"""

from dataclasses import replace

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Bool, Float, Int, directions
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import GLASS, MIRROR, WALL, LineMap
from lrf3d.mapping.robust.beams import Beams, Frame
from lrf3d.mapping.robust.ground import DEPTH, Ground, find_real_parts, sort_returns
from lrf3d.mapping.robust.light import RANGE, UX, UY, LaserEquation, LitScan, LitScans, way_to_first
from lrf3d.mapping.robust.surface_lines import Flashes, SurfaceLines
from lrf3d.mapping.robust.surfaces import GRAZING

EDGE = 0.3
"""[m] Beams that pass a mirror by less show neither what is there nor what is not."""

ABSORBED, ABSORBED_DISTANCE, ABSORBED_SINE = 0.5, 0.12, 0.15
"""[share, m, sine] A segment of the map is a part of a pane or a mirror where so much of its length
lies by it, no farther off and no more askew."""

JOINS = 0.4
"""[m] A pane or a mirror is of the object of a wall whose end it reaches so nearly."""


class Optics:
    """What the scans so far have shown of glass and mirrors."""

    def __init__(self) -> None:
        self._equation, self._scans = LaserEquation(), LitScans()
        self._flashes, self._lines, self._ground = (
            Flashes(),
            SurfaceLines(),
            Ground.of_size(),
        )

    def look(
        self,
        scan: LaserScan,
        place: tuple[float, float],
        heading: float,
        noise: RangeNoise,
    ) -> tuple[LaserScan, LitScan | None]:
        """A scan from a place [m] with a heading [rad] in the map's frame, without images.

        The second is the scan with its light; None where it has none.
        """
        if scan.intensities is None:
            return scan, None
        order = np.argsort(scan.angles, kind="stable")
        units, free, _ = Beams.of(scan, heading, noise)
        ranges, lights = free.clip(0.0), scan.intensities[order]
        hit = (ranges > 0.0) & (lights > 0.0) & (lights < np.inf)
        if not hit.any():
            return scan, None
        light = np.where(hit, lights * ranges * ranges, 0.0)
        bright = light / self._scans.usual_brightness(light[hit])
        deviations = np.sqrt(noise.variance(ranges))
        columns = (
            units.T,
            [ranges, np.abs(free), deviations, light, bright, np.zeros(len(free))],
        )
        lit = LitScan(np.array(place), heading, np.ascontiguousarray(np.vstack(columns).T))
        turned = np.zeros(len(order), np.bool_)
        find_turned(lit.place, lit.rays, self._lines.mirrors, 1.0, turned)
        find_turned(lit.place, lit.rays, self._lines.glass, GRAZING, turned)
        if turned.any():
            seen = np.where(turned, -np.inf, scan.ranges[order])
            scan = replace(
                scan, angles=scan.angles[order], ranges=seen, walls=np.full(len(order), -1),
                intensities=None, echoes=None, echo_intensities=None,
            )  # fmt: skip
        return scan, lit

    def update(self, lit: LitScan, walls: Float, segments: Float) -> None:
        """Learn from a scan, its walls (w, 4) around the laser, and segments (m, 4) of the map."""
        self._equation.read(lit.rays, walls)
        self._flashes.add(lit)
        if not self._scans.keep(lit):
            return
        self._sort(newest=True)
        if self._equation.fits:
            self._lines.add_images(
                self._scans.count, lit.place, walls + np.tile(lit.place, 2), segments
            )
            if self._lines.look(self._scans, self._flashes, segments, self._ground):
                self._sort(newest=False)

    def _sort(self, newest: bool) -> None:
        """Count where beams of kept scans ended, as it is known now which of them were turned."""
        places, rays, kinds = self._scans.rows(newest)
        mirrors = self._lines.mirrors
        wider = mirrors.copy()
        wider[:, :4] += EDGE * np.tile(directions(mirrors[:, :4]), 2) * [-1.0, -1.0, 1.0, 1.0]
        self._ground = self._ground.with_room(kinds.size)
        sort_returns(places, rays, kinds, mirrors, wider, self._ground)

    def show(self, line_map: LineMap, frame: Frame) -> LineMap:
        """A map in the world with what is known to be glass or a mirror in it."""
        glass, mirrors = self._lines.glass[:, :4], self._lines.mirrors[:, :4]
        if not (self._equation.fits and (len(glass) or len(mirrors))):
            return line_map
        segments, rows = line_map.segments, np.arange(len(line_map))
        if len(mirrors):
            segments, rows = self._without_images(segments, frame)
        special, kept = frame.in_world(np.concatenate([glass, mirrors])), np.full(len(rows), True)
        absorb(special, segments, kept)
        segments, rows = segments[kept], rows[kept]
        objects = line_map.objects[rows]
        objects = np.concatenate([objects, objects_of(special, segments, objects)])
        return LineMap(
            np.concatenate([segments, special]),
            np.unique(objects, return_inverse=True)[1],
            np.concatenate([line_map.points[rows], np.full(len(special), 2)]),
            np.repeat([WALL, GLASS, MIRROR], [len(rows), len(glass), len(mirrors)]),
        )

    def _without_images(self, segments: Float, frame: Frame) -> tuple[Float, Int]:
        """The parts (n, 4) of segments (m, 4) that not only mirrors show, and of which each is."""
        ends, parts = frame.of_world(segments.reshape(-1, 2)), np.empty((2 * len(segments) + 99, 3))
        parts = parts[: find_real_parts(self._ground, ends.reshape(-1, 4), parts)]
        rows, shares = parts[:, 0].astype(np.int64), parts[:, 1:, None]
        whole = segments[rows].reshape(-1, 2, 2)
        return (whole[:, :1] + shares * (whole[:, 1:] - whole[:, :1])).reshape(-1, 4), rows


@compiled
def find_turned(place: Float, rays: Float, mirrors: Float, steepest: float, turned: Bool) -> None:
    """Mark the rays (n, 8) that mirrors (m, 5) turned which they met no steeper [cosine]."""
    for row in range(len(mirrors)):
        one = mirrors[row : row + 1]
        dx, dy = one[0, 2] - one[0, 0], one[0, 3] - one[0, 1]
        size = np.hypot(dx, dy)
        for beam in range(len(rays)):
            ray = rays[beam]
            if abs(dx * ray[UY] - dy * ray[UX]) <= steepest * size:
                turned[beam] |= way_to_first(place, ray, one, -1.0) + DEPTH < ray[RANGE]


@compiled
def absorb(stretches: Float, segments: Float, kept: Bool) -> None:
    """Take segments (m, 4) of a map that lie on stretches (g, 4) of glass or a mirror for parts.

    Stretches become as long as what they take in; what is kept (m,) is not of them.
    """
    for row in range(len(stretches)):
        x, y = stretches[row, 0], stretches[row, 1]
        ux, uy = stretches[row, 2] - x, stretches[row, 3] - y
        size = np.hypot(ux, uy)
        ux, uy = ux / size, uy / size
        low, high = 0.0, size
        for other in range(len(segments)):
            x1, y1, x2, y2 = segments[other]
            length = np.hypot(x2 - x1, y2 - y1)
            aside = (y1 - y) * ux - (x1 - x) * uy, (y2 - y) * ux - (x2 - x) * uy
            along = (x1 - x) * ux + (y1 - y) * uy, (x2 - x) * ux + (y2 - y) * uy
            if not kept[other] or max(abs(aside[0]), abs(aside[1])) >= ABSORBED_DISTANCE:
                continue
            shared = min(max(along[0], along[1]), size) - max(min(along[0], along[1]), 0.0)
            if shared > ABSORBED * length and abs(aside[1] - aside[0]) < ABSORBED_SINE * length:
                kept[other] = False
                low, high = min(low, along[0], along[1]), max(high, along[0], along[1])
        stretches[row, 0], stretches[row, 1] = x + low * ux, y + low * uy
        stretches[row, 2], stretches[row, 3] = x + high * ux, y + high * uy


def objects_of(stretches: Float, segments: Float, objects: Int) -> Int:
    """The object of each stretch (g, 4): that of a segment whose end it reaches, or a new one."""
    found = int(objects.max(initial=-1)) + 1 + np.arange(len(stretches))
    ends = segments.reshape(-1, 2)
    for row, own in enumerate(stretches):
        squares = (ends - own[:2]) ** 2, (ends - own[2:]) ** 2
        apart = np.minimum(*(square.sum(axis=1) for square in squares))
        if apart.min(initial=np.inf) < JOINS**2:
            found[row] = objects[int(np.argmin(apart)) // 2]
    return found
