"""Key scans: the scans of all lasers at one moment, and how well other points agree with them.

Scans enter; key scans leave. A key scan classifies points as out of view, hidden behind a hit,
passed by a beam (a free-space violation), or hit. At the right place most points of another scan
are hit or new, and hardly any are passed.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import borrower, compiled
from lrf3d.geometry.lines import Float, Int, Records, wrap_angle
from lrf3d.geometry.pose import Pose, between
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import CENTRE
from lrf3d.laser.unrolling import unrolled
from lrf3d.matching.surface import (
    CELL,
    CONNECTED,
    CONNECTED_GROWTH,
    DEVIATIONS,
    FLATTEST,
    LEAST_NOISE,
    concatenated,
    placement,
    points_of,
    range_noise,
    surface_of_scan,
    thinned,
)

# Weight of the past in running means, at each scan.
FORGETTING = 0.98

# How a key scan sees a point. Of several lasers the highest value counts.
OUT_OF_VIEW, HIDDEN, PASSED, HIT = range(4)

# Distance behind a point [m] beyond which the end of a beam shows that it passed the point.
BEHIND = 0.3

# Distance of a beam's end from a point [m] within which the beam hit it.
AT = 0.05

# Largest share of points that beams may pass at a right place: doors open and people walk.
MOST_THROUGH = 0.04

# The same of a few scans: all of them may see a door that was closed or a lorry that has left, and
# lasers with ten beams see false corners.
MOST_THROUGH_PART = 0.2

# The scans of all lasers at one moment.
Moment = tuple[LaserScan, ...]


class Fans(NamedTuple):
    """The beams of lasers (f,) at x, y [m] on their robots.

    Each laser belongs to a key scan, by number, and its ranges have a standard deviation [m]. Its
    beams start at index ``first`` of all beams (b,), which have rising angles [rad] and ranges [m].
    """

    keys: Int
    x: Float
    y: Float
    noise: Float
    first: Int
    angles: Float
    ranges: Float


@dataclass(frozen=True, eq=False)
class Key:
    """A key scan: its number among all scans, and its pose (3,) in the front end's drifting frame.

    Its surface, in the frame of the robot, is matched with maps; its walls are added to them. Hits
    are the points of all returns, without normals.
    """

    scan: int
    pose: Float
    surface: Records
    walls: Records
    hits: Records
    fans: Fans

    @cached_property
    def far(self) -> float:
        """The distance [m] within which four of five hits lie."""
        return float(np.quantile(np.hypot(self.hits["x"], self.hits["y"]), 0.8))


class ScanConverter:
    """Converts scans to candidates for key scans, and estimates their range noise.

    Lasers without a mount stand a distance [m] ahead of the robot's centre.
    """

    def __init__(self, laser_offset: float = 0.0) -> None:
        self._laser = Pose(float(laser_offset), 0.0, 0.0)
        self._noise = 0.0

    def candidate(self, scan: LaserScan | Moment, number: int = 0) -> Key:
        """Convert the scans of a moment to a candidate for a key scan, at the origin."""
        scans = _still(scan)
        for each in scans:
            kept = FORGETTING if self._noise else 0.0
            self._noise = kept * self._noise + (1.0 - kept) * range_noise(each)
        fans, *others = (fan_of(each, self.mount(each), self._noise) for each in scans)
        if others:
            fans = all_fans([fans, *others])._replace(keys=np.zeros(len(scans), np.int64))
        surface, hits = self._seen(scans)
        return Key(number, np.zeros(3), surface, thinned(surface), hits, fans)

    def mount(self, scan: LaserScan) -> Pose:
        """The pose of a scan's laser on the robot."""
        return self._laser if scan.mount == CENTRE else scan.mount

    def surface(self, scan: LaserScan | Moment) -> Records:
        """The surface that the scans of a moment show, in the frame of the robot."""
        return self._seen(_still(scan))[0]

    def _seen(self, scans: Moment) -> tuple[Records, Records]:
        """The surface that scans show, and the points of all their returns."""
        noise = max(self._noise, LEAST_NOISE)
        hits = [points_of(each, self.mount(each)) for each in scans]
        seen = zip(scans, hits, strict=True)
        parts = [surface_of_scan(each, self.mount(each), points, noise) for each, points in seen]
        return concatenated(parts), concatenated(hits)


def _still(scan: LaserScan | Moment) -> Moment:
    """The scans of a moment, unrolled where the robot moved."""
    scans = (scan,) if isinstance(scan, LaserScan) else scan
    return tuple(each if each.motion is None else unrolled(each) for each in scans)


def fan_of(scan: LaserScan, mount: Pose, noise: float) -> Fans:
    """The beams of one laser."""
    x, y, heading = (np.array([value]) for value in mount)
    # A laser that is mounted upside down turns clockwise.
    order = -1 if scan.angles[0] > scan.angles[-1] else 1
    angles = (scan.angles + heading)[::order]
    ranges = scan.ranges[::order]
    first = np.array([0, len(ranges)])
    return Fans(np.zeros(1, np.int64), x, y, np.array([noise]), first, angles, ranges)


def all_fans(fans: Iterable[Fans]) -> Fans:
    """Join the fans of several key scans, which are numbered from 0."""
    keys, *at, first, angles, ranges = zip(*fans, strict=True)
    numbers = np.repeat(np.arange(len(keys)), [len(each) for each in keys])
    begins = np.cumsum(np.concatenate([[0], *(each[1:] - each[:-1] for each in first)]))
    x, y, noise = map(np.concatenate, at)
    return Fans(numbers, x, y, noise, begins, np.concatenate(angles), np.concatenate(ranges))


@compiled
def views_of(points: Records, poses: Float, fans: Fans) -> NDArray[np.uint8]:
    """How each of the key scans (k,) of fans sees points (m,): `OUT_OF_VIEW`, …, `HIT`, as (k, m).

    The frame of the points is at poses (k, 3), as seen from the key scans. Walls that beams run
    along are out of view.
    """
    views = np.zeros((len(poses), len(points)), np.uint8)
    for number, key in enumerate(fans.keys):
        first = fans.first[number]
        last = fans.first[number + 1] - 1
        at = placement(poses[key])
        begin = fans.angles[first]
        step = (fans.angles[last] - begin) / (last - first)
        for i in range(len(points)):
            point = points[i]
            dx = at.x + at.cos * point.x - at.sin * point.y - fans.x[number]
            dy = at.y + at.sin * point.x + at.cos * point.y - fans.y[number]
            distance = np.sqrt(dx * dx + dy * dy)
            nx = at.cos * point.nx - at.sin * point.ny
            ny = at.sin * point.nx + at.cos * point.ny
            # A post has no normal.
            if 0.0 < abs(nx * dx + ny * dy) <= FLATTEST * distance:
                continue
            away = np.arctan2(dy, dx) - begin
            away -= 2.0 * np.pi * np.floor(away / (2.0 * np.pi))
            beam = _nearest_beam(fans.angles, first, last, begin + away, away / step)
            if first < beam < last:
                view = _view_along(fans.ranges, beam, distance, DEVIATIONS * fans.noise[number])
                views[key, i] = max(views[key, i], view)
    return views


@borrower
def _nearest_beam(angles: Float, first: int, last: int, bearing: float, steps: float) -> int:
    """The beam nearest to a bearing [rad], which is some mean spacings from the first beam."""
    beam = min(first + max(int(steps + 0.5), 0), last)
    # Beams of several lasers taken together are not evenly spaced.
    while beam > first and bearing - angles[beam - 1] < angles[beam] - bearing:
        beam -= 1
    while beam < last and angles[beam + 1] - bearing < bearing - angles[beam]:
        beam += 1
    return beam


@borrower
def _view_along(ranges: Float, beam: int, distance: float, noise: float) -> int:
    """How a beam sees a point at a distance, by ranges that may be off by a noise [m].

    The shortest range of the beam and its neighbours counts, so that one that slips past an edge is
    no free-space violation. A point between two hits on one surface is hit as well.
    """
    one = ranges[beam]
    least = min(ranges[beam - 1], one, ranges[beam + 1])
    if not (least > 0.0 and np.isfinite(least)):
        return OUT_OF_VIEW
    near = AT + noise
    for side in range(-1, 2):
        other = ranges[beam + side]
        surface = abs(one - other) < CONNECTED + CONNECTED_GROWTH * distance
        if surface and min(one, other) - near < distance < max(one, other) + near:
            return HIT
    return PASSED if least > distance + (BEHIND + noise) else HIDDEN


def evidence(hits: Records, explained: float, poses: Float, fans: Fans) -> float:
    """The log odds of a place from which a scan hit points (m,).

    The share of points that matching explains and the share that other beams hit support the place;
    points that beams passed contradict it. Poses and fans are those of `views_of`.
    """
    if not len(hits):
        return -np.inf
    counted = 120  # Points of a scan that are enough as evidence.
    views = views_of(np.ascontiguousarray(hits[:: 1 + len(hits) // counted]), poses, fans)
    *_, passed, hit = np.bincount(views.max(axis=0), minlength=HIT + 1) / views.shape[1]
    shares = np.array([hit, explained])
    chance = 0.05  # Share of points that agree or disagree by chance.
    new = 0.1  # Weight of a point that is neither hit nor passed, relative to a passed one.
    against = passed + new * np.maximum(1.0 - shares - passed, 0.0)
    return float(np.log((shares + chance) / (against + chance)).sum())


def same_place(first: Float, second: Float, tolerance: float = 1.0) -> bool:
    """Whether two poses (3,) are the same place."""
    x, y, turn = first - second
    most_turned = 0.1  # Turn [rad] up to which two poses are one place.
    # From a cell apart, matching finds the same walls.
    near = np.hypot(x, y) < tolerance * CELL
    return bool(near and abs(wrap_angle(turn)) < tolerance * most_turned)


def seen_through_both(olds: Sequence[Key], new: Key, poses: Float) -> tuple[int, int]:
    """Count the points of a key scan that beams of older ones pass, and all in view, in both ways.

    The poses (k, 3) are those of the new one as seen from each older one. A point counts once for
    each key scan that has it in view.
    """
    views = [views_of(new.surface, poses, all_fans(old.fans for old in olds)).ravel()]
    for old, back in zip(olds, between(poses, np.zeros(3)), strict=True):
        views.append(views_of(old.surface, back[None], new.fans)[0])
    _, hidden, passed, hit = np.bincount(np.concatenate(views), minlength=4).tolist()
    return passed, hidden + passed + hit


class MixedPixelModel:
    """Learns the share of points that beams pass at right poses, from adjacent key scans.

    A mixed pixel is a range at which there is no surface: the beam met two surfaces at once, a
    hedge or glass. Their share differs between recordings.
    """

    def __init__(self) -> None:
        self._through = self._seen = 0

    def learn(self, olds: Iterable[Key], new: Key) -> None:
        """Add a key scan and those just before it, at the front end's poses."""
        if olds := list(olds):
            poses = between(np.array([key.pose for key in olds]), new.pose)
            through, seen = seen_through_both(olds, new, poses)
            self._through, self._seen = self._through + through, self._seen + seen

    @property
    def rate(self) -> float:
        """The share of passed points; 0 at first."""
        enough = 1000  # Points below which the rate is uncertain, and so is taken to be lower.
        return self._through / max(self._seen, enough)

    def contradict(self, olds: Sequence[Key], new: Key, poses: Float) -> bool:
        """Whether beams pass more points than they do at a right place."""
        through, seen = seen_through_both(olds, new, poses)
        return through > most_through(self.rate) * max(seen, 1)


def most_through(rate: float) -> float:
    """Largest share of points that beams may pass at a right place, by the rate of mixed pixels."""
    farther_off = 2.0  # Factor on the rate of adjacent scans: farther off, more edges are met.
    return MOST_THROUGH + farther_off * rate
