"""First-seen times: when beams first passed each cell of the ground, and when the map covered it.

The scans of a run enter; one picture of times leaves, which every renderer compares with the
current time. The ground uses its own cell, a wall the cell in front of it. Light reaches as far as
the true ranges if they are known, so that it ends at walls, else as far as the measured ones. Beams
start at the robot's estimated poses: where these are wrong, so is the light.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from PIL import Image, ImageDraw
from scipy.ndimage import (
    binary_dilation,
    binary_erosion,
    distance_transform_edt,
    gaussian_filter,
    gaussian_filter1d,
    maximum_filter,
    minimum_filter,
)

from lrf3d.geometry.lines import LEFT, Bool, Float, Int, Records, Single, directions, lengths
from lrf3d.geometry.pose import as_pose
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.laser.unrolling import unrolled
from lrf3d.simulation.run import Run
from lrf3d.studio.scene.look import TINY
from lrf3d.studio.scene.shapes import single
from lrf3d.studio.scene.stage.structures import FARTHEST, Structures, folded

# A cell of the first-seen times.
TIME = np.dtype(
    [
        ("seen", np.float32),  # When a beam first passed [lengths of the run].
        ("sure", np.float32),  # How surely, 0…1.
        ("mapped", np.float32),  # When a segment of the map first covered it [lengths of the run].
        ("delay", np.float32),  # Of the wave of light [s of the film].
    ]
)

# Largest number of cells, which are larger where there would be more.
_MOST_CELLS = 1_500_000

# Largest number of scans; longer runs are lit by every n-th, as a film has no more frames.
_MOST_SCANS = 1500

# Longest delay of light [s of the film]: the robot must not overtake it.
_LONGEST_WAVE = 0.7

# Time of what is never seen [lengths of the run].
_NEVER = 9.0

# Least length of a run [s]: a single scan takes no time.
_LEAST_LENGTH = 1e-3

# How surely what is seen is seen at the least.
_SEEN = 0.5

# Standard deviation by which times are smoothed [cells].
_SOFT = 1.3

# Standard deviation by which the rim of what was seen is smoothed [cells].
_RIM = 2.0

# Factor by which the smoothed rim is steeper.
_RIM_STEEP = 1.6

# Value of the steeper rim that is not seen: what is seen keeps its width.
_RIM_LOW = 0.3

# Standard deviation by which the times of the map are smoothed [cells].
_SLOPE = 5.0

# Half the width of gaps between beams that are closed [cells].
_CLOSED = 3

# Half the width of the strip in which a segment of the map sets the time of its cells [cells].
_COVERS = 3.2

# Distance up to which a segment of the map colours walls [cells]: well within its strip.
_TOLERANCE = 0.5 * _COVERS

# Least time between the light and the map's colour [s].
_GAP = 0.3

# Widest gap in the map of a wall over which its colour goes [m].
WAVE_GAP = 1.6

# Standard deviation by which the times of a wall are smoothed [m].
_WAVE_SMOOTH = 0.8

# Speed of the map's colour along a wall [m/s of the film].
_WAVE_SPEED = 9.0

# Width of what is not lit yet in the colour of the map [cells].
_BRIDGED = 13

# Motion of a robot below which it sees nothing new [m, rad].
_MOVED = 1e-3

# Number of cells around a picture in which gaps at its edge are closed.
_AROUND = _CLOSED + 1


@dataclass(frozen=True, eq=False, slots=True)
class Exposure:
    """When the places of a world were first seen and first mapped."""

    # (h, w) cells of `TIME`.
    times: Records
    # (2,) its lower left corner in the film's frame [m].
    corner: Float
    # Side of a cell [m].
    cell: float
    # When the run starts [s].
    start: float
    # How long the run is [s].
    length: float

    @property
    def texels(self) -> Single:
        """The times (h, w, 4) as textures take them."""
        return texels_of(self.times)

    @property
    def size(self) -> Float:
        """Width and height (2,) [m]."""
        return self.cell * np.array(self.times.shape[::-1], float)

    @property
    def area(self) -> tuple[float, ...]:
        """Its corner [m] and one over its size [1/m], as shaders take them."""
        return (*self.corner.tolist(), *(1.0 / self.size).tolist())

    @property
    def tolerance(self) -> float:
        """How far from a wall a segment of the map may lie to be that wall [m]."""
        return _TOLERANCE * self.cell

    def joined(self, other: "Exposure") -> "Exposure":
        """The places of both, with the light of another one where that is first or surer."""
        low = np.minimum(self.corner, other.corner)
        high = np.maximum(self.corner + self.size, other.corner + other.size)
        cell = max(self.cell, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
        # Where the cells need not grow they stay where they are.
        low = self.corner - cell * np.ceil((self.corner - low) / cell - TINY)
        columns, rows = np.ceil((high - low) / cell - TINY).astype(int).tolist()
        y, x = np.mgrid[:rows, :columns]
        places = low + cell * (np.column_stack([x.ravel(), y.ravel()]) + 0.5)
        times, others = (one.sampled(places) for one in (self, other))
        for name in ("seen", "mapped"):
            others[name] = (other.start + other.length * others[name] - self.start) / self.length
        mine, theirs = (one["sure"] > _SEEN for one in (times, others))
        taken = theirs & (~mine | (others["seen"] < times["seen"]))
        taken |= ~mine & (others["sure"] > times["sure"])
        for name in ("seen", "sure", "delay"):
            times[name][taken] = others[name][taken]
        times["mapped"] = np.minimum(times["mapped"], others["mapped"])
        return replace(self, times=times.reshape(rows, columns), corner=low, cell=cell)

    def clock(self, time: Any, playback: float) -> tuple[Any, float]:
        """A time of the run [s] in lengths of it, and the film's seconds in one length."""
        return (time - self.start) / self.length, self.length / playback

    def cells_of(self, places: Float) -> Int:
        """Columns and rows (2, n) of places (n, 2)."""
        cells = np.floor((places - self.corner) / self.cell).astype(int)
        return np.asarray(np.clip(cells, 0, np.array(self.times.shape[::-1]) - 1).T)

    def sampled(self, places: Float) -> Records:
        """The times (n,) at places (n, 2)."""
        columns, rows = self.cells_of(places)
        return np.asarray(self.times[rows, columns])

    def walls(self, structures: Structures) -> Bool:
        """Which cells (h, w) contain walls that let no light pass."""
        picture = Image.new("1", self.times.shape[::-1])
        draw = ImageDraw.Draw(picture)
        opaque = structures.segments[~structures.glass]
        for ends in ((opaque - np.tile(self.corner, 2)) / self.cell - 0.5).tolist():
            draw.line(ends, fill=1)
        return np.asarray(picture) > 0

    def fan(self, scan: LaserScan, mirrors: Float, picture: Image.Image, value: int) -> None:
        """Paint a value into a picture where the beams of a scan in the film's frame pass."""
        draw = ImageDraw.Draw(picture)
        ways = beam_directions(scan.pose.theta, scan.angles)
        place = np.array([scan.pose.x, scan.pose.y])

        def fill(corners: Float) -> None:
            draw.polygon(((corners - self.corner) / self.cell - 0.5).ravel().tolist(), fill=value)

        far = min(scan.range_max, FARTHEST)
        reach = np.where(np.isfinite(scan.ranges), scan.ranges, far) + 0.5 * self.cell
        reach[scan.ranges == -np.inf] = 0.0
        if len(mirrors):
            legs, beams, gone = folded(place, place + reach[:, None] * ways, mirrors)
            for one, other in pairwise(legs.reshape(-1, 2, 2)):
                # Behind a mirror neighbouring beams light what lies between them.
                a, b = one
                c, d = other
                if np.hypot(*(a - c)) < 1.0 and not (a == place).all():
                    fill(np.array([a, b, d, c]))
            first = np.argsort(beams[gone == 0.0])
            reach = lengths(legs[gone == 0.0])[first] + 0.5 * self.cell
        # Between two beams light goes as far as both do where they meet one wall, else as the
        # nearer: what stands there may hide the rest.
        one = (scan.walls[:-1] == scan.walls[1:]) & (scan.walls[:-1] >= 0)
        one |= np.abs(np.diff(reach)) < 2.0 * self.cell
        low = np.minimum(reach[:-1], reach[1:])
        right = np.where(one, reach[:-1], low)
        left = np.where(one, reach[1:], low)
        ends = np.stack([right[:, None] * ways[:-1], left[:, None] * ways[1:]], axis=1)
        # A single beam has no neighbour: it lights a line.
        ends = ends.reshape(-1, 2) if len(ways) > 1 else reach[:, None] * ways
        fill(place + np.concatenate([ends, [[0.0, 0.0]]]))


def texels_of(times: Records) -> Single:
    """Times (h, w) as textures (h, w, 4) take them."""
    return np.ascontiguousarray(times).view(np.float32).reshape(*times.shape, 4)


def unexposed(structures: Structures, low: Float, high: Float) -> Exposure:
    """The times of a world in a box from low to high (2,) [m] before anything has been seen."""
    cell = max(structures.setting.cell, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
    columns, rows = np.maximum(np.ceil((high - low) / cell), 2).astype(int).tolist()
    return Exposure(
        np.full((rows, columns), np.array((_NEVER, 0.0, _NEVER, 0.0), TIME)), low, cell, 0.0, 1.0
    )


def expose(run: Run, structures: Structures, low: Float, high: Float) -> Exposure:
    """The first-seen times of a run in a box from low to high (2,) [m] of the film's frame."""
    origin = structures.origin
    poses = (run.trajectory if run.estimate is None else run.estimate).poses - [*origin, 0.0]
    if not len(poses):
        return unexposed(structures, low, high)
    # No farther from the path than anything was measured.
    far = float(np.max(run.ranges, initial=FARTHEST, where=np.isfinite(run.ranges)))
    low = np.maximum(low, poses[:, :2].min(axis=0) - far - 2.0)
    high = np.maximum(np.minimum(high, poses[:, :2].max(axis=0) + far + 2.0), low + 1.0)
    bare = unexposed(structures, low, high)
    times = run.trajectory.times
    start = float(times.min())
    length = max(float(np.ptp(times)), _LEAST_LENGTH)
    exposure = replace(bare, start=start, length=length)
    size = bare.times.shape[::-1]
    cells = bare.times
    first = Image.new("I", size)
    mirrors = structures.segments[structures.mirrors]
    # From the last scan to the first: what was seen first lies on top.
    for number in range(0, len(poses), 1 + (len(poses) - 1) // _MOST_SCANS)[::-1]:
        for laser, (lrf, scan) in enumerate(zip(run.lasers, run.scans_at(number), strict=True)):
            if run.knows_truth:
                scan = run.true_scan(number, laser=laser)
            placed = replace(unrolled(scan), pose=as_pose(lrf.placed(poses[number])))
            if not run.knows_truth:
                # Recorded beams without a return may have met what is black or clear.
                placed = replace(placed, ranges=np.where(placed.hits, placed.ranges, -np.inf))
            exposure.fan(placed, mirrors, first, number + 1)
    seen: Bool = np.asarray(first) > 0
    near = distance_transform_edt(~seen, return_distances=False, return_indices=True)
    scans = np.maximum(np.asarray(first)[tuple(near)] - 1, 0)
    share = (times - start) / length
    cells["seen"] = gaussian_filter(share[scans].astype(np.float32), _SOFT)
    # Beyond the picture nothing is seen.
    cells["sure"][1:-1, 1:-1] = soft_rim(seen, exposure.walls(structures))[1:-1, 1:-1]
    covered = Image.new("I", size)
    draw = ImageDraw.Draw(covered)
    for number, line_map in reversed(list(zip(run.snapshot_scans, run.maps, strict=True))):
        segments = (line_map.segments - np.tile(origin + low, 2)) / exposure.cell - 0.5
        for ends in segments.tolist():
            draw.line(ends, fill=number + 1, width=round(2.0 * _COVERS))
    within: Bool = np.asarray(covered) > 0
    # A wall that grows scan by scan is coloured by an even slope, without steps.
    sums, weights = (
        gaussian_filter(each.astype(np.float32), _SLOPE)
        for each in (np.append(0.0, share)[np.asarray(covered)], within)
    )
    mapped = np.where(within, sums / np.maximum(weights, TINY), _NEVER)
    cells["mapped"] = mapped
    # A film shows a run at this speed, unless it is told otherwise.
    even_walls(exposure, structures, run.film.playback_of(0.0) / length)
    mapped = cells["mapped"].copy()
    # What the map has between two lit places is coloured with them.
    cells["mapped"] = np.maximum(mapped, minimum_filter(cells["seen"], _BRIDGED) + _GAP / length)
    cells["delay"] = gaussian_filter(
        wave(exposure, poses[scans, :2], structures.setting.light), _SOFT
    )
    return exposure


def even_walls(exposure: Exposure, structures: Structures, second: float) -> None:
    """Let the map's colour come over each wall in one wave, from where the map has it first.

    Gaps in a wall are closed, and times along it are smoothed. The wave is no faster than the eye
    follows; a second of the film is given in lengths of the run.
    """
    cell = exposure.cell
    opaque = structures.segments[~structures.glass]
    off = directions(opaque) @ LEFT * cell * structures.setting.before
    sides = np.concatenate([opaque + side * np.tile(off, 2) for side in (-1.0, 1.0)])
    size = lengths(sides)
    begin, end = np.hsplit(sides, 2)
    # Most walls of a large world are not in the map.
    ends = (begin + share * (end - begin) for share in (0.1, 0.5, 0.9))
    known = np.any([exposure.sampled(each)["mapped"] < _NEVER for each in ends], axis=0)
    for number in np.flatnonzero(known & (size > WAVE_GAP)).tolist():
        along = np.arange(0.0, size[number], 0.5 * cell)
        places = begin[number] + (along / size[number])[:, None] * (end - begin)[number]
        columns, rows = exposure.cells_of(places)
        times = exposure.times["mapped"][rows, columns]
        there = np.flatnonzero(times < _NEVER)
        if not len(there):
            continue
        nearest = distance_transform_edt(times >= _NEVER) * 0.5 * cell
        filled = np.interp(along, along[there], times[there])
        smooth = gaussian_filter1d(filled, 2.0 * _WAVE_SMOOTH / cell, mode="nearest")
        first = int(smooth.argmin())
        front = smooth[first] + np.abs(along - along[first]) / _WAVE_SPEED * second
        even = np.where(nearest <= 0.5 * WAVE_GAP, np.maximum(smooth, front), _NEVER)
        for aside in range(-1, 2):
            near_rows, near_columns = (
                np.clip(each + aside, 0, most - 1)
                for each, most in zip((rows, columns), exposure.times.shape, strict=True)
            )
            for pair in ((near_rows, columns), (rows, near_columns)):
                exposure.times["mapped"][pair] = even


class LiveExposure:
    """The times of a drive that goes on, lit by each scan as it comes, from those before it."""

    def __init__(self, exposure: Exposure, structures: Structures) -> None:
        self.exposure = replace(exposure, times=exposure.times.copy())
        self._structures = structures
        self._poses: Float | None = None
        self._fresh: tuple[Int, Int] | None = None

    def see(self, scans: Sequence[LaserScan], time: float) -> None:
        """Light what scans of a time [s] see, if the robot has moved."""
        poses = np.array([scan.pose for scan in scans]) - [*self._structures.origin, 0.0]
        if self._poses is not None and (np.abs(poses - self._poses) < _MOVED).all():
            return
        self._poses = poses
        for pose, scan in zip(poses, scans, strict=True):
            self._light(replace(scan, pose=as_pose(pose)), time)

    def _light(self, scan: LaserScan, time: float) -> None:
        place = np.array(scan.pose[:2])
        whole = self.exposure
        far = (
            np.max(scan.ranges, initial=min(scan.range_max, FARTHEST), where=scan.hits) + whole.cell
        )
        size = np.array(whole.times.shape[::-1])
        low, high = (
            np.clip(((place + side * far - whole.corner) / whole.cell).astype(int), 1, size - 1)
            for side in (-1.0, 1.0)
        )
        if (high <= low).any():
            return
        times = whole.times[_box(low, high)]
        part = replace(whole, times=times, corner=whole.corner + low * whole.cell)
        picture = Image.new("L", (high - low).tolist())
        part.fan(scan, self._structures.segments[self._structures.mirrors], picture, 255)
        cover = soft_rim(
            (np.asarray(picture) > 0) | (times["sure"] > 0.5), part.walls(self._structures)
        )
        first = (cover > 0.0) & (times["sure"] == 0.0)
        times["seen"][first] = time
        times["mapped"][first] = time + _GAP
        times["delay"][first] = wave(part, place, self._structures.setting.light)[first]
        np.maximum(times["sure"], cover, out=times["sure"])
        before, after = self._fresh or (low, high)
        self._fresh = np.minimum(low, before), np.maximum(high, after)

    def fresh(self) -> tuple[Single, list[int]] | None:
        """The part of the times (h, w, 4) that changed since the last call, and its first cell."""
        if self._fresh is None:
            return None
        low, high = self._fresh
        self._fresh = None
        return texels_of(self.exposure.times[_box(low, high)]), low.tolist()


def _box(low: Int, high: Int) -> tuple[slice, ...]:
    """Rows and columns of a box from low to high (2,), columns and rows."""
    return tuple(slice(*ends) for ends in zip(low[::-1].tolist(), high[::-1].tolist(), strict=True))


def soft_rim(seen: Bool, walls: Bool) -> Float:
    """How surely cells (h, w) were seen, 0…1: gaps between beams are closed, edges are blurred.

    Gaps are not closed through walls (h, w); a wall gets the light of its brighter side.
    """
    within = slice(_AROUND, -_AROUND)
    open_ = np.pad(~walls, _AROUND, constant_values=True)
    lit = np.pad(seen, _AROUND) & open_
    grown = binary_dilation(lit, iterations=_CLOSED, mask=open_)
    # Darkness behind a wall does not erode the light in front of it.
    closed = (binary_erosion(grown | ~open_, iterations=_CLOSED) & open_ | lit)[within, within]
    closed |= walls & maximum_filter(closed, 3)
    soft = gaussian_filter(closed.astype(np.float32), _RIM)
    return np.asarray(np.clip(_RIM_STEEP * soft - _RIM_LOW, 0.0, 1.0))


def wave(exposure: Exposure, places: Float, speed: float) -> Single:
    """The delay (h, w) of light of a speed [m/s] from places (h, w, 2) or (2,) [s of the film]."""
    left, low = exposure.corner
    rows, columns = exposure.times.shape
    x = left + (np.arange(columns, dtype=np.float32) + 0.5) * exposure.cell
    y = low + (np.arange(rows, dtype=np.float32) + 0.5) * exposure.cell
    from_x, from_y = np.moveaxis(places, -1, 0)
    return single(np.minimum(np.hypot(x - from_x, y[:, None] - from_y) / speed, _LONGEST_WAVE))
