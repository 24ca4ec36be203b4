"""The cameras of a film: those that move with the robot, fixed ones, and the overview."""

from dataclasses import replace
from functools import cache

import numpy as np
import shapely

from lrf3d.geometry.lines import Float
from lrf3d.studio.scene.camera import AIM, CameraPath, Look, PathCamera, SmoothPath
from lrf3d.studio.scene.look import SECTION, TINY, Rig
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.staging import STAGINGS
from lrf3d.studio.scene.timeline import Timeline, interpolated
from lrf3d.world.cameras import FixedCamera

# Angular speed of an orbit [rad/s of the film].
_TURN = np.radians(9.0)

# Where an orbit stands at first [rad].
PHASE = -2.2

# Angle of view from the top of the robot [rad].
_FIRST_FIELD = float(np.radians(62.0))

# Slope at which the view from the robot looks up.
_FIRST_UP = 0.09

# Height of the eye of that view over the laser [m], above the bands of the map.
_FIRST_OVER = 0.36

# Share of the picture that the world fills.
_FILL = 0.89

# Ratio of length and width of a world that is turned to fit better.
_LONG = 1.2

# How steeply an overview looks down in an upright picture [rad], which it then fills.
_UPRIGHT = float(np.radians(72.0))

# Angle of view of an overview [rad].
_FIELD = float(np.radians(34.0))

# Angle of view from straight above [rad]: rays are nearly parallel, so that no wall leans over the
# map.
_TOP_FIELD = float(np.radians(3.0))

# Where an overview may stand [rad]: the sun shines on the sides of houses that are seen.
_SIDES = np.radians(np.arange(-110.0, 0.0, 5.0))[:, None]

# Share of an overview's worth that it loses if the robot is hidden in the end.
_HIDDEN = 0.6

# Angular speed of an overview [rad/s of the film].
DRIFT = np.radians(1.2)

# Time before and after its middle for which an overview goes round [s of the film]: long films do
# not end at the back.
_LONGEST = 20.0

# How far the whole reaches past its walls [m].
_PAST = 0.5

# Share of the ends of a recording's walls that lie at each edge.
_FEW = 0.01

# Distance of an end from all others from which on it is left out, in the extent of these.
_RIM = 0.1

# Extent of a world from which on only what is near the drive is shown as the whole [m].
_LARGEST_WORLD = 600.0

# Distance from the drive up to which a larger world is shown [m].
_DRIVE_AROUND = 0.1 * _LARGEST_WORLD

# Height up to which buildings are in the picture of the whole [m].
_TALLEST_WALL = 14.0

# Distance from which on the angle of view of a fixed camera that turns narrows [m].
_CALM = 12.5

# Least share of the angle that is left, so that the robot stays in sight when it is far off.
_NARROWEST = 0.15


def chase(timeline: Timeline, structures: Structures) -> PathCamera:
    """Follows the robot from behind, smoothly, and looks ahead with it.

    Among houses the eye comes nearer where a wall hides the robot; in rooms walls are cut.
    """
    # Where there are mirrors walls are not cut, before a low eye, so that they show the robot.
    path = SmoothPath.of(timeline)
    mirrors = structures.indoor and bool(structures.mirrors.any())
    track = behind(path, STAGINGS["mirror"].first if mirrors else structures.setting.chase)
    track = track.past_walls(
        replace(structures, indoor=False) if mirrors else structures, path.places
    )
    return PathCamera(lambda aspect: track, {"cuts": not mirrors, "shot": "chase"})


def behind(path: SmoothPath, rig: Rig) -> CameraPath:
    """Looks from behind a path."""
    return CameraPath.along(path, path.headings + np.pi, rig)


def orbit(
    timeline: Timeline, structures: Structures, rig: Rig | None = None, phase: float = PHASE
) -> PathCamera:
    """Goes slowly round the robot from a phase [rad] on, and nearer where a house is in between."""
    path = SmoothPath.of(timeline)
    turns = _TURN * (path.times - timeline.start) / timeline.playback + phase
    track = CameraPath.along(path, turns, rig or structures.setting.orbit)
    track = track.past_walls(structures, path.places)
    return PathCamera(lambda aspect: track, {"cuts": True, "shot": "close"})


class First:
    """Looks ahead from the top of the robot, and a little up: that is where houses are."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._height = timeline.run.lasers[0].height + _FIRST_OVER

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
        eye = np.array(camera.position) - place
        target = np.array(camera.target) - place
        east, north, high = target - eye
        # Straight down or up there is no side that is up but the north.
        up = (0.0, 0.0, 1.0) if np.hypot(east, north) > TINY * abs(high) else (0.0, 1.0, 0.0)
        self._look = Look(eye, target, float(np.radians(camera.field_deg)), up=up, shot=camera.name)
        self._path = SmoothPath.of(timeline) if camera.track else None

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        if self._path is None:
            return self._look
        place = interpolated(np.array([time]), self._path.times, self._path.places)
        target = np.append(place, AIM)
        narrow = np.clip(_CALM / np.linalg.norm(target - self._look.eye), _NARROWEST, 1.0)
        return replace(self._look, target=target, field=self._look.field * float(narrow))


def overview(
    timeline: Timeline,
    structures: Structures,
    at: float | None = None,
    drift: float = DRIFT,
) -> PathCamera:
    """Shows the whole world from its best side, and drifts slowly round it [rad/s of the film].

    It reaches that side at a given time [s] of a story, or else in the middle of the run. In the
    end it sees the robot.
    """
    corners = corners_of(timeline, structures)
    passed = np.linspace(-_LONGEST, _LONGEST, 9)
    middle = 0.5 * (timeline.start + timeline.end) if at is None else at
    times = middle + passed * timeline.playback
    # Where the robot is in the end.
    last = timeline.poses(np.array([timeline.end]))[:, :2] - timeline.origin

    @cache
    def track(aspect: float) -> CameraPath:
        steep = structures.setting.steep if aspect > 1.0 else _UPRIGHT
        shape = steep, _FIELD, aspect
        tracks = [fitted(corners, times[:1], side, *shape) for side in _SIDES]
        # From where the ground takes the most of the picture, and no wall hides the robot.
        eyes = np.array([track.eyes() for track in tracks])
        ground = np.array([np.sin(track.steeps[0]) / track.aways[0] ** 2 for track in tracks])
        hidden = structures.hides(eyes, last, timeline.run.radius, structures.tops)
        worth = ground * (1.0 - _HIDDEN * hidden)
        best = tracks[int(np.argmax(worth))]
        return fitted(corners, times, best.turns + drift * passed, *shape)

    return PathCamera(track, {"cuts": True, "dusk": 1.0, "shot": "whole"})


def top(timeline: Timeline, structures: Structures) -> PathCamera:
    """Looks down on the whole world."""
    corners = corners_of(timeline, structures) * [1.0, 1.0, 0.0]
    wide, tall, _ = np.ptp(corners, axis=0)

    @cache
    def track(aspect: float) -> CameraPath:
        turned = (wide > tall) != (aspect > 1.0) and max(wide, tall) > _LONG * min(wide, tall)
        turn = np.array([np.pi if turned else -0.5 * np.pi])
        found = fitted(corners, np.zeros(1), turn, 0.5 * np.pi, _TOP_FIELD, aspect)
        return found._replace(aways=found.aways + float(structures.heights.max(initial=0.0)))

    return PathCamera(track, {"shows_map": True, "inset": 0.0, "shot": "whole"})


def places_of(run: Shown, structures: Structures) -> Float:
    """The ends of walls (n, 2) without those of a recording that are far from all others [m].

    What was seen through a door far away would make all else small.
    """
    ends = structures.places
    if run.knows_truth or not len(ends):
        return ends
    low, high = np.quantile(ends, [_FEW, 1.0 - _FEW], axis=0)
    rim = _RIM * (high - low)
    return np.asarray(ends[((ends >= low - rim) & (ends <= high + rim)).all(axis=1)])


def corners_of(timeline: Timeline, structures: Structures) -> Float:
    """Corners (n, 3) of all that is to be in a picture of the whole [m]."""
    run = timeline.run
    path = run.trajectory.poses[:, :2] - timeline.origin
    ends = places_of(run, structures)
    if len(ends) and float(np.ptp(ends, axis=0).max()) > _LARGEST_WORLD:
        low = path.min(axis=0) - _DRIVE_AROUND
        high = path.max(axis=0) + _DRIVE_AROUND
        ends = ends[((ends >= low) & (ends <= high)).all(axis=1)]
    square = _PAST * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
    level = (np.concatenate([ends, path])[:, None] + square).reshape(-1, 2)
    level = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(level)))
    tallest = SECTION if structures.indoor else _TALLEST_WALL
    top = min(float(structures.heights.max(initial=0.0)), tallest)
    return np.concatenate(
        [np.column_stack([level, np.full(len(level), height)]) for height in (0.0, top)]
    )


def fitted(
    corners: Float,
    times: Float,
    turns: Float,
    steep: float,
    field: float,
    aspect: float,
) -> CameraPath:
    """Looks from sides (k,) [rad], that steep [rad], that show corners (n, 3) as large as fits."""
    found = []
    room = _FILL * np.tan(0.5 * field) * np.array([aspect, 1.0])
    for turn in turns:
        level = np.cos(steep)
        back = np.array([np.cos(turn) * level, np.sin(turn) * level, np.sin(steep)])
        right = np.array([-np.sin(turn), np.cos(turn), 0.0])
        axes = np.column_stack([right, np.cross(back, right)])
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        away = 1.0
        for _ in range(6):
            local = (corners - middle) @ axes
            near = (corners - middle) @ back
            away = max(float(((np.abs(local) / room).max(axis=1) + near).max()), 1.0)
            # What is nearer is larger: the middle of the picture is not that of the box.
            seen = local / (away - near)[:, None]
            middle = middle + axes @ (0.5 * away * (seen.max(axis=0) + seen.min(axis=0)))
        found.append((*middle, away))
    *place, aways = np.array(found).T
    steeps, fields, shifts = (np.full(len(turns), each) for each in (steep, field, 0.0))
    return CameraPath(times, np.column_stack(place), turns, steeps, aways, fields, shifts)
