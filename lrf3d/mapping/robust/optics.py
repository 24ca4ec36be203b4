"""Optics: glass and mirrors in a map, from the light of scans with intensities.

Scans enter with their intensities; what leaves are scans without what mirrors show, and a map in
which glass and mirrors stand in place of what beams, most of which pass or are turned, left of
them. Scans without intensities change nothing here.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry import Float, Int, directions, lengths
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import GLASS, MIRROR, WALL, LineMap
from lrf3d.mapping.robust.beams import Beams, Frame
from lrf3d.mapping.robust.dim_returns import DimReturns
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.mapping.robust.hidden_panes import hidden_images
from lrf3d.mapping.robust.intensities import LaserEquation
from lrf3d.mapping.robust.lit_beams import LitBeams, flashes, pairs
from lrf3d.mapping.robust.mirrors import Mirrors, without_images
from lrf3d.mapping.robust.optics_constants import (
    ABSORBED,
    ABSORBED_DISTANCE,
    ABSORBED_SINE,
    DIM_SHARE,
    FLASH_SHARE,
    PANE_JOINS,
)
from lrf3d.mapping.robust.pane_images import PaneImages
from lrf3d.mapping.robust.panes import Panes, grazed


class Seen(NamedTuple):
    """A scan with intensities, as the mapper takes it.

    Args:
        scan: The scan by rising angle, without the returns of beams that a mirror turned.
        limits: (n,) how far [m] each of its beams went before it was turned, or infinity.
        beams: All of its beams with their light.
    """

    scan: LaserScan
    limits: Float
    beams: LitBeams


class Optics:
    """What the scans so far have shown of glass and mirrors.

    Args:
        extract: Finds the walls of a scan.

    Attributes:
        panes: The lines on which glass may stand.
        dim: Returns that may be of glass, on no line so far.
        mirrors: The lines that may be mirrors.
        glass: (s, 4) the stretches that are glass, in the map's frame [m].
    """

    def __init__(self, extract: LikelihoodExtractor) -> None:
        self._extract, self._equation = extract, LaserEquation()
        self.panes, self.dim, self.mirrors = Panes(), DimReturns(), Mirrors()
        self.bright = PaneImages()
        self.glass = np.empty((0, 4))

    def look(
        self, scan: LaserScan, place: tuple[float, float], heading: float, noise: RangeNoise
    ) -> Seen | None:
        """What a scan from a place [m] with a heading [rad] in the map's frame shows directly.

        None for a scan without intensities.
        """
        if scan.intensities is None:
            return None
        order = np.argsort(scan.angles, kind="stable")
        units, free, _ = Beams.of(scan, heading, noise)
        ranges = free.clip(0.0)
        lights = scan.intensities[order]
        lights = np.where(np.isfinite(lights), lights, 0.0)
        returned = (ranges > 0.0) & (lights > 0.0)
        beams = LitBeams(
            np.array(place),
            units,
            ranges,
            np.abs(free),
            np.sqrt(noise.variance(ranges)),
            lights,
            self.panes.usual_brightness(lights[returned] * ranges[returned] ** 2),
        )
        limits = np.minimum(self.mirrors.turns(beams), grazed(beams, self.glass))
        direct = replace(
            scan,
            angles=scan.angles[order],
            ranges=np.where(np.isfinite(limits), np.inf, scan.ranges[order]),
            walls=np.full(len(order), -1),
            intensities=None,
            echoes=None,
            echo_intensities=None,
        )
        return Seen(direct, limits, beams)

    def update(
        self, seen: Seen, heading: float, noise: RangeNoise, walls: Float, segments: Float
    ) -> None:
        """Learn from a scan.

        Args:
            seen: The scan.
            heading: Its heading [rad].
            noise: The noise of the ranges.
            walls: (w, 4) the walls that it shows, from the laser [m].
            segments: (m, 4) the segments of the map [m].
        """
        beams = seen.beams
        own = beams.units, beams.ranges, beams.intensities, walls
        self._equation.reflectances(*own)
        if not self._equation.fits:
            return
        self.mirrors.update(beams, walls + np.tile(beams.place, 2), segments)
        turned = np.isfinite(seen.limits)
        beams = beams._replace(
            ranges=np.where(turned, 0.0, beams.ranges), free=np.minimum(beams.free, seen.limits)
        )
        self.bright.add(beams)
        flash, dim = beams.classes()
        glass = flash | dim
        if glass.any():
            self.panes.add(*flashes(beams, flash))
            self.panes.add(*pairs(beams, dim))
            alone = replace(seen.scan, ranges=np.where(glass, beams.ranges, np.inf))
            ends, moments, _ = self._extract.walls(alone, heading, noise)
            moments[:, 1:3] += beams.place
            self.panes.add(ends + np.tile(beams.place, 2), moments)
        self.panes.take_up(self.dim)
        if len(self.panes):
            glass &= ~self.panes.count(beams, np.arange(len(self.panes)))
            self.glass = self.panes.segments(segments)
        if glass.any():
            self.dim.add(beams.returns(glass))

    def show(self, line_map: LineMap, frame: Frame, walls: Float) -> LineMap:
        """A map in the world with what is known to be glass or a mirror in it.

        Args:
            line_map: The map as it was drawn.
            frame: The map's own frame.
            walls: (w, 4) the segments of the map in its own frame [m].
        """
        if not self._equation.fits or not (len(self.mirrors.found) or len(self.glass)):
            return line_map
        segments, rows = line_map.segments, np.arange(len(line_map))
        mirrors, glass = frame.in_world(self.mirrors.segments()), frame.in_world(self.glass)
        if len(mirrors):
            normals = directions(mirrors) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
            distances = np.einsum("ij,ij->i", normals, mirrors[:, :2])
            lines = np.column_stack([normals, distances])
            shown = np.concatenate([segments, glass])
            segments, rows = without_images(segments, lines, shown)
            glass, _ = without_images(glass, lines, shown)
        usual = self.panes.usual()
        found = self.bright.images(self.panes, walls, self.mirrors.known)
        drawn = np.concatenate([walls, self.glass])
        found = hidden_images(self.bright.returns, found, drawn, walls, usual)
        if found.any():
            rays = frame.in_world(self.bright.returns[:, :4])
            segments, left = self.bright.without(
                segments, found, rays, DIM_SHARE * usual, FLASH_SHARE * usual
            )
            rows = rows[left]
            glass, _ = self.bright.without(glass, found, rays, 0.0, np.inf)
        special = np.concatenate([glass, mirrors])
        special, kept = absorb(special, segments)
        segments, rows = segments[kept], rows[kept]
        objects = line_map.objects[rows]
        objects = np.concatenate([objects, objects_of(special, segments, objects)])
        return LineMap(
            np.concatenate([segments, special]),
            np.unique(objects, return_inverse=True)[1],
            np.concatenate([line_map.points[rows], np.full(len(special), 2)]),
            np.repeat([WALL, GLASS, MIRROR], [len(kept), len(glass), len(mirrors)]),
        )

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names; `restore` takes them back."""
        known = {**self.panes.state(), **self.dim.state(), **self.mirrors.state()}
        light = {"light_pairs": self._equation.counts}
        return {**known, **light, **self.bright.state(), "glass": self.glass.copy()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what was known."""
        self.panes.restore(state)
        self.dim.restore(state)
        self.glass = state["glass"].copy()
        self.mirrors.restore(state)
        self.bright.restore(state)
        self._equation.counts = state["light_pairs"]


def absorb(stretches: Float, segments: Float) -> tuple[Float, Int]:
    """Take segments of a map that lie on glass or a mirror for parts of it.

    Args:
        stretches: (g, 4) of glass and mirrors [m].
        segments: (m, 4) segments of the map [m].

    Returns:
        The stretches, as long as what they take in, and the rows of the other segments.
    """
    stretches, kept = stretches.copy(), np.ones(len(segments), np.bool_)
    if not len(segments):
        return stretches, np.flatnonzero(kept)
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
    if len(ends):
        for row, own in enumerate(stretches):
            apart = np.hypot(*(ends[:, None] - own.reshape(2, 2)).transpose(2, 0, 1)).min(axis=1)
            nearest = int(np.argmin(apart))
            if apart[nearest] < PANE_JOINS:
                found[row] = objects[nearest // 2]
    return found
