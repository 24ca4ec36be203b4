"""Looks at a scene, and the smoothed path that cameras follow.

A camera is a function of the film's time alone and does not remember frames: every process that
draws a part of a film sees the same.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from lrf3d.geometry import Float
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
        shift: How far the picture is moved up, in halves of its height.
        near: Distance [m] from which on things are drawn.
        clear: Whether the air is without haze, as for bird's-eye cameras.
        air: Distance [m] at which half of what is seen is haze, at the least.
        fan: How strong the glow of the beams is drawn; less where it would cover the picture.
        shows_map: Whether the map is laid over the scene.
        plan: Whether the map is also shown in a corner.
        cuts: Whether walls of rooms are cut off where they hide the robot.
        ghost: How far houses have faded to pale ghosts, 0…1.
        raised: How far the walls of the map stand up, 0…1.
        shot: What is shown, which a caption says: a key of :mod:`lrf3d.scene.panel`.
    """

    eye: Float
    target: Float
    field: float
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    shift: float = 0.0
    near: float = 0.2
    clear: bool = False
    air: float = 0.0
    fan: float = 1.0
    shows_map: bool = False
    plan: bool = True
    cuts: bool = False
    ghost: float = 0.0
    raised: float = 0.0
    shot: str = ""

    @property
    def key(self) -> tuple[object, ...]:
        """What distinguishes this look from others of its camera."""
        place = self.eye.tobytes(), self.target.tobytes(), self.field
        return *place, self.ghost, self.raised, self.shot

    @property
    def sky_below(self) -> float:
        """Row of the picture, −1…1 from the top, down to which there may be sky; −1 for none."""
        ahead = self.target - self.eye
        level = float(np.hypot(ahead[0], ahead[1]))
        if level < 1e-6 * abs(float(ahead[2])):
            return -1.0
        # The ground ends before the horizon: by so much the sky is seen below it.
        dip = np.arctan2(abs(float(self.eye[2])), _LAND)
        angle = np.arctan2(-float(ahead[2]), level) - dip
        if angle >= 0.5 * np.pi:
            return -1.0
        horizon = np.tan(angle) / np.tan(0.5 * self.field) - 0.01 + self.shift
        return float(np.clip(-horizon, -1.0, 1.0))

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

    def matrix(self, aspect: float, far: float) -> Float:
        """The matrix (4, 4) from the film's frame to −1…1 of a picture, x right, y down.

        The picture is as wide as its aspect says, and shows things up to so far away [m].
        """
        tall, near = 1.0 / np.tan(0.5 * self.field), self.near
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1], matrix[1, 2] = tall / aspect, -tall, self.shift
        matrix[2, 2], matrix[2, 3] = (far + near) / (near - far), 2.0 * far * near / (near - far)
        matrix[3, 2] = -1.0
        view = np.eye(4)
        view[:3, :3] = self.pose[:3, :3].T
        view[:3, 3] = -view[:3, :3] @ self.eye
        return np.asarray(matrix @ view)


class Camera(Protocol):
    """Anything that says where a film is seen from."""

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run, for a picture of an aspect (width over height)."""
        ...


class SmoothPath:
    """The robot's path at even times, smoothed over time, for cameras that follow it."""

    STEP = 0.04
    """Time of the film between the points [s] that the path is computed at."""
    SMOOTH = 0.7
    """Time of the film [s] over which turns are smoothed, however fast the run is played."""
    FOLLOW = 0.15
    """The same for places: otherwise the robot would leave the middle of fast films."""

    def __init__(self, timeline: Timeline) -> None:
        step = self.STEP * timeline.playback
        count = int(np.ceil((timeline.end - timeline.start) / step)) + 2
        self.times: Float = timeline.start + step * np.arange(count, dtype=np.float64)
        poses = timeline.poses(self.times)
        width, follow = self.SMOOTH / self.STEP, self.FOLLOW / self.STEP
        self.headings = gaussian_filter1d(np.unwrap(poses[:, 2]), width, mode="nearest")
        places = poses[:, :2] - timeline.origin
        self.places = gaussian_filter1d(places, follow, axis=0, mode="nearest")

    def place(self, time: float) -> Float:
        """The smoothed place (2,) at a time [s]."""
        return np.array([np.interp(time, self.times, axis) for axis in self.places.T])


class Track(NamedTuple):
    """Looks from a side and a distance at a middle, at times (k,) between which they are mixed."""

    times: Float
    middles: Float
    """(k, 3) what is in the middle [m]."""
    turns: Float
    steeps: Float
    """(k,) the direction from there to the eye: around, and over the ground [rad]."""
    aways: Float
    """(k,) how far off the eye is [m]."""
    fields: Float
    """(k,) angles of view [rad]."""
    shifts: Float
    """(k,) how far the picture is moved up, in halves of its height."""
    airs: Float
    """(k,) the reach of the air [m]."""

    def at(self, times: Float) -> "Track":
        """The looks at other times."""
        x, y, z = self.middles.T
        x, y, z, *others = (np.interp(times, self.times, each) for each in (x, y, z, *self[2:]))
        return Track(times, np.column_stack([x, y, z]), *others)

    def eyes(self) -> Float:
        """Where the eye is, (k, 3) [m]."""
        level = self.aways * np.cos(self.steeps)
        way = [level * np.cos(self.turns), level * np.sin(self.turns)]
        return self.middles + np.column_stack([*way, self.aways * np.sin(self.steeps)])

    def look(self, time: float, **others: Any) -> Look:
        """The look at a time [s], with what else is to be said of it."""
        now = self.at(np.array([time]))
        field, shift, air = (float(each[0]) for each in now[5:])
        return Look(now.eyes()[0], now.middles[0], field, shift=shift, air=air, **others)

    def over_walls(self, structures: Structures, robots: Float, smooth: float) -> "Track":
        """Looks that are as steep as it takes to see robots (k, 2) over walls, smoothed [samples].

        In rooms walls are cut instead.
        """
        if structures.indoor:
            return self
        eyes = self.eyes()
        way = eyes[:, :2] - robots
        reach = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-6)
        # Walls beyond this are below the line of sight.
        rise = np.maximum(np.tan(self.steeps), 0.1)
        highest = float(structures.heights.max(initial=0.0))
        way *= np.minimum(1.0, (highest / rise + _CLEARANCE) / reach)[:, None]
        aside = np.column_stack([-way[:, 1], way[:, 0]])
        tree = structures.tree
        needed = self.steeps.copy()
        for side in (-_ASIDE, 0.0, _ASIDE):
            ways = shapely.linestrings(np.stack([robots, robots + way + side * aside], axis=1))
            number, wall = tree.query(ways, predicate="intersects")
            cuts = shapely.intersection(ways[number], tree.geometries[wall])
            gap = shapely.distance(shapely.points(robots[number]), cuts) - _CLEARANCE
            above = structures.heights[wall] - _ROBOT
            steep = np.arctan2(above, np.maximum(gap, 0.1)) + _MARGIN * (above > 0.0)
            np.maximum.at(needed, number, steep)
        # The most over the filter's reach comes first: its mean is then never too low.
        most = maximum_filter1d(np.minimum(needed, _STEEPEST), 2 * int(2.0 * smooth) + 1)
        steeps = gaussian_filter1d(most, smooth, mode="nearest", truncate=2.0)
        return self._replace(steeps=np.maximum(self.steeps, steeps))


_ASIDE, _CLEARANCE = 0.12, 0.3
"""How far from the line to the eye walls count, as a share of its length, and before it [m]."""

_MARGIN, _STEEPEST = float(np.radians(9.0)), float(np.radians(80.0))
"""How far under the robot roofs are seen, so that they are no large part of the picture, and how
steeply eyes look down at the most [rad]."""

_ROBOT = 0.5
"""Height of a robot [m]: lower walls do not hide it."""
