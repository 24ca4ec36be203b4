"""Cameras that go with the robot: behind it, round it, on top of it, and fixed ones that turn."""

from dataclasses import replace

import numpy as np

from lrf3d.scene.beams import turning_walls
from lrf3d.scene.camera import Look, Rig, SmoothPath, Track, Tracked
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline, interpolated
from lrf3d.world.cameras import FixedCamera

_CHASE, _CHASE_INDOOR = Rig(4.1, 24.0, 50.0, -0.45), Rig(4.4, 33.0, 50.0, -0.3)
"""How the chase goes behind the robot, which is in the lower half of its picture."""

_CHASE_MIRRORS = Rig(3.4, 15.0, 56.0, -0.25)
"""How it goes where mirrors stand in rooms: so low, in walls that are not cut, they show the robot.
"""

_ORBIT, _ORBIT_INDOOR = Rig(7.0, 20.0, 46.0, -0.3), Rig(7.0, 38.0, 42.0)
"""How an orbit goes round it."""

_TURN, PHASE = np.radians(9.0), -2.2
"""Angle of an orbit per second of the film [rad/s], and where it stands at first [rad]."""

_FIRST_FIELD, _FIRST_UP, _FIRST_OVER = float(np.radians(62.0)), 0.09, 0.36
"""Angle of view from the top of the robot [rad], how much it looks up, as a slope, and how far over
the laser the eye is [m], above the bands of the map."""

_CALM, _NARROWEST = 12.5, 0.15
"""Distance [m] from which on the field of a fixed camera that turns narrows, and what is left of it
at the least: the farther off the robot is, it stays in sight."""


def chase(timeline: Timeline, structures: Structures) -> Tracked:
    """Follows the robot from behind, smoothly, and looks ahead with it.

    Among houses the eye comes nearer where a wall hides the robot; in rooms walls are cut.
    """
    path = SmoothPath.of(timeline)
    if has_mirrors(timeline, structures):
        track = Track.along(path, path.headings + np.pi, _CHASE_MIRRORS)
        track = track.past_walls(replace(structures, indoor=False), path.places)
        return Tracked(lambda aspect: track, {"shot": "chase"})
    track = behind(path, structures).past_walls(structures, path.places)
    return Tracked(lambda aspect: track, {"cuts": True, "shot": "chase"})


def has_mirrors(timeline: Timeline, structures: Structures) -> bool:
    """Whether mirrors stand in these rooms, whose walls are then not cut before a low eye."""
    return structures.indoor and bool(turning_walls(timeline.run.world).any())


def behind(path: SmoothPath, structures: Structures) -> Track:
    """Looks from behind a path."""
    rig = _CHASE_INDOOR if structures.indoor else _CHASE
    return Track.along(path, path.headings + np.pi, rig)


def orbit(
    timeline: Timeline, structures: Structures, rig: Rig | None = None, phase: float = PHASE
) -> Tracked:
    """Goes slowly round the robot from a phase [rad] on, and nearer where a house is in between."""
    path = SmoothPath.of(timeline)
    turns = _TURN * (path.times - timeline.start) / timeline.playback + phase
    usual = _ORBIT_INDOOR if structures.indoor else _ORBIT
    track = Track.along(path, turns, rig or usual).past_walls(structures, path.places)
    return Tracked(lambda aspect: track, {"cuts": True, "shot": "close"})


class First:
    """Looks ahead from the top of the robot, and a little up: that is where houses are."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._height = timeline.run.lrf.height + _FIRST_OVER

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        x, y, theta = self._timeline.poses(np.array([time]))[0] - [*self._timeline.origin, 0.0]
        eye = np.array([x, y, self._height])
        ahead = np.array([np.cos(theta), np.sin(theta), _FIRST_UP])
        return Look(eye, eye + ahead, _FIRST_FIELD, shot="chase")


class Fixed:
    """Stands where the world says, and looks where it says, or turns with the robot."""

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
        narrow = np.clip(_CALM / np.linalg.norm(target - eye), _NARROWEST, 1.0)
        return replace(self._look, target=target, field=self._look.field * float(narrow))
