"""Lidar: layers of beams at fixed elevations, and LidarScan, the ranges of one revolution.

A level lidar's beam of azimuth a and elevation e goes along (cos a, sin a, tan e): at distance t in
the plane its height is z + t · tan e, and its range is t / cos e.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.errors import InputError, check_names, shown
from lrf3d.geometry.lines import (
    LARGEST_COORDINATE,
    Bool,
    Float,
    Int,
    Value,
    is_finite,
    number,
    sealed,
)
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser.range_finder import (
    FARTHEST_MOUNT,
    LARGEST_ANGLE,
    LaserRangeFinder,
    layer_directions,
    turned,
)

# Default mount of a sensor: at this height above the robot's centre, facing ahead; x, y, z [m].
RAISED = (0.0, 0.0, 0.5)

# Largest number of beams of a scan, whose ranges and walls take 160 MB.
MOST_BEAMS = 10_000_000

# [rad] Largest elevation of a beam; a vertical beam would have no azimuth.
STEEPEST = math.radians(89.9)


def mounted(values: Any, name: str) -> tuple[float, ...]:
    """Check a mount x, y, z [m], yaw, pitch, roll [rad]; the angles may be left out.

    The sensor is on the floor, z = 0, or above it.
    """
    found = values if isinstance(values, list | tuple | np.ndarray) else ()
    if len(found) not in (3, 6):
        raise InputError(
            f"{name}: mount {shown(values)}: expected x, y, z [m], or x, y, z, yaw, pitch, roll"
        )
    limits = [FARTHEST_MOUNT, FARTHEST_MOUNT, LARGEST_COORDINATE, *[LARGEST_ANGLE] * 3]
    mount = tuple(
        number(value, f"{name}: mount", least=-most, most=most)
        for value, most in zip(found, limits, strict=False)
    )
    if mount[2] < 0.0:
        raise InputError(f"{name}: mount {mount}: z is below the floor, z = 0")
    return (*mount, 0.0, 0.0, 0.0)[:6]


def tilted(mount: tuple[float, ...], attitude: tuple[float, float]) -> tuple[float, ...]:
    """The mount, as on a level robot, of a sensor whose robot is pitched and rolled [rad]."""
    # Most programs tilt nothing, and need not load it.
    from scipy.spatial.transform import Rotation

    x, y, z, *turns = mount
    robot = Rotation.from_euler("YX", attitude)
    place = robot.apply([x, y, z])
    if place[2] < 0.0 <= z:
        raise InputError(f"attitude {attitude}: it puts the sensor at {mount} below the floor")
    return (*place.tolist(), *(robot * Rotation.from_euler("ZYX", turns)).as_euler("ZYX").tolist())


class Mounted(Value):
    """A sensor on a mount x, y, z [m], yaw, pitch, roll [rad], with rows of beams."""

    mount: tuple[float, ...]

    def _check(self, kind: str, row: str) -> None:
        """Check the mount, and what the range finder of a row of beams checks."""
        object.__setattr__(self, "mount", mounted(self.mount, kind))
        try:
            object.__setattr__(self, row, self.planar.beams)
        except InputError as error:
            text = str(error).removeprefix("range finder: ").replace("beams", row)
            raise InputError(f"{kind}: {text}") from None

    @cached_property
    def planar(self) -> LaserRangeFinder:
        """The range finder that has the beams of a level row."""
        raise NotImplementedError

    @property
    def tilt(self) -> dict[str, float]:
        """Its pitch and roll [rad], for `layer_directions`."""
        return {"pitch": self.mount[4], "roll": self.mount[5]}

    @property
    def is_level(self) -> bool:
        """Whether its columns of beams are upright: neither pitched nor rolled."""
        return not any(self.mount[4:])


@dataclass(frozen=True, eq=False)
class Lidar(Mounted):
    """A rotating lidar: layers of beams, one above the other, all around.

    Args:
        elevations: (layers,) elevations of the layers [rad], up to ±89.9°; a layer's ring number is
            its index in this list.
        columns: Number of azimuths, evenly spaced counter-clockwise, starting at −π, behind.
        range_min: Nearest distance that is measured [m].
        range_max: Farthest distance that is measured [m].
        mount: Pose on the robot, x, y, z [m], or x, y, z, yaw, pitch, roll [m, rad], z above the
            floor. Like those of a `LaserRangeFinder`, casters take the pose of the lidar and use
            only z, pitch and roll of the mount; a `Simulation` takes the pose of the robot.
        scan_duration: Time from the first column to the last [s]; with 0 all are cast at once.
        name: Name of the sensor and of its frame.
        prisms: Of a lidar that looks ahead through two turning prisms, instead of around: half of
            its field of view [rad], and the turns a second of each prism. Its rosette does not
            repeat; it has a single layer.
        since: Time since the prisms were at angle 0 [s]; scans have their own time here.

    Raises:
        InputError: There are no layers, an elevation is too steep, the mount is below the floor, or
            a number is invalid.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> lidar = lrf3d.Lidar(np.radians([-10, 0, 10]), columns=4)
        >>> world = lrf3d.World([[3, -9, 3, 9]])
        >>> scan = lrf3d.PlanarCaster(world).cast_lidar(lidar, (0, 0, 0))
        >>> scan.ranges.round(3)[:, 2].tolist()
        [2.879, 3.0, 3.046]
    """

    elevations: Float
    columns: int = 1024
    range_min: float = 0.0
    range_max: float = 100.0
    mount: tuple[float, ...] = RAISED
    scan_duration: float = 0.0
    name: str = "lidar"
    prisms: tuple[float, ...] = ()
    since: float = 0.0

    def __post_init__(self) -> None:
        self._hold("elevations")
        steep = self.elevations
        if steep.ndim != 1 or not len(steep) or not (np.abs(steep) <= STEEPEST).all():
            raise InputError(
                f"lidar: elevations {shown(steep.tolist())}: expected radians, at least one,"
                f" within ±{STEEPEST:.4g} (89.9°)"
            )
        self._check("lidar", "columns")
        object.__setattr__(self, "prisms", tuple(np.ravel(self.prisms).tolist()))
        if self.prisms and (len(self.prisms) != 3 or steep.any() or not is_finite(*self.prisms)):
            raise InputError(
                f"lidar: prisms {shown(self.prisms)}: expected half of the field of view [rad] and"
                " two speeds [turns/s], of a lidar with the elevations [0.0]"
            )
        if self.columns * len(steep) > MOST_BEAMS:
            raise InputError(
                f"lidar: {len(steep)} layers of {self.columns:,} columns: expected at most"
                f" {MOST_BEAMS:,} beams"
            )

    @classmethod
    def preset(cls, name: str, /, **changes: Any) -> "Lidar":
        """The lidar of a data sheet at 10 revolutions a second; other arguments change it.

        `PRESETS` lists the names. The azimuth offsets of layers in real devices are left out:
        columns are upright.

        Examples:
            >>> import lrf3d
            >>> lrf3d.Lidar.preset("OS1-64").elevations.shape
            (64,)
        """
        check_names("lidar", [name], PRESETS)
        lowest, highest, layers, columns, nearest, farthest = PRESETS[name]
        settings = {
            "range_min": float(nearest),
            "range_max": float(farthest),
            # Ten revolutions a second.
            "scan_duration": 0.1 * (columns - 1) / columns,
            "columns": columns,
            "prisms": PRISMS.get(name, ()),
        }
        return cls(np.radians(np.linspace(lowest, highest, layers)), **(settings | changes))

    @classmethod
    def of(cls, lrf: LaserRangeFinder, attitude: tuple[float, float]) -> "Lidar":
        """A range finder on a robot that is pitched and rolled [rad], as a lidar of one layer."""
        x, y, yaw = lrf.mount
        mount = tilted((x, y, lrf.height, yaw, 0.0, 0.0), attitude)
        lidar = cls(
            np.zeros(1), lrf.beams, lrf.range_min, lrf.range_max, mount, lrf.scan_duration, lrf.name
        )
        lidar.__dict__["planar"] = replace(
            lrf, mount=Pose(mount[0], mount[1], mount[3]), height=mount[2]
        )
        return lidar

    @cached_property
    def planar(self) -> LaserRangeFinder:
        """The range finder that equals its layer of elevation 0, if it is level."""
        x, y, z, yaw, *_ = self.mount
        last = math.pi - 2.0 * math.pi / self.columns if self.columns else math.pi
        return LaserRangeFinder(
            -math.pi, max(last, -math.pi), self.columns, self.range_min, self.range_max, z,
            self.scan_duration, mount=Pose(x, y, yaw), name=self.name,
        )  # fmt: skip

    @property
    def is_level(self) -> bool:
        """Whether its columns of beams are upright."""
        return not self.prisms and super().is_level

    @cached_property
    def slopes(self) -> Float:
        """Tangents (layers,) of the elevations: the rise of a beam for each metre in the plane."""
        return sealed(np.tan(self.elevations))

    @cached_property
    def stretches(self) -> Float:
        """Length (layers,) of a beam for each metre in the plane."""
        return sealed(1.0 / np.cos(self.elevations))

    def directions(self, pose: Sequence[float] | Float) -> Float:
        """Unit vectors (layers, columns, 3) of the beams in the world, from a pose."""
        theta = as_pose(pose).theta
        if self.prisms:
            from scipy.spatial.transform import Rotation

            turn = Rotation.from_euler("ZYX", [theta, *self.tilt.values()])
            return np.asarray(
                turn.apply(rosette(self.since + self.planar.delays, *self.prisms))[None]
            )
        if not self.is_level:
            return layer_directions(self.planar, theta, self.elevations.tolist(), **self.tilt)
        flat = np.broadcast_to(turned(self.planar.fan, theta), (len(self.slopes), self.columns, 2))
        rise = np.broadcast_to(self.slopes[:, None, None], (*flat.shape[:2], 1))
        return np.concatenate([flat, rise], axis=2) / self.stretches[:, None, None]


def rosette(times: Float, field: float, *speeds: float) -> Float:
    """Unit vectors (n, 3) at times (n,) [s] through two prisms, which deflect a beam alike.

    Half of the field of view [rad] and the speeds [turns/s] of the prisms are given.
    """
    turns = 2.0 * np.pi * np.outer(speeds, times)
    left, up = 0.5 * field * np.array([np.cos(turns), np.sin(turns)]).sum(axis=1)
    away = np.hypot(left, up)
    share = np.sinc(away / np.pi)
    return np.column_stack([np.cos(away), share * left, share * up])


# Lidars by their names: elevations of the lowest and of the highest layer [°], layers, columns at
# 10 Hz, least and largest range [m]. From the data sheets of Velodyne VLP-16 (63-9243) and HDL-32E
# (63-9113), Ouster OS0 and OS1 (revision 6), Hesai PandarXT-32, and Livox Mid-40 (user manual 1.0).
PRESETS: dict[str, tuple[float, float, int, int, float, float]] = {
    "VLP-16": (-15, 15, 16, 1800, 0.5, 100),
    "HDL-32E": (-30.67, 10.67, 32, 2170, 1, 100),
    **{f"OS0-{n}": (-45, 45, n, 1024, 0.3, 50) for n in (32, 64, 128)},
    **{f"OS1-{n}": (-22.5, 22.5, n, 1024, 0.3, 120) for n in (32, 64, 128)},
    "XT-32": (-16, 15, 32, 2000, 0.05, 120),
    "Mid-40": (0, 0, 1, 10_000, 1, 260),
}

# Half of their field of view [rad], and the turns a second of their prisms. The pattern is that of
# Z. Liu et al., "Low-cost retina-like robotic lidars based on incommensurable scanning", 2020; data
# sheets give no speeds of prisms, and these are typical.
PRISMS = {"Mid-40": (math.radians(19.2), 7294 / 60, -4664 / 60)}


@dataclass(frozen=True, eq=False, repr=False)
class LidarScan(Value):
    """The ranges of one revolution of a lidar.

    Args:
        pose: Pose x, y [m], theta [rad] of the lidar in the world; z, pitch and roll are those of
            its mount.
        lidar: The lidar.
        ranges: (layers, columns) distances [m]; +inf if there is no return, −inf if it is nearer
            than range_min.
        walls: (layers, columns) index of the segment that was hit; −1 for the floor or no return.
            The top of an object counts as one of its walls.
        time: Time of the first column [s].
        motion: (3,) motion of the robot from the first column to the last, as in `LaserScan`.
        light: What computes the intensities of the true scan, which most programs do not need.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> world = lrf3d.World([[3, -9, 3, 9]])
        >>> lidar = lrf3d.Lidar(np.array([-0.1, 0.0]), columns=4)
        >>> scan = lrf3d.EmbreeCaster(world).cast_lidar(lidar, (1, 0, 0))
        >>> scan.points().round(2).tolist()[-1]
        [3.0, 0.0, 0.5]
    """

    pose: Pose
    lidar: Lidar
    ranges: Float
    walls: NDArray[np.int32]
    time: float = 0.0
    motion: Float | None = field(default=None)
    light: Callable[[], Float] | None = field(default=None)

    def __repr__(self) -> str:
        layers, columns = self.ranges.shape
        returned = np.count_nonzero(self.hits)
        return f"LidarScan({layers} x {columns} beams, {returned} returned, from {self.pose})"

    @cached_property
    def hits(self) -> Bool:
        """Which beams (layers, columns) returned."""
        return sealed(np.isfinite(self.ranges))

    @cached_property
    def intensities(self) -> Float:
        """Intensities (layers, columns) as those of a `LaserScan`: 1 is a white wall at 1 m.

        Without a return, and at the triangles of a mesh, they are 0.
        """
        found = np.zeros(self.ranges.shape) if self.light is None else self.light()
        return sealed(np.where(self.hits, found, 0.0))

    @property
    def rings(self) -> Int:
        """The layer (m,) of each point."""
        return np.nonzero(self.hits)[0]

    @property
    def times(self) -> Float:
        """The time (m,) of each point after the first column [s]."""
        return self.lidar.planar.time_increment * np.nonzero(self.hits)[1].astype(np.float64)

    def points(self, *, local: bool = False) -> Float:
        """Hit points (m, 3) [m], layer by layer, in the world, or in the lidar's own frame.

        In the world, all beams are taken to start at the scan's pose, that of the first column.
        """
        if local:
            beams = replace(self.lidar, mount=RAISED).directions((0.0, 0.0, 0.0))[self.hits]
            return self.ranges[self.hits][:, None] * beams
        place = np.array([self.pose[0], self.pose[1], self.lidar.mount[2]])
        return place + self.ranges[self.hits][:, None] * self.lidar.directions(self.pose)[self.hits]
