"""What a drive leaves behind: the robot's trail on the ground, and the map as it grows.

The keys of a drive and the maps of a run enter; leave the lines of the trail and of the map, in the
film's frame.
"""

from dataclasses import dataclass

import numpy as np
import shapely

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

_FASTEST = 1000.0
"""A robot that went faster than this [m/s] did not drive but was set down elsewhere."""

_FRESH = 0.95
"""Opacity of the trail where the robot is."""


def trail_lines(
    keys: DriveKeys, now: float, fade: float, colour: tuple[float, float, float] = TRAIL_COLOUR
) -> Lines:
    """The trail up to a time [s]; what is older is paler, after a time of fading [s]."""
    begun = min(len(keys.times) - 1, int(np.searchsorted(keys.times, now)))
    places, times = keys.poses[: begun + 1, :2].copy(), keys.times[: begun + 1]
    if begun and times[-1] > now:
        share = (now - times[-2]) / max(times[-1] - times[-2], 1e-12)
        places[-1] = places[-2] + share * (places[-1] - places[-2])
    old = np.clip((now - times) / fade, 0.0, 1.0)
    left = _FRESH + (TRAIL_OLD - _FRESH) * old * (2.0 - old)
    legs = np.flatnonzero(driven(keys)[:begun])
    opacities = np.column_stack([left[legs], left[legs + 1]])
    colours = np.tile(colour, (len(legs), 1))
    starts, ends = places[legs], places[legs + 1]
    return lines_at(TRAIL_HEIGHT, starts, ends, colours, opacities, TRAIL_WIDTH_PIXELS)


def driven(keys: DriveKeys) -> Bool:
    """Which legs (k − 1,) between keys the robot drove."""
    way = np.hypot(*np.diff(keys.poses[:, :2], axis=0).T)
    return np.asarray(way <= _FASTEST * np.diff(keys.times))


def thinned(keys: DriveKeys, error: float = 0.005) -> DriveKeys:
    """The keys without those that the robot passes while it drives evenly, to within an error [m].

    Lines are simplified (Douglas and Peucker, 1973) that run as the robot does, and as its path
    grows with time.
    """
    times, places = keys.times, keys.poses[:, :2]
    if len(times) < 3:
        return keys
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
    pace = way[-1] / (times[-1] - times[0])
    lines = np.column_stack([places, times]), np.column_stack([way, pace * times, times])
    simple = shapely.simplify(shapely.linestrings(lines), error, preserve_topology=False)
    kept = np.isin(times, shapely.get_coordinates(simple, include_z=True)[:, 2])
    return DriveKeys(times[kept], keys.poses[kept])


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
