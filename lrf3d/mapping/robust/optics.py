"""Optics: glass and mirrors in a map, from the light of scans with intensities.

Scans enter with their intensities; what leaves are scans without what mirrors show, and a map in
which glass and mirrors stand in place of what beams, most of which pass or are turned, left of
them. Scans without intensities, or whose intensities are no light, change nothing here.
"""

from dataclasses import replace

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int, directions, lengths
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import GLASS, MIRROR, WALL, LineMap
from lrf3d.mapping.robust.beams import Beams, Frame
from lrf3d.mapping.robust.glass import GRAZING, Glass
from lrf3d.mapping.robust.ground import DIRECT, NOTHING, TURNED, UNSURE, Ground
from lrf3d.mapping.robust.intensities import LaserEquation
from lrf3d.mapping.robust.lit_scans import RANGE, UX, UY, LitScan, LitScans, way_to_first
from lrf3d.mapping.robust.mirrors import DEPTH, Mirrors

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
        self._glass, self._mirrors, self._ground = Glass(), Mirrors(), Ground()

    def look(
        self, scan: LaserScan, place: tuple[float, float], heading: float, noise: RangeNoise
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
        columns = units[:, 0], units[:, 1], ranges, np.abs(free), deviations, light, bright
        lit = LitScan(np.array(place), heading, np.column_stack(columns))
        turned = np.isfinite(self._limits(lit))
        if turned.any():
            seen = np.where(turned, -np.inf, scan.ranges[order])
            scan = replace(
                scan, angles=scan.angles[order], ranges=seen, walls=np.full(len(order), -1),
                intensities=None, echoes=None, echo_intensities=None,
            )  # fmt: skip
        return scan, lit

    def _limits(self, lit: LitScan) -> Float:
        """How far [m] the beams (n,) of a scan went before they were turned, or infinity."""
        way, _ = lit.crossings(self._mirrors.segments)
        grazing, cos = lit.crossings(self._glass.segments)
        way = np.concatenate([way, np.where(cos < GRAZING, grazing, np.inf)])
        first: Float = way.min(axis=0, initial=np.inf)
        return np.where(lit.rays[:, RANGE] > first + DEPTH, first, np.inf)

    def update(self, lit: LitScan, walls: Float, segments: Float) -> None:
        """Learn from a scan.

        Args:
            lit: The scan.
            walls: (w, 4) the walls that it shows, around the laser [m].
            segments: (m, 4) the segments of the map [m].
        """
        reflectances = self._equation.reflectances(lit.rays, walls)
        self._glass.add(lit)
        if not self._scans.keep(lit):
            return
        known = reflectances > 0.0
        self._ground.add_light(lit.ends[known], reflectances[known])
        changed = False
        if self._equation.fits:
            self._mirrors.add(self._scans.count, lit.place, walls + np.tile(lit.place, 2), segments)
            mirrors = self._mirrors
            self._glass.look(self._scans, segments, mirrors.segments)
            changed = mirrors.look(self._scans, segments, self._glass.segments, self._ground)
        self._sort(slice(None) if changed else slice(self._scans.newest, self._scans.newest + 1))

    def _sort(self, rows: slice) -> None:
        """Count where beams of kept scans ended, as it is known now which of them were turned."""
        scans, mirrors = self._scans, self._mirrors.segments
        places, rays, kinds = scans.places[rows], scans.rays[rows], scans.kinds[rows]
        found = np.zeros_like(kinds)
        along = EDGE * np.tile(directions(mirrors), 2) * [-1.0, -1.0, 1.0, 1.0]
        sort_returns(places, rays, mirrors, mirrors + along, found)
        ends = places[:, None] + rays[..., RANGE, None] * rays[..., [UX, UY]]
        changed = found != kinds
        self._ground.add(
            ends[changed & (kinds != NOTHING)], kinds[changed & (kinds != NOTHING)], -1
        )
        self._ground.add(ends[changed], found[changed])
        kinds[:] = found

    def show(self, line_map: LineMap, frame: Frame) -> LineMap:
        """A map in the world with what is known to be glass or a mirror in it."""
        glass, mirrors = self._glass.segments, self._mirrors.segments
        if not (self._equation.fits and (len(glass) or len(mirrors))):
            return line_map
        segments, rows = line_map.segments, np.arange(len(line_map))
        if len(mirrors):
            segments, rows = self._without_images(segments, frame)
        special, kept = absorb(frame.in_world(np.concatenate([glass, mirrors])), segments)
        segments, rows = segments[kept], rows[kept]
        objects = line_map.objects[rows]
        objects = np.concatenate([objects, objects_of(special, segments, objects)])
        return LineMap(
            np.concatenate([segments, special]),
            np.unique(objects, return_inverse=True)[1],
            np.concatenate([line_map.points[rows], np.full(len(special), 2)]),
            np.repeat([WALL, GLASS, MIRROR], [len(kept), len(glass), len(mirrors)]),
        )

    def _without_images(self, segments: Float, frame: Frame) -> tuple[Float, Int]:
        """The parts (n, 4) of segments (m, 4) that not only mirrors show, and of which each is."""
        ends = frame.of_world(segments.reshape(-1, 2)).reshape(-1, 4)
        rows, shares = self._ground.real_parts(ends)
        start, along = segments[rows, None, :2], segments[rows, None, 2:] - segments[rows, None, :2]
        return (start + shares[..., None] * along).reshape(-1, 4), rows


@compiled
def sort_returns(places: Float, rays: Float, mirrors: Float, wider: Float, kinds: Int) -> None:
    """Find what the beams (k, n) of scans from places (k, 2) show where they ended.

    Args:
        places: Where the scans were taken [m].
        rays: (k, n, 7) their rays.
        mirrors: (m, 4) the mirrors [m].
        wider: (m, 4) the same and their rims: beams through these show nothing.
        kinds: (k, n) is filled.
    """
    for scan in range(len(places)):
        for beam in range(rays.shape[1]):
            ray = rays[scan, beam]
            if ray[RANGE] <= 0.0:
                kinds[scan, beam] = NOTHING
            elif way_to_first(places[scan], ray, mirrors) < ray[RANGE] - DEPTH:
                kinds[scan, beam] = TURNED
            elif way_to_first(places[scan], ray, wider) < ray[RANGE] - DEPTH:
                kinds[scan, beam] = UNSURE
            else:
                kinds[scan, beam] = DIRECT


def absorb(stretches: Float, segments: Float) -> tuple[Float, Int]:
    """Take segments of a map that lie on glass or a mirror for parts of it.

    Args:
        stretches: (g, 4) of glass and mirrors [m].
        segments: (m, 4) segments of the map [m].

    Returns:
        The stretches, as long as what they take in, and the rows of the other segments.
    """
    stretches, kept = stretches.copy(), np.ones(len(segments), np.bool_)
    units, sizes = directions(segments), lengths(segments)
    for row, (own, unit, size) in enumerate(
        zip(stretches, directions(stretches), lengths(stretches), strict=True)
    ):
        ends = segments.reshape(-1, 2, 2) - own[:2]
        along = ends @ unit
        aside = np.abs(ends[:, :, 1] * unit[0] - ends[:, :, 0] * unit[1]).max(axis=1)
        shared = np.minimum(along.max(axis=1), size) - np.maximum(along.min(axis=1), 0.0)
        sine = np.abs(units[:, 0] * unit[1] - units[:, 1] * unit[0])
        within = (aside < ABSORBED_DISTANCE) & (sine < ABSORBED_SINE) & kept
        within &= shared > ABSORBED * sizes
        if within.any():
            kept &= ~within
            low = min(0.0, float(along[within].min()))
            high = max(float(size), float(along[within].max()))
            stretches[row] = np.concatenate([own[:2] + low * unit, own[:2] + high * unit])
    return stretches, np.flatnonzero(kept)


def objects_of(stretches: Float, segments: Float, objects: Int) -> Int:
    """The object of each of some stretches: that of a segment whose end it reaches, or a new one.

    Args:
        stretches: (g, 4) the stretches [m].
        segments: (m, 4) segments of the map [m].
        objects: (m,) their objects.
    """
    found = int(objects.max(initial=-1)) + 1 + np.arange(len(stretches))
    ends = segments.reshape(-1, 2)
    for row, own in enumerate(stretches):
        apart = np.hypot(*(ends[:, None] - own.reshape(2, 2)).transpose(2, 0, 1)).min(axis=1)
        if apart.min(initial=np.inf) < JOINS:
            found[row] = objects[int(np.argmin(apart)) // 2]
    return found
