"""Cameras that go with the robot: behind it, round it, and on top of it."""

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from lrf3d.geometry import Float
from lrf3d.scene.camera import Look, SmoothPath, walls_met
from lrf3d.scene.look import FAN_SHARE_AHEAD
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline

_LOW = 1.2
"""Walls up to this height [m] do not hide the robot from the eye."""


class Chase:
    """Follows the robot from behind, smoothly, and looks ahead with it.

    Among houses the eye comes nearer where a wall is in its way; in rooms walls are cut off there.
    """

    BACK, BACK_INDOOR = 3.7, 3.0
    """How far behind the robot the eye is [m]."""
    HEIGHT, HEIGHT_INDOOR = 1.95, 2.1
    """Height of the eye [m]."""
    BELOW = np.radians(12.0)
    """Angle at which the robot is seen under the middle of the picture [rad]."""
    FIELD = float(np.radians(50.0))
    CLEARANCE = 0.30
    """Distance [m] that the eye keeps from walls."""
    NEAREST = 0.1
    """What is left of the way back [m] at the least; then the eye looks from above."""
    AIM = 0.3
    """Height of the robot's middle [m]."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        path = self._path = SmoothPath(timeline)
        self._indoor = structures.indoor
        # The least over the filter's reach comes first: its mean is then never past a wall.
        free = self.free_way(structures, path.places, path.headings)
        least = minimum_filter1d(free, 2 * int(2.0 * path.width) + 1, mode="nearest")
        self._back = gaussian_filter1d(least, path.width, mode="nearest", truncate=2.0)

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        x, y, heading, back = (
            float(np.interp(time, self._path.times, values))
            for values in (*self._path.places.T, self._path.headings, self._back)
        )
        return self.behind(x, y, heading, back, indoor=self._indoor)

    @classmethod
    def behind(cls, x: float, y: float, heading: float, back: float, *, indoor: bool) -> Look:
        """The look from so far [m] behind a place, along a heading [rad]."""
        forward = np.array([np.cos(heading), np.sin(heading), 0.0])
        # The nearer the eye, the higher it is and the steeper it looks.
        height = cls.HEIGHT_INDOOR if indoor else cls.HEIGHT + 0.9 * (1.0 - back / cls.BACK)
        eye = np.array([x, y, height]) - back * forward
        down = np.arctan2(height - cls.AIM, back) - cls.BELOW
        target = eye + np.cos(down) * forward - [0.0, 0.0, np.sin(down)]
        return Look(eye, target, cls.FIELD, cuts=True, shot="chase")

    @classmethod
    def free_way(cls, structures: Structures, places: Float, headings: Float) -> Float:
        """How far (k,) behind places (k, 2) no tall wall is in the way of the eye [m]."""
        if structures.indoor:
            return np.full(len(places), cls.BACK_INDOOR)
        backward = -np.column_stack([np.cos(headings), np.sin(headings)])
        sideways = np.column_stack([-backward[:, 1], backward[:, 0]])
        free = np.full(len(places), cls.BACK)
        for side in (-cls.CLEARANCE, 0.0, cls.CLEARANCE):
            ends = places + (cls.BACK + cls.CLEARANCE) * backward + side * sideways
            point, wall, gap = walls_met(structures, places, ends)
            tall = structures.heights[wall] > _LOW
            np.minimum.at(free, point[tall], gap[tall] - 1.5 * cls.CLEARANCE)
        return np.asarray(np.maximum(free, cls.NEAREST))


class Orbit:
    """Goes slowly round the robot, and higher where a house is in between.

    Args:
        away: How far off the robot it is [m]; as far as is usual if not given.
        least: How steeply it looks down at the least [rad].
        phase: Where it stands round the robot at first [rad].
    """

    FIELD = float(np.radians(42.0))
    AWAY, AWAY_INDOOR = 11.5, 7.0
    """How far off the robot it is [m]."""
    LEAST, LEAST_INDOOR = float(np.radians(32.0)), float(np.radians(38.0))
    """How steeply it looks down at the least [rad]."""
    TURN = np.radians(9.0)
    """Angle per second of the film [rad/s]."""
    STEEPEST = np.radians(80.0)
    """How steeply it looks down at the most [rad]."""
    MARGIN = np.radians(4.0)
    """How far above the edge of a roof it keeps [rad]."""

    def __init__(
        self,
        timeline: Timeline,
        structures: Structures,
        away: float | None = None,
        least: float | None = None,
        phase: float = -2.2,
    ) -> None:
        path = self._path = SmoothPath(timeline)
        self._timeline, self._phase = timeline, phase
        indoor = structures.indoor
        self._away = away or (self.AWAY_INDOOR if indoor else self.AWAY)
        least = least or (self.LEAST_INDOOR if indoor else self.LEAST)
        self._angles = np.full(len(path.times), least)
        if indoor:
            return
        turns = self._turns(path.times)
        sides = np.column_stack([np.cos(turns), np.sin(turns)])
        ends = path.places + self._away * float(np.cos(least)) * sides
        point, wall, gap = walls_met(structures, path.places, ends)
        needed = np.arctan2(structures.heights[wall], np.maximum(gap, 1e-3)) + self.MARGIN
        np.maximum.at(self._angles, point, needed)
        # The most over the filter's reach comes first: its mean is then never too low.
        most = maximum_filter1d(self._angles, 2 * int(2.0 * path.width) + 1, mode="nearest")
        smooth = gaussian_filter1d(most, path.width, mode="nearest", truncate=2.0)
        self._angles = np.clip(smooth, least, self.STEEPEST)

    def _turns(self, times: Float) -> Float:
        """Where the eye stands round the robot at times [rad]."""
        passed = (times - self._timeline.start) / self._timeline.playback
        return np.asarray(self.TURN * passed + self._phase)

    def steepest(self, first: float, last: float) -> float:
        """How steeply it looks down at the most between two times [rad]."""
        within = (self._path.times >= first) & (self._path.times <= last)
        return float(self._angles[within].max(initial=0.0))

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        turn = self._turns(np.array([time]))[0]
        steep = float(np.interp(time, self._path.times, self._angles))
        middle = np.array([*self._path.place(time), 0.4])
        side = np.array([np.cos(turn) * np.cos(steep), np.sin(turn) * np.cos(steep), np.sin(steep)])
        eye = middle + self._away * side
        return Look(eye, middle, self.FIELD, cuts=True, shot="close")


class First:
    """Looks ahead from the top of the robot, and a little up: that is where houses are."""

    FIELD = float(np.radians(62.0))
    UP = 0.09
    """How much it looks up, as the slope of its way."""
    OVER = 0.36
    """How far over the laser the eye is [m]: above the bands of the map."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._height = timeline.run.lrf.height + self.OVER

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        x, y, theta = self._timeline.poses(np.array([time]))[0]
        origin = self._timeline.origin
        eye = np.array([x - origin[0], y - origin[1], self._height])
        ahead = np.array([np.cos(theta), np.sin(theta), self.UP])
        return Look(eye, eye + ahead, self.FIELD, fan=FAN_SHARE_AHEAD, shot="chase")
