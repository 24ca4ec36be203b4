"""The film that shows a run as a story, in shots of some seconds.

It opens from above, when nothing is known yet; then come the chase, a rising shot in which the map
draws itself, a look from near and one from high up, again and again in long runs; at the end houses
fade to ghosts and the walls of the map stand up.
"""

import numpy as np

from lrf3d.geometry import Float
from lrf3d.scene.camera import Look, SmoothPath, Track
from lrf3d.scene.following import Chase, Orbit, track_of
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline
from lrf3d.scene.whole import CARD, Overview

OPENING, CLOSING = 3.0, 6.0
"""How long a story shows the whole before the run starts and after it has ended [s of the film]."""

SHOT = 4.8
"""About how long a shot is [s of the film]."""

SHOTS = ("chase", "rise", "close", "high")
"""Shots of the run, in their order."""

HELD = 3.2
"""How long the finished map and its card are held at the end [s of the film]."""

_DOWN = 1.5
"""Time after the start in which the eye goes down to the robot [s of the film]."""

_UNKNOWN = 0.2
"""Time after the start in which hardly anything is known yet [s of the film]."""

_RISEN = 0.85
"""Share of the distance to the view of the whole that a rising shot covers."""

_CLOSE, _CLOSE_STEEP, _CLOSE_SIDES = 4.6, float(np.radians(24.0)), 6
"""How far off the robot a shot from near is [m], how steeply it looks down at the least [rad], and
from how many sides it may begin."""

_HIGH, _HIGH_SHARE, _HIGH_STEEP = 50.0, 0.55, float(np.radians(60.0))
"""How far off the robot a shot from high up is at the most [m], and as a share of the distance to
where the whole is seen from; and how steeply it looks down at the least [rad]."""

_LEAVES, _CALM = 0.1, 0.3
"""Share of a path from the robot after which it leads over all walls, and the time [s of the film]
over which it does so."""


class Story:
    """Shows a run in shots."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline, self._structures = timeline, structures
        self._path = SmoothPath(timeline)
        self._opening = Overview(timeline, structures)
        self._whole = Overview(timeline, structures, CARD)
        self._chase = Chase(timeline, structures)
        turns = -2.2 + np.linspace(0.0, 2.0 * np.pi, _CLOSE_SIDES, endpoint=False)
        self._orbits = [
            Orbit(timeline, structures, _CLOSE, _CLOSE_STEEP, float(turn)).track for turn in turns
        ]
        self._length = (timeline.end - timeline.start) / timeline.playback
        self._down = min(_DOWN, 0.4 * self._length)
        self._count = max(1, round((self._length - self._down) / SHOT))
        self._tracks: dict[tuple[int, float], Track] = {}

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run, also before its start and after its end."""
        passed = (time - self._timeline.start) / self._timeline.playback
        place = (passed - self._down) / max(self._length - self._down, 1e-9) * self._count
        number = int(np.clip(np.floor(place), -1, self._count - 1))
        number = self._count if passed > self._length else number
        if (number, aspect) not in self._tracks:
            self._tracks[number, aspect] = self._track(number, aspect)
        track = self._tracks[number, aspect]
        if number < 0:
            shot = "unknown" if passed <= _UNKNOWN else "chase"
            return track.look(time, plan=False, cuts=True, shot=shot)
        if number == self._count:
            faded = _eased((passed - self._length) / (CLOSING - HELD))
            fading = {"ghost": float(faded), "raised": float(faded), "shot": "end"}
            return track.look(time, plan=False, cuts=True, **fading)
        shot = SHOTS[number % len(SHOTS)]
        near = 0.5 if shot == "high" else 0.2
        return track.look(time, plan=shot in ("chase", "close"), cuts=True, near=near, shot=shot)

    def _track(self, number: int, aspect: float) -> Track:
        """The looks of a shot by its number; that of the opening is −1."""
        begin, end = (
            self._down + place * (self._length - self._down) / self._count
            for place in (number, number + 1)
        )
        if number < 0:
            begin, end = -OPENING, self._down
        if number == self._count:
            begin, end = self._length, self._length + CLOSING
        passed = np.arange(begin, end + SmoothPath.STEP, SmoothPath.STEP)
        times = self._timeline.start + self._timeline.playback * passed
        chase, whole = self._chase.track.at(times), self._whole.track(aspect).at(times)
        if number < 0:
            share = _eased(1.0 - passed / self._down)
            return self._over(between(chase, self._opening.track(aspect).at(times), share), share)
        if number == self._count:
            share = _eased((passed - begin) / (CLOSING - HELD))
            last = self._track(number - 1, aspect).at(times)
            return self._over(between(last, whole, share), share)
        shot = SHOTS[number % len(SHOTS)]
        if shot == "rise":
            share = _RISEN * _eased((passed - begin) / (end - begin))
            return self._over(between(chase, whole, share), share)
        if shot == "close":
            # The side from which it looks down the least: from above, little is seen of it.
            sides = [chase, *(track.at(times) for track in self._orbits)]
            return min(sides, key=lambda track: float(track.steeps.max()))
        if shot == "high":
            away = min(_HIGH, _HIGH_SHARE * float(whole.aways[0]))
            turns = np.full(len(self._path.times), whole.turns[0])
            high = track_of(
                self._path, turns, away=away, steep=_HIGH_STEEP, field=float(whole.fields[0])
            )
            high = high.at(times)._replace(airs=whole.airs)
            places = high.middles[:, :2]
            return high.over_walls(self._structures, places, SmoothPath.SMOOTH / SmoothPath.STEP)
        return chase

    def _over(self, way: Track, share: Float) -> Track:
        """A way from the robot, at shares (k,) of it, that leads over walls."""
        places = np.array([self._path.place(time) for time in way.times])
        over = way.over_walls(self._structures, places, _CALM / SmoothPath.STEP)
        leads = np.clip(share / _LEAVES, 0.0, 1.0)
        return way._replace(steeps=way.steeps + leads * (over.steeps - way.steeps))


def between(near: Track, far: Track, share: Float) -> Track:
    """Looks along the path from the robot to far away, at shares (k,) 0…1 of it."""
    # The way is as long to the eye in each second; steps in and down come last.
    aways = np.exp(np.log(near.aways) + share * np.log(far.aways / near.aways))
    moved = (aways - near.aways) / np.where(far.aways == near.aways, 1.0, far.aways - near.aways)
    middles = near.middles + moved[:, None] * (far.middles - near.middles)
    half = (far.turns - near.turns + np.pi) % (2.0 * np.pi) - np.pi
    turns = near.turns + share * half
    steeps = near.steeps + np.sqrt(share) * (far.steeps - near.steeps)
    fields, shifts, airs = (a + share * (b - a) for a, b in zip(near[5:], far[5:], strict=True))
    return Track(near.times, middles, turns, steeps, aways, fields, shifts, airs)


def _eased(shares: Float | float) -> Float:
    """Shares that leave 0 and reach 1 at rest."""
    shares = np.clip(shares, 0.0, 1.0)
    return np.asarray(shares**3 * (10.0 - 15.0 * shares + 6.0 * shares**2))
