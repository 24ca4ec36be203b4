"""Cameras that go with the robot: behind it, round it, and on top of it."""

import numpy as np

from lrf3d.geometry import Float
from lrf3d.scene.camera import Look, SmoothPath, Track
from lrf3d.scene.look import FAN_SHARE_AHEAD
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline


def track_of(
    path: SmoothPath, turns: Float, *, away: float, steep: float, field: float, shift: float = 0.0
) -> Track:
    """Looks at the robot along its path from sides [rad], that far off [m] and that steep [rad]."""
    count = len(path.times)
    middles = np.column_stack([path.places, np.full(count, Orbit.AIM)])
    others = (np.full(count, value) for value in (steep, away, field, shift, 0.0))
    return Track(path.times, middles, turns, *others)


class Chase:
    """Follows the robot from behind, smoothly, and looks ahead with it.

    Among houses the eye is higher where a wall hides the robot; in rooms walls are cut off there.
    """

    AWAY, AWAY_INDOOR = 4.1, 3.5
    """How far off the robot the eye is [m]."""
    LEAST, LEAST_INDOOR = float(np.radians(24.0)), float(np.radians(31.0))
    """How steeply it looks down at the least [rad]."""
    FIELD, SHIFT = float(np.radians(50.0)), -0.45
    """Angle of view [rad]; the robot is in the lower half of the picture."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        path = SmoothPath(timeline)
        track = self.behind(path, structures)
        self.track = track.over_walls(structures, path.places, path.SMOOTH / path.STEP)

    @classmethod
    def behind(cls, path: SmoothPath, structures: Structures) -> Track:
        """Looks from behind a path."""
        indoor = structures.indoor
        return track_of(
            path,
            path.headings + np.pi,
            away=cls.AWAY_INDOOR if indoor else cls.AWAY,
            steep=cls.LEAST_INDOOR if indoor else cls.LEAST,
            field=cls.FIELD,
            shift=cls.SHIFT,
        )

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        return self.track.look(time, cuts=True, shot="chase")


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
    AIM = 0.35
    """Height of the robot's middle [m]."""

    def __init__(
        self,
        timeline: Timeline,
        structures: Structures,
        away: float | None = None,
        least: float | None = None,
        phase: float = -2.2,
    ) -> None:
        path, indoor = SmoothPath(timeline), structures.indoor
        passed = (path.times - timeline.start) / timeline.playback
        track = track_of(
            path,
            self.TURN * passed + phase,
            away=away or (self.AWAY_INDOOR if indoor else self.AWAY),
            steep=least or (self.LEAST_INDOOR if indoor else self.LEAST),
            field=self.FIELD,
        )
        self.track = track.over_walls(structures, path.places, path.SMOOTH / path.STEP)

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        return self.track.look(time, cuts=True, shot="close")


class First:
    """Looks ahead from the top of the robot, and a little up: that is where houses are."""

    FIELD = float(np.radians(62.0))
    UP = 0.09
    """How much it looks up, as the slope of its sight."""
    OVER = 0.36
    """How far over the laser the eye is [m]: above the bands of the map."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._height = timeline.run.lrf.height + self.OVER

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        x, y, theta = self._timeline.poses(np.array([time]))[0] - [*self._timeline.origin, 0.0]
        eye = np.array([x, y, self._height])
        ahead = np.array([np.cos(theta), np.sin(theta), self.UP])
        return Look(eye, eye + ahead, self.FIELD, fan=FAN_SHARE_AHEAD, shot="chase")
