"""Looks at a scene, and camera paths: looks that go with the robot.

A camera is a function of the film's time alone and does not remember frames: every process that
draws a part of a film sees the same.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from lrf3d.geometry.lines import LEFT, Float
from lrf3d.studio.scene.look import TINY, Rig
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.timeline import Timeline, interpolated

# Time between the points of a smoothed path [s of the film]: a frame.
STEP = 0.04

# Standard deviation by which turns are smoothed [s of the film], however fast the run is played.
_SMOOTH = 0.7

# Standard deviation by which places are smoothed [s of the film].
_FOLLOW = 0.15

# Largest distance of the smoothed place from the robot [m].
_STRAY = 0.3

# Height of the robot's middle [m].
AIM = 0.35

# Height up to which the eye looks over walls [m].
_LOW = 1.0

# Height above which the robot is then seen [m].
_BODY = 0.1

# How steeply the eye looks down at the most [rad].
_STEEPEST = float(np.radians(60.0))

# Distance from the line to the eye within which walls count, as a share of its length.
_ASIDE = 0.12

# Distance of the eye from the wall behind it [m].
_CLEARANCE = 0.3

# Least distance of the eye from the robot [m]: nearer, it would fill the picture.
_LEAST_AWAY = 1.6

# Depth of the near plane [m].
NEAR = 0.2

# Least depth of the near plane, in the distance to the target: depths are then fine far away.
_NEAR_SHARE = 0.004


@dataclass(frozen=True, slots=True)
class Look:
    """A look at the scene, in the film's frame.

    Args:
        eye: (3,) where the eye is [m].
        target: (3,) what stands in the middle of the picture [m].
        field: Angle of view from the bottom to the top of the picture [rad].
        up: Direction that is up in the picture.
        shift: How far the picture is moved up, in halves of its height.
        aside: How far the picture is moved to the left, in halves of its width.
        shows_map: Whether the map is laid over the scene.
        inset: Which share of the strip with the map is left next to it, 0…1.
        cuts: Whether the walls of rooms are cut level, so that one looks into them.
        above: How much higher than usual they are cut [m].
        dusk: How far the dark has become dusk, 0…1.
        shot: What is shown, which a caption says: a key of :mod:`lrf3d.studio.scene.panel`.
        said: The lines that the caption begins with.
        robot: Which of several robots is followed.
    """

    eye: Float
    target: Float
    field: float
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    shift: float = 0.0
    aside: float = 0.0
    shows_map: bool = False
    inset: float = 1.0
    cuts: bool = False
    above: float = 0.0
    dusk: float = 0.0
    shot: str = ""
    said: tuple[str, ...] = ()
    robot: int = 0

    @property
    def away(self) -> float:
        """How far off the target is [m]."""
        return float(np.linalg.norm(self.target - self.eye))

    @property
    def pose(self) -> Float:
        """The matrix (4, 4) that takes the camera's frame, which looks along −z, to the film's."""
        back = self.eye - self.target
        right = np.cross(np.array(self.up), back)
        back = back / np.linalg.norm(back)
        right = right / np.linalg.norm(right)
        matrix = np.eye(4)
        matrix[:3] = np.column_stack([right, np.cross(back, right), back, self.eye])
        return matrix

    def matrix(self, aspect: float, far: float) -> Float:
        """The matrix (4, 4) from the film's frame to −1…1 of a picture, x right, y down.

        The picture is as wide as its aspect says, and shows things up to so far away [m].
        """
        tall = 1.0 / np.tan(0.5 * self.field)
        near = max(NEAR, _NEAR_SHARE * self.away)
        projection = np.array([
            [tall / aspect, 0, self.aside, 0],
            [0, -tall, self.shift, 0],
            [0, 0, (far + near) / (near - far), 2.0 * far * near / (near - far)],
            [0, 0, -1, 0],
        ])  # fmt: skip
        return np.asarray(projection @ np.linalg.inv(self.pose))


class Camera(Protocol):
    """Anything that says where a film is seen from."""

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run, for a picture of an aspect (width over height)."""
        ...


class SmoothPath(NamedTuple):
    """The robot's path, smoothed over time, for cameras that follow it."""

    # (k,) even times [s].
    times: Float
    # (k, 2) [m].
    places: Float
    # (k,) [rad]; they go on past half a turn.
    headings: Float

    @classmethod
    def of(cls, timeline: Timeline, poses: Callable[[Float], Float] | None = None) -> "SmoothPath":
        """The smoothed path of a run's robot, or of another one with poses (k, 3) at times (k,)."""
        step = STEP * timeline.playback
        count = int(np.ceil((timeline.end - timeline.start) / step)) + 2
        times = timeline.start + step * np.arange(count, dtype=np.float64)
        x, y, headings = (poses or timeline.poses)(times).T
        places = np.column_stack([x, y]) - timeline.origin
        off = gaussian_filter1d(places, _FOLLOW / STEP, axis=0, mode="nearest") - places
        # In fast films the robot stays in near pictures all the same.
        off *= np.minimum(1.0, _STRAY / np.maximum(np.hypot(*off.T), TINY))[:, None]
        headings = gaussian_filter1d(np.unwrap(headings), _SMOOTH / STEP, mode="nearest")
        return cls(times, places + off, headings)


class CameraPath(NamedTuple):
    """Looks from a side and a distance at a middle, at times (k,) between which they are mixed."""

    times: Float
    # (k, 3) what is in the middle of the picture [m].
    middles: Float
    # (k,) the direction from there to the eye, around [rad].
    turns: Float
    # (k,) the angle of that direction over the ground [rad].
    steeps: Float
    # (k,) distances of the eye from the middle [m].
    aways: Float
    # (k,) angles of view [rad].
    fields: Float
    # (k,) how far the picture is moved up, in halves of its height.
    shifts: Float

    @classmethod
    def along(cls, path: SmoothPath, turns: Float, rig: Rig) -> "CameraPath":
        """Looks at the robot from sides (k,) [rad]."""
        how = np.radians(rig.steep), rig.away, np.radians(rig.field), rig.shift
        even = np.broadcast_to(np.array(how)[:, None], (len(how), len(path.times)))
        return cls(path.times, np.insert(path.places, 2, AIM, axis=1), turns, *even)

    def at(self, times: Float) -> "CameraPath":
        """The looks at other times."""
        now = interpolated(times, self.times, np.column_stack(self[1:]))
        return CameraPath(times, now[:, :3], *now[:, 3:].T)

    def eyes(self) -> Float:
        """Where the eye is, (k, 3) [m]."""
        level = np.cos(self.steeps)
        up = np.sin(self.steeps)
        back = np.column_stack([level * np.cos(self.turns), level * np.sin(self.turns), up])
        return np.asarray(self.middles + self.aways[:, None] * back)

    def look(self, time: float, **others: Any) -> Look:
        """The look at a time [s]; the others are further fields of it."""
        now = self.at(np.array([time]))
        turn, steep, _, field, shift = (each.item() for each in now[2:])
        # What is up in the picture, also when it is seen from straight above.
        up = -np.cos(turn) * np.sin(steep), -np.sin(turn) * np.sin(steep), np.cos(steep)
        (eye,) = now.eyes()
        (middle,) = now.middles
        return Look(eye, middle, field, up, shift, **others)

    def past_walls(
        self, structures: Structures, robots: Float, smooth: float = _SMOOTH / STEP
    ) -> "CameraPath":
        """Looks that see robots (k, 2): over low walls, and before high ones; smoothed [samples].

        The walls of rooms are all low, as they are cut.
        """
        tops = structures.tops
        steeps = self.steeps.copy()
        aways = self.aways.copy()
        way = self.eyes()[:, :2] - robots
        for aside in (-_ASIDE, 0.0, _ASIDE):
            ends = robots + way + aside * way @ LEFT
            number, wall, share = structures.crossed(robots, ends)
            gap = share * np.hypot(*(ends - robots)[number].T)
            needed = np.arctan2(tops[wall] - _BODY, gap)
            low = tops[wall] <= _LOW
            np.maximum.at(steeps, number[low], np.minimum(needed[low], _STEEPEST))
            hides = ~low & (needed > self.steeps[number])
            number = number[hides]
            gap = gap[hides] - _CLEARANCE
            np.minimum.at(aways, number, np.maximum(gap / np.cos(self.steeps[number]), _LEAST_AWAY))
            # Where even that is too far, the eye looks down into the gap.
            down = np.arccos(np.clip(gap / _LEAST_AWAY, np.cos(_STEEPEST), 1.0))
            np.maximum.at(steeps, number, down)
        # The extremes over the filter's reach come first: its mean is then never too little.
        reach = 2 * int(2.0 * smooth) + 1
        steeps, aways = (
            gaussian_filter1d(each, smooth, mode="nearest", truncate=2.0)
            for each in (maximum_filter1d(steeps, reach), minimum_filter1d(aways, reach))
        )
        return self._replace(steeps=steeps, aways=aways)


@dataclass(frozen=True)
class PathCamera:
    """A camera whose path depends on the aspect of the picture alone."""

    track: Callable[[float], CameraPath]
    # Further fields of its looks.
    shown: Mapping[str, Any]

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        return self.track(aspect).look(time, **self.shown)
