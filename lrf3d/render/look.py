"""A look at the scene, and the smooth path that cameras follow."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from lrf3d.geometry import Float
from lrf3d.render.timeline import Timeline

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
        clear: Whether the air is without haze, for eyes so far away that they are no one's.
        fan: How strong the fan of beams is drawn; less where it would cover the picture.
        shows_map: Whether the map is laid over the scene.
    """

    eye: Float
    target: Float
    field: float
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    near: float = 0.2
    clear: bool = False
    fan: float = 1.0
    shows_map: bool = False

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

    def __init__(self, timeline: Timeline) -> None:
        step = self.STEP * timeline.playback
        count = int(np.ceil((timeline.end - timeline.start) / step)) + 2
        self.times: Float = timeline.start + step * np.arange(count, dtype=np.float64)
        poses = timeline.poses(self.times)
        self.places = poses[:, :2] - timeline.origin
        self.width = self.SMOOTH / self.STEP
        self.headings = gaussian_filter1d(np.unwrap(poses[:, 2]), self.width, mode="nearest")
        self._smooth = gaussian_filter1d(self.places, self.width, axis=0, mode="nearest")

    def place(self, time: float) -> Float:
        """The smoothed place (2,) at a time [s]."""
        return np.array([np.interp(time, self.times, axis) for axis in self._smooth.T])
