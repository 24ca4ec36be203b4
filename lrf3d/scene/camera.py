"""Looks at a scene, and the smoothed path that cameras follow.

A camera is a function of the film's time alone and does not remember frames: every process that
draws a part of a film sees the same.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d

from lrf3d.geometry import Float, Int
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
    """The robot's path, smoothed over time, for cameras that follow it."""

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
        self.places = poses[:, :2] - timeline.origin
        self.width = self.SMOOTH / self.STEP
        self.headings = gaussian_filter1d(np.unwrap(poses[:, 2]), self.width, mode="nearest")
        follow = self.FOLLOW / self.STEP
        self._smooth = gaussian_filter1d(self.places, follow, axis=0, mode="nearest")

    def place(self, time: float) -> Float:
        """The smoothed place (2,) at a time [s]."""
        return np.array([np.interp(time, self.times, axis) for axis in self._smooth.T])


def walls_met(structures: Structures, starts: Float, ends: Float) -> tuple[Int, Int, Float]:
    """Which ways (k, 2) to (k, 2) meet which walls: the numbers of both, and how far off [m]."""
    tree = shapely.STRtree(shapely.linestrings(structures.segments.reshape(-1, 2, 2)))
    ways = shapely.linestrings(np.stack([starts, ends], axis=1))
    way, wall = tree.query(ways, predicate="intersects")
    cuts = shapely.intersection(ways[way], tree.geometries[wall])
    return way, wall, np.asarray(shapely.distance(shapely.points(starts[way]), cuts))
