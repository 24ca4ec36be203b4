"""CARMEN logs: one message a line, as the CARMEN toolkit and its log archives write them.

A log may be gzipped. Its scans have the logged poses, or those of odometry or ground truth at their
times. In a log that a SLAM system has corrected, the logged poses are the corrected ones. These
messages are read, of which old and related programs leave out the end of FLASER, from the stamp or
from odom_x on; DP-SLAM calls them Laser and Odometry::

    FLASER n r1 … rn  x y theta  odom_x odom_y odom_theta  time host logger_time
    ROBOTLASER1 type start fov step max_range accuracy mode  n r1 … rn  m s1 … sm  x y theta
                robot_x robot_y robot_theta  v w  safety safety turn  time host logger_time
    ODOM x y theta  v w acceleration  time host logger_time
    TRUEPOS x y theta  odom_x odom_y odom_theta  time host logger_time
    PARAM robot_frontlaser_offset metres  time host logger_time
    Odometry x y theta
    Laser n r1 … rn

Lines that cannot be read are skipped and reported. If a log holds each scan twice, as an old and as
a new message, only the kind that comes first is read.
"""

import gzip
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from math import inf, isfinite, pi
from pathlib import Path
from typing import Any, cast

import numpy as np

from lrf3d.errors import InputError
from lrf3d.files import as_path, opened
from lrf3d.geometry import LARGEST_COORDINATE, Float, sealed, wrap_angle
from lrf3d.interrupts import check
from lrf3d.io.laser_log import (
    A_MESSAGE,
    GZIPPED,
    LARGEST_LOG,
    LARGEST_RANGE,
    MOST_LINES,
    MOST_READINGS,
    NAMED,
    BadLine,
    LaserLog,
    WheelRecord,
    log_name,
    without_no_returns,
)
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import CENTRE
from lrf3d.pose import Pose, between
from lrf3d.robot import Trajectory

FARTHEST_LASER = 10.0
"""How far a laser may stand from its robot's centre [m]: farther, the number is in other units."""

LONGEST_LINE = 1 << 20
"""Bytes that are read of a line, enough for 100,000 beams; what is left counts as more lines."""

SHORT_ENDS = {b"Laser": (0,), b"FLASER": (3, 6, 7, 8, 9)}
"""Words after the ranges: up to the pose, the pose by odometry, the stamp, the host, or all."""

UNTIMED = 0.1
"""Time between scans that have no stamp [s]."""

TRACKS = {b"ODOM": "odom", b"TRUEPOS": "truth"}

STEADY = 1e-3
"""How far mounts of one laser may differ [m], [rad]: logs round their numbers."""


def load_carmen(
    path: str | Path, *, largest_range: float | None = None, poses: str = "auto"
) -> LaserLog:
    """Read the scans of a CARMEN log; see `load_log`.

    Readings from the largest range on are no return: if not given, the farthest that the message
    says its range finder sees, or 50 m, or less if the largest reading of the log stands out.
    """
    path = as_path(path)
    reading, bad, bad_count = _Reading(largest_range), list[BadLine](), 0
    for number, text, fault in lines_of(path):
        try:
            if fault:
                raise ValueError(fault)
            reading.take(text.split())
        except ValueError as error:
            bad_count += 1
            bad += [BadLine(number, str(error))] if len(bad) < NAMED else []
        if reading.readings > MOST_READINGS:
            raise InputError(
                f"{path}: line {number}: more than {MOST_READINGS:,} readings; cut the log into"
                " parts"
            )
    if not reading.scans:
        why = f"; {bad_count} bad lines, first {bad[0]}" if bad else ""
        raise InputError(f"{path}: no laser scan in it, expected FLASER or ROBOTLASER1 lines{why}")
    wheels, mount = reading.wheels(), reading.mount()
    scans, note = without_no_returns(reading.scans, largest_range)
    notes = [note] * bool(note)
    if reading.untimed:
        notes.append(f"no stamps on {reading.untimed} scans: one each {UNTIMED:g} s assumed")
    # Without ODOM lines the poses of the scans are the odometry, and those are the laser's.
    mount = mount if wheels else Pose(reading.offset, 0.0, 0.0)
    if mount != CENTRE:
        scans = [replace(scan, mount=mount) for scan in scans]
    log = LaserLog(
        log_name(path),
        scans,
        bad_count,
        tuple(bad),
        wheels=wheels,
        not_numbers=reading.not_numbers,
        notes=tuple(notes),
    )
    return log if poses == "auto" else _placed_by(log, reading.tracks(), poses, path)


def lines_of(path: Path) -> Iterator[tuple[int, bytes, str]]:
    """The lines of a file, gzipped or not: number, bytes, and what is wrong, if anything."""
    number = size = 0
    with opened(path, what="a log") as file:
        packed = file.read(len(GZIPPED)) == GZIPPED
        file.seek(0)
        stream: Any = gzip.open(file) if packed else file
        try:
            parts = iter(lambda: stream.readline(LONGEST_LINE), b"")
            for number, text in enumerate(parts, 1):
                check()
                size += len(text)
                if number > MOST_LINES or size > LARGEST_LOG:
                    most = f"{MOST_LINES:,} lines or {LARGEST_LOG / 1e9:.1f} GB"
                    raise InputError(f"{path}: line {number}: more than {most}; cut it into parts")
                yield number, text, ""
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            yield number + 1, b"", f"the packed data are damaged from here on ({error})"


def _placed_by(log: LaserLog, tracks: Mapping[str, Trajectory], name: str, path: Path) -> LaserLog:
    """The log with the poses of one of the tracks; what lies before or after it is left out."""
    if name not in tracks:
        there = ", ".join(["auto", *tracks])
        raise InputError(f"{path}: no poses from {name} in it; there are {there}")
    track = tracks[name]
    inside = (log.times >= track.times[0]) & (log.times <= track.times[-1])
    if not inside.any():
        raise InputError(f"{path}: no scan within the time of the poses from {name}")
    rows = zip(log.scans, track.at(log.times).tolist(), inside, strict=True)
    scans = [
        replace(scan, pose=Pose(*pose) if scan.mount == CENTRE else Pose(*pose) @ scan.mount)
        for scan, pose, known in rows
        if known
    ]
    wheels = log.wheels and replace(log.wheels, places=log.wheels.places[inside])
    source = "ODOM messages" if name == "odom" else "TRUEPOS messages"
    return replace(log, scans=scans, source=source, wheels=wheels)


class _Reading:
    """What the messages so far contain."""

    def __init__(self, largest_range: float | None) -> None:
        self.scans: list[LaserScan] = []
        self.readings = self.not_numbers = self.untimed = 0
        self._pose, self._end = Pose(0.0, 0.0, 0.0), cast("int | None", None)
        self.offset = 0.0
        self._largest_range = largest_range
        self._kind, self._robots = b"", list[Pose]()
        self._places: list[int] = []
        self._stamped: dict[str, list[tuple[float, Pose]]] = {"odom": [], "truth": []}

    def take(self, words: list[bytes]) -> None:
        """Read a message; a ValueError says why it cannot be read."""
        name = words[0] if words else b"#"
        if name == b"Odometry":
            self._pose = _pose(words, 1)
        elif name in TRACKS:
            if len(words) != 10:
                raise ValueError(f"{len(words)} words, expected 10")
            self.readings += A_MESSAGE // 2
            self._stamped[TRACKS[name]].append((_number(words, 7, "time"), _pose(words, 1)))
        elif words[:2] == [b"PARAM", b"robot_frontlaser_offset"]:
            offset = _number(words, 2, "robot_frontlaser_offset")
            if abs(offset) > FARTHEST_LASER:
                raise ValueError(f"robot_frontlaser_offset {offset:g} m, expected at most 10 m")
            self.offset = offset
        elif name in (b"FLASER", b"ROBOTLASER1", b"Laser"):
            if self._kind in (b"", name):
                scan = self._scan(words)
                self._kind = name
                self.scans.append(scan)
                self._places.append(len(self._stamped["odom"]) - 1)
                self.readings += len(scan.ranges) + A_MESSAGE
        elif not name.startswith(b"#") and not (name.isupper() and name[:1].isalpha()):
            raise ValueError("not a CARMEN message")

    def _scan(self, words: list[bytes]) -> LaserScan:
        """The scan of a FLASER message, 180° wide, or of a ROBOTLASER1 message, which has its fan.

        The pose follows the readings, in the newer message after the remissions.
        """
        is_front = words[0] != b"ROBOTLASER1"
        first = 2 if is_front else 9
        count = _count(words, first - 1)
        place = last = first + count
        if not is_front:
            place += 1 + _count(words, last, least=0)
        time, length = place + (6 if is_front else 11), place + 14
        if is_front:
            # All lines of a log are alike; one that ends before is cut.
            ends = SHORT_ENDS.get(words[0], (9,)) if self._end is None else (self._end,)
            if (end := len(words) - place) not in ends:
                raise ValueError(f"{len(words)} words, expected {place + ends[-1]}")
            self._end = end
        elif len(words) != length:
            raise ValueError(f"{len(words)} words, expected {length}")
        (start, step), range_max = front_fan(count), 0.0
        if not is_front:
            start, step, range_max = (_number(words, k) for k in (2, 4, 5))
            if not 0.0 < step * (count - 1) < 2.1 * pi:
                raise ValueError(f"{count} beams {step} rad apart, expected at most a full turn")
            if range_max > LARGEST_COORDINATE:
                raise ValueError(f"a range of {range_max:g} m, expected at most 1e+09 m")
        # A message without a range holds 0; the user's limit holds where it is nearer.
        limits = [limit for limit in (range_max, self._largest_range or 0.0) if limit > 0.0]
        farthest = min(limits, default=LARGEST_RANGE)
        try:
            ranges = np.array([float(word) for word in words[first:last]])
        except ValueError as error:
            word = str(error).rpartition(": ")[2].lstrip("b")
            raise ValueError(f"reading {word[:40]}, expected a number") from None
        if (ranges < 0.0).any():
            raise ValueError(f"reading {ranges[ranges < 0.0][0]:g}, expected metres")
        # Some drivers write NaN for a beam without a return, and 0 for one without a valid range.
        self.not_numbers += int(np.isnan(ranges).sum())
        ranges[~(ranges < farthest)] = inf
        ranges[ranges == 0.0] = -inf
        pose = self._pose if words[0] == b"Laser" else _pose(words, place)
        is_timed = len(words) > time
        self.untimed += not is_timed
        stamp = _number(words, time, "time") if is_timed else UNTIMED * len(self.scans)
        self._robots.append(pose if is_front else _pose(words, place + 3))
        angles = even_angles(count, start, step)
        return LaserScan(pose, angles, ranges, range_max=farthest, time=stamp)

    def mount(self) -> Pose:
        """The pose of the laser on the robot, if all scans agree on one; else the centre."""
        lasers = np.array([scan.pose for scan in self.scans])
        mounts = between(np.array(self._robots), lasers)
        apart = mounts - mounts[0]
        apart[:, 2] = wrap_angle(apart[:, 2])
        far = float(np.hypot(*mounts[0, :2]))
        if np.abs(apart).max() > STEADY or far > FARTHEST_LASER:
            return CENTRE
        mount: Float = np.where(np.abs(mounts[0]) > STEADY, np.median(mounts, axis=0), 0.0)
        return Pose(*mount.tolist())

    def tracks(self) -> dict[str, Trajectory]:
        """The trajectories of ODOM and TRUEPOS messages.

        A pose that is no later than the one before is left out.
        """
        tracks = {}
        for name, stamped in self._stamped.items():
            if stamped:
                times, poses = (np.array(column) for column in zip(*stamped, strict=True))
                later = np.diff(np.maximum.accumulate(times), prepend=-inf) > 0.0
                tracks[name] = Trajectory(times[later], poses[later])
        return tracks

    def wheels(self) -> WheelRecord | None:
        """The ODOM messages as they stand, and the places of the scans between them."""
        odom = self._stamped["odom"]
        if not odom:
            return None
        times, poses = zip(*odom, strict=True)
        return WheelRecord(np.array(times), np.array(poses), np.array(self._places), self.offset)


def front_fan(count: int) -> tuple[float, float]:
    """First angle and step [rad] of a FLASER message's beams.

    An odd fan reaches both −90° and +90°; an even one leaves +90° out.
    """
    return -0.5 * pi, pi / (count - 1) if count % 2 else pi / count


@lru_cache(maxsize=4)
def even_angles(count: int, start: float, step: float) -> Float:
    """Angles (count,) [rad] of a message's beams; successive scans share the array."""
    return sealed(np.asarray(start + step * np.arange(count), dtype=np.float64))


def _pose(words: list[bytes], place: int) -> Pose:
    x, y, theta = (_number(words, place + k, ("x", "y", "theta")[k]) for k in range(3))
    if not max(abs(x), abs(y), abs(theta)) <= LARGEST_COORDINATE:
        raise ValueError(f"pose {x:g} {y:g} {theta:g}, expected at most 1e+09 m")
    return Pose(x, y, float(wrap_angle(theta)))


def _count(words: list[bytes], place: int, least: int = 2) -> int:
    count = _number(words, place, "the number of readings")
    if not least <= count <= MOST_READINGS or count != int(count):
        raise ValueError(f"{count:g} readings, expected a whole number from {least}")
    return int(count)


def _number(words: list[bytes], place: int, what: str = "a value") -> float:
    word = b"".join(words[place : place + 1])
    try:
        value = float(word)
    except ValueError:
        value = inf
    if not isfinite(value):
        shown = word[:40].decode("ascii", "backslashreplace")
        raise ValueError(f"{what} is {shown!r}, expected a finite number")
    return value
