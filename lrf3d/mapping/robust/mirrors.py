"""Mirrors: where a room behind a wall is the mirror image of what stands before it.

The beams of a scan, the walls that it shows and the segments of the map enter. A wall of the scan
and a segment of the map define the line that mirrors one into the other. Such a line is a mirror if
it does so with nearly all returns behind it, in several scans, and if all of these are darker than
what they are images of by the same share: no mirror reflects all light, and a room that is merely
symmetrical is as bright on both sides. Leaves the stretch of the line that beams were turned at.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions, lengths
from lrf3d.mapping.robust.lit_beams import LitBeams, crossings
from lrf3d.mapping.robust.optics_constants import (
    DIFFERENT_SINE,
    IMAGE_DISTANCE,
    IMAGE_SHARE,
    LEAST_COSINE,
    LEAST_IMAGES,
    LIGHT_CELL,
    LIGHT_DEVIATION,
    MIRROR_ANGLE,
    MIRROR_DEPTH,
    MIRROR_LIGHT,
    MIRROR_SCANS,
    MOST_MIRROR_LINES,
    PARALLEL_SINE,
    STRAY_WINDOW,
)

SAMPLE = 0.1
"""[m] Steps in which segments are searched for images."""

LEAST_LEFT = 0.3
"""[share] What is left of a segment beside its images stays from this part of it or
half a metre on."""


class Reflectance:
    """The mean reflectance of the walls in each cell where returns came from.

    Attributes:
        cells: (c,) the cells, in ascending order.
        sums: (c, 2) of each the sum of what returns showed, and their number.
    """

    def __init__(self) -> None:
        self.cells, self.sums = np.empty(0, np.int64), np.empty((0, 2))

    def add(self, points: Float, values: Float) -> None:
        """Add reflectances (n,) at points (n, 2) [m]."""
        cells, rows = np.unique(cells_of(points), return_inverse=True)
        fresh = np.setdiff1d(cells, self.cells, assume_unique=True)
        if len(fresh):
            places = np.searchsorted(self.cells, fresh)
            self.cells = np.insert(self.cells, places, fresh)
            self.sums = np.insert(self.sums, places, 0.0, axis=0)
        mine = np.searchsorted(self.cells, cells)
        self.sums[mine, 0] += np.bincount(rows, values, len(cells))
        self.sums[mine, 1] += np.bincount(rows, minlength=len(cells))

    def at(self, points: Float) -> Float:
        """The reflectance (n,) at points (n, 2) [m], NaN where it is not known."""
        if not len(self.cells):
            return np.full(len(points), np.nan)
        cells = cells_of(points)
        places = np.minimum(np.searchsorted(self.cells, cells), len(self.cells) - 1)
        means = self.sums[places, 0] / self.sums[places, 1]
        return np.where(self.cells[places] == cells, means, np.nan)

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names; `restore` takes them back."""
        return {"light_cells": self.cells.copy(), "light_sums": self.sums.copy()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what was known."""
        self.cells, self.sums = state["light_cells"].copy(), state["light_sums"].copy()


def cells_of(points: Float) -> Int:
    """The cells (n,) of points (n, 2) [m]."""
    columns, rows = np.floor(points / LIGHT_CELL).astype(np.int64).T
    cells: Int = (columns << 32) + rows
    return cells


class Mirrors:
    """Lines that may be mirrors.

    Attributes:
        lines: (k, 3) the unit normal of each, towards the laser, and its distance along the normal
            from the origin [m].
        window: (k, 2) from where to where beams were turned, along the normal turned left [m].
        scans: (k,) numbers of scans that show the mirror.
        known: How bright walls are.
    """

    def __init__(self) -> None:
        self.lines, self.window = np.empty((0, 3)), np.empty((0, 2))
        self.scans = np.empty(0, np.int64)
        self.known = Reflectance()

    @property
    def found(self) -> Int:
        """Those that are mirrors."""
        return np.flatnonzero(self.scans >= MIRROR_SCANS)

    def segments(self) -> Float:
        """The mirrors (s, 4) [m], seen from their left."""
        rows = self.found
        normals, along = self.lines[rows, :2], turned(self.lines[rows, :2])
        feet = normals * self.lines[rows, 2:]
        low, high = self.window[rows, :1], self.window[rows, 1:]
        segments: Float = np.hstack([feet + high * along, feet + low * along])
        return segments

    def turns(self, beams: LitBeams) -> Float:
        """How far [m] the beams (n,) go to the first mirror that turns them; infinity for none."""
        rows = self.found
        if not len(rows):
            return np.full(len(beams.free), np.inf)
        way, stations = self._crossings(beams, rows)
        low, high = self.window[rows, :1], self.window[rows, 1:]
        turned = (way > 0.0) & (stations >= low) & (stations <= high)
        turned &= beams.free > way + MIRROR_DEPTH
        limits: Float = np.where(turned, way, np.inf).min(axis=0)
        return limits

    def update(self, beams: LitBeams, walls: Float, segments: Float) -> None:
        """Look for mirrors, and for more of those that are known.

        Args:
            beams: The beams of a scan.
            walls: (w, 4) the walls that it shows [m].
            segments: (m, 4) the segments of the map [m].
        """
        hit = beams.ranges > 0.0
        points = beams.place + beams.ranges[:, None] * beams.units
        reach = float(beams.ranges.max(initial=0.0))
        middle = 0.5 * (segments[:, :2] + segments[:, 2:]) - beams.place
        near = np.hypot(middle[:, 0], middle[:, 1]) < reach + lengths(segments)
        segments = segments[near]
        if not len(segments):
            return
        apart, _, cosine = nearest_segments(points, beams.units, segments)
        sure = hit & (apart < IMAGE_DISTANCE) & (cosine > LEAST_COSINE)
        self.known.add(points[sure], beams.brightness()[sure] / cosine[sure])
        candidates = mirror_lines(beams.place, walls, segments)
        for line in np.concatenate([self.lines[self.found], candidates]):
            window = images(beams, line, segments, self.known)
            if window is not None:
                self._add(line, window)

    def _add(self, line: Float, window: Float) -> None:
        """Add what a scan shows of a line: its window."""
        same = np.flatnonzero(
            (self.lines[:, :2] @ line[:2] > np.cos(MIRROR_ANGLE))
            & (np.abs(self.lines[:, 2] - line[2]) < IMAGE_DISTANCE + MIRROR_ANGLE * abs(line[2]))
        )
        if not len(same):
            self.lines = np.vstack([self.lines, line])
            self.window = np.vstack([self.window, window])
            self.scans = np.append(self.scans, 1)
            return
        row = same[np.argmax(self.scans[same])]
        count = min(int(self.scans[row]), 50)
        mixed = (count * self.lines[row] + line) / (count + 1)
        mixed[:2] /= np.hypot(mixed[0], mixed[1])
        self.lines[row] = mixed
        self.scans[row] += 1
        self.window[row, 0] = min(self.window[row, 0], window[0])
        self.window[row, 1] = max(self.window[row, 1], window[1])

    def _crossings(self, beams: LitBeams, rows: Int) -> tuple[Float, Float]:
        """How far along each beam (m, n) [m] it crosses some lines, and where along them."""
        normals = self.lines[rows, :2]
        feet = normals * self.lines[rows, 2:]
        way, stations, _ = crossings(beams.place, beams.units, feet, turned(normals))
        # Only the side that was seen to mirror does.
        ahead = normals @ beams.place > self.lines[rows, 2]
        return np.where(ahead[:, None], way, -1.0), stations

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names; `restore` takes them back."""
        return {
            "mirror_lines": self.lines.copy(),
            "mirror_window": self.window.copy(),
            "mirror_scans": self.scans.copy(),
            **self.known.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what was known."""
        self.lines, self.window = state["mirror_lines"].copy(), state["mirror_window"].copy()
        self.scans = state["mirror_scans"].copy()
        self.known.restore(state)


def turned(normals: Float) -> Float:
    """Vectors (k, 2), turned left by a right angle."""
    return np.column_stack([-normals[:, 1], normals[:, 0]])


def mirrored(points: Float, line: Float) -> Float:
    """Points (n, 2) [m], mirrored at a line (3,)."""
    image: Float = points - 2.0 * ((points @ line[:2]) - line[2])[:, None] * line[:2]
    return image


def mirror_lines(place: Float, walls: Float, segments: Float) -> Float:
    """The lines (c, 3) that mirror segments of a map (m, 4) into walls of a scan (w, 4).

    They are seen from a place (2,) [m], before which the segments lie and behind which the walls
    do. Walls at a right angle to a mirror go on in their images, and say nothing.
    """
    images, reals = directions(walls), directions(segments)
    own, other = turned(images)[:, None], turned(reals)[None]
    normal = other - own
    size = np.hypot(normal[..., 0], normal[..., 1])
    row, column = np.nonzero(size > PARALLEL_SINE)
    normal = normal[row, column] / size[row, column, None]
    own_p = np.einsum("ij,ij->i", turned(images), walls[:, :2])[row]
    other_p = np.einsum("ij,ij->i", turned(reals), segments[:, :2])[column]
    distance = (own_p - other_p) / (2.0 * np.einsum("ij,ij->i", turned(images)[row], normal))
    # Towards the laser.
    flip = np.where(normal @ place < distance, -1.0, 1.0)
    normal, distance = normal * flip[:, None], distance * flip
    good = normal @ place - distance > MIRROR_DEPTH
    worst = np.zeros(len(row))
    unit = reals[column]
    stations = np.empty((2, len(row)))
    for end in range(2):
        point = walls[row, 2 * end : 2 * end + 2]
        behind = np.einsum("ij,ij->i", point, normal) - distance
        good &= behind < MIRROR_DEPTH
        image = point - 2.0 * behind[:, None] * normal - segments[column, :2]
        worst = np.maximum(worst, np.abs(image[:, 1] * unit[:, 0] - image[:, 0] * unit[:, 1]))
        stations[end] = np.einsum("ij,ij->i", image, unit)
    shared = np.minimum(stations.max(axis=0), lengths(segments)[column])
    shared -= np.maximum(stations.min(axis=0), 0.0)
    good &= (worst < IMAGE_DISTANCE) & (shared > 0.5 * lengths(walls)[row])
    found, weights = np.column_stack([normal, distance])[good], shared[good]
    # Lines that several pairs agree on come first.
    alike = found[:, :2] @ found[:, :2].T > np.cos(MIRROR_ANGLE)
    alike &= np.abs(found[:, None, 2] - found[None, :, 2]) < IMAGE_DISTANCE
    votes = alike @ weights
    chosen: list[int] = []
    for k in np.argsort(-votes, kind="stable").tolist():
        if not any(alike[k, other] for other in chosen):
            chosen.append(k)
        if len(chosen) == MOST_MIRROR_LINES:
            break
    lines: Float = found[chosen]
    return lines


def images(beams: LitBeams, line: Float, segments: Float, known: Reflectance) -> Float | None:
    """The window (2,) [m] in a line (3,) through which a scan shows the image of segments (m, 4).

    None where it does not. How bright the segments are themselves is known where beams met them.
    """
    normal = line[:2]
    way, stations, _ = crossings(
        beams.place, beams.units, (normal * line[2])[None], turned(normal[None])
    )
    way, stations = way[0], stations[0]
    hit = beams.ranges > 0.0
    behind = hit & (way > 0.0) & (beams.ranges > way + MIRROR_DEPTH)
    if np.count_nonzero(behind) < LEAST_IMAGES:
        return None
    points = beams.place + beams.ranges[:, None] * beams.units
    image, unit = points.copy(), beams.units.copy()
    image[behind] = mirrored(points[behind], line)
    unit[behind] -= 2.0 * (unit[behind] @ normal)[:, None] * normal
    apart, nearest, cosine = nearest_segments(image, unit, segments)
    tolerance = IMAGE_DISTANCE + 3.0 * beams.deviations
    seen = hit & (apart < tolerance)
    explained = behind & seen
    count = np.count_nonzero(explained)
    if count < LEAST_IMAGES:
        return None
    ends = np.quantile(stations[explained], (0.02, 0.98))
    within = behind & (stations >= ends[0]) & (stations <= ends[1])
    if np.count_nonzero(within & explained) < IMAGE_SHARE * np.count_nonzero(within):
        return None
    rows, counts = np.unique(nearest[explained], return_counts=True)
    ways = directions(segments[rows[counts >= LEAST_IMAGES // 4]])
    if not len(ways) or np.abs(_crossed(ways[:1], ways)).max() < DIFFERENT_SINE:
        return None
    sure = explained & (cosine > LEAST_COSINE)
    share = beams.brightness()[sure] / cosine[sure] / known.at(image[sure])
    share = share[np.isfinite(share)]
    if len(share) < LEAST_IMAGES // 2:
        return None
    usual = float(np.median(share))
    if not MIRROR_LIGHT[0] < usual < MIRROR_LIGHT[1]:
        return None
    if np.count_nonzero(np.abs(share - usual) < LIGHT_DEVIATION) < IMAGE_SHARE * len(share):
        return None
    window: Float = np.array([stations[explained].min(), stations[explained].max()])
    trimmed: Float = window.clip(ends[0] - STRAY_WINDOW, ends[1] + STRAY_WINDOW)
    return trimmed


def _crossed(one: Float, others: Float) -> Float:
    """Cross products (n,) of a vector (1, 2) with others (n, 2)."""
    cross: Float = one[:, 0] * others[:, 1] - one[:, 1] * others[:, 0]
    return cross


def nearest_segments(points: Float, units: Float, segments: Float) -> tuple[Float, Int, Float]:
    """How far (n,) [m] points (n, 2) lie off segments (m, 4), which is nearest, and its incidence.

    The incidence is the cosine of beams with directions (n, 2).
    """
    along, size = directions(segments), lengths(segments)
    offset = points[:, None] - segments[None, :, :2]
    station = np.einsum("nmk,mk->nm", offset, along).clip(0.0, size)
    rest = offset - station[..., None] * along
    apart = np.hypot(rest[..., 0], rest[..., 1])
    nearest = np.argmin(apart, axis=1)
    found = along[nearest]
    cosine = np.abs(units[:, 0] * found[:, 1] - units[:, 1] * found[:, 0])
    return apart[np.arange(len(points)), nearest], nearest, cosine


def without_images(segments: Float, lines: Float, shown: Float) -> tuple[Float, Int]:
    """Segments (m, 4) [m] without what lies behind mirrors and is an image.

    Args:
        segments: The segments of a map.
        lines: (k, 3) the mirrors.
        shown: (s, 4) segments of which there may be images [m], the former among them.

    Returns:
        The parts (n, 4) that are left, and of which segment each is.
    """
    kept: list[Float] = []
    rows: list[int] = []
    for row, own in enumerate(segments):
        count = max(int(np.hypot(*(own[2:] - own[:2])) / SAMPLE), 1)
        share = (np.arange(count) + 0.5) / count
        points = own[:2] + share[:, None] * (own[2:] - own[:2])
        ghost: Bool = np.zeros(count, np.bool_)
        for line in lines:
            behind = points @ line[:2] < line[2] - IMAGE_DISTANCE
            if behind.any():
                # A wall that goes on behind the mirror is its own image.
                image = mirrored(points, line)
                apart, _, _ = nearest_segments(image, np.zeros_like(image), shown)
                ghost |= behind & (apart < 2.0 * IMAGE_DISTANCE)
        edges = np.flatnonzero(np.diff(~ghost, prepend=False, append=False)).reshape(-1, 2)
        if not ghost.any():
            edges = np.array([[0, count]])
        for first, last in edges.tolist():
            if (
                ghost.any()
                and (last - first) < LEAST_LEFT * count
                and (last - first) * SAMPLE < 0.5
            ):
                continue
            low, high = first / count, last / count
            kept.append(
                np.hstack(
                    [own[:2] + low * (own[2:] - own[:2]), own[:2] + high * (own[2:] - own[:2])]
                )
            )
            rows.append(row)
    return np.array(kept).reshape(-1, 4), np.array(rows, np.int64)
