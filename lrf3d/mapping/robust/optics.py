"""Optics: glass and mirrors in a map, from the light of scans with intensities.

Scans enter with their intensities; the segments that are glass leave, and a map in which they stand
in place of what beams, most of which pass glass, left of them. Scans without intensities change
nothing here.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lrf3d.geometry import Float, directions, lengths
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import GLASS, WALL, LineMap
from lrf3d.mapping.robust.beams import Frame, free_ranges
from lrf3d.mapping.robust.constants import ABSORBED, ABSORBED_DISTANCE, ABSORBED_SINE, PANE_JOINS
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.mapping.robust.panes import LitBeams, Panes, flashes, pairs


class Optics:
    """What the scans so far have shown of glass.

    Args:
        extract: Finds the walls of a scan.
    """

    def __init__(self, extract: LikelihoodExtractor) -> None:
        self._extract = extract
        self.panes = Panes()

    def update(
        self, scan: LaserScan, place: tuple[float, float], heading: float, noise: RangeNoise
    ) -> None:
        """Take a scan from a place [m] with a heading [rad] in the map's frame."""
        if scan.intensities is None:
            return
        order = np.argsort(scan.angles, kind="stable")
        angles = scan.angles[order] + heading
        free = free_ranges(scan.ranges[order], scan.range_max)
        ranges = free.clip(0.0)
        lights = np.nan_to_num(scan.intensities[order])
        returned = (ranges > 0.0) & (lights > 0.0)
        beams = LitBeams(
            np.array(place),
            np.column_stack([np.cos(angles), np.sin(angles)]),
            ranges,
            np.abs(free),
            np.sqrt(noise.variance(ranges)),
            lights,
            self.panes.usual_brightness(lights[returned] * ranges[returned] ** 2),
        )
        flash, dim = beams.classes()
        glass = flash | dim
        if glass.any():
            self.panes.add(*flashes(beams, flash))
            self.panes.add(*pairs(beams, dim))
            alone = replace(
                scan, angles=scan.angles[order], ranges=np.where(glass, ranges, np.inf),
                intensities=None, echoes=None, echo_intensities=None,
            )  # fmt: skip
            ends, moments, _ = self._extract.walls(alone, heading, noise)
            moments[:, 1:3] += place
            self.panes.add(ends + np.tile(place, 2), moments)
        if len(self.panes):
            self.panes.count(beams, np.arange(len(self.panes)))

    def show(self, line_map: LineMap, frame: Frame) -> LineMap:
        """A map in the world with what is known to be glass in it."""
        glass = self.panes.segments() if len(self.panes) else np.empty((0, 4))
        if not len(glass):
            return line_map
        glass, kept = absorb(frame.in_world(glass), line_map.segments)
        objects = np.concatenate([line_map.objects[kept], objects_of(glass, line_map, kept)])
        return LineMap(
            np.concatenate([line_map.segments[kept], glass]),
            np.unique(objects, return_inverse=True)[1],
            np.concatenate([line_map.points[kept], np.full(len(glass), 2)]),
            np.repeat([WALL, GLASS], [len(kept), len(glass)]),
        )

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names; `restore` takes them back."""
        return self.panes.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what was known."""
        self.panes.restore(state)


def absorb(glass: Float, segments: Float) -> tuple[Float, Any]:
    """Take segments of a map that lie on glass for parts of it.

    Args:
        glass: (g, 4) stretches of glass [m].
        segments: (m, 4) segments of the map [m].

    Returns:
        The glass, as long as what it takes in, and the rows of the other segments.
    """
    glass, kept = glass.copy(), np.ones(len(segments), np.bool_)
    if not len(segments):
        return glass, np.flatnonzero(kept)
    units, sizes = directions(segments), lengths(segments)
    for row, own in enumerate(glass):
        unit = directions(own[None])[0]
        ends = segments.reshape(-1, 2, 2) - own[:2]
        along = ends @ unit
        aside = np.abs(ends[:, :, 1] * unit[0] - ends[:, :, 0] * unit[1]).max(axis=1)
        size = float(lengths(own[None])[0])
        shared = np.minimum(along.max(axis=1), size) - np.maximum(along.min(axis=1), 0.0)
        sine = np.abs(units[:, 0] * unit[1] - units[:, 1] * unit[0])
        within = (aside < ABSORBED_DISTANCE) & (sine < ABSORBED_SINE) & kept
        within &= shared > ABSORBED * sizes
        if within.any():
            kept &= ~within
            low = min(0.0, float(along[within].min()))
            high = max(size, float(along[within].max()))
            glass[row] = np.concatenate([own[:2] + low * unit, own[:2] + high * unit])
    return glass, np.flatnonzero(kept)


def objects_of(glass: Float, line_map: LineMap, kept: Any) -> Any:
    """The object of each stretch of glass: that of a segment whose end it reaches, or a new one."""
    count = int(line_map.objects.max()) + 1 if len(line_map) else 0
    found = count + np.arange(len(glass))
    ends = line_map.segments[kept].reshape(-1, 2)
    if not len(ends):
        return found
    for row, own in enumerate(glass):
        apart = np.hypot(*(ends[:, None] - own.reshape(2, 2)).transpose(2, 0, 1)).min(axis=1)
        nearest = int(np.argmin(apart))
        if apart[nearest] < PANE_JOINS:
            found[row] = line_map.objects[kept][nearest // 2]
    return found
