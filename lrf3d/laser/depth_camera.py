"""DepthCamera: a pinhole camera that measures depth, and DepthImage, its measurement.

The pixel in column k and row r looks along (1, −y, −z), with axes ahead, to the left and up, where
y = (k + ½ − width / 2) / f and z = (r + ½ − height / 2) / f. Depth is the distance along the
optical axis, so a wall at a right angle to it has the same depth everywhere.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import (
    Bool,
    Float,
    Value,
    number,
    sealed,
    whole_number,
)
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser.lidar import MOST_BEAMS, RAISED, Mounted
from lrf3d.laser.range_finder import LaserRangeFinder, oriented

# [rad] Largest field of view of a pinhole camera.
WIDEST = math.radians(179)


@dataclass(frozen=True)
class DepthCamera(Mounted):
    """A depth camera, level unless its mount is tilted.

    Args:
        width: Number of pixels in a row.
        height: Number of rows.
        fov: Horizontal field of view [rad], up to 179°; pixels are square.
        mount: Pose on the robot, x, y, z [m], or x, y, z, yaw, pitch, roll [m, rad], as for
            `Lidar`; a positive pitch looks down.
        range_min: Least depth that is measured [m].
        range_max: Largest depth that is measured [m].
        name: Name of the sensor and of its frame.

    Raises:
        InputError: A number is invalid, or the mount is below the floor.

    Examples:
        >>> import lrf3d
        >>> camera = lrf3d.DepthCamera(4, 3, fov=1.0, mount=(0, 0, 1))
        >>> world = lrf3d.World([[3, -9, 3, 9]])
        >>> image = lrf3d.PlanarCaster(world).cast_depth(camera, (0, 0, 0))
        >>> image.depth.round(2).tolist()[1:]
        [[3.0, 3.0, 3.0, 3.0], [3.0, 3.0, 3.0, 3.0]]
    """

    width: int
    height: int
    fov: float
    mount: tuple[float, ...] = RAISED
    range_min: float = 0.0
    range_max: float = 20.0
    name: str = "camera"

    def __post_init__(self) -> None:
        number(self.fov, "depth camera: fov", "radians", positive=True, most=WIDEST)
        self._check("depth camera", "width")
        height = whole_number(self.height, "depth camera: height", most=MOST_BEAMS)
        object.__setattr__(self, "height", height)
        if self.width * self.height > MOST_BEAMS:
            raise InputError(
                f"depth camera: {self.width:,} x {self.height:,} pixels: expected at most"
                f" {MOST_BEAMS:,}"
            )

    @property
    def focal_length(self) -> float:
        """Focal length [pixels]."""
        return 0.5 * self.width / math.tan(0.5 * self.fov)

    @cached_property
    def planar(self) -> LaserRangeFinder:
        """A range finder of as many beams as a row has pixels, for noises."""
        x, y, _, yaw, *_ = self.mount
        half = 0.5 * self.fov
        return LaserRangeFinder(
            -half, half, self.width, self.range_min, self.range_max,
            mount=Pose(x, y, yaw), name=self.name,
        )  # fmt: skip

    @cached_property
    def lefts(self) -> Float:
        """Offsets (width,) of the columns to the left, at depth 1."""
        columns = np.arange(self.width, dtype=np.float64)
        return sealed((0.5 * (self.width - 1) - columns) / self.focal_length)

    @cached_property
    def slopes(self) -> Float:
        """Offsets (height,) of the rows upward, at depth 1, the top row first."""
        rows = np.arange(self.height, dtype=np.float64)
        return sealed((0.5 * (self.height - 1) - rows) / self.focal_length)

    def directions(self, pose: Sequence[float] | Float) -> Float:
        """Vectors (height, width, 3) of the pixels in the world, to depth 1, from a pose."""
        shape = (self.height, self.width)
        ahead = np.ones(shape)
        left = np.broadcast_to(self.lefts, shape)
        up = np.broadcast_to(self.slopes[:, None], shape)
        return oriented(ahead, left, up, as_pose(pose).theta, *self.mount[4:])


@dataclass(frozen=True, eq=False, repr=False)
class DepthImage(Value):
    """A depth image.

    Args:
        pose: Pose x, y [m], theta [rad] of the camera in the world; z, pitch and roll are those of
            its mount.
        camera: The camera.
        depth: (height, width) depths along the optical axis [m], row 0 at the top; +inf if there is
            no return, −inf if it is nearer than range_min.
        walls: (height, width) index of the segment that was hit, or −1.
        time: Time of the image [s].

    Examples:
        >>> import lrf3d
        >>> camera = lrf3d.DepthCamera(4, 3, fov=1.0, mount=(0, 0, 1))
        >>> image = lrf3d.PlanarCaster(lrf3d.World([[3, -9, 3, 9]])).cast_depth(camera, (0, 0, 0))
        >>> image.points().shape
        (12, 3)
    """

    pose: Pose
    camera: DepthCamera
    depth: Float
    walls: NDArray[np.int32]
    time: float = 0.0

    def __repr__(self) -> str:
        return f"DepthImage({self.camera.width} x {self.camera.height}, from {self.pose})"

    @cached_property
    def hits(self) -> Bool:
        """Which pixels (height, width) have a depth."""
        return sealed(np.isfinite(self.depth))

    def points(self) -> Float:
        """Points (m, 3) [m] in the world, row by row."""
        place = np.array([self.pose[0], self.pose[1], self.camera.mount[2]])
        return place + self.depth[self.hits][:, None] * self.camera.directions(self.pose)[self.hits]
