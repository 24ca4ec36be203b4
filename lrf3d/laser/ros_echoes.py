"""RosEchoScan: ``sensor_msgs/MultiEchoLaserScan``, for range finders of several echoes.

It is made from a LaserScan with echoes; any object or dict with ROS's fields can be converted back.
Ranges and intensities are float32, as in a `RosScan`; echoes that did not return are left out.
"""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.laser.range_finder import within_limits
from lrf3d.laser.ros_scan import (
    Float32,
    ScanFields,
    field_of,
    make_ros_scan,
    read_ros_scan,
)

if TYPE_CHECKING:
    from lrf3d.laser.scan import LaserScan

OTHERS = [field.name for field in fields(ScanFields)]
"""Fields that both messages have alike."""


@dataclass(frozen=True, slots=True, eq=False)
class RosEchoes:
    """``sensor_msgs/LaserEcho``: the echoes of a beam.

    Args:
        echoes: (k,) float32 ranges [m] or intensities, the nearest first.
    """

    echoes: Float32


@dataclass(frozen=True, slots=True, eq=False)
class RosEchoScan(ScanFields):
    """``sensor_msgs/MultiEchoLaserScan``: its fields are those of `ScanFields`, and these.

    Args:
        ranges: (n,) the ranges of the echoes of each beam; none for a beam without a return.
        intensities: (n,) their intensities.
    """

    ranges: tuple[RosEchoes, ...]
    intensities: tuple[RosEchoes, ...]


def has_echoes(message: Any) -> bool:
    """Whether a message holds the echoes of beams rather than ranges."""
    try:
        ranges = field_of(message, "ranges")
        return bool(len(ranges)) and not np.isscalar(ranges[0])
    except (AttributeError, KeyError, TypeError):
        return False


def make_ros_echoes(scan: "LaserScan", frame_id: str, scan_time: float) -> RosEchoScan:
    """A scan of several echoes as a ROS message.

    Raises:
        InputError: The scan has no echoes, or its beams are not evenly spaced.
    """
    if scan.echoes is None or scan.echo_intensities is None:
        raise InputError("scan without echoes: give the range finder echoes=2 or more")
    plain = make_ros_scan(scan, frame_id, scan_time)
    ranges = within_limits(scan.echoes, scan.range_min, scan.range_max)
    columns = [
        tuple(
            RosEchoes(row[returned].astype(np.float32))
            for row, returned in zip(values, np.isfinite(ranges), strict=True)
        )
        for values in (ranges, scan.echo_intensities)
    ]
    others = {name: getattr(plain, name) for name in OTHERS}
    return RosEchoScan(**others, ranges=columns[0], intensities=columns[1])


def read_ros_echoes(message: Any, choice: str = "strongest") -> dict[str, Any]:
    """The arguments of a LaserScan, except its pose, from a message with the echoes of beams.

    Args:
        message: A RosEchoScan, a message of rclpy or rosbags, or nested dicts.
        choice: Which echo is the range: ``first``, ``last`` or ``strongest``.

    Raises:
        InputError: The message is invalid, or its angles and limits are.
    """
    try:
        rows, lights = (
            [
                np.asarray(field_of(one, "echoes"), dtype=np.float64)
                for one in field_of(message, name)
            ]
            for name in ("ranges", "intensities")
        )
        others = {name: field_of(message, name) for name in OTHERS}
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"message is not a sensor_msgs/MultiEchoLaserScan ({error})") from None
    shape = len(rows), max(map(len, rows), default=0)
    echoes, light = np.full(shape, np.inf), np.zeros(shape)
    for row, (values, lit) in enumerate(zip(rows, lights or rows, strict=False)):
        echoes[row, : len(values)] = values
        if lights and len(lit) == len(values):
            light[row, : len(lit)] = lit
    # Echoes that are no number or nearer than range_min are none.
    read = read_ros_scan(others | {"ranges": np.full(shape[0], np.inf), "intensities": ()})
    lost = ~((echoes >= read["range_min"]) & (echoes <= read["range_max"]))
    echoes[lost], light[lost] = np.inf, 0.0
    order = np.argsort(echoes, axis=1, kind="stable")
    echoes = np.take_along_axis(echoes, order, axis=1)
    light = np.take_along_axis(light, order, axis=1)
    if not shape[1]:
        return read
    chosen = {
        "first": np.zeros(shape[0], np.int64),
        "last": np.maximum(np.isfinite(echoes).sum(axis=1) - 1, 0),
        # Echoes of one brightness, as where intensities are missing: the first of them.
        "strongest": np.argmax(light, axis=1),
    }[choice]
    beams = np.arange(shape[0])
    return read | {
        "ranges": echoes[beams, chosen],
        "intensities": light[beams, chosen] if lights else None,
        "echoes": echoes,
        "echo_intensities": light,
    }
