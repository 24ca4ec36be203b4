"""The film that tells a run as a story, in shots of some seconds.

It opens from above, when nothing is known yet; then come the chase, a rising shot in which the map
draws itself, a look from near and one from high up, again and again in long runs; at the end houses
fade to ghosts and the walls of the map stand up.
"""

from dataclasses import replace

import numpy as np

from lrf3d.geometry import Float
from lrf3d.scene.camera import Camera, Look, SmoothPath
from lrf3d.scene.following import Chase, Orbit
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
"""Share of the way to the whole that a rising shot goes."""

_CLOSE, _CLOSE_STEEP = 4.6, float(np.radians(24.0))
"""How far off the robot a shot from near is [m], and how steeply it looks down at the least [rad].
"""

_CLOSE_SIDES, _TOO_STEEP = 6, float(np.radians(55.0))
"""Sides from which such a shot may begin, and how steeply it never looks down [rad]: of a robot
from above there is little to see."""

_HIGH, _HIGH_SHARE, _HIGH_STEEP = 50.0, 0.55, float(np.radians(60.0))
"""How far off the robot a shot from high up is at the most [m], and as a share of the way to where
the whole is seen from; and how steeply it looks down [rad], so that few houses hide the robot."""


class Story:
    """Shows a run in shots."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._path = SmoothPath(timeline)
        self._opening = Overview(timeline, structures)
        self._whole = Overview(timeline, structures, CARD)
        self._chase = Chase(timeline, structures)
        length = (timeline.end - timeline.start) / timeline.playback
        self._down = min(_DOWN, 0.4 * length)
        self._length = length
        self._count = max(1, round((length - self._down) / SHOT))
        orbits = [
            Orbit(timeline, structures, _CLOSE, _CLOSE_STEEP, float(turn))
            for turn in -2.2 + np.linspace(0.0, 2.0 * np.pi, _CLOSE_SIDES, endpoint=False)
        ]
        self._close = [self._clearest(orbits, number) for number in range(self._count)]

    def _clearest(self, orbits: list[Orbit], number: int) -> Camera:
        """The orbit that looks down the least in a shot; between near houses, the chase."""
        timeline, shot = self._timeline, (self._length - self._down) / self._count
        first, last = (
            timeline.start + timeline.playback * (self._down + place * shot)
            for place in (number, number + 1)
        )
        steep = [orbit.steepest(first, last) for orbit in orbits]
        least = int(np.argmin(steep))
        return orbits[least] if steep[least] < _TOO_STEEP else self._chase

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run, also before its start and after its end."""
        passed = (time - self._timeline.start) / self._timeline.playback
        if passed < self._down:
            near, far = self._chase.look(time, aspect), self._opening.look(time, aspect)
            share = _eased(1.0 - max(passed, 0.0) / self._down)
            known = "unknown" if passed <= _UNKNOWN else "chase"
            return replace(between(near, far, share), plan=False, shot=known)
        place = (passed - self._down) / max(self._length - self._down, 1e-9) * self._count
        number = min(int(place), self._count - 1)
        shot = self._shot(number, place - number, time, aspect)
        if passed <= self._length:
            return shot
        moved = _eased((passed - self._length) / (CLOSING - HELD))
        last = between(shot, self._whole.look(time, aspect), moved)
        return replace(last, plan=False, ghost=moved, raised=moved, shot="end")

    def _shot(self, number: int, share: float, time: float, aspect: float) -> Look:
        name = SHOTS[number % len(SHOTS)]
        if name == "close":
            return replace(self._close[number].look(time, aspect), shot="close")
        if name == "chase":
            return self._chase.look(time, aspect)
        far = self._whole.look(time, aspect)
        if name == "rise":
            near = self._chase.look(time, aspect)
            return replace(between(near, far, _RISEN * _eased(share)), shot="rise", plan=False)
        way = far.eye - far.target
        away = min(_HIGH, _HIGH_SHARE * float(np.linalg.norm(way)))
        target = np.array([*self._path.place(time), 0.0])
        level = np.cos(_HIGH_STEEP) * _unit(way[:2])
        eye = target + away * np.array([*level, np.sin(_HIGH_STEEP)])
        return Look(eye, target, far.field, near=0.5, air=far.air, plan=False, shot="high")


def between(near: Look, far: Look, share: float) -> Look:
    """A look on the way from one at the robot to one from far away, at a share 0…1 of it."""
    if share <= 0.0:
        return near
    robot = near.eye + _reach(near) * _unit(near.target - near.eye)
    offsets = [near.eye - robot, far.eye - far.target]
    away, turn, steep = np.array([_polar(offset) for offset in offsets]).T
    # The way is as long to the eye in each second; steps in and down come last.
    distance = float(np.exp(np.log(away[0]) + share * np.log(away[1] / away[0])))
    moved = (distance - away[0]) / (away[1] - away[0]) if away[1] != away[0] else share
    target = robot + moved * (far.target - robot)
    half = (turn[1] - turn[0] + np.pi) % (2.0 * np.pi) - np.pi
    angle = turn[0] + share * half
    down = steep[0] + np.sqrt(share) * (steep[1] - steep[0])
    level = distance * np.cos(down)
    way = [level * np.cos(angle), level * np.sin(angle), distance * np.sin(down)]
    eye = target + np.array(way)
    mixed = {
        name: getattr(near, name) + share * (getattr(far, name) - getattr(near, name))
        for name in ("field", "air", "shift")
    }
    return replace(near, eye=eye, target=target, **mixed)


def _reach(look: Look) -> float:
    """How far off the ground is in the middle of a look [m], within reason."""
    ahead = _unit(look.target - look.eye)
    return float(np.clip(look.eye[2] / max(-ahead[2], 0.05), 1.0, 12.0))


def _unit(way: Float) -> Float:
    return np.asarray(way / np.linalg.norm(way))


def _polar(offset: Float) -> tuple[float, float, float]:
    """Length [m], turn and rise [rad] of an offset (3,)."""
    level = float(np.hypot(offset[0], offset[1]))
    return (
        float(np.linalg.norm(offset)),
        float(np.arctan2(offset[1], offset[0])),
        float(np.arctan2(offset[2], level)),
    )


def _eased(share: float) -> float:
    """A share that leaves 0 and reaches 1 at rest."""
    share = float(np.clip(share, 0.0, 1.0))
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
