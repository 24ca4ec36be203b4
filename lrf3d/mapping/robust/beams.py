"""What a robust mapper makes of a scan before it judges its beams.

A scan enters; leave where it was taken in the map's own frame, how far each of its beams was free,
and how far off the places may be where they ended.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Records
from lrf3d.laser import LaserScan, RangeNoise

CELL = 0.1
"""[m] Size of a cell. What is kept of the ground grows with its square; at 0.2 the purity of the
objects of a town falls by 0.05."""

LOSS_ODDS = 0.01
"""[odds] A gap in a scan that lost beams leave by no more than such a chance is a real one."""

LEAST_LOST, MOST_LOST = 2, 8
"""[beams] How many beams beside each other may be lost at least, also where hardly any are, and at
most. More forgets what is seen through narrow gaps, less takes lost beams for gaps of walls."""


SHIFT = (0.37 * CELL, 0.41 * CELL)
"""[m] Where the first scan was taken in the map's frame: off the edges of the cells, on which
rounding would decide."""

MOST_FREE = 1_000.0
"""[m] How far a beam without return is taken to be free at most, however far its laser reaches."""

MOST_RANGE = 10_000.0
"""[m] No laser of a robot measures farther than this: such a range is not known."""


@inner
def range_deviation(noise: RangeNoise, reach: float) -> float:
    """Standard deviation [m] of a range [m]."""
    deviation: float = np.sqrt(noise.floor * noise.floor + (noise.growth * reach) ** 2)
    return deviation


class Frame(NamedTuple):
    """The map's own frame: that of the first scan, so that it turns and moves with the world."""

    x: float
    y: float
    theta: float

    @classmethod
    def of(cls, scan: LaserScan) -> "Frame":
        """The frame of a scan."""
        return cls(*(float(value) for value in scan.pose))

    def pose_of(self, scan: LaserScan) -> tuple[tuple[float, float], float]:
        """Where a scan was taken [m], and its heading [rad]."""
        dx, dy = scan.pose.x - self.x, scan.pose.y - self.y
        cos, sin = np.cos(self.theta), np.sin(self.theta)
        place = float(cos * dx + sin * dy + SHIFT[0]), float(cos * dy - sin * dx + SHIFT[1])
        return place, float(scan.pose.theta - self.theta)

    def in_world(self, segments: Float) -> Float:
        """Segments (n, 4) of this frame in the world."""
        cos, sin = np.cos(self.theta), np.sin(self.theta)
        turn = np.array([[cos, sin], [-sin, cos]])
        placed: Float = (segments.reshape(-1, 2) - SHIFT) @ turn + [self.x, self.y]
        return placed.reshape(-1, 4)


class Beams(NamedTuple):
    """The beams of a scan in the map's frame.

    Their unit vectors (n, 2); ranges (n,) [m], where nothing returned minus the range that is free,
    and 0 where nothing is known; and standard deviations (n,) [m] of the places where they end.
    """

    units: Float
    ranges: Float
    deviations: Float

    @classmethod
    def of(cls, scan: LaserScan, heading: float, noise: RangeNoise) -> "Beams":
        """The beams of a scan that was taken at a heading [rad]."""
        angles, measured = in_order(scan)
        headings = angles + heading
        count = len(headings)
        beams = cls(np.empty((count, 2)), np.empty(count), np.empty(count))
        np.cos(headings, out=beams.units[:, 0])
        np.sin(headings, out=beams.units[:, 1])
        measure_beams(plain(measured), float(scan.range_max), noise, pose_spread(scan), beams)
        return beams


def in_order(scan: LaserScan) -> tuple[Float, Float]:
    """Angles (n,) [rad] and ranges (n,) [m] of a scan by rising angle."""
    angles, ranges = scan.angles, scan.ranges
    if (angles[1:] < angles[:-1]).any():
        order = np.argsort(angles, kind="stable")
        angles, ranges = angles[order], ranges[order]
    return angles, ranges


def plain(values: Float) -> Float:
    """The values as an array of the one kind that the compiled code is made for."""
    if values.flags.c_contiguous and values.flags.writeable:
        return values
    return np.array(values)


@inner
def longest_loss(ranges: Float, range_max: float) -> int:
    """How many beams beside each other that return nothing are put down to beams that are lost.

    Each gap in a scan is taken for a lost beam to learn how often one is lost, at worst: of a scan
    without losses the gaps are few.
    """
    hits = gaps = 0
    returned = False
    for beam in range(len(ranges)):
        before, reach = returned, ranges[beam]
        returned = reach > 0.0 and reach <= range_max and reach < np.inf
        hits += returned
        gaps += before and not returned
    if gaps == 0 or gaps >= hits:
        return MOST_LOST if gaps else LEAST_LOST
    run = int(np.ceil(np.log(LOSS_ODDS) / np.log(gaps / hits)))
    return min(max(run, LEAST_LOST), MOST_LOST)


@compiled
def measure_beams(
    measured: Float,
    range_max: float,
    noise: RangeNoise,
    spread: tuple[float, float],
    beams: Beams,
) -> None:
    """Find how far beams were free, and how far off the places may be where they ended.

    A beam that is lost between two that returned says nothing: only where more beside each other
    return nothing, nothing is there. Ranges and deviations of the beams are filled in from measured
    ranges (n,) [m] by rising angle; see `pose_spread` for the spread.
    """
    ranges = beams.ranges
    count, missed, lost = len(measured), 0, longest_loss(measured, range_max)
    for beam in range(count + 1):
        if beam < count and measured[beam] > range_max:
            missed += 1
            continue
        if missed:
            # At the rim of the field of view there is no neighbour to lose it from.
            alone = missed <= lost and missed < beam < count
            for other in range(beam - missed, beam):
                ranges[other] = 0.0 if alone else -min(range_max, MOST_FREE)
            missed = 0
        if beam < count:
            # Nothing is known before what is too near, nor where any range may be measured.
            known = 0.0 < measured[beam] < MOST_RANGE
            ranges[beam] = measured[beam] if known else 0.0
    for beam in range(count):
        reach = ranges[beam]
        variance = noise.floor * noise.floor + (noise.growth * reach) * (noise.growth * reach)
        beams.deviations[beam] = np.sqrt(variance + (spread[0] + spread[1] * (reach * reach)))


def pose_spread(scan: LaserScan) -> tuple[float, float]:
    """What the pose's error adds to the variance of places: at no distance, and by its square."""
    covariance = scan.pose_covariance
    if covariance is None:
        return 0.0, 0.0
    return float(0.5 * (covariance[0, 0] + covariance[1, 1])), float(covariance[2, 2])


def widen(fits: Records, scan: LaserScan) -> None:
    """Let fits (n,) around the laser weigh no more than the error of the pose leaves them.

    All points of a scan share it, so that it does not average out.
    """
    if scan.pose_covariance is None:
        return
    own, turn = pose_spread(scan)
    less = 1.0 + fits["weight"] * (own + turn * np.hypot(fits["x"], fits["y"]) ** 2)
    for name in ("weight", "xx", "xy", "yy"):
        fits[name] /= less
