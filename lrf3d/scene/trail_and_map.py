"""What a drive leaves behind: the robot's trail on the ground, and the map as it grows.

The keys of a drive and the maps of a run enter; leave the ribbon and the pieces of the trail, and
the lines and bands of the map, in the film's frame.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int
from lrf3d.mapping import LineMap
from lrf3d.run import Run
from lrf3d.scene.beams import lines_at
from lrf3d.scene.look import (
    TRAIL_COLOUR,
    TRAIL_HEIGHT,
    TRAIL_OLD,
    TRAIL_WIDTH_PIXELS,
    object_tints,
)
from lrf3d.scene.shapes import Lines
from lrf3d.scene.timeline import DriveKeys

_PIECE_ERROR = 0.03
"""How far a straight piece of the trail may be off [m], in place and along the way."""

_THIN_ERROR = 0.002
"""How far a leg of the trail may be off one of the keys that it replaces [m]."""

_BENT, _FINER = 0.02, 5
"""Turn of a leg [rad] from which on it is drawn as a curve, and the number of its pieces."""

_SHORTEST = 1e-3
"""Pieces of the trail below this length [m] are left out: a robot that turns on the spot."""


class TrailPiece(NamedTuple):
    """A straight piece of the trail, which grows evenly.

    Args:
        begin: When the robot is at its start, from the start of the run on [s].
        end: When it is at its end [s].
        start: (2,) its start [m].
        way: (2,) from its start to its end [m].
    """

    begin: float
    end: float
    start: Float
    way: Float


def trail_lines(keys: DriveKeys, now: float, fade: float) -> Lines:
    """The trail up to a time [s]; what is older is paler, after a time of fading [s]."""
    begun = legs_begun(keys, now)
    places, times = keys.poses[: begun + 1, :2].copy(), keys.times[: begun + 1]
    if begun and times[-1] > now:
        share = (now - times[-2]) / max(times[-1] - times[-2], 1e-12)
        places[-1] = places[-2] + share * (places[-1] - places[-2])
    old = np.clip((now - times) / fade, 0.0, 1.0)
    left = 0.95 + (TRAIL_OLD - 0.95) * old * (2.0 - old)
    driven = ~keys.set_down[:begun]
    ends = np.column_stack([left[:-1], left[1:]])[driven]
    colours = np.tile(TRAIL_COLOUR, (len(ends), 1))
    starts, stops = places[:-1][driven], places[1:][driven]
    return lines_at(TRAIL_HEIGHT, starts, stops, colours, ends, TRAIL_WIDTH_PIXELS)


def smoothed(keys: DriveKeys) -> DriveKeys:
    """The keys with more of them where the robot turns: there its trail is a curve.

    Between two poses the curve leaves and arrives along their headings (Hermite's cubic).
    """
    way = np.diff(keys.poses[:, :2], axis=0)
    length = np.hypot(way[:, 0], way[:, 1])
    bends = (np.abs(np.diff(keys.poses[:, 2])) > _BENT) & (length > _SHORTEST) & ~keys.set_down
    counts = np.where(bends, _FINER, 1)
    leg = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(leg)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[leg]
    straight = keys.poses[leg] + share[:, None] * (keys.poses[leg + 1] - keys.poses[leg])
    first, last = (
        length[leg, None] * np.column_stack([np.cos(turn), np.sin(turn)])
        for turn in (keys.poses[leg, 2], keys.poses[leg + 1, 2])
    )
    # How far the cubic leaves the straight line: by its slopes at both ends less the line's own.
    s = share[:, None]
    off = s * (1.0 - s) * ((1.0 - s) * (first - way[leg]) - s * (last - way[leg]))
    # A robot that drives backwards, or aside, has headings that are not its way's.
    ahead = np.einsum("ij,ij->i", first, way[leg]) > 0.9 * length[leg] ** 2
    straight[:, :2] += np.where((bends[leg] & ahead)[:, None], off, 0.0)
    times = keys.times[leg] + share * (keys.times[leg + 1] - keys.times[leg])
    return DriveKeys(
        np.append(times, keys.times[-1]),
        np.concatenate([straight, keys.poses[-1:]]),
        keys.set_down[leg],
    )


def thinned(keys: DriveKeys) -> DriveKeys:
    """The keys without those that lie where the robot drives evenly from one to the next."""
    before = -1
    while len(keys.times) != before:
        before = len(keys.times)
        # Of neighbours only every other one goes at a time: it is seen from where the others are.
        for parity in (1, 2):
            kept = np.ones(len(keys.times), dtype=bool)
            kept[parity:-1:2] = ~_is_between(keys)[parity - 1 :: 2]
            keys = DriveKeys(keys.times[kept], keys.poses[kept], keys.set_down[kept[:-1]])
    return keys


def _is_between(keys: DriveKeys) -> Bool:
    """Which keys (k − 2,) lie where the way from the one before to the next is at their time."""
    times, places = keys.times, keys.poses[:, :2]
    share = (times[1:-1] - times[:-2]) / np.maximum(times[2:] - times[:-2], 1e-12)
    even = places[:-2] + share[:, None] * (places[2:] - places[:-2])
    near = np.abs(even - places[1:-1]).max(axis=1, initial=0.0) < _THIN_ERROR
    return np.asarray(near & ~keys.set_down[:-1] & ~keys.set_down[1:])


def legs_begun(keys: DriveKeys, time: float) -> int:
    """How many legs of the trail have begun, from the start of the run on [s]."""
    return min(len(keys.times) - 1, int(np.searchsorted(keys.times, time)))


def straight_pieces(keys: DriveKeys) -> Iterator[TrailPiece]:
    """The trail in as few pieces as are straight and driven evenly."""
    times, places = keys.times, keys.poses[:, :2]
    first = 0
    while first < len(times) - 1:
        last = first + 1
        while last + 1 < len(times) and _is_straight(times, places, first, last + 1):
            last += 1
        way = places[last] - places[first]
        if np.hypot(*way) >= _SHORTEST and not keys.set_down[first:last].any():
            yield TrailPiece(float(times[first]), float(times[last]), places[first], way)
        first = last


@dataclass(frozen=True, eq=False, slots=True)
class DrawnMap:
    """A map as it is drawn, each object in its colour.

    Args:
        segments: (m, 4) its segments in the film's frame [m].
        colours: (m, 3) red, green, blue in 0…1.
    """

    segments: Float
    colours: Float

    @classmethod
    def from_map(cls, line_map: LineMap, objects: Int, origin: Float) -> "DrawnMap":
        """Take a map whose objects (m,) have numbers that last while it grows."""
        return cls(line_map.segments - np.tile(origin, 2), object_tints(objects))

    @classmethod
    def from_snapshot(cls, run: Run, number: int, origin: Float) -> "DrawnMap":
        """Take a map snapshot of a run; −1 is the empty map before the first."""
        if number < 0:
            return cls(np.zeros((0, 4)), np.zeros((0, 3)))
        return cls.from_map(run.maps[number], run.lasting_objects[number], origin)

    def lines(self, height: float, width: float, opacity: float, *, hidden: bool = False) -> Lines:
        """Its segments as lines at a height [m], of a width [pixels] and an opacity."""
        opacities = np.full((len(self.segments), 2), opacity)
        start, end = self.segments[:, :2], self.segments[:, 2:]
        return lines_at(height, start, end, self.colours, opacities, width, hidden=hidden)


def _is_straight(times: Float, places: Float, first: int, last: int) -> bool:
    share = (times[first : last + 1] - times[first]) / (times[last] - times[first])
    even = places[first] + share[:, None] * (places[last] - places[first])
    return bool(np.abs(places[first : last + 1] - even).max() < _PIECE_ERROR)
