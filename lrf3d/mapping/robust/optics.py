"""Optics: glass and mirrors in a map, from the light of scans with intensities.

Scans enter with their intensities; what leaves are scans without what mirrors show, and a map in
which glass and mirrors stand in place of what beams, most of which pass or are turned, left of
them. Scans without intensities, or whose intensities are no light, change nothing here.
"""

from dataclasses import replace

import numpy as np

from lrf3d.geometry import Bool, Float, cross, directions, lengths
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import GLASS, MIRROR, LineMap
from lrf3d.mapping.robust.cells import Cells, NewEvidence
from lrf3d.mapping.robust.ground import PATCHES, find_turned, turn_rays
from lrf3d.mapping.robust.light import LitScans
from lrf3d.mapping.robust.surface_lines import SurfaceLines

ABSORBED, ABSORBED_DISTANCE, ABSORBED_SINE = 0.5, 0.12, 0.15
"""[share, m, sine] A segment of the map is a part of a pane or a mirror where so much of its length
lies by it, no farther off and no more askew."""

JOINS = 0.4
"""[m] A pane or a mirror is of the object of a wall whose end it reaches so nearly."""


class Optics:
    """What the scans so far have shown of glass and mirrors."""

    def __init__(self) -> None:
        self._scans, self._lines = LitScans(), SurfaceLines()
        self._ground = np.zeros((0, 4))

    @property
    def surfaces(self) -> Float:
        """Glass and mirrors (s, 5) [m] in the map's frame, and whether each is a mirror."""
        return self._lines.surfaces

    def without_images(
        self, scan: LaserScan, place: tuple[float, float], heading: float
    ) -> LaserScan:
        """A scan from a place [m] with a heading [rad] in the map's frame, without images."""
        if scan.intensities is None or not len(self.surfaces):
            return scan
        turned = np.zeros(len(scan.angles), np.bool_)
        ranges, headings = np.array(scan.ranges), scan.angles + heading
        find_turned(np.array(place), headings, ranges, self.surfaces, turned)
        if not turned.any():
            return scan
        return replace(
            scan, ranges=np.where(turned, -np.inf, ranges), walls=np.full(len(turned), -1),
            intensities=None, echoes=None, echo_intensities=None,
        )  # fmt: skip

    def update(
        self, scan: LaserScan, pose: tuple[float, float, float], noise: RangeNoise, walls: Float,
        segments: Float, cells: Cells, fresh: NewEvidence,
    ) -> None:  # fmt: skip
        """Learn from a scan, its walls (w, 4) around the laser, and segments (m, 4) of the map.

        What mirrors showed, as is known now, is forgotten: new evidence of the walls of it.
        """
        if not self._scans.keep(scan, pose, noise, walls):
            return
        missing = len(cells.passes) * PATCHES - len(self._ground)
        if missing > 0:
            self._ground = np.pad(self._ground, ((0, missing), (0, 0)))
        places, rays = self._scans.rows(newest=True)
        turn_rays(places, rays, self.surfaces, cells, self._ground, fresh)
        self._lines.add(places[0], rays[0], walls + np.tile(places[0], 2), segments)
        places, rays = self._scans.rows(newest=False)
        if self._lines.look(places, rays, cells, self._ground):
            turn_rays(places, rays, self.surfaces, cells, self._ground, fresh)


def with_surfaces(line_map: LineMap, surfaces: Float, mirrors: Bool) -> LineMap:
    """A map with surfaces (s, 4) [m] in place of what lies by them: some (s,) mirrors, or glass."""
    if not len(surfaces):
        return line_map
    segments, objects = line_map.segments, line_map.objects
    along, size, length = directions(surfaces), lengths(surfaces), lengths(segments)[:, None]
    # Where both ends (m, 2) of each segment lie along each surface (s,), and beside it.
    off = segments.reshape(-1, 2, 1, 2) - surfaces[:, :2]
    stations, aside = (off * along).sum(axis=3), cross(along, off)
    low, high = stations.min(axis=1), stations.max(axis=1)
    part = np.minimum(high, size) - np.maximum(low, 0.0) > ABSORBED * length
    part &= np.abs(aside).max(axis=1) < ABSORBED_DISTANCE
    part &= np.abs(aside[:, 1] - aside[:, 0]) < ABSORBED_SINE * length
    # Surfaces become as long as what they take in.
    first = np.where(part, low, 0.0).min(axis=0, initial=0.0)
    last = np.maximum(np.where(part, high, 0.0).max(axis=0, initial=0.0), size)
    ends = np.tile(surfaces[:, :2], 2) + np.column_stack([first, first, last, last]) * np.tile(
        along, 2
    )
    kept = ~part.any(axis=1)
    segments, objects = segments[kept], objects[kept]
    owners = objects.max(initial=-1) + 1 + np.arange(len(ends))
    if len(segments):
        tips = (segments.reshape(-1, 1, 2) - ends.reshape(-1, 2)).reshape(len(segments), 2, -1, 4)
        apart = np.hypot(tips[..., ::2], tips[..., 1::2]).min(axis=(1, 3))
        nearest = apart.argmin(axis=0)
        owners = np.where(apart.min(axis=0) < JOINS, objects[nearest], owners)
    return LineMap(
        np.concatenate([segments, ends]),
        np.unique(np.concatenate([objects, owners]), return_inverse=True)[1],
        np.concatenate([line_map.points[kept], np.full(len(ends), 2)]),
        np.concatenate([line_map.kinds[kept], np.where(mirrors, MIRROR, GLASS)]),
    )
