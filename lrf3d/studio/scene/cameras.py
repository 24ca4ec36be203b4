"""The cameras of a film by name: with the robot, fixed, of the whole, and one that tells a story.

The story shows a run in shots of some seconds. It opens at the robot in the dark, and rises to show
its first scan as a wave of light; then come the chase, a rising shot, a look from near and one from
high up, again and again in long runs; at the end the whole is seen, and what the robot never saw
becomes glass.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import shapely

from lrf3d.geometry.lines import Float
from lrf3d.studio.scene.camera import AIM, STEP, Camera, CameraPath, Look, PathCamera, SmoothPath
from lrf3d.studio.scene.look import SECTION, Rig
from lrf3d.studio.scene.stage.stage import STREET
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.timeline import Timeline, interpolated
from lrf3d.world.cameras import FixedCamera

# The chase camera in rooms with mirrors: it is low, and walls are not cut, so mirrors show the
# robot.
_CHASE_MIRRORS = Rig(3.4, 15.0, 56.0, -0.25)

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

# Share of the picture's height that is free above the whole.
_FREE_ABOVE = 0.05

# Share of the picture's height that is free below the whole, for text.
_FREE_BELOW = 0.06

# The same share where the text is a card.
CARD = 0.10

# Share of what is left of the picture that the world fills.
_FILL = 0.94

# Ratio of length and width of a world that is turned to fit better.
_LONG = 1.2

# Angle of view of an overview [rad].
_FIELD = float(np.radians(34.0))

# Angle of view from straight above [rad]: rays are nearly parallel, so that no wall leans over the
# map.
_TOP_FIELD = float(np.radians(3.0))

# Where an overview may stand [rad]: the sun shines on the sides of houses that are seen.
_SIDES = np.radians(np.arange(-110.0, 0.0, 5.0))[:, None]

# Angular speed of an overview [rad/s of the film].
_DRIFT = np.radians(1.2)

# Time before and after its middle for which an overview goes round [s of the film]: long films do
# not end at the back.
_LONGEST = 20.0

# Extent of a world from which on only what is near the drive is shown as the whole [m].
_LARGEST_WORLD = 600.0

# Distance from the drive up to which a larger world is shown [m].
_DRIVE_AROUND = 0.1 * _LARGEST_WORLD

# Height up to which buildings are in the picture of the whole [m].
_TALLEST_WALL = 14.0

# Least slope of a look in which the vertical is still up in the picture [m/m].
_STRAIGHT = 1e-6

# Distance from which on the angle of view of a fixed camera that turns narrows [m].
_CALM = 12.5

# Least share of the angle that is left, so that the robot stays in sight when it is far off.
_NARROWEST = 0.15

# Time for which a story shows the robot before the run starts [s of the film].
OPENING = 1.6

# Time for which a story shows the whole after the run has ended [s of the film].
CLOSING = 6.0

# Time for which the finished map and its card are held at the end [s of the film].
HELD = 3.2

# Least share of glass at the end: what is lit is seen from both sides from its first picture on.
_FIRST_GLASS = 1e-3

# Shots of the run, in their order.
SHOTS = ("chase", "rise", "close", "high")

# About how long each shot is [s of the film].
_SHOT = 4.8

# Time after the start in which the first scan is seen [s of the film].
_FIRST = 2.6

# Largest share of the run for which the first scan is shown.
_FIRST_SHARE = 0.4

# The camera in the dark.
_DARK = Rig(2.9, 13.0, shift=-0.25)

# Angle by which that camera turns round the robot [rad].
_DARK_TURN = 0.7

# When that camera begins to rise, as a share of the opening before the run starts.
_RISES = 0.3

# When that camera has risen, as a share of the time in which the first scan is seen.
_RISEN = 0.6

# How much steeper the eye looks down on its way to where the whole is seen from [rad]: into
# streets, over the houses beside the robot.
_INTO_STREETS = np.radians(25.0)

# The camera at the end of a rising shot, over the robot.
_ABOVE = Rig(92.0, 66.0, 40.0)

# Share of the robot's turns that a rising shot follows.
_ABOVE_TURN = 0.5

# Speed of a rising shot, in that which would take all its time: it ends at rest.
_ABOVE_SPEED = 1.15

# Largest distance of shots from above, as a share of that from which the whole is seen.
_SHARE = 0.6

# The camera of a shot from near.
_CLOSE = Rig(4.6, 20.0, 42.0, -0.35)

# Number of sides from which a shot from near may begin.
_CLOSE_SIDES = 6

# The camera of a shot from high up.
_HIGH = Rig(64.0, 68.0, 34.0)


def chase(timeline: Timeline, structures: Structures) -> PathCamera:
    """Follows the robot from behind, smoothly, and looks ahead with it.

    Among houses the eye comes nearer where a wall hides the robot; in rooms walls are cut.
    """
    # Where there are mirrors walls are not cut, before a low eye.
    path = SmoothPath.of(timeline)
    mirrors = structures.indoor and bool(structures.mirrors.any())
    track = behind(path, _CHASE_MIRRORS if mirrors else structures.setting.chase)
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
        up = (0.0, 0.0, 1.0) if np.hypot(east, north) > _STRAIGHT * abs(high) else (0.0, 1.0, 0.0)
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
    free_below: float = _FREE_BELOW,
    at: float | None = None,
) -> PathCamera:
    """Looks at the whole world from one side, and drifts slowly round it.

    It stands at that side at a time [s] of a story, or else in the middle of the run.
    """
    corners = corners_of(timeline, structures)
    passed = np.linspace(-_LONGEST, _LONGEST, 9)
    middle = 0.5 * (timeline.start + timeline.end) if at is None else at
    times = middle + passed * timeline.playback

    @cache
    def track(aspect: float) -> CameraPath:
        shape = structures.setting.steep, _FIELD, aspect, free_below
        # From the side from which the whole is as large as from any.
        tracks = [_fit(corners, times[:1], side, *shape) for side in _SIDES]
        side = min(tracks, key=lambda track: float(track.aways.min())).turns
        return _fit(corners, times, side + _DRIFT * passed, *shape)

    return PathCamera(track, {"cuts": True, "shot": "whole"})


def top(timeline: Timeline, structures: Structures) -> PathCamera:
    """Looks down on the whole world."""
    corners = corners_of(timeline, structures) * [1.0, 1.0, 0.0]
    wide, tall, _ = np.ptp(corners, axis=0)

    @cache
    def track(aspect: float) -> CameraPath:
        turned = (wide > tall) != (aspect > 1.0) and max(wide, tall) > _LONG * min(wide, tall)
        turn = np.array([np.pi if turned else -0.5 * np.pi])
        found = _fit(corners, np.zeros(1), turn, 0.5 * np.pi, _TOP_FIELD, aspect, _FREE_BELOW)
        return found._replace(aways=found.aways + float(structures.heights.max(initial=0.0)))

    return PathCamera(track, {"shows_map": True, "inset": False, "shot": "whole"})


def corners_of(timeline: Timeline, structures: Structures) -> Float:
    """Corners (n, 3) of all that is to be in a picture of the whole [m]."""
    path = timeline.run.trajectory.poses[:, :2] - timeline.origin
    ends = structures.places
    if len(ends) and float(np.ptp(ends, axis=0).max()) > _LARGEST_WORLD:
        low = path.min(axis=0) - _DRIVE_AROUND
        high = path.max(axis=0) + _DRIVE_AROUND
        ends = ends[((ends >= low) & (ends <= high)).all(axis=1)]
    # Streets reach past the houses.
    past = 0.5 if structures.indoor else 0.5 * STREET
    square = past * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
    level = (np.concatenate([ends, path])[:, None] + square).reshape(-1, 2)
    level = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(level)))
    tallest = SECTION if structures.indoor else _TALLEST_WALL
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
) -> CameraPath:
    """Looks from sides (k,) [rad], that steep [rad], that show corners (n, 3) as large as fits."""
    found = []
    room = _FILL * np.tan(0.5 * field) * np.array([aspect, 1.0 - _FREE_ABOVE - free_below])
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
    steeps, fields, shifts = (
        np.full(len(turns), each) for each in (steep, field, free_below - _FREE_ABOVE)
    )
    return CameraPath(times, np.column_stack(place), turns, steeps, aways, fields, shifts)


class Story:
    """Shows a run in shots."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._structures = structures
        self._into_streets = 0.0 if structures.indoor else _INTO_STREETS
        self._path = SmoothPath.of(timeline)
        end = timeline.end + (CLOSING - 0.5 * HELD) * timeline.playback
        self._whole = overview(timeline, structures, CARD, at=end)
        followed = chase(timeline, structures)
        self._chase = followed.track(1.0)
        self._cuts_near = followed.shown["cuts"]
        turns = PHASE + np.linspace(0.0, 2.0 * np.pi, _CLOSE_SIDES, endpoint=False)
        self._close = [orbit(timeline, structures, _CLOSE, turn).track(1.0) for turn in turns]
        self._length = (timeline.end - timeline.start) / timeline.playback
        first = min(_FIRST, _FIRST_SHARE * self._length)
        count = max(1, round((self._length - first) / _SHOT))
        self._shots = ["opening", *(SHOTS[shot % len(SHOTS)] for shot in range(count)), "end"]
        self._cuts = np.array(
            [-OPENING, *np.linspace(first, self._length, count + 1), self._length + CLOSING]
        )
        self._track = cache(self._made)

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run, also before its start and after its end."""
        passed = (time - self._timeline.start) / self._timeline.playback
        # The end begins when the run has ended.
        last = len(self._shots) - 1 - (passed <= self._length)
        number = int(np.clip(np.searchsorted(self._cuts, passed, "right") - 1, 0, last))
        shot = self._shots[number]
        track = self._track(number, aspect)
        if shot == "opening":
            return track.look(time, cuts=True, opens=passed > 0.0, shot="wave")
        if shot == "end":
            glass = max(float(_eased((passed - self._length) / (CLOSING - HELD))), _FIRST_GLASS)
            return track.look(time, cuts=True, glass=glass, shot=shot)
        cuts = shot != "chase" or self._cuts_near
        return track.look(time, cuts=cuts, opens=shot in ("rise", "high"), shot=shot)

    def _made(self, number: int, aspect: float) -> CameraPath:
        """The looks of a shot by its number."""
        begin, end = self._cuts[number : number + 2]
        passed = np.arange(begin, end + STEP, STEP)
        times = self._timeline.start + self._timeline.playback * passed
        near = self._chase.at(times)
        whole = self._whole.track(aspect).at(times)
        shot = self._shots[number]
        path = self._path
        places = interpolated(times, path.times, path.places)
        ahead, *_ = near.turns
        side, *_ = whole.turns
        farthest, *_ = whole.aways

        def above(turns: Float, rig: Rig) -> CameraPath:
            away = min(rig.away, _SHARE * float(farthest))
            return CameraPath.along(
                SmoothPath(times, places, turns), turns, rig._replace(away=away)
            )

        if shot == "opening":
            turns = ahead + _DARK_TURN * (1.0 - _eased((passed - begin) / (end - begin)))
            # The smoothed path of a fast film begins ahead of the robot.
            poses = self._timeline.poses(np.maximum(times, self._timeline.start))
            places = poses[:, :2] - self._timeline.origin
            dark = CameraPath.along(SmoothPath(times, places, turns), turns, _DARK)
            dark = dark.past_walls(self._structures, places)
            rises = _RISES * begin
            shown = _eased((passed - rises) / (_RISEN * end - rises))
            return self._between(dark, above(turns, self._structures.setting.wave), shown)
        if shot == "end":
            last = self._track(number - 1, aspect).at(times)
            return self._between(last, whole, _eased((passed - begin) / (CLOSING - HELD)))
        if shot == "rise":
            far = above(ahead + _ABOVE_TURN * (near.turns - ahead), _ABOVE)
            return self._between(near, far, _eased(_ABOVE_SPEED * (passed - begin) / (end - begin)))
        if shot == "close":
            # The side from which it has the most room, and low walls hide the least.
            sides = [track.at(times) for track in self._close]
            return max(sides, key=lambda track: (track.aways.min(), -track.steeps.max()))
        return above(np.full(len(times), side), _HIGH) if shot == "high" else near

    def _between(self, near: CameraPath, far: CameraPath, share: Float) -> CameraPath:
        """Looks along the path from the robot to far away, at shares (k,) 0…1 of it."""
        # The distance grows by the same factor in each second; steps in and down come last.
        aways = np.exp(np.log(near.aways) + share * np.log(far.aways / near.aways))
        gap = far.aways - near.aways
        moved = (aways - near.aways) / np.where(gap == 0.0, 1.0, gap)
        # The short way round as seen half-way, and for the whole shot: else the eye would leap.
        turned = far.turns - near.turns
        turned -= 2.0 * np.pi * np.round(turned[np.argmin(np.abs(share - 0.5))] / (2.0 * np.pi))
        down = np.sqrt(share)
        fields = near.fields + share * (far.fields - near.fields)
        # Seen from above, the robot would soon leave a picture that is moved up.
        steeps, shifts = (
            a + down * (b - a) for a, b in ((near.steeps, far.steeps), (near.shifts, far.shifts))
        )
        steeps += np.sin(np.pi * down) * self._into_streets
        middles = near.middles + moved[:, None] * (far.middles - near.middles)
        return CameraPath(
            near.times, middles, near.turns + share * turned, steeps, aways, fields, shifts
        )


def _eased(shares: Float | float) -> Float:
    """Shares that leave 0 and reach 1 at rest."""
    shares = np.clip(shares, 0.0, 1.0)
    return np.asarray(shares**3 * (10.0 - 15.0 * shares + 6.0 * shares**2))


CAMERAS: dict[str, Callable[[Timeline, Structures], Camera]] = {
    "chase": chase,
    "first": First,
    "orbit": orbit,
    "overview": overview,
    "story": Story,
    "top": top,
}


def margins(view: str) -> tuple[float, float]:
    """How long a film goes on before the run starts and after it has ended [s of the film]."""
    return (OPENING, CLOSING) if view == "story" else (0.0, 0.0)


def make_camera(view: str, timeline: Timeline, structures: Structures) -> Camera:
    """Make the camera of a name, of every world or a fixed one of this, for a run."""
    if view in CAMERAS:
        return CAMERAS[view](timeline, structures)
    return Fixed(next(c for c in timeline.run.world.cameras if c.name == view), timeline)
