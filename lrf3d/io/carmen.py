"""CARMEN logs: one message a line, as the CARMEN toolkit and its log archives write them.

A log may be gzipped. Its scans have the logged poses, or those of odometry or ground truth at their
times. In a log that a SLAM system has corrected, the logged poses are the corrected ones. These
messages are read::

    FLASER n r1 … rn  x y theta  odom_x odom_y odom_theta  time host logger_time
    ROBOTLASER1 type start fov step max_range accuracy mode  n r1 … rn  m s1 … sm  x y theta
                robot_x robot_y robot_theta  v w  safety safety turn  time host logger_time
    ODOM x y theta  v w acceleration  time host logger_time
    TRUEPOS x y theta  odom_x odom_y odom_theta  time host logger_time
    PARAM robot_frontlaser_offset metres  time host logger_time

Lines that cannot be read are skipped and reported.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf, isfinite, isnan, nan, pi
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, wrap_angle
from lrf3d.io.laser_log import (
    LARGEST_RANGE,
    MOST_READINGS,
    NAMED,
    BadLine,
    LaserLog,
    WheelRecord,
    log_name,
)
from lrf3d.io.no_return import without_no_returns
from lrf3d.io.packed import LogLine, lines_of
from lrf3d.laser import LaserScan
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory
from lrf3d.world.schema import LARGEST_COORDINATE

MOST_WITHOUT_SCAN = 1_000_000
"""Largest number of successive lines without a scan: hours of other messages."""

LONGEST_NAME = 40
"""Length of the longest name of a message [characters]."""

FARTHEST_LASER = 10.0
"""How far a laser may stand from its robot's centre [m]: farther, the number is in other units."""


class _BadMessage(ValueError):
    """A message that cannot be read, with the reason."""


class LaserOffset(NamedTuple):
    """How far the laser stands ahead of the robot's centre [m], from a PARAM message."""

    metres: float


class NotNumbers(NamedTuple):
    """Readings of the next scan that are no numbers, such as NaN, which mean no return."""

    readings: int


class LoggedPose(NamedTuple):
    """A pose of the robot from an ODOM or a TRUEPOS message.

    Args:
        track: ``odom`` or ``truth``.
        time: When it was there [s].
        pose: Where.
    """

    track: str
    time: float
    pose: Pose


def load_carmen(
    path: str | Path, *, largest_range: float | None = None, poses: str = "auto"
) -> LaserLog:
    """Read the scans of a CARMEN log.

    Args:
        path: The log, packed with gzip or not.
        largest_range: Readings from here on are no return [m]; if not given the farthest that
            the message says its range finder sees, or 50 m, or less if the largest reading of
            the log stands out.
        poses: ``auto`` for those of the scans, ``odom`` or ``truth`` for those that ODOM or
            TRUEPOS messages give for the times of the scans, taken as the laser's.

    Raises:
        InputError: The file cannot be read, holds no scan or not the poses that are asked for,
            or more than fit into memory.
    """
    path = Path(path)
    if largest_range is not None and not largest_range > 0.0:
        raise InputError(f"largest range {largest_range}: expected metres, more than 0")
    scans: list[LaserScan] = []
    tracks: dict[str, list[LoggedPose]] = {"odom": [], "truth": []}
    named: list[BadLine] = []
    wheels: list[LoggedPose] = []
    places: list[int] = []
    offset = 0.0
    bad = readings = not_numbers = 0
    for item in read_carmen(lines_of(path), largest_range=largest_range, source=str(path)):
        if isinstance(item, BadLine):
            bad += 1
            named += [item] if len(named) < NAMED else []
            continue
        if isinstance(item, LoggedPose):
            track = tracks[item.track]
            # A pose that is no later than the one before is left out.
            if not track or item.time > track[-1].time:
                track.append(item)
            if item.track == "odom":
                wheels.append(item)
            continue
        if isinstance(item, LaserOffset):
            offset = item.metres
            continue
        if isinstance(item, NotNumbers):
            not_numbers += item.readings
            continue
        readings += len(item.ranges)
        if readings > MOST_READINGS:
            raise InputError(
                f"{path}: more than {MOST_READINGS:,} readings; cut the log into parts"
            )
        scans.append(item)
        places.append(len(wheels) - 1)
    if not scans:
        why = f"; {bad} bad lines, first {named[0]}" if named else ""
        raise InputError(f"{path}: no laser scan in it, expected FLASER or ROBOTLASER1 lines{why}")
    known = {
        name: Trajectory([row.time for row in rows], [row.pose for row in rows])
        for name, rows in tracks.items()
        if rows
    }
    record = WheelRecord(
        np.array([row.time for row in wheels]),
        np.array([row.pose for row in wheels]).reshape(-1, 3),
        np.array(places),
        offset,
    )
    if largest_range is None:
        scans = without_no_returns(scans)
    log = LaserLog(
        log_name(path),
        scans,
        bad,
        tuple(named),
        tracks=known,
        wheels=record if len(record) else None,
        # Without ODOM lines the poses of the scans are the odometry, and those are the laser's.
        mount=Pose(0.0 if wheels else offset, 0.0, 0.0),
        not_numbers=not_numbers,
    )
    return log if poses == "auto" else _placed_by(log, poses, path)


def _placed_by(log: LaserLog, name: str, path: Path) -> LaserLog:
    """The log with the poses of one of its tracks; what lies before or after it is left out."""
    if name not in log.tracks:
        there = ", ".join(["auto", *log.tracks])
        raise InputError(f"{path}: no poses from {name} in it; there are {there}")
    track = log.tracks[name]
    inside = (log.times >= track.times[0]) & (log.times <= track.times[-1])
    placed = track.at(log.times)
    scans = [
        replace(scan, pose=Pose(*pose.tolist()))
        for scan, pose, known in zip(log.scans, placed, inside, strict=True)
        if known
    ]
    wheels = log.wheels and replace(log.wheels, places=log.wheels.places[inside])
    if not scans:
        raise InputError(f"{path}: no scan within the time of the poses from {name}")
    source = "ODOM messages" if name == "odom" else "TRUEPOS messages"
    return replace(log, scans=scans, source=source, wheels=wheels)


def read_carmen(
    lines: Iterable[LogLine], *, largest_range: float | None = None, source: str = "log"
) -> Iterator[LaserScan | LoggedPose | LaserOffset | NotNumbers | BadLine]:
    """Read scans and poses line by line, in constant memory.

    If a log holds each scan twice, as an old and as a new message, only the kind that comes first
    is read.

    Args:
        lines: The lines.
        largest_range: Readings from here on are no return [m].
        source: Name of the log, for messages.

    Yields:
        A scan, a pose or the laser's offset for each line that holds one, and a BadLine for each
        that cannot be read.

    Raises:
        InputError: A million lines in a row hold no scan.
    """
    fans: dict[tuple[int, float, float], Float] = {}
    chosen = b""
    idle = 0
    for number, text, fault in lines:
        idle += 1
        if idle > MOST_WITHOUT_SCAN:
            raise InputError(
                f"{source}: line {number}: no scan in {MOST_WITHOUT_SCAN:,} lines before it;"
                " expected FLASER or ROBOTLASER1 lines"
            )
        try:
            if fault:
                raise _BadMessage(fault)
            words = text.split()
            name = words[0] if words else b"#"
            if name in _TRACKS:
                yield _logged_pose(words)
            elif name == b"PARAM" and words[1:2] == [b"robot_frontlaser_offset"]:
                yield LaserOffset(_offset(words))
            elif name not in _READERS:
                _check_name(name)
            elif chosen in (b"", name):
                scan = _READERS[name](words, largest_range, fans)
                chosen, idle = name, 0
                if count := sum(word.lower().lstrip(b"+-") == b"nan" for word in words):
                    yield NotNumbers(count)
                yield scan
        except _BadMessage as error:
            yield BadLine(number, str(error))


def _check_name(name: bytes) -> None:
    """Distinguish messages that may be skipped from lines that are not messages."""
    known = name.replace(b"_", b"").isalnum() and name == name.upper() and name[:1].isalpha()
    if not (name.startswith(b"#") or (known and len(name) <= LONGEST_NAME)):
        raise _BadMessage("not a CARMEN message")


def _logged_pose(words: list[bytes]) -> LoggedPose:
    """The pose of an ODOM or a TRUEPOS message."""
    if len(words) != 10:
        raise _BadMessage(f"{len(words)} words, expected 10")
    return LoggedPose(_TRACKS[words[0]], _number(words[7], "time"), _pose(words[1:4]))


def _offset(words: list[bytes]) -> float:
    """The value of a PARAM message of robot_frontlaser_offset [m]."""
    offset = _number(words[2] if len(words) > 2 else b"", "robot_frontlaser_offset")
    if abs(offset) > FARTHEST_LASER:
        raise _BadMessage(f"robot_frontlaser_offset {offset:g} m, expected at most 10 m")
    return offset


def _front_laser(
    words: list[bytes], largest_range: float | None, fans: dict[tuple[int, float, float], Float]
) -> LaserScan:
    """The scan of a FLASER message, 180° wide."""
    count = _count(words, 1)
    if len(words) != count + 11:
        raise _BadMessage(f"{len(words)} words, {count} readings need {count + 11}")
    return _scan(
        words[2 : count + 2],
        words[count + 2 : count + 5],
        words[count + 8],
        _fan(fans, count, *_front(count)),
        LARGEST_RANGE if largest_range is None else largest_range,
    )


def _front(count: int) -> tuple[float, float]:
    """First angle and step [rad] of a FLASER message's beams.

    An odd fan looks to both −90° and +90°; an even one leaves +90° out.
    """
    return -0.5 * pi, pi / (count - 1) if count % 2 else pi / count


def front_angles(count: int) -> Float:
    """Angles (count,) [rad] of a FLASER message's beams."""
    start, step = _front(count)
    angles: Float = start + step * np.arange(count, dtype=np.float64)
    return angles


def _robot_laser(
    words: list[bytes], largest_range: float | None, fans: dict[tuple[int, float, float], Float]
) -> LaserScan:
    """The scan of a ROBOTLASER1 message, which holds its angles and its range."""
    count = _count(words, 8)
    remissions = _count(words, count + 9, least=0)
    tail = count + remissions + 10
    if len(words) != tail + 14:
        raise _BadMessage(
            f"{len(words)} words, {count} readings and {remissions} remissions need {tail + 14}"
        )
    start, step, farthest = (_number(words[k]) for k in (2, 4, 5))
    if not 0.0 < step * (count - 1) < 2.1 * pi:
        raise _BadMessage(f"{count} beams {step} rad apart, expected at most a full turn")
    return _scan(
        words[9 : count + 9],
        words[tail : tail + 3],
        words[tail + 11],
        _fan(fans, count, start, step),
        _farthest(farthest, largest_range),
    )


def _farthest(said: float, largest_range: float | None) -> float:
    """Least reading that means no return: that of the message, if it has one, or the user's."""
    if said > LARGEST_COORDINATE:
        raise _BadMessage(f"a range of {said:g} m, expected at most {LARGEST_COORDINATE:g} m")
    if largest_range is None:
        return said if said > 0.0 else LARGEST_RANGE
    return min(said, largest_range) if said > 0.0 else largest_range


_READERS = {b"FLASER": _front_laser, b"ROBOTLASER1": _robot_laser}
_TRACKS = {b"ODOM": "odom", b"TRUEPOS": "truth"}


def _scan(
    readings: list[bytes], pose: list[bytes], time: bytes, angles: Float, farthest: float
) -> LaserScan:
    try:
        ranges = np.array([float(word) for word in readings])
    except ValueError:
        # Only here each reading is looked at alone, to name the one that is wrong.
        ranges = np.array(
            [
                _number(word, f"reading {place}", finite=False)
                for place, word in enumerate(readings, 1)
            ]
        )
    if (ranges < 0.0).any():
        place = int(np.flatnonzero(ranges < 0.0)[0])
        raise _BadMessage(f"reading {place + 1} is {_shown(readings[place])}, expected metres")
    # Some drivers write NaN for a beam without a return.
    ranges[~(ranges < farthest)] = inf
    # Some drivers write a reading of 0 for a beam without a valid range.
    ranges[ranges == 0.0] = -inf
    return LaserScan(
        _pose(pose),
        angles,
        ranges,
        range_max=farthest,
        time=_number(time, "time"),
    )


def _reading(word: bytes, place: int) -> float:
    """A reading, which may be NaN; the message of one that is no number says which it is."""
    return nan if word.lower() == b"nan" else _number(word, f"reading {place}", finite=False)


def _pose(words: list[bytes]) -> Pose:
    x, y, theta = (
        _number(word, what) for word, what in zip(words, "x y theta".split(), strict=True)
    )
    if not max(abs(x), abs(y), abs(theta)) <= LARGEST_COORDINATE:
        raise _BadMessage(f"pose {x:g} {y:g} {theta:g}, expected at most {LARGEST_COORDINATE:g} m")
    return Pose(x, y, float(wrap_angle(theta)))


def _fan(
    fans: dict[tuple[int, float, float], Float], count: int, start: float, step: float
) -> Float:
    """The angles of a fan (count,) [rad], one array for all scans that share them."""
    if (count, start, step) not in fans:
        angles: Float = start + step * np.arange(count, dtype=np.float64)
        angles.flags.writeable = False
        fans.clear()
        fans[count, start, step] = angles
    return fans[count, start, step]


def _count(words: list[bytes], place: int, least: int = 2) -> int:
    word = words[place] if place < len(words) else b""
    if not word.isdigit() or len(word) > 7 or int(word) < least:
        raise _BadMessage(f"{_shown(word)} readings, expected a number from {least}")
    return int(word)


def _number(word: bytes, what: str = "a value", *, finite: bool = True) -> float:
    try:
        value = float(word)
    except ValueError:
        raise _BadMessage(f"{what} is {_shown(word)}, expected a number") from None
    if isnan(value) or (finite and not isfinite(value)):
        raise _BadMessage(f"{what} is {_shown(word)}, expected a finite number")
    return value


def _shown(word: bytes) -> str:
    """A word without spaces, for a message of one line."""
    return repr(word[:LONGEST_NAME].decode("ascii", "backslashreplace"))
