"""LaserScan: the ranges of one scan, with its pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError, shown
from lrf3d.base.lazy import Pictured
from lrf3d.geometry.lines import (
    LARGEST_COORDINATE,
    LARGEST_TIME,
    ROUNDING,
    Bool,
    Float,
    Int,
    Value,
    least_of,
    number,
    read_only,
    sealed,
)
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser.range_finder import (
    CENTRE,
    LARGEST_ANGLE,
    LaserRangeFinder,
    beam_directions,
    robot_pose,
    within_limits,
)
from lrf3d.laser.ros_scan import Stamp, even_spread, read_ros_scan

# The attributes of a scan for its light: number of axes, and the value of a beam without return.
LIGHT = {"intensities": (1, 0.0), "echoes": (2, np.inf), "echo_intensities": (2, 0.0)}

# Largest median range that a laser on a robot measures [m]: a larger one is in other units.
LARGEST_MEDIAN = 100.0


@dataclass(frozen=True, eq=False, repr=False, init=False)
class LaserScan(Value, Pictured):
    """The ranges of one scan, with the pose that they were measured at.

    Args:
        pose: Pose x, y [m], theta [rad] of the laser in the world.
        angles: (beams,) angles of the beams [rad], 0 ahead, counter-clockwise.
        ranges: (beams,) distances [m]; +inf where nothing returned, −inf where the wall is
            nearer than range_min (REP 117). NaN, and range_max or more, count as no return, and
            what is negative as too near.
        walls: (beams,) index of the segment that was hit; −1 for beams without a range or that
            hit no wall.
        range_min: Nearest distance that the range finder measures [m].
        range_max: Farthest distance that the range finder measures [m]; over 1e9 m it is unknown.
        intensities: (beams,) brightness of what returned, 0 where nothing did; 1 is that of a white
            wall at 1 m at a right angle. None in worlds without materials.
        echoes: (beams, k) ranges [m] of several echoes of each beam, the nearest first, +inf after
            the last; None where the range finder reports one.
        echo_intensities: (beams, k) their intensities.
        time: Time of the first beam [s].
        time_increment: Time from one beam to the next [s].
        pose_covariance: (3, 3) covariance of the pose's x, y [m] and theta [rad]; None if the pose
            is exact or its error is unknown. The larger it is, the farther apart two views of one
            wall may lie for the mapper.
        mount: Pose of the laser on its robot; that of the robot is ``pose @ mount.inverse()``.
        laser: Name of the laser.
        motion: (3,) motion of the robot from the first beam to the last, as seen from where the
            first was sent: ahead, to the left [m], turn [rad]. None if it is unknown.

    Raises:
        InputError: The arrays do not fit together, or a number is invalid.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> angles = [-np.pi / 2, 0, np.pi / 2]
        >>> scan = lrf3d.LaserScan((1, 2, 0), angles, ranges=[1, 4, np.inf])
        >>> scan.hits.tolist()
        [True, True, False]
        >>> scan.points().round(3).tolist()
        [[1.0, 1.0], [5.0, 2.0]]
    """

    pose: Pose
    angles: Float
    ranges: Float
    walls: Int
    range_min: float = 0.0
    range_max: float = np.inf
    time: float = 0.0
    time_increment: float = 0.0
    pose_covariance: Float | None = None
    intensities: Float | None = None
    echoes: Float | None = None
    echo_intensities: Float | None = None
    mount: Pose = CENTRE
    laser: str = "laser"
    motion: Float | None = None

    def __init__(
        self,
        pose: Sequence[float] | Float,
        angles: ArrayLike,
        ranges: ArrayLike,
        walls: ArrayLike | None = None,
        *,
        range_min: float = 0.0,
        range_max: float = np.inf,
        time: float = 0.0,
        time_increment: float = 0.0,
        pose_covariance: ArrayLike | None = None,
        intensities: ArrayLike | None = None,
        echoes: ArrayLike | None = None,
        echo_intensities: ArrayLike | None = None,
        mount: Sequence[float] | Float = CENTRE,
        laser: str = "laser",
        motion: ArrayLike | None = None,
    ) -> None:
        # Drivers write the largest float32 for a range finder whose reach they do not know.
        unknown = isinstance(range_max, float) and range_max == np.inf
        far = np.inf if unknown else number(range_max, "scan: range_max", positive=True)
        reach = min(far, LARGEST_COORDINATE)
        below = math.nextafter(reach, 0.0)
        near = number(range_min, "scan: range_min", "metres below range_max", most=below)
        turns = read_only(angles, "angles")
        distances = read_only(ranges, "ranges")
        met = np.full(distances.shape, -1) if walls is None else walls
        met = read_only(met, "walls", np.int64)
        if turns.ndim != 1 or not turns.shape == distances.shape == met.shape:
            raise InputError(
                f"scan with angles {turns.shape}, ranges {distances.shape} and walls {met.shape}:"
                " expected one of each for every beam"
            )
        _check_angles(turns)
        light = zip(LIGHT, (intensities, echoes, echo_intensities), strict=True)
        self.__dict__.update(
            {name: _of_beams(value, len(turns), name) for name, value in light},
            pose=as_pose(pose),
            angles=turns,
            ranges=returned(distances, reach),
            walls=met,
            range_min=near,
            range_max=far if far <= LARGEST_COORDINATE else np.inf,
            time=number(time, "scan: time", "seconds", least=-LARGEST_TIME),
            time_increment=number(time_increment, "scan: time_increment", least=-LARGEST_TIME),
            pose_covariance=None if pose_covariance is None else _covariance(pose_covariance),
            mount=as_pose(mount),
            laser=laser,
            motion=None if motion is None else _motion(motion),
        )

    def __repr__(self) -> str:
        x, y, theta = self.pose
        near = f", {self.ranges[self.hits].min():.3f} m and more" if self.hits.any() else ""
        return (
            f"LaserScan({len(self.ranges)} beams, {np.count_nonzero(self.hits)} returned{near},"
            f" from ({x:.3f} m, {y:.3f} m, {theta:.3f} rad))"
        )

    @classmethod
    def unchecked(
        cls, lrf: LaserRangeFinder, pose: Pose, ranges: Float, walls: Int, *light: Float | None,
        time: float = 0.0, motion: Float | None = None,
    ) -> LaserScan:  # fmt: skip
        """The scan of new arrays of a caster: they are made read-only, not checked or copied.

        The light is that of its attributes: intensities, echoes and echo_intensities, if known.
        """
        scan = object.__new__(cls)
        # What is left out has its default in the class: a scan costs microseconds.
        own = scan.__dict__
        own.update(lrf.of_scans, pose=pose, ranges=sealed(ranges), walls=sealed(walls), time=time)
        if motion is not None:
            own["motion"] = sealed(motion)
        if light:
            for name, values in zip(LIGHT, light, strict=False):
                if values is not None:
                    own[name] = sealed(values)
        return scan

    def at_time(self, time: float) -> Self:
        """The same scan at another time of its first beam [s]; nothing is checked or copied."""
        scan = object.__new__(type(self))
        scan.__dict__.update(self.__dict__, time=time)
        return scan

    @property
    def duration(self) -> float:
        """Time from the first beam to the last [s]."""
        return self.time_increment * (len(self.ranges) - 1)

    @property
    def robot(self) -> Pose:
        """The pose of the robot that carries the laser, at the first beam."""
        return robot_pose(self.pose, self.mount)

    @classmethod
    def from_ros(cls, message: Any, pose: Sequence[float] = (0.0, 0.0, 0.0)) -> LaserScan:
        """The scan of a ROS ``sensor_msgs/LaserScan``, taken at a pose: see `ros_scan`."""
        return cls(as_pose(pose), **read_ros_scan(message))

    def as_ros(self, frame_id: str = "laser", *, scan_time: float = 0.0) -> dict[str, Any]:
        """The scan as a ROS ``sensor_msgs/LaserScan``, as nested dicts: see `ros_scan`.

        Its beams must be evenly spaced. The time between two scans [s] is 0 if it is unknown.
        """
        light = np.empty(0) if self.intensities is None else self.intensities
        names = "angle_min angle_max angle_increment time_increment scan_time range_min range_max"
        limits = self.range_min, self.range_max
        numbers = *even_spread(self.angles), self.time_increment, scan_time, *limits
        rounded = (float(np.float32(number)) for number in numbers)
        return {
            "header": {"stamp": asdict(Stamp.of(self.time)), "frame_id": frame_id},
            **dict(zip(names.split(), rounded, strict=True)),
            "ranges": within_limits(self.ranges, *limits).astype(np.float32),
            "intensities": light.astype(np.float32),
        }

    @cached_property
    def hits(self) -> Bool:
        """Which beams (beams,) returned: a finite range up to range_max."""
        return sealed(np.isfinite(self.ranges) & (self.ranges <= self.range_max))

    def points(self) -> Float:
        """Reflection points (m, 2) in the world of the beams that returned (Eq. 8)."""
        return reflection_points(self.pose, self.angles[self.hits], self.ranges[self.hits])


@dataclass(frozen=True, slots=True, eq=False)
class ScanBatch:
    """Scans (k,) of one range finder, which noises take at once.

    Angles (beams,) and limits are those of `LaserScan`; ranges, walls, and light have an axis more
    than there, of the scans. A noise changes it by ``dataclasses.replace``.
    """

    angles: Float
    ranges: Float
    walls: Int
    range_min: float
    range_max: float
    intensities: Float | None = None
    echoes: Float | None = None
    echo_intensities: Float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "ranges", returned(self.ranges, self.range_max))

    @classmethod
    def of(cls, scans: Sequence[LaserScan]) -> ScanBatch:
        """Scans, at least one, as one value; their poses and times are left out."""
        first = scans[0]
        rows = {
            name: np.array([getattr(scan, name) for scan in scans])
            for name in ("ranges", "walls", *LIGHT)
            if getattr(first, name) is not None
        }
        return cls(first.angles, range_min=first.range_min, range_max=first.range_max, **rows)


def _check_angles(angles: Float) -> None:
    spare = LARGEST_ANGLE - np.abs(angles)
    if not least_of(spare) >= 0.0:
        beam = int(np.argmin(spare >= 0.0))
        raise InputError(
            f"scan with the angle {angles[beam]:g} of beam {beam}: expected at most"
            f" ±{LARGEST_ANGLE:g} rad"
        )


def returned(ranges: Float, range_max: float) -> Float:
    """Ranges, in which NaN and what is not within range_max are no return, +inf.

    Negative ones, which noise makes of short ones, are too near, −inf.
    """
    within = ranges < range_max
    # Nearly all scans stay as they are, and in many all beams returned.
    rest = ranges.size - np.count_nonzero(within)
    if least_of(ranges) >= 0.0 and (not rest or np.count_nonzero(ranges == np.inf) == rest):
        return ranges
    return sealed(np.where(ranges < 0.0, -np.inf, np.where(within, ranges, np.inf)))


def _of_beams(values: Any, beams: int, name: str) -> Float | None:
    """Values for each beam (beams, …); NaN becomes the value that stands for nothing."""
    if values is None:
        return None
    array: Float = read_only(values, name)
    axes, nothing = LIGHT[name]
    if array.ndim != axes or len(array) != beams:
        raise InputError(
            f"scan with {name} {array.shape}: expected a row for each of {beams} beams"
        )
    return sealed(np.where(np.isnan(array), nothing, array)) if np.isnan(array).any() else array


def _motion(values: Any) -> Float:
    """A motion (3,), which copies of a scan share."""
    motion: Float = read_only(values, "motion")
    as_pose(motion)
    return motion


def _covariance(values: Any) -> Float:
    """A matrix (3, 3), checked to be finite, symmetric, and semidefinite, but for rounding."""
    matrix: Float = read_only(values, "pose_covariance")
    if matrix.shape == (3, 3) and np.isfinite(matrix).all():
        rounding = ROUNDING * np.abs(matrix).max()
        even = np.abs(matrix - matrix.T).max() <= rounding
        if even and np.linalg.eigvalsh(matrix).min() >= -rounding:
            return matrix
    raise InputError(
        f"scan with pose_covariance {shown(matrix.tolist())}: expected a symmetric matrix (3, 3),"
        " without negative eigenvalues"
    )


def reflection_points(pose: Sequence[float], angles: Float, ranges: Float) -> Float:
    """Points (n, 2) in the world at ranges (n,) along beams at angles (n,) (Eq. 8)."""
    return np.array([pose[0], pose[1]]) + ranges[:, None] * beam_directions(pose[2], angles)


def doubtful_ranges(scans: Sequence[LaserScan]) -> str | None:
    """Why the ranges of a drive are hardly in metres, in a sentence; None if they may be."""
    ranges = np.concatenate([scan.ranges[scan.hits & (scan.ranges > 0.0)] for scan in scans])
    beams = sum(len(scan.ranges) for scan in scans)
    # [share] With fewer returns no wall is recognised.
    least_returned = 0.02
    if len(ranges) < least_returned * beams:
        return (
            f"{len(ranges)} of {beams} beams returned, too few to show walls; are the ranges in"
            " metres (millimetres have to be divided by 1000, centimetres by 100), and is the"
            " largest range right?"
        )
    return doubtful_unit(ranges)


def doubtful_unit(ranges: Float) -> str | None:
    """Why ranges (n,) of hits are unlikely to be in metres, in a sentence; None if they may be."""
    if len(ranges) and (middle := float(np.median(ranges))) > LARGEST_MEDIAN:
        return (
            f"half of the ranges are over {middle:g}: expected metres; divide millimetres by 1000,"
            " centimetres by 100"
        )
    # [m] What 19 of 20 ranges reach at least, wherever a robot has room to drive.
    smallest_most = 0.1
    measured = ranges[ranges > 0.0]
    if len(measured) and (most := float(np.quantile(measured, 0.95))) < smallest_most:
        return (
            f"19 of 20 ranges are under {most:.2g} m: expected metres; metres may have been taken"
            " for the centimetres or millimetres of this format"
        )
    return None
