"""The cameras that go with the robot, fixed ones, and those that show the whole."""

from dataclasses import replace
from functools import cache

import numpy as np
import shapely

from lrf3d.geometry import Float
from lrf3d.scene.camera import AIM, Look, SmoothPath, Track, Tracked
from lrf3d.scene.look import SECTION, Rig
from lrf3d.scene.stage.ground import STREET
from lrf3d.scene.stage.structures import Structures
from lrf3d.scene.timeline import Timeline, interpolated
from lrf3d.world.cameras import FixedCamera

_CHASE_MIRRORS = Rig(3.4, 15.0, 56.0, -0.25)
"""The chase camera in rooms with mirrors: it is low, and walls are not cut, so mirrors show the
robot."""

_TURN, PHASE = np.radians(9.0), -2.2
"""Angle of an orbit per second of the film [rad/s], and where it stands at first [rad]."""

_FIRST_FIELD, _FIRST_UP, _FIRST_OVER = float(np.radians(62.0)), 0.09, 0.36
"""Angle of view from the top of the robot [rad], how much it looks up, as a slope, and how far over
the laser the eye is [m], above the bands of the map."""

_FREE_ABOVE, _FREE_BELOW, CARD, _FILL, _LONG = 0.05, 0.06, 0.10, 0.94, 1.2
"""Shares of the picture's height that are free above the whole, and below for text, more for a
card; the share of what is left that the world fills; and how many times as long as wide a world is
that is turned to fit better."""

_FIELD, _TOP_FIELD = float(np.radians(34.0)), float(np.radians(3.0))
"""Angles of view of an overview and from straight above [rad], where rays are nearly parallel, so
that no wall leans over the map."""

_SIDES = np.radians(np.arange(-110.0, 0.0, 5.0))[:, None]
"""Where an overview may stand [rad]: the sun shines on the sides of houses that are seen."""

_DRIFT, _LONGEST = np.radians(1.2), 20.0
"""Angle per second of the film [rad/s] by which it goes round, and for how many seconds before and
after its middle: long films do not end at the back."""


def chase(timeline: Timeline, structures: Structures) -> Tracked:
    """Follows the robot from behind, smoothly, and looks ahead with it.

    Among houses the eye comes nearer where a wall hides the robot; in rooms walls are cut.
    """
    # Where there are mirrors walls are not cut, before a low eye.
    path, mirrors = SmoothPath.of(timeline), structures.indoor and bool(structures.mirrors.any())
    track = behind(path, _CHASE_MIRRORS if mirrors else structures.setting.chase)
    standing = replace(structures, indoor=False) if mirrors else structures
    track = track.past_walls(standing, path.places)
    return Tracked(lambda aspect: track, {"cuts": not mirrors, "shot": "chase"})


def behind(path: SmoothPath, rig: Rig) -> Track:
    """Looks from behind a path."""
    return Track.along(path, path.headings + np.pi, rig)


def orbit(
    timeline: Timeline, structures: Structures, rig: Rig | None = None, phase: float = PHASE
) -> Tracked:
    """Goes slowly round the robot from a phase [rad] on, and nearer where a house is in between."""
    path = SmoothPath.of(timeline)
    turns = _TURN * (path.times - timeline.start) / timeline.playback + phase
    track = Track.along(path, turns, rig or structures.setting.orbit)
    track = track.past_walls(structures, path.places)
    return Tracked(lambda aspect: track, {"cuts": True, "shot": "close"})


class First:
    """Looks ahead from the top of the robot, and a little up: that is where houses are."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._height = timeline.run.lrf.height + _FIRST_OVER

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        ((x, y, theta),) = self._timeline.poses(np.array([time])) - [*self._timeline.origin, 0.0]
        eye = np.array([x, y, self._height])
        ahead = np.array([np.cos(theta), np.sin(theta), _FIRST_UP])
        return Look(eye, eye + ahead, _FIRST_FIELD, shot="chase")


class Fixed:
    """Stands where the world says, and looks where it says, or turns with the robot."""

    def __init__(self, camera: FixedCamera, timeline: Timeline) -> None:
        place = np.array([*timeline.origin, 0.0])
        eye, target = np.array(camera.position) - place, np.array(camera.target) - place
        east, north, high = target - eye
        # Straight down or up there is no side that is up but the north.
        level = np.hypot(east, north) > 1e-6 * abs(high)
        up = (0.0, 0.0, 1.0) if level else (0.0, 1.0, 0.0)
        field = float(np.radians(camera.field_deg))
        self._look = Look(eye, target, field, up=up, shot=camera.name)
        self._path = SmoothPath.of(timeline) if camera.track else None

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        if self._path is None:
            return self._look
        place = interpolated(np.array([time]), self._path.times, self._path.places)
        eye, target = self._look.eye, np.append(place, AIM)
        # Distance [m] from which on the field of a fixed camera that turns narrows, and its least
        # share of the full one: the robot stays in sight when it is far off.
        calm, narrowest = 12.5, 0.15
        narrow = np.clip(calm / np.linalg.norm(target - eye), narrowest, 1.0)
        return replace(self._look, target=target, field=self._look.field * float(narrow))


def overview(
    timeline: Timeline,
    structures: Structures,
    free_below: float = _FREE_BELOW,
    at: float | None = None,
) -> Tracked:
    """Looks at the whole world from one side, and drifts slowly round it.

    It stands at that side at a time [s] of a story, or else in the middle of the run.
    """
    corners = corners_of(timeline, structures)
    passed = np.linspace(-_LONGEST, _LONGEST, 9)
    middle = 0.5 * (timeline.start + timeline.end) if at is None else at
    times = middle + passed * timeline.playback

    @cache
    def track(aspect: float) -> Track:
        shape = structures.setting.steep, _FIELD, aspect, free_below
        # From the side from which the whole is as large as from any.
        tracks = [_fit(corners, times[:1], side, *shape) for side in _SIDES]
        side = min(tracks, key=lambda track: float(track.aways.min())).turns
        return _fit(corners, times, side + _DRIFT * passed, *shape)

    return Tracked(track, {"cuts": True, "shot": "whole"})


def top(timeline: Timeline, structures: Structures) -> Tracked:
    """Looks down on the whole world."""
    corners = corners_of(timeline, structures) * [1.0, 1.0, 0.0]
    wide, tall, _ = np.ptp(corners, axis=0)

    @cache
    def track(aspect: float) -> Track:
        turned = (wide > tall) != (aspect > 1.0) and max(wide, tall) > _LONG * min(wide, tall)
        turn = np.array([np.pi if turned else -0.5 * np.pi])
        found = _fit(corners, np.zeros(1), turn, 0.5 * np.pi, _TOP_FIELD, aspect, _FREE_BELOW)
        tallest = float(structures.heights.max(initial=0.0))
        return found._replace(aways=found.aways + tallest)

    return Tracked(track, {"shows_map": True, "plan": False, "shot": "whole"})


def corners_of(timeline: Timeline, structures: Structures) -> Float:
    """Corners (n, 3) of all that is to be in a picture of the whole [m]."""
    path = timeline.run.trajectory.poses[:, :2] - timeline.origin
    ends = structures.places
    # Worlds longer than this [m] are shown only as far as they were driven and seen, with this
    # margin around the path [m]; and the height up to which buildings are in the picture [m].
    largest_world, drive_around, tallest_wall = 600.0, 60.0, 14.0
    if len(ends) and float(np.ptp(ends, axis=0).max()) > largest_world:
        low, high = path.min(axis=0) - drive_around, path.max(axis=0) + drive_around
        ends = ends[((ends >= low) & (ends <= high)).all(axis=1)]
    # Streets reach past the houses.
    past = 0.5 if structures.indoor else 0.5 * STREET
    square = past * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
    level = (np.concatenate([ends, path])[:, None] + square).reshape(-1, 2)
    level = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(level)))
    tallest = SECTION if structures.indoor else tallest_wall
    top = min(float(structures.heights.max(initial=0.0)), tallest)
    return np.concatenate(
        [np.column_stack([level, np.full(len(level), height)]) for height in (0.0, top)]
    )


def _fit(
    corners: Float,
    times: Float,
    turns: Float,
    steep: float,
    field: float,
    aspect: float,
    free_below: float,
) -> Track:
    """Looks from sides (k,) [rad], that steep [rad], that show corners (n, 3) as large as fits."""
    found = []
    room = _FILL * np.tan(0.5 * field) * np.array([aspect, 1.0 - _FREE_ABOVE - free_below])
    for turn in turns:
        level = np.cos(steep)
        back = np.array([np.cos(turn) * level, np.sin(turn) * level, np.sin(steep)])
        right = np.array([-np.sin(turn), np.cos(turn), 0.0])
        axes = np.column_stack([right, np.cross(back, right)])
        middle, away = 0.5 * (corners.min(axis=0) + corners.max(axis=0)), 1.0
        for _ in range(6):
            local, near = (corners - middle) @ axes, (corners - middle) @ back
            away = max(float(((np.abs(local) / room).max(axis=1) + near).max()), 1.0)
            # What is nearer is larger: the middle of the picture is not that of the box.
            seen = local / (away - near)[:, None]
            middle = middle + axes @ (0.5 * away * (seen.max(axis=0) + seen.min(axis=0)))
        found.append((*middle, away))
    *place, aways = np.array(found).T
    steeps, fields, shifts = (
        np.full(len(turns), each) for each in (steep, field, free_below - _FREE_ABOVE)
    )
    return Track(times, np.column_stack(place), turns, steeps, aways, fields, shifts)
