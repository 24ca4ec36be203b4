"""The oblique view of the whole, and the film that opens and ends with it.

A run and what stands in its world enter; looks leave, as functions of the film's time alone.
"""

from dataclasses import replace

import numpy as np
import shapely

from lrf3d.geometry import Float
from lrf3d.scene.camera import Chase, Look
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline
from lrf3d.scene.town import STREET

OPENING, CLOSING = 2.5, 3.0
"""How long a story shows the whole before the run starts and after it has ended [s of the film]."""

_PULL = 2.2
"""Time of the film [s] in which the eye pulls back to the finished map."""


class Overview:
    """Looks at all that was driven and seen from one side, and drifts slowly round it."""

    FIELD = float(np.radians(34.0))
    STEEP, STEEPER, STEEP_INDOOR = np.radians(37.0), np.radians(47.0), np.radians(56.0)
    """How steeply it looks down [rad]: at long, narrow towns up to the second, so that they fill
    more of the picture, and into rooms still more, so that near walls hide less."""
    FULL = 0.7
    """Share of the picture's height from which on it is full."""
    SIDES = (np.radians(-112.0), np.radians(-22.0), np.radians(-67.0))
    """Where it may stand [rad]: from each, two sides of houses are seen on which the sun shines."""
    AS_LARGE = 1.08
    """It stands at the first of them that is at most so many times as far off as the nearest."""
    AROUND, AROUND_INDOOR = 24.0, 1.5
    """What is shown around the path [m], where the world goes on."""
    WHOLE = 1.6
    """A world so many times as large as that is shown whole."""
    TALLEST = 14.0
    """Height [m] up to which buildings are in the picture for certain."""
    FILL = 0.93
    """Share of the picture that it fills."""
    DRIFT = np.radians(1.2)
    """Angle per second of the film [rad/s]."""
    AIR = 2.6
    """Reach of the air's haze, in distances to the middle: the whole is seen through clear air."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        path = timeline.run.trajectory.poses[:, :2] - timeline.origin
        ends = structures.places
        around = self.AROUND_INDOOR if structures.indoor else self.AROUND
        low, high = path.min(axis=0) - around, path.max(axis=0) + around
        if len(ends) and (np.ptp(ends, axis=0) > self.WHOLE * (high - low)).any():
            ends = ends[((ends >= low) & (ends <= high)).all(axis=1)]
        # Streets reach past the houses.
        past = 0.0 if structures.indoor else STREET
        beside = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
        level = np.concatenate(
            [
                places + reach * step
                for places, reach in ((ends, past), (path, 1.0))
                for step in beside
            ]
        )
        level = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(level)))
        self._steeps = [self.STEEP_INDOOR]
        if not structures.indoor:
            self._steeps = np.linspace(self.STEEP, self.STEEPER, 5).tolist()
        top = min(float(structures.heights.max(initial=0.0)), self.TALLEST)
        self._corners = np.concatenate(
            [np.column_stack([level, np.full(len(level), height)]) for height in (0.0, top)]
        )
        self._sides: dict[float, tuple[float, float]] = {}

    def _side(self, aspect: float) -> tuple[float, float]:
        """Which side it looks from and how steeply [rad]: what shows the whole as large as any."""
        if aspect not in self._sides:
            looks = [self._fitting(turn, self._steeps[0], aspect) for turn in self.SIDES]
            away = np.array([np.linalg.norm(look.eye - look.target) for look, _ in looks])
            turn = self.SIDES[int(np.argmax(away <= self.AS_LARGE * away.min()))]
            full = [self._fitting(turn, steep, aspect)[1] >= self.FULL for steep in self._steeps]
            steep = self._steeps[full.index(True) if True in full else -1]
            self._sides[aspect] = turn, steep
        return self._sides[aspect]

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        passed = (time - self._timeline.start) / self._timeline.playback
        length = (self._timeline.end - self._timeline.start) / self._timeline.playback
        # At its middle time it stands at that side; long films do not end at the back.
        turn, steep = self._side(aspect)
        turn += self.DRIFT * float(np.clip(passed - 0.5 * length, -20.0, 20.0))
        return self._fitting(turn, steep, aspect)[0]

    def _fitting(self, turn: float, steep: float, aspect: float) -> tuple[Look, float]:
        """The look from a side that shows the whole, and the share of the height that it fills."""
        level = np.cos(steep)
        back = np.array([np.cos(turn) * level, np.sin(turn) * level, np.sin(steep)])
        right = np.array([-np.sin(turn), np.cos(turn), 0.0])
        up = np.cross(back, right)
        tall = self.FILL * np.tan(0.5 * self.FIELD)
        target, away = 0.5 * (self._corners.min(axis=0) + self._corners.max(axis=0)), 1.0
        for _ in range(6):
            local = (self._corners - target) @ np.column_stack([right, up, back])
            needed = np.maximum(np.abs(local[:, 0]) / (tall * aspect), np.abs(local[:, 1]) / tall)
            away = float((needed + local[:, 2]).max())
            # What is nearer is larger: the middle of the picture is not that of the box.
            seen = local[:, :2] / (away - local[:, 2])[:, None]
            shift = 0.5 * (seen.max(axis=0) + seen.min(axis=0)) * away
            target = target + shift[0] * right + shift[1] * up
        eye = target + away * back
        high = float(np.ptp(seen[:, 1])) / (2.0 * np.tan(0.5 * self.FIELD))
        look = Look(eye, target, self.FIELD, near=0.5, air=self.AIR * away, through=1.0)
        return look, high


class Story:
    """Opens with the whole, goes down to the robot, follows it, and ends with the finished map."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._whole, self._chase = Overview(timeline, structures), Chase(timeline, structures)

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run, also before its start and after its end."""
        timeline = self._timeline
        before = (timeline.start - time) / timeline.playback
        after = (time - timeline.end) / timeline.playback
        share = _eased(before / OPENING if before > 0.0 else after / _PULL)
        near = self._chase.look(time, aspect)
        if share == 0.0:
            return near
        return between(near, self._whole.look(time, aspect), share)


def between(near: Look, far: Look, share: float) -> Look:
    """A look on the way from one at the robot to one from far away, at a share 0…1 of it."""
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
    field = near.field + share * (far.field - near.field)
    air = near.air + share * (far.air - near.air)
    return replace(near, eye=eye, target=target, field=field, air=air, through=share * far.through)


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
