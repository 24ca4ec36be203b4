"""Cameras: where a film is seen from, as a function of its time alone.

A camera does not remember frames: every process that draws a part of a film sees the same.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from lrf3d.geometry import Float
from lrf3d.scene.look import FAN_SHARE_AHEAD
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline

_LAND = 2500.0
"""How far the ground reaches at the least [m]."""


@dataclass(frozen=True, slots=True)
class Look:
    """A look at the scene, in the film's frame.

    Args:
        eye: (3,) where the eye is [m].
        target: (3,) what stands in the middle of the picture [m].
        field: Angle of view from the bottom to the top [rad].
        up: (3,) what is up in the picture.
        near: Distance [m] from which on things are drawn.
        clear: Whether the air is without haze, as for bird's-eye cameras.
        air: Distance [m] at which half of what is seen is haze, at the least.
        fan: How strong the fan of beams is drawn; less where it would cover the picture.
        shows_map: Whether the map is laid over the scene.
        through: How strongly, 0…1, the map shines through what hides it.
    """

    eye: Float
    target: Float
    field: float
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    near: float = 0.2
    clear: bool = False
    air: float = 0.0
    fan: float = 1.0
    shows_map: bool = False
    through: float = 0.0

    @property
    def key(self) -> tuple[bytes, bytes, float]:
        """What distinguishes this look from others of its camera."""
        return self.eye.tobytes(), self.target.tobytes(), self.field

    @property
    def horizon(self) -> float:
        """Height in the picture, −1…1 from the bottom up, under which there is no sky."""
        ahead = self.target - self.eye
        level = float(np.hypot(ahead[0], ahead[1]))
        if level < 1e-6 * abs(float(ahead[2])):
            return np.inf
        # The ground ends before the horizon: by so much the sky is seen below it.
        dip = np.arctan2(abs(float(self.eye[2])), _LAND)
        angle = np.arctan2(-float(ahead[2]), level) - dip
        if angle >= 0.5 * np.pi:
            return np.inf
        return float(np.tan(angle) / np.tan(0.5 * self.field)) - 0.01

    @property
    def pose(self) -> Float:
        """The matrix (4, 4) that takes the camera's frame, which looks along −z, to the film's."""
        back = self.eye - self.target
        back = back / np.linalg.norm(back)
        right = np.cross(np.array(self.up), back)
        right = right / np.linalg.norm(right)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = right, np.cross(back, right), back
        matrix[:3, 3] = self.eye
        return matrix


class SmoothPath:
    """The robot's path, smoothed over time, for cameras that follow it."""

    STEP = 0.04
    """Time of the film between the points [s] that the path is computed at."""
    SMOOTH = 0.7
    """Time of the film [s] over which turns are smoothed: what looks calm does not hang on how
    fast the run is played."""
    FOLLOW = 0.15
    """The same for places: otherwise the robot would leave the middle of fast films."""

    def __init__(self, timeline: Timeline) -> None:
        step = self.STEP * timeline.playback
        count = int(np.ceil((timeline.end - timeline.start) / step)) + 2
        self.times: Float = timeline.start + step * np.arange(count, dtype=np.float64)
        poses = timeline.poses(self.times)
        self.places = poses[:, :2] - timeline.origin
        self.width = self.SMOOTH / self.STEP
        self.headings = gaussian_filter1d(np.unwrap(poses[:, 2]), self.width, mode="nearest")
        follow = self.FOLLOW / self.STEP
        self._smooth = gaussian_filter1d(self.places, follow, axis=0, mode="nearest")

    def place(self, time: float) -> Float:
        """The smoothed place (2,) at a time [s]."""
        return np.array([np.interp(time, self.times, axis) for axis in self._smooth.T])


class Camera(Protocol):
    """Anything that says where a film is seen from."""

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run, for a picture of an aspect (width over height)."""
        ...


class Chase:
    """Follows the robot from behind, smoothly, and never from inside or behind a wall.

    Among houses the eye comes nearer where a wall is in its way; in rooms, which have no ceiling,
    it looks over the wall.
    """

    BACK = 3.7
    """How far behind the robot the eye is [m]."""
    HEIGHT = 1.95
    """Height of the eye [m]."""
    BELOW = np.radians(12.0)
    """Angle at which the robot is seen under the middle of the picture [rad]."""
    FIELD = np.radians(50.0)
    CLEARANCE = 0.30
    """Distance [m] that the eye keeps from walls."""
    NEAREST = 0.1
    """What is left of the way back [m] at the least; then the eye looks from above."""
    AIM = 0.3
    """Height of the robot's middle [m]."""
    AWAY = 5.0
    """How far the eye is from the robot in rooms [m]."""
    LEAST, MOST = np.radians(31.0), np.radians(76.0)
    """How steeply it then looks at it [rad]."""
    LOW = 1.2
    """Walls up to this height [m] do not hide the robot from the eye."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._path = SmoothPath(timeline)
        self._indoor = structures.indoor
        self._over = float(structures.heights.max(initial=0.0)) + 0.15
        width = self._path.width
        free = self._free_way(structures)
        # The least over the filter's reach comes first: its mean is then never past a wall.
        reach = int(2.0 * width)
        least = minimum_filter1d(free, 2 * reach + 1, mode="nearest")
        self._back = gaussian_filter1d(least, width, mode="nearest", truncate=2.0)

    def _free_way(self, structures: Structures) -> Float:
        """How far (k,) the eye can go back from the robot at each point [m]."""
        path = self._path
        backward = -np.column_stack([np.cos(path.headings), np.sin(path.headings)])
        sideways = np.column_stack([-backward[:, 1], backward[:, 0]])
        free = np.full(len(path.times), self.BACK)
        tall = structures.segments[structures.heights > self.LOW]
        tree = shapely.STRtree(shapely.linestrings(tall.reshape(-1, 2, 2)))
        for side in (-self.CLEARANCE, 0.0, self.CLEARANCE):
            ends = path.places + (self.BACK + self.CLEARANCE) * backward + side * sideways
            ways = shapely.linestrings(np.stack([path.places, ends], axis=1))
            point, wall = tree.query(ways, predicate="intersects")
            cuts = shapely.intersection(ways[point], tree.geometries[wall])
            gap = shapely.distance(shapely.points(path.places[point]), cuts)
            np.minimum.at(free, point, gap - 1.5 * self.CLEARANCE)
        return np.asarray(np.maximum(free, self.NEAREST))

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        x, y, heading, back = (
            float(np.interp(time, self._path.times, values))
            for values in (*self._path.places.T, self._path.headings, self._back)
        )
        forward = np.array([np.cos(heading), np.sin(heading), 0.0])
        place = np.array([x, y, 0.0])
        if self._indoor:
            steep = np.clip(np.arctan2(self._over - self.AIM, back), self.LEAST, self.MOST)
            away, height = self.AWAY * np.cos(steep), self.AIM + self.AWAY * np.sin(steep)
        else:
            # The nearer the eye, the higher it is and the steeper it looks.
            away, height = back, self.HEIGHT + 0.9 * (1.0 - back / self.BACK)
        eye = place - away * forward + [0.0, 0.0, height]
        down = np.arctan2(height - self.AIM, away) - self.BELOW
        target = eye + np.cos(down) * forward - [0.0, 0.0, np.sin(down)]
        return Look(eye, target, float(self.FIELD))


class Top:
    """Looks down on the whole world, or follows the robot where the world is large."""

    FIELD = np.radians(3.0)
    """Nearly parallel rays: walls then do not lean over the map."""
    WHOLE = 220.0
    """Largest world [m] that is seen whole."""
    WINDOW = 70.0
    """Shorter side [m] of what is seen of a larger one."""
    LONG = 1.2
    """A world so many times as long as wide is turned where that fits the picture better."""
    MARGIN, SMALLER = 1.06, 1.18
    """What is seen around the world, as a factor, at the least and to free the panel's corner."""

    def __init__(
        self,
        timeline: Timeline,
        structures: Structures,
        covered: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self._timeline = timeline
        self._covered = covered
        ends = structures.places
        if not len(ends):
            ends = np.array([[-1.0, -1.0], [1.0, 1.0]])
        self._low: Float = ends.min(axis=0)
        self._high: Float = ends.max(axis=0)
        sides = self._high - self._low
        self._longer = float(sides.max() / max(sides.min(), 1e-9))
        self._tallest = float(structures.heights.max(initial=0.0))
        self._path = SmoothPath(timeline)

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        size, up = self._high - self._low, (0.0, 1.0, 0.0)
        if float(size.max()) <= self.WHOLE:
            # The world is in the middle, and smaller where that frees the corner for the panel,
            # but not much smaller.
            wide, high = self._covered
            turned = (size[0] > size[1]) != (aspect > 1.0) and self._longer > self.LONG
            size, up = (size[::-1], (1.0, 0.0, 0.0)) if turned else (size, up)
            whole = max(size[1], size[0] / aspect)
            beside = size[0] / (aspect - 2.0 * wide) if 2.0 * wide < aspect else np.inf
            above = size[1] / (1.0 - 2.0 * high) if high < 0.5 else np.inf
            window = max(self.MARGIN * whole, min(beside, above, self.SMALLER * whole))
            middle = 0.5 * (self._low + self._high)
        else:
            middle, window = self._path.place(time), self.WINDOW / min(1.0, aspect)
        away = 0.5 * window / np.tan(0.5 * self.FIELD) + self._tallest
        eye = np.array([*middle, away])
        return Look(
            eye,
            np.array([*middle, 0.0]),
            float(self.FIELD),
            up=up,
            near=0.5 * (away - self._tallest),
            clear=True,
            shows_map=True,
        )


class Orbit:
    """Goes slowly round the robot, near it, and higher where a house is in between."""

    FIELD = np.radians(42.0)
    AWAY, AWAY_INDOOR = 11.5, 7.0
    """How far off the robot it is [m]."""
    LEAST, LEAST_INDOOR = np.radians(32.0), np.radians(48.0)
    """How steeply it looks down at the least [rad]."""
    TURN = np.radians(9.0)
    """Angle per second of the film [rad/s]."""
    STEEPEST = np.radians(80.0)
    """How steeply it looks down at the most [rad]."""
    MARGIN = np.radians(4.0)
    """How far above the edge of a roof it keeps [rad]."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._path = SmoothPath(timeline)
        self._timeline = timeline
        self._away = self.AWAY_INDOOR if structures.indoor else self.AWAY
        least = self.LEAST_INDOOR if structures.indoor else self.LEAST
        needed = self._free_angles(structures, self._away * float(np.cos(least)))
        width = self._path.width
        # The most over the filter's reach comes first: its mean is then never too low.
        most = maximum_filter1d(needed, 2 * int(2.0 * width) + 1, mode="nearest")
        smooth = gaussian_filter1d(most, width, mode="nearest", truncate=2.0)
        self._angles = np.clip(smooth, least, self.STEEPEST)

    def _free_angles(self, structures: Structures, level: float) -> Float:
        """How steeply (k,) the eye must look down at each time to see the robot [rad]."""
        places, turns = self._path.places, self._turns(self._path.times)
        sides = np.column_stack([np.cos(turns), np.sin(turns)])
        ways = shapely.linestrings(np.stack([places, places + level * sides], axis=1))
        tree = shapely.STRtree(shapely.linestrings(structures.segments.reshape(-1, 2, 2)))
        point, wall = tree.query(ways, predicate="intersects")
        cuts = shapely.intersection(ways[point], tree.geometries[wall])
        gap = np.maximum(shapely.distance(shapely.points(places[point]), cuts), 1e-3)
        angles = np.zeros(len(places))
        np.maximum.at(angles, point, np.arctan2(structures.heights[wall], gap) + self.MARGIN)
        return angles

    def _turns(self, times: Float) -> Float:
        """Where the eye stands round the robot at times [rad]."""
        passed = (times - self._timeline.start) / self._timeline.playback
        return np.asarray(self.TURN * passed - 2.2)

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        turn = self._turns(np.array([time]))[0]
        steep = float(np.interp(time, self._path.times, self._angles))
        middle = np.array([*self._path.place(time), 0.5])
        side = np.array([np.cos(turn) * np.cos(steep), np.sin(turn) * np.cos(steep), np.sin(steep)])
        return Look(middle + self._away * side, middle, float(self.FIELD))


class First:
    """Looks ahead from the top of the robot, and a little up: that is where houses are."""

    FIELD = np.radians(62.0)
    UP = 0.09
    """How much it looks up, as the slope of its way."""
    OVER = 0.36
    """How far over the laser the eye is [m]: above the bands of the map."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._timeline = timeline
        self._height = timeline.run.lrf.height + self.OVER

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        x, y, theta = self._timeline.poses(np.array([time]))[0]
        origin = self._timeline.origin
        eye = np.array([x - origin[0], y - origin[1], self._height])
        ahead = np.array([np.cos(theta), np.sin(theta), self.UP])
        return Look(eye, eye + ahead, float(self.FIELD), fan=FAN_SHARE_AHEAD)
