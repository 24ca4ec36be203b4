"""LaserRangeFinder: the fan of beams of a laser range finder (section 2.3)."""

import math
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, TypeVar

import numpy as np

from lrf3d.base.errors import InputError, Lrf3dWarning, check_names, expect, shown
from lrf3d.geometry.lines import (
    LARGEST_COORDINATE,
    TINY,
    Float,
    Radians,
    Value,
    number,
    sealed,
    whole_number,
)
from lrf3d.geometry.pose import Pose, as_pose, between, compose

# Which echo of a beam may be its range.
ECHO_CHOICES = ("first", "last", "strongest")

Number = TypeVar("Number", float, Float)

# The mount of a laser in the middle of its robot, facing ahead.
CENTRE = Pose(0.0, 0.0, 0.0)

# [rad] Largest angle of a beam: ten turns. Far beyond it float64 does not resolve beams.
LARGEST_ANGLE = 63.0

# Largest distance [m] of a laser from its robot's centre: a larger one is in other units.
FARTHEST_MOUNT = 100.0


@dataclass(frozen=True)
class LaserRangeFinder(Value):
    """A planar laser range finder on a robot.

    Args:
        angle_min: Angle of the first beam [rad], 0 ahead, counter-clockwise.
        angle_max: Angle of the last beam [rad].
        beams: Number of beams, evenly spread from the first angle to the last.
        range_min: Nearest distance that is measured [m].
        range_max: Farthest distance that is measured [m], d_max in the paper.
        height: Height of the beams above the ground [m].
        scan_duration: Time from the first beam of a scan to its last [s]; the robot moves on
            meanwhile. With 0 all beams are sent at once.
        threshold: Least intensity that is detected; 1 is that of a white wall at 1 m. It counts,
            like the next three, in worlds with materials.
        near_field: Length of the near field [m], in which light is lost beside the detector; 0 for
            none.
        echo: Which echo of a beam is its range: ``first``, ``last`` or ``strongest``.
        echoes: Number of echoes that are reported of each beam, the strongest ones, 1 to 5.
        mount: Pose x, y [m], theta [rad] on the robot, whose centre is the origin and whose x axis
            points ahead. Casters take the pose of the laser; a `Simulation` that of the robot.
        name: Name among the lasers of a robot, and of its frame: letters, digits and underscores.

    Raises:
        InputError: There are no beams or over 1,000,000, or a limit is not finite, out of order,
            or an angle of more than ten turns; the mount is farther than 100 m from the centre, or
            the name is invalid.

    Examples:
        >>> import lrf3d
        >>> lrf = lrf3d.LaserRangeFinder(beams=3, range_max=20.0)
        >>> lrf.angles.round(3).tolist()
        [-1.571, 0.0, 1.571]
        >>> lrf.directions((0, 0, 0)).round(3).tolist()
        [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0]]
    """

    angle_min: Radians = -np.pi / 2
    angle_max: Radians = np.pi / 2
    beams: int = 181
    range_min: float = 0.0
    range_max: float = 80.0
    height: float = 0.5
    scan_duration: float = 0.0
    threshold: float = field(default=0.0, repr=False)
    near_field: float = field(default=0.0, repr=False)
    echo: Annotated[str, ECHO_CHOICES] = field(default="strongest", repr=False)
    echoes: int = field(default=1, repr=False)
    mount: Pose = field(default=CENTRE, repr=False)
    name: str = field(default="laser", repr=False)

    def __post_init__(self) -> None:
        def check(name: str, unit: str = "", **limits: Any) -> None:
            value = number(getattr(self, name), f"range finder: {name}", unit, **limits)
            # Kernels take float64, and angles are as fine as their limits.
            object.__setattr__(self, name, value)

        check("angle_max", least=-LARGEST_ANGLE, most=LARGEST_ANGLE)
        check("angle_min", "rad up to angle_max", least=-LARGEST_ANGLE, most=self.angle_max)
        # [rad] An unrolled scan of a full turn may be wider, but by less than half a turn.
        widest = 3 * math.pi
        if max(-self.angle_min, self.angle_max, width := self.angle_max - self.angle_min) > widest:
            warnings.warn(
                f"range finder: angles from {self.angle_min:g} to {self.angle_max:g} rad are a"
                f" field of {math.degrees(width):.0f}°;"
                f" for degrees write math.radians({self.angle_max:g})",
                Lrf3dWarning,
                stacklevel=3,
            )
        check("range_max", positive=True, most=LARGEST_COORDINATE)
        check("range_min", "metres below range_max", most=math.nextafter(self.range_max, 0.0))
        check("height", least=-LARGEST_COORDINATE)
        for name in ("scan_duration", "threshold", "near_field"):
            check(name)
        check_names("range finder: echo", [str(self.echo)], ECHO_CHOICES)
        # Largest number of beams of a scan, some hundred times that of any range finder.
        most_beams = 1_000_000
        for name, most in (("beams", most_beams), ("echoes", 5)):
            count = whole_number(getattr(self, name), f"range finder: {name}", most=most)
            object.__setattr__(self, name, count)
        if not isinstance(self.name, str) or not re.fullmatch(r"[A-Za-z]\w*", self.name, re.A):
            raise InputError(
                f"range finder: name {shown(self.name)}: expected letters, digits and underscores,"
                " a letter first"
            )
        try:
            mount = as_pose(self.mount)
        except InputError as error:
            raise InputError(f"{self.name}: mount: {error}") from None
        if math.hypot(mount.x, mount.y) > FARTHEST_MOUNT or abs(mount.theta) > LARGEST_ANGLE:
            raise InputError(
                f"{self.name}: mount {tuple(mount)}: expected x, y up to {FARTHEST_MOUNT:g} m and"
                " radians"
            )
        object.__setattr__(self, "mount", mount)

    def placed(self, poses: Float) -> Float:
        """Poses (…, 3) of the laser in the world, where its robot is at poses (…, 3)."""
        return poses if self.mount == CENTRE else compose(np.asarray(poses), np.array(self.mount))

    @cached_property
    def angles(self) -> Float:
        """Angles of the beams (beams,) [rad], 0 ahead; θ_s of the paper is angles + π/2."""
        # A copy, as NumPy's is a view of an array that may be written, which scans would copy.
        return sealed(np.linspace(self.angle_min, self.angle_max, self.beams).copy())

    @cached_property
    def fan(self) -> Float:
        """Cosines and sines (2, beams) of the angles: the beams at heading 0."""
        fan = np.array([np.cos(self.angles), np.sin(self.angles)])
        return sealed(np.where(np.abs(fan) < TINY, 0.0, fan))

    @cached_property
    def time_increment(self) -> float:
        """Time from one beam to the next [s]."""
        return self.scan_duration / (self.beams - 1) if self.beams > 1 else 0.0

    @cached_property
    def spread(self) -> tuple[float, float]:
        """Angle of the middle of the fan, and half of its width [rad]."""
        return 0.5 * (self.angle_min + self.angle_max), 0.5 * (self.angle_max - self.angle_min)

    @cached_property
    def delays(self) -> Float:
        """Times of the beams (beams,) after the first one [s]."""
        return sealed(self.time_increment * np.arange(self.beams, dtype=np.float64))

    @cached_property
    def plain(self) -> tuple[Any, ...]:
        """The fan, the middle and half of its width, and the limits, as kernels take them."""
        return self.fan, *self.spread, float(self.range_min), float(self.range_max)

    @cached_property
    def of_scans(self) -> dict[str, Any]:
        """What all its scans have in common, by the names of their attributes."""
        return {
            "angles": self.angles, "range_min": self.range_min, "range_max": self.range_max,
            "time_increment": self.time_increment, "mount": self.mount, "laser": self.name,
        }  # fmt: skip

    def directions(self, pose: Sequence[float] | Float) -> Float:
        """Unit vectors (beams, 2) of the beams in the world, for the laser at a pose."""
        return turned(self.fan, as_pose(pose).theta)


def lasers_of(
    lasers: "LaserRangeFinder | Sequence[LaserRangeFinder]",
) -> "tuple[LaserRangeFinder, ...]":
    """The lasers of a robot, one or several, whose names must differ."""
    found = tuple(lasers) if isinstance(lasers, list | tuple) else (lasers,)
    if not found:
        raise InputError("lasers: none; expected at least one range finder")
    for each in found:
        expect(each, LaserRangeFinder, "range finder")
    names = [each.name for each in found]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"lasers: two of the name {twice[0]!r}; give each its own name=")
    if len({each.echoes for each in found}) > 1:
        raise InputError("lasers: of different numbers of echoes; give all the same")
    return found


def robot_pose(laser: Pose, mount: Pose) -> Pose:
    """The pose of a robot whose laser, on a mount, is at a pose."""
    if mount == CENTRE:
        return laser
    return Pose(*compose(np.array(laser), between(np.array(mount), np.zeros(3))).tolist())


def beam_directions(theta: float, angles: Float) -> Float:
    """Unit vectors (beams, 2) in the world of beams at angles (beams,) from the heading theta."""
    return turned(np.array([np.cos(angles), np.sin(angles)]), theta)


def layer_directions(
    lrf: LaserRangeFinder,
    theta: float,
    elevations: Sequence[float],
    *,
    pitch: float = 0.0,
    roll: float = 0.0,
) -> Float:
    """Unit vectors (layers, beams, 3) of layers of beams at elevations [rad] of a tilted laser.

    The laser is turned by the heading theta, then pitched about its left, then rolled about its
    ahead, each right-handed [rad].
    """
    rise = np.asarray(elevations, dtype=np.float64)[:, None]
    ahead = np.cos(rise) * lrf.fan[0]
    left = np.cos(rise) * lrf.fan[1]
    up = np.broadcast_to(np.sin(rise), ahead.shape)
    return oriented(ahead, left, up, theta, pitch, roll)


def oriented(
    ahead: Float, left: Float, up: Float, theta: float, pitch: float, roll: float
) -> Float:
    """Vectors (…, 3) in the world of those of a sensor with a heading, a pitch and a roll [rad]."""
    left, up = turn(left, up, math.cos(roll), math.sin(roll))
    ahead, up = turn(ahead, up, math.cos(pitch), -math.sin(pitch))
    ahead, left = turn(ahead, left, math.cos(theta), math.sin(theta))
    return np.stack([ahead, left, up], axis=-1)


def turned(fan: Float, theta: float) -> Float:
    """A fan (2, beams) of beams, turned by the heading theta [rad], as rows (beams, 2)."""
    return np.column_stack(turn(fan[0], fan[1], math.cos(theta), math.sin(theta)))


def turn(x: Number, y: Number, cos: float, sin: float) -> tuple[Number, Number]:
    """Turn vectors by an angle of which the cosine and sine are given.

    Casters compile this function, so that all use the same beam to the last bit.
    """
    return cos * x - sin * y, sin * x + cos * y


def within_limits(ranges: Float, range_min: float, range_max: float) -> Float:
    """Ranges after REP 117: +inf above range_max, −inf below range_min."""
    return np.where(ranges > range_max, np.inf, np.where(ranges < range_min, -np.inf, ranges))
