"""Looks at a scene, and tracks of looks that go with the robot.

A camera is a function of the film's time alone and does not remember frames: every process that
draws a part of a film sees the same.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from lrf3d.geometry.lines import LEFT, Float
from lrf3d.studio.scene.look import SECTION, Rig
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.timeline import Timeline, interpolated

# Times of the film [s] between the points of a smoothed path, and over which turns and places are
# smoothed, however fast the run is played; how far the smoothed place may be off the robot's [m],
# and the height of the robot's middle [m].
STEP = 0.04
_SMOOTH = 0.7
_FOLLOW = 0.15
_STRAY = 0.3
AIM = 0.35

# The eye looks over walls up to the first height [m], so that the robot is seen above the second
# height, and how steeply an eye then looks down at the most [rad].
_LOW = 1.0
_BODY = 0.1
_STEEPEST = float(np.radians(60.0))


@dataclass(frozen=True, slots=True)
class Look:
    """A look at the scene, in the film's frame."""

    eye: Float
    """(3,) where the eye is [m]."""
    target: Float
    """(3,) what stands in the middle of the picture [m]."""
    field: float
    """Angle of view from the bottom to the top of the picture [rad]."""
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """What is up in the picture."""
    shift: float = 0.0
    """How far the picture is moved up, in halves of its height."""
    shows_map: bool = False
    """Whether the map is laid over the scene."""
    plan: bool = True
    """Whether the map is also shown in a corner."""
    cuts: bool = False
    """Whether the walls of rooms are cut level, so that one looks into them."""
    glass: float = 0.0
    """How far what was never seen has become glass, 0…1."""
    opens: bool = False
    """Whether what hides the robot is opened."""
    shot: str = ""
    """What is shown, which a caption says: a key of :mod:`lrf3d.studio.scene.panel`."""

    @property
    def key(self) -> tuple[object, ...]:
        """What distinguishes this look from others of its camera."""
        place = self.eye.tobytes(), self.target.tobytes(), self.field
        return *place, self.glass, self.shot

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
        # Distance [m] from which on things are drawn, and the share of the distance to the target
        # that it is at the least: depths are then fine enough far away.
        near_plane = 0.2
        near_share = 0.004
        tall = 1.0 / np.tan(0.5 * self.field)
        near = max(near_plane, near_share * self.away)
        depth = (far + near) / (near - far), 2.0 * far * near / (near - far)
        wide = [tall / aspect, 0, 0, 0]
        up = [0, -tall, self.shift, 0]
        deep = [0, 0, *depth]
        return np.asarray(np.array([wide, up, deep, [0, 0, -1, 0]]) @ np.linalg.inv(self.pose))


class Camera(Protocol):
    """Anything that says where a film is seen from."""

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run, for a picture of an aspect (width over height)."""
        ...


class SmoothPath(NamedTuple):
    """The robot's path at even times (k,) [s], smoothed over time, for cameras that follow it.

    Places (k, 2) [m] and headings (k,) [rad], which go on past half a turn.
    """

    times: Float
    places: Float
    headings: Float

    @classmethod
    def of(cls, timeline: Timeline) -> "SmoothPath":
        """The smoothed path of a run's robot."""
        step = STEP * timeline.playback
        count = int(np.ceil((timeline.end - timeline.start) / step)) + 2
        times = timeline.start + step * np.arange(count, dtype=np.float64)
        x, y, headings = timeline.poses(times).T
        places = np.column_stack([x, y]) - timeline.origin
        off = gaussian_filter1d(places, _FOLLOW / STEP, axis=0, mode="nearest") - places
        # In fast films the robot stays in near pictures all the same.
        off *= np.minimum(1.0, _STRAY / np.maximum(np.hypot(*off.T), 1e-9))[:, None]
        headings = gaussian_filter1d(np.unwrap(headings), _SMOOTH / STEP, mode="nearest")
        return cls(times, places + off, headings)


class Track(NamedTuple):
    """Looks from a side and a distance at a middle, at times (k,) between which they are mixed."""

    times: Float
    middles: Float
    """(k, 3) what is in the middle [m]."""
    turns: Float
    steeps: Float
    """(k,) the direction from there to the eye: around, and over the ground [rad]."""
    aways: Float
    fields: Float
    shifts: Float
    """(k,) distances of the eye [m], angles of view [rad], and how far the picture is moved up, in
    halves of its height."""

    @classmethod
    def along(cls, path: SmoothPath, turns: Float, rig: Rig) -> "Track":
        """Looks at the robot from sides (k,) [rad]."""
        how = np.radians(rig.steep), rig.away, np.radians(rig.field), rig.shift
        even = np.broadcast_to(np.array(how)[:, None], (len(how), len(path.times)))
        return cls(path.times, np.insert(path.places, 2, AIM, axis=1), turns, *even)

    def at(self, times: Float) -> "Track":
        """The looks at other times."""
        now = interpolated(times, self.times, np.column_stack(self[1:]))
        return Track(times, now[:, :3], *now[:, 3:].T)

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
    ) -> "Track":
        """Looks that see robots (k, 2): over low walls, and before high ones; smoothed [samples].

        The walls of rooms are all low, as they are cut.
        """
        tops = np.minimum(structures.heights, SECTION if structures.indoor else np.inf)
        steeps = self.steeps.copy()
        aways = self.aways.copy()
        way = self.eyes()[:, :2] - robots
        # How far from the line to the eye walls count, as a share of its length; how far before
        # them the eye stays, and how near it comes to the robot [m]: nearer, the robot would fill
        # the picture.
        aside_share = 0.12
        clearance = 0.3
        least_away = 1.6
        for aside in (-aside_share, 0.0, aside_share):
            ends = robots + way + aside * way @ LEFT
            ways = shapely.linestrings(np.stack([robots, ends], axis=1))
            number, wall = structures.tree.query(ways, predicate="intersects")
            cuts = shapely.intersection(ways[number], structures.tree.geometries[wall])
            gap = shapely.distance(shapely.points(robots[number]), cuts)
            needed = np.arctan2(tops[wall] - _BODY, gap)
            low = tops[wall] <= _LOW
            np.maximum.at(steeps, number[low], np.minimum(needed[low], _STEEPEST))
            hides = ~low & (needed > self.steeps[number])
            number = number[hides]
            gap = gap[hides] - clearance
            np.minimum.at(aways, number, np.maximum(gap / np.cos(self.steeps[number]), least_away))
            # Where even that is too far, the eye looks down into the gap.
            down = np.arccos(np.clip(gap / least_away, np.cos(_STEEPEST), 1.0))
            np.maximum.at(steeps, number, down)
        # The extremes over the filter's reach come first: its mean is then never too little.
        reach = 2 * int(2.0 * smooth) + 1
        steeps, aways = (
            gaussian_filter1d(each, smooth, mode="nearest", truncate=2.0)
            for each in (maximum_filter1d(steeps, reach), minimum_filter1d(aways, reach))
        )
        return self._replace(steeps=steeps, aways=aways)


@dataclass(frozen=True)
class Tracked:
    """A camera whose track depends on the aspect of the picture alone."""

    track: Callable[[float], Track]
    shown: Mapping[str, Any]
    """Further fields of its looks."""

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        return self.track(aspect).look(time, **self.shown)
