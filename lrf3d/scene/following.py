"""Cameras that go with the robot: behind it, round it, on top of it, and fixed ones that turn."""

from dataclasses import replace

import numpy as np

from lrf3d.scene.camera import Look, SmoothPath, Track
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline, interpolated
from lrf3d.world.cameras import FixedCamera


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
        path = SmoothPath.of(timeline)
        self.track = self.behind(path, structures).over_walls(structures, path.places)

    @classmethod
    def behind(cls, path: SmoothPath, structures: Structures) -> Track:
        """Looks from behind a path."""
        return Track.along(
            path,
            path.headings + np.pi,
            away=cls.AWAY_INDOOR if structures.indoor else cls.AWAY,
            steep=cls.LEAST_INDOOR if structures.indoor else cls.LEAST,
            field=cls.FIELD,
            shift=cls.SHIFT,
        )

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        return self.track.look(time, cuts=True, shot="chase")


class Orbit:
    """Goes slowly round the robot, and higher where a house is in between.

    It begins at a phase [rad], and keeps as far off [m] and looks down as steeply at the least
    [rad] as is given, or as is usual.
    """

    FIELD = float(np.radians(42.0))
    AWAY, AWAY_INDOOR = 11.5, 7.0
    """How far off the robot it is [m]."""
    LEAST, LEAST_INDOOR = float(np.radians(32.0)), float(np.radians(38.0))
    """How steeply it looks down at the least [rad]."""
    TURN, PHASE = np.radians(9.0), -2.2
    """Angle per second of the film [rad/s], and where it stands round the robot at first [rad]."""

    def __init__(
        self,
        timeline: Timeline,
        structures: Structures,
        away: float | None = None,
        least: float | None = None,
        phase: float = PHASE,
    ) -> None:
        path, indoor = SmoothPath.of(timeline), structures.indoor
        passed = (path.times - timeline.start) / timeline.playback
        self.track = Track.along(
            path,
            self.TURN * passed + phase,
            away=away or (self.AWAY_INDOOR if indoor else self.AWAY),
            steep=least or (self.LEAST_INDOOR if indoor else self.LEAST),
            field=self.FIELD,
        ).over_walls(structures, path.places)

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
    GLOW = 0.12
    """How much of the glow of the beams is left, which it looks through."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._height = timeline.run.lrf.height + self.OVER

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        x, y, theta = self._timeline.poses(np.array([time]))[0] - [*self._timeline.origin, 0.0]
        eye = np.array([x, y, self._height])
        ahead = np.array([np.cos(theta), np.sin(theta), self.UP])
        return Look(eye, eye + ahead, self.FIELD, fan=self.GLOW, shot="chase")


class Fixed:
    """Stands where the world says, and looks where it says, or turns with the robot.

    The farther off the robot is, the narrower is then its field: the robot stays in sight.
    """

    CALM = 12.5
    """Distance [m] from which on its field narrows."""
    NARROWEST = 0.15
    """What is left of its field at the least."""

    def __init__(self, camera: FixedCamera, timeline: Timeline) -> None:
        place = np.array([*timeline.origin, 0.0])
        eye, target = np.array(camera.position) - place, np.array(camera.target) - place
        ahead = target - eye
        # Straight down or up there is no side that is up but the north.
        level = np.hypot(ahead[0], ahead[1]) > 1e-6 * abs(ahead[2])
        up = (0.0, 0.0, 1.0) if level else (0.0, 1.0, 0.0)
        field = float(np.radians(camera.field_deg))
        self._look = Look(eye, target, field, up=up, shot=camera.name)
        self._path = SmoothPath.of(timeline) if camera.track else None

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        if self._path is None:
            return self._look
        place = interpolated(np.array([time]), self._path.times, self._path.places)
        eye, target = self._look.eye, np.append(place, 0.4)
        narrow = np.clip(self.CALM / np.linalg.norm(target - eye), self.NARROWEST, 1.0)
        return replace(self._look, target=target, field=self._look.field * float(narrow))
