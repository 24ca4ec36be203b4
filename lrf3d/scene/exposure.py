"""First-seen times: when beams first passed each cell of the ground, and when the map covered it.

The scans of a run enter; one picture of times leaves, which every renderer compares with now. The
ground takes its own cell, a wall the cell before it. Light comes from measured ranges, at the poses
that the robot had to go by: where its estimate is wrong, so is the light.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from PIL import Image, ImageDraw
from scipy.ndimage import binary_closing, distance_transform_edt, gaussian_filter, minimum_filter

from lrf3d.geometry import Bool, Float, Int, Single
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.laser.unrolling import unrolled
from lrf3d.pose import as_pose
from lrf3d.run import Run
from lrf3d.scene.beams import folded, turning_walls
from lrf3d.scene.shapes import single
from lrf3d.scene.structures import Structures
from lrf3d.world import World

_CELL, _CELL_INDOOR, _MOST_CELLS = 0.25, 0.08, 1_500_000
"""Side of a cell outdoors and in rooms [m], which is longer where there would be more cells."""

_SPEED, _SPEED_INDOOR, _LONGEST_WAVE = 110.0, 26.0, 0.7
"""Speed of light in the picture [m/s of the film], so that a scan comes as a wave, and its longest
delay [s of the film]: the robot must not overtake it."""

_FREE = 30.0
"""How far beams without return light the ground [m]."""

_MOST_SCANS = 1500
"""Longer runs are lit by every n-th scan: a film has no more frames."""

_NEVER = 9.0
"""Time of what is never seen [lengths of the run]."""

_SOFT, _CLOSED = 1.3, 3
"""How far times and rims are smoothed, and how wide gaps between beams are closed [cells]."""

_COVERS, _TOLERANCE = 3.2, 1.6
"""Half the width of the strip in which a segment sets the time of its cells, and how far from a
wall it may lie to colour it [cells]."""

_MOVED = 1e-3
"""A robot that has moved by less [m, rad] sees nothing new."""

_GAP, _BRIDGED = 0.3, 13
"""Least time between the light and the map's colour [s], and how wide what is not lit yet may be in
the colour of the map [cells]."""


@dataclass(frozen=True, eq=False, slots=True)
class Exposure:
    """When the places of a world were first seen and first mapped."""

    times: Single
    """(h, w, 4) when a beam first passed [lengths of the run]; how surely, 0…1; when a segment of
    the map first covered it; the delay of the wave of light [s of the film]."""
    corner: Float
    """(2,) its lower left corner in the film's frame [m]."""
    cell: float
    """Side of a cell [m]."""
    start: float
    length: float
    """When the run starts and how long it is [s]."""

    @property
    def size(self) -> Float:
        """Width and height (2,) [m]."""
        return self.cell * np.array(self.times.shape[1::-1], float)

    @property
    def area(self) -> tuple[float, ...]:
        """Its corner [m] and one over its size [1/m], as shaders take them."""
        return (*self.corner.tolist(), *(1.0 / self.size).tolist())

    @property
    def tolerance(self) -> float:
        """How far from a wall a segment of the map may lie to be that wall [m]."""
        return _TOLERANCE * self.cell

    def clock(self, time: float, playback: float) -> tuple[float, float]:
        """A time of the run [s] in lengths of it, and the film's seconds in one length."""
        return (time - self.start) / self.length, self.length / playback

    def strips(self, segments: Float, picture: Image.Image, value: int) -> None:
        """Paint a value into a picture where segments (m, 4) cover cells."""
        draw, width = ImageDraw.Draw(picture), round(2.0 * _COVERS)
        for ends in (segments.reshape(-1, 2, 2) - self.corner).reshape(-1, 4) / self.cell - 0.5:
            draw.line(ends.tolist(), fill=value, width=width)

    def fan(self, scan: LaserScan, mirrors: Float, picture: Image.Image, value: int) -> None:
        """Paint a value into a picture where the beams of a scan in the film's frame pass."""
        draw, ways = ImageDraw.Draw(picture), beam_directions(scan.pose.theta, scan.angles)
        place = np.array([scan.pose.x, scan.pose.y])

        def fill(corners: Float) -> None:
            draw.polygon(((corners - self.corner) / self.cell - 0.5).ravel().tolist(), fill=value)

        far = min(scan.range_max, _FREE)
        reach = np.where(np.isfinite(scan.ranges), scan.ranges, far) + 0.5 * self.cell
        reach[scan.ranges == -np.inf] = 0.0
        if len(mirrors):
            legs, beams, gone = folded(place, place + reach[:, None] * ways, mirrors)
            for a, b in pairwise(legs):
                # Behind a mirror neighbouring beams light what lies between them.
                if np.hypot(*(a[:2] - b[:2])) < 1.0 and not (a[:2] == place).all():
                    fill(np.array([a[:2], a[2:], b[2:], b[:2]]))
            first = np.argsort(beams[gone == 0.0])
            reach = np.hypot(*(legs[gone == 0.0] @ _SPAN).T)[first] + 0.5 * self.cell
        # Between two beams light goes as far as both do where they meet one wall, else as the
        # nearer: what stands there may hide the rest.
        one = (scan.walls[:-1] == scan.walls[1:]) & (scan.walls[:-1] >= 0)
        one |= np.abs(np.diff(reach)) < 2.0 * self.cell
        low = np.minimum(reach[:-1], reach[1:])
        right, left = np.where(one, reach[:-1], low), np.where(one, reach[1:], low)
        ends = np.stack([right[:, None] * ways[:-1], left[:, None] * ways[1:]], axis=1)
        # A single beam has no neighbour: it lights a line.
        ends = ends.reshape(-1, 2) if len(ways) > 1 else reach[:, None] * ways
        fill(place + np.concatenate([ends, [[0.0, 0.0]]]))


_SPAN = np.array([[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
"""Makes vectors from their ends."""


def unexposed(structures: Structures, low: Float, high: Float) -> Exposure:
    """The times of a world in a box from low to high (2,) [m] before anything has been seen."""
    least = _CELL_INDOOR if structures.indoor else _CELL
    cell = max(least, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
    columns, rows = np.maximum(np.ceil((high - low) / cell), 2).astype(int).tolist()
    times = np.full((rows, columns, 4), _NEVER, np.float32)
    times[..., 1] = times[..., 3] = 0.0
    return Exposure(times, low, cell, 0.0, 1.0)


def expose(run: Run, structures: Structures, low: Float, high: Float) -> Exposure:
    """The first-seen times of a run in a box from low to high (2,) of the film's frame [m]."""
    origin = structures.origin
    poses = (run.trajectory if run.estimate is None else run.estimate).poses - [*origin, 0.0]
    if not len(poses):
        return unexposed(structures, low, high)
    # No farther from the path than anything was measured.
    far = float(np.max(run.ranges, initial=_FREE, where=np.isfinite(run.ranges)))
    low = np.maximum(low, poses[:, :2].min(axis=0) - far - 2.0)
    high = np.maximum(np.minimum(high, poses[:, :2].max(axis=0) + far + 2.0), low + 1.0)
    bare, times = unexposed(structures, low, high), run.trajectory.times
    length = max(float(times[-1] - times[0]), 1e-3)
    exposure = Exposure(bare.times, low, bare.cell, float(times[0]), length)
    size = bare.times.shape[1::-1]
    first, mirrors = Image.new("I", size), _mirrors(run.world, origin)
    # From the last scan to the first: what was seen first lies on top.
    step = 1 + (len(poses) - 1) // _MOST_SCANS
    for number in range(0, len(poses), step)[::-1]:
        for lrf, scan in zip(run.lasers, run.scans_at(number), strict=True):
            placed = replace(unrolled(scan), pose=as_pose(lrf.placed(poses[number])))
            exposure.fan(placed, mirrors, first, number + 1)
    seen: Bool = np.asarray(first) > 0
    near = distance_transform_edt(~seen, return_distances=False, return_indices=True)
    scans = np.maximum(np.asarray(first)[tuple(near)] - 1, 0)
    share = (times - times[0]) / length
    found = bare.times
    found[..., 0] = gaussian_filter(share[scans].astype(np.float32), _SOFT)
    found[..., 1] = soft_rim(seen)
    covered = Image.new("I", size)
    for number, line_map in reversed(list(zip(run.snapshot_scans, run.maps, strict=True))):
        exposure.strips(line_map.segments - np.tile(origin, 2), covered, number + 1)
    mapped = np.append(_NEVER, share)[np.asarray(covered)]
    # What the map has between two lit places is coloured with them.
    lit = minimum_filter(found[..., 0], _BRIDGED)
    found[..., 2] = np.maximum(mapped, lit + _GAP / length)
    found[..., 3] = gaussian_filter(wave(exposure, poses[scans, :2], structures.indoor), _SOFT)
    # Beyond the picture nothing is seen.
    found[[0, -1], :, 1] = found[:, [0, -1], 1] = 0.0
    return exposure


class LiveExposure:
    """The times of a drive that goes on, lit by each scan as it comes, from those before it."""

    def __init__(self, exposure: Exposure, structures: Structures, world: World) -> None:
        self.exposure = replace(exposure, times=exposure.times.copy())
        self._structures = structures
        self._mirrors = _mirrors(world, structures.origin)
        self._poses: Float | None = None
        self._fresh: tuple[Int, Int] | None = None

    def see(self, scans: Sequence[LaserScan], time: float) -> None:
        """Light what the beams of the scans of a time [s] pass, if the robot has moved."""
        origin = [*self._structures.origin, 0.0]
        poses = np.array([scan.pose for scan in scans]) - origin
        if self._poses is not None and (np.abs(poses - self._poses) < _MOVED).all():
            return
        self._poses = poses
        for pose, scan in zip(poses, scans, strict=True):
            self._light(replace(scan, pose=as_pose(pose)), time)

    def _light(self, scan: LaserScan, time: float) -> None:
        place, whole = np.array(scan.pose[:2]), self.exposure
        far = np.max(scan.ranges, initial=min(scan.range_max, _FREE), where=scan.hits) + whole.cell
        size = np.array(whole.times.shape[1::-1])
        low, high = (
            np.clip(((place + side * far - whole.corner) / whole.cell).astype(int), 1, size - 1)
            for side in (-1.0, 1.0)
        )
        if (high <= low).any():
            return
        times = whole.times[low[1] : high[1], low[0] : high[0]]
        part = replace(whole, times=times, corner=whole.corner + low * whole.cell)
        picture = Image.new("L", (high - low).tolist())
        part.fan(scan, self._mirrors, picture, 255)
        cover = soft_rim((np.asarray(picture) > 0) | (times[..., 1] > 0.5))
        first = (cover > 0.0) & (times[..., 1] == 0.0)
        times[first, 0], times[first, 2] = time, time + _GAP
        times[first, 3] = wave(part, place, self._structures.indoor)[first]
        np.maximum(times[..., 1], cover, out=times[..., 1])
        if self._fresh is not None:
            low, high = np.minimum(low, self._fresh[0]), np.maximum(high, self._fresh[1])
        self._fresh = low, high

    def fresh(self) -> tuple[Single, int, int] | None:
        """The part of the times (h, w, 4) that is new since the last call; its column and row."""
        if self._fresh is None:
            return None
        (left, low), (right, high) = (each.tolist() for each in self._fresh)
        self._fresh = None
        return self.exposure.times[low:high, left:right], left, low


def _mirrors(world: World, origin: Float) -> Float:
    """The mirrors (m, 4) of a world in the film's frame."""
    return world.segments[turning_walls(world)] - np.tile(origin, 2)


def soft_rim(seen: Bool) -> Float:
    """How surely cells (h, w) were seen, 0…1: teeth between beams close, and the rim is soft."""
    closed = binary_closing(np.pad(seen, 4), iterations=_CLOSED)[4:-4, 4:-4]
    soft = gaussian_filter(closed.astype(np.float32), 0.8 * _SOFT)
    return np.asarray(np.clip(1.6 * soft - 0.3, 0.0, 1.0))


def wave(exposure: Exposure, places: Float, indoor: bool) -> Single:
    """The delay (h, w) of light from places (h, w, 2) or (2,) [s of the film]."""
    rows, columns, _ = exposure.times.shape
    x = exposure.corner[0] + (np.arange(columns, dtype=np.float32) + 0.5) * exposure.cell
    y = exposure.corner[1] + (np.arange(rows, dtype=np.float32) + 0.5) * exposure.cell
    away = np.hypot(x - places[..., 0], y[:, None] - places[..., 1])
    return single(np.minimum(away / (_SPEED_INDOOR if indoor else _SPEED), _LONGEST_WAVE))


def sampled(exposure: Exposure, places: Float) -> Single:
    """The times (n, 4) at places (n, 2)."""
    cells = np.floor((places - exposure.corner) / exposure.cell).astype(int)
    columns, rows = np.clip(cells, 0, np.array(exposure.times.shape[1::-1]) - 1).T
    return np.asarray(exposure.times[rows, columns])
