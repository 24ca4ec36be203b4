"""Scans as ``sensor_msgs/LaserScan`` of ROS, field by field.

All numbers except the stamp are float32, and only here: the angles are consistent in float32,
``angle_max == angle_min + (n − 1) · angle_increment``, the stamp is that of the first beam, and
after REP 117 a beam without return is +inf, one that met something nearer than range_min is −inf.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import Float
from lrf3d.laser.range_finder import within_limits

# Nanoseconds in a second.
NANO = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Stamp:
    """A time in ROS: seconds, and nanoseconds from 0 to 999,999,999."""

    sec: int
    nanosec: int

    @classmethod
    def of(cls, time: float) -> "Stamp":
        """The stamp nearest to a time [s], but never 0, which in ROS means that there is none."""
        sec = math.floor(time)
        whole = sec * NANO + round((time - sec) * NANO)
        return cls(*divmod(whole or 1, NANO))

    @property
    def nanoseconds(self) -> int:
        """All of it in nanoseconds."""
        return self.sec * NANO + self.nanosec

    @property
    def seconds(self) -> float:
        """The float64 nearest to it [s]."""
        return self.nanoseconds / NANO


def read_ros_scan(message: Any) -> dict[str, Any]:
    """The arguments of a LaserScan, except its pose, of a message or of nested dicts.

    The beams are evenly spread between their ends where their step is impossible.
    """
    try:
        low, step, increment, range_min, range_max = (
            float(field_of(message, name))
            for name in "angle_min angle_increment time_increment range_min range_max".split()
        )
        ranges = np.asarray(field_of(message, "ranges"), dtype=np.float64)
        # Files of some loggers have no such field.
        intensities = np.asarray(field_of(message, "intensities", ()), dtype=np.float64)
        stamp = field_of(field_of(message, "header"), "stamp")
        time = Stamp(int(field_of(stamp, "sec")), int(field_of(stamp, "nanosec"))).seconds
        wide = float(field_of(message, "angle_max", math.nan)) - low
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"message is not a sensor_msgs/LaserScan ({error})") from None
    count = len(ranges) if ranges.ndim == 1 else 0
    if count == 0:
        raise InputError("scan without ranges")
    angles: Float = low + _step(low, wide, step, count) * np.arange(count, dtype=np.float64)
    # Some drivers do not set the largest range of their laser.
    range_max = math.inf if range_max == 0.0 or math.isnan(range_max) else range_max
    return {
        "angles": angles,
        "ranges": within_limits(ranges, range_min, range_max),
        "range_min": range_min,
        "range_max": range_max,
        "time": time,
        "time_increment": increment if math.isfinite(increment) else 0.0,
        # Many drivers leave them out, and some send fewer than ranges.
        "intensities": intensities if intensities.shape == ranges.shape else None,
    }


def _step(low: float, wide: float, step: float, count: int) -> float:
    """The step of beams [rad], or that of an even spread where the step is impossible.

    It is impossible if it runs against the ends of the fan, or takes the beams beyond a turn.
    """
    # [rad] At most a full turn, with room for rounding.
    turn = 2.1 * math.pi
    possible = count == 1 or 0.0 < abs(step) * (count - 1) <= turn
    # Drivers that do not set angle_max leave it at 0.
    against = step * wide < 0.0 and low + wide != 0.0
    if 0.0 < abs(wide) <= turn and (against or not possible):
        possible = True
        step = wide / max(count - 1, 1)
    if not (math.isfinite(low) and possible):
        raise InputError(
            f"scan of {count} beams {step:g} rad apart from {low:g} rad, expected at most a turn,"
            " in radians"
        )
    return step


def field_of(message: Any, name: str, *other: Any) -> Any:
    """A field of a message, or of a dict in its place; or another value, if one is given."""
    if isinstance(message, Mapping):
        return message.get(name, *other) if other else message[name]
    return getattr(message, name, *other)


def even_spread(angles: Float) -> tuple[float, float, float]:
    """First angle, last angle and step of evenly spaced beams, consistent in float32."""
    low = np.float32(angles[0])
    if len(angles) == 1:
        return float(low), float(low), 0.0
    step = (angles[-1] - angles[0]) / (len(angles) - 1)
    even = angles[0] + step * np.arange(len(angles))
    # Files round their angles.
    if step == 0.0 or not (np.abs(angles - even) <= 1e-3 * abs(step)).all():
        raise InputError("scan with beams at uneven angles: ROS needs them evenly spaced")
    step32 = np.float32(step)
    return float(low), float(low + np.float32(len(angles) - 1) * step32), float(step32)
