"""The cameras of a film by name, and the one that shows a run as a story, in shots of some seconds.

It opens at the robot in the dark, and rises to show its first scan as a wave of light; then come
the chase, a rising shot, a look from near and one from high up, again and again in long runs; at
the end the whole is seen, and what the robot never saw becomes glass.
"""

from collections.abc import Callable
from functools import cache

import numpy as np

from lrf3d.geometry import Float
from lrf3d.scene.camera import STEP, Camera, Look, SmoothPath, Track
from lrf3d.scene.cameras import CARD, PHASE, First, Fixed, chase, orbit, overview, top
from lrf3d.scene.look import Rig
from lrf3d.scene.stage.structures import Structures
from lrf3d.scene.timeline import Timeline, interpolated
from lrf3d.world.cameras import check_view

OPENING, CLOSING = 1.6, 6.0
"""How long a story shows the robot before the run starts and the whole after it has ended [s of the
film]."""

SHOTS, _SHOT, HELD = ("chase", "rise", "close", "high"), 4.8, 3.2
"""Shots of the run, in their order, about how long each is, and how long the finished map and its
card are held at the end [s of the film]."""

_FIRST, _DARK, _DARK_TURN, _INTO_STREETS = 2.6, Rig(2.9, 13.0, 46.0, -0.25), 0.7, np.radians(25.0)
"""Time after the start in which the first scan is seen [s of the film]; how the eye looks at the
robot in the dark, and how far that turns round it [rad]; and how much steeper it looks down on its
way to where the whole is seen from [rad]: into streets, over the houses beside the robot."""

_ABOVE, _ABOVE_TURN, _SHARE = Rig(92.0, 66.0, 40.0), 0.5, 0.6
"""Where a rising shot ends, over the robot, what share of the robot's turns it follows, and how far
off shots from above are at the most, as a share of the distance from which the whole is seen."""

_CLOSE, _CLOSE_SIDES, _HIGH = Rig(4.6, 20.0, 42.0, -0.35), 6, Rig(64.0, 68.0, 34.0)
"""How a shot from near looks at the robot, from how many sides it may begin, and how a shot from
high up does."""


class Story:
    """Shows a run in shots."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline, self._structures = timeline, structures
        self._into_streets = 0.0 if structures.indoor else _INTO_STREETS
        self._path = SmoothPath.of(timeline)
        end = timeline.end + (CLOSING - 0.5 * HELD) * timeline.playback
        self._whole = overview(timeline, structures, CARD, at=end)
        followed = chase(timeline, structures)
        self._chase, self._cuts_near = followed.track(1.0), followed.shown["cuts"]
        turns = PHASE + np.linspace(0.0, 2.0 * np.pi, _CLOSE_SIDES, endpoint=False)
        self._close = [orbit(timeline, structures, _CLOSE, turn).track(1.0) for turn in turns]
        self._length = (timeline.end - timeline.start) / timeline.playback
        first = min(_FIRST, 0.4 * self._length)
        count = max(1, round((self._length - first) / _SHOT))
        self._shots = ["opening", *(SHOTS[shot % len(SHOTS)] for shot in range(count)), "end"]
        cuts = np.linspace(first, self._length, count + 1)
        self._cuts = np.array([-OPENING, *cuts, self._length + CLOSING])
        self._track = cache(self._made)

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run, also before its start and after its end."""
        passed = (time - self._timeline.start) / self._timeline.playback
        # The end begins when the run has ended.
        last = len(self._shots) - 1 - (passed <= self._length)
        number = int(np.clip(np.searchsorted(self._cuts, passed, "right") - 1, 0, last))
        shot, track = self._shots[number], self._track(number, aspect)
        if shot == "opening":
            return track.look(time, cuts=True, opens=passed > 0.0, shot="wave")
        if shot == "end":
            # Glass from the first picture on: what is lit is then seen from both sides.
            glass = max(float(_eased((passed - self._length) / (CLOSING - HELD))), 1e-3)
            return track.look(time, cuts=True, glass=glass, shot=shot)
        cuts = shot != "chase" or self._cuts_near
        return track.look(time, cuts=cuts, opens=shot in ("rise", "high"), shot=shot)

    def _made(self, number: int, aspect: float) -> Track:
        """The looks of a shot by its number."""
        begin, end = self._cuts[number : number + 2]
        passed = np.arange(begin, end + STEP, STEP)
        times = self._timeline.start + self._timeline.playback * passed
        near, whole = self._chase.at(times), self._whole.track(aspect).at(times)
        shot, path = self._shots[number], self._path
        places = interpolated(times, path.times, path.places)
        (ahead, *_), (side, *_), (farthest, *_) = near.turns, whole.turns, whole.aways

        def above(turns: Float, rig: Rig) -> Track:
            away = min(rig.away, _SHARE * float(farthest))
            return Track.along(SmoothPath(times, places, turns), turns, rig._replace(away=away))

        if shot == "opening":
            share = (passed - begin) / (end - begin)
            turns = ahead + _DARK_TURN * (1.0 - _eased(share))
            # The smoothed path of a fast film begins ahead of the robot.
            poses = self._timeline.poses(np.maximum(times, self._timeline.start))
            places = poses[:, :2] - self._timeline.origin
            dark = Track.along(SmoothPath(times, places, turns), turns, _DARK)
            dark = dark.past_walls(self._structures, places)
            shown = _eased((passed - 0.3 * begin) / (0.6 * end - 0.3 * begin))
            return self._between(dark, above(turns, self._structures.setting.wave), shown)
        if shot == "end":
            last = self._track(number - 1, aspect).at(times)
            return self._between(last, whole, _eased((passed - begin) / (CLOSING - HELD)))
        if shot == "rise":
            far = above(ahead + _ABOVE_TURN * (near.turns - ahead), _ABOVE)
            return self._between(near, far, _eased(1.15 * (passed - begin) / (end - begin)))
        if shot == "close":
            # The side from which it has the most room, and low walls hide the least.
            sides = [track.at(times) for track in self._close]
            return max(sides, key=lambda track: (track.aways.min(), -track.steeps.max()))
        return above(np.full(len(times), side), _HIGH) if shot == "high" else near

    def _between(self, near: Track, far: Track, share: Float) -> Track:
        """Looks along the path from the robot to far away, at shares (k,) 0…1 of it."""
        # The distance grows by the same factor in each second; steps in and down come last.
        aways = np.exp(np.log(near.aways) + share * np.log(far.aways / near.aways))
        gap = far.aways - near.aways
        moved = (aways - near.aways) / np.where(gap == 0.0, 1.0, gap)
        # The short way round as seen half-way, and for the whole shot: else the eye would leap.
        turned = far.turns - near.turns
        turned -= 2.0 * np.pi * np.round(turned[np.argmin(np.abs(share - 0.5))] / (2.0 * np.pi))
        down, fields = np.sqrt(share), near.fields + share * (far.fields - near.fields)
        # Seen from above, the robot would soon leave a picture that is moved up.
        steeps, shifts = (
            a + down * (b - a) for a, b in ((near.steeps, far.steeps), (near.shifts, far.shifts))
        )
        steeps += np.sin(np.pi * down) * self._into_streets
        middles = near.middles + moved[:, None] * (far.middles - near.middles)
        turns = near.turns + share * turned
        return Track(near.times, middles, turns, steeps, aways, fields, shifts)


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
    """Make the camera of a name, of every world or a fixed one of this, for a run.

    Raises:
        InputError: There is no camera of that name.
    """
    world = timeline.run.world
    check_view(view, world.cameras)
    if view in CAMERAS:
        return CAMERAS[view](timeline, structures)
    return Fixed(next(c for c in world.cameras if c.name == view), timeline)
