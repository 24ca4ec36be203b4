"""Logs of messages, one a line: CARMEN's and those of related programs, Player's, and SICK's.

A log may be gzipped. Its scans have the logged poses, or those of odometry or ground truth at their
times. In a log that a SLAM system has corrected, the logged poses are the corrected ones. Old and
related programs leave out the end of FLASER, from the stamp or from odom_x on. ``n`` readings stand
after their number. Lines that cannot be read are skipped and reported. If a log holds each scan
twice, as an old and as a new message, only the kind that comes first is read. Of several lasers,
such as that of RLASER messages, each has the mount that its poses and those of its robot show.
"""

import re
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from math import degrees, inf, isfinite, pi, radians
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, wrap_angle
from lrf3d.geometry.pose import Pose, between
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import CENTRE
from lrf3d.recordings.formats.text.fans import even_angles, front_ends, front_fan
from lrf3d.recordings.log import (
    A_MESSAGE,
    LARGEST_RANGE,
    MOST_READINGS,
    UNTIMED,
    Intake,
    LaserLog,
    WheelRecord,
)
from lrf3d.robot import Trajectory

_FAN = "type start fov step range_max accuracy mode n m "
_POSE = "x y theta "
_END = "time host end"
# The words of each message; ``n`` and ``m`` are the number of the readings or the remissions, and
# these. The last of scans without a pose are those of DP-SLAM.
LAYOUTS = {
    b"FLASER": "n " + _POSE + "odom_x odom_y odom_theta " + _END,
    b"ROBOTLASER1": _FAN + _POSE + "robot_x robot_y robot_theta v w safety safety turn " + _END,
    b"RAWLASER1": _FAN + _END,
    b"Laser": "n",
    b"ODOM": _POSE + "v w acceleration " + _END,
    b"TRUEPOS": _POSE + "odom_x odom_y odom_theta " + _END,
    b"Odometry": _POSE,
}

# The numbers of the lasers of FLASER messages and their like.
OLD = {b"FLASER": 1, b"RLASER": 2, b"LLASER": 3}

# Messages of lasers by their numbers.
NUMBERED = re.compile(rb"(ROBOTLASER|RAWLASER)([1-9])").fullmatch

# Scans without a pose: it is that of the odometry before it.
RAW = (b"RAWLASER1", b"Laser")

TRACKS = {b"ODOM": "odom", b"TRUEPOS": "truth"}

# Words that the end of a line may lack: the host, the stamp, and the pose by odometry.
SHORT_ENDS = {b"FLASER": (0, 1, 2, 3, 6)}

# What lines of such logs begin with.
WORDS = re.compile(
    rb"(?m)^(?:(?:[FRL]LASER|(?:ROBOT|RAW)LASER\d|LASER_READING|ODOM|PARAM|TRUEPOS|Laser|Odometry) "
    rb"|[\d.]+ \S+ \d+ (?:laser|position2d) \d+ |\x02?s(?:RA|SN) LMDscandata )"
)

# Millimetres of a unit of a telegram, by the bits of a float.
SCALES = {b"3F800000": 1.0, b"40000000": 2.0}

# How far a laser may stand from its robot's centre [m]: farther, the number is in other units.
FARTHEST_LASER = 10.0


def load_carmen(intake: Intake, poses: str = "auto") -> LaserLog:
    """Read the scans of a CARMEN log; see `load_log`.

    Readings from the largest range on are no return: if not given, the farthest that the message
    says its range finder sees, or 50 m, or less if the largest reading of the log stands out.
    """
    path = intake.path
    reading = _Reading(intake)
    for number, line in intake.lines():
        try:
            size = reading.take(line.split())
        except ValueError as error:
            intake.refuse(number, error)
        else:
            intake.take(size, number)
    if not reading.rows:
        expected = "no laser scan in it, expected FLASER or ROBOTLASER1 lines"
        raise InputError(f"{path}: {expected}{intake.first_bad}")
    if untimed := sum(not row.timed for row in reading.rows):
        intake.notes.append(f"no stamps on {untimed} scans: one each {UNTIMED:g} s assumed")
    reading.settle()
    scans = [row.scan for row in reading.rows]
    wheels = None
    if odom := reading.stamped["odom"]:
        times, driven = (np.array(column) for column in zip(*odom, strict=True))
        places = np.array([row.place for row in reading.rows])
        wheels = WheelRecord(times, driven, places, reading.offset)
    not_numbers = sum(row.not_numbers for row in reading.rows)
    log = intake.log(
        scans, wheels=wheels, not_numbers=not_numbers, placed=reading.placed,
        source="as logged" if reading.placed else "none", fans=reading.fans,
    )  # fmt: skip
    return log if poses == "auto" else _placed_by(log, reading.tracks(), poses, path)


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
    return replace(log, scans=scans, source=source, wheels=wheels, placed=True)


def _translated(words: list[bytes]) -> list[bytes]:
    """A message of GMapping, Player or SICK as one of CARMEN."""
    if words[:1] == [b"LASER_READING"]:
        return [b"FLASER", *words[1:-1], *words[-4:]]
    if words[:1] == [b"ODOM"] and len(words) == 5:
        return [*words[:4], b"0", b"0", b"0", words[4], b"", words[4]]
    if len(words) > 14 and words[3] == b"laser" and b"." in words[5]:
        # The first version of Player has no index, type and subtype.
        words = [*words[:5], b"", b"", words[5], b"", *words[6:9], b"0", *words[9:]]
    if len(words) > 14 and words[3] == b"position2d":
        # Time, host, robot, kind, index, type, subtype and time come first.
        return [b"ODOM", *words[8:12], words[13], b"0", words[7], *words[1::-1]]
    if len(words) > 14 and words[3] == b"laser":
        start, end, step, farthest, count = words[9:14]
        fan = [b"0", start, end, step, farthest, b"0", b"0", count]
        return [b"RAWLASER1", *fan, *words[14::2], b"0", words[7], *words[1::-1]]
    if words[1:2] == [b"LMDscandata"] and b"DIST1" in words:
        return _of_telegram(words, words.index(b"DIST1"))
    return words


def _of_telegram(words: list[bytes], at: int) -> list[bytes]:
    """A scan of a SICK range finder, whose first channel of ranges begins at a word.

    Its numbers are hexadecimal: microseconds, ten thousandths of a degree, 90° ahead, and units.
    """
    if words[at + 1] not in SCALES:
        raise ValueError(f"a scale of {words[at + 1]!r}, expected 3F800000 or 40000000")
    start, step, count = (int(word, 16) for word in words[at + 3 : at + 6])
    if start >= 1 << 31:
        start -= 1 << 32
    ranges = [SCALES[words[at + 1]] * int(word, 16) for word in words[at + 6 : at + 6 + count]]
    fan = [radians(1e-4 * start - 90.0), 0.0, radians(1e-4 * step), 0.0, 0.0, 0.0, count]
    stamp = 1e-6 * int(words[9], 16)
    numbers = [0.0, *fan, *(1e-3 * each for each in ranges), 0.0, stamp]
    return [b"RAWLASER1", *(b"%.9g" % number for number in numbers), b"", b"%.9g" % stamp]


def _by_name(
    words: list[bytes], kind: bytes, lacking: int | None
) -> tuple[dict[str, list[bytes]], int]:
    """The words of a message by their names, and how many its end lacks; or a ValueError."""
    found = dict[str, list[bytes]]()
    place = 1
    for name in LAYOUTS[kind].split():
        found[name] = words[place : place + 1]
        place += 1
        if name in ("n", "m"):
            count = _number(found, name, "the number of readings")
            if not 2 * (name == "n") <= count <= MOST_READINGS or count != int(count):
                raise ValueError(f"{count:g} readings, expected a whole number from 2")
            found[name] = words[place : place + int(count)]
            place += int(count)
    short = place - len(words)
    allowed = SHORT_ENDS.get(kind, (0,)) if lacking is None else (lacking,)
    if short not in allowed:
        raise ValueError(f"{len(words)} words, expected {place - allowed[0]}")
    return found, short


def _number(found: Mapping[str, list[bytes]], name: str, what: str = "") -> float:
    word = b"".join(found[name])
    try:
        value = float(word)
    except ValueError:
        value = inf
    if not isfinite(value):
        shown = word[:40].decode("ascii", "backslashreplace")
        raise ValueError(f"{what or name} is {shown!r}, expected a finite number")
    return value


def _pose(found: Mapping[str, list[bytes]], prefix: str = "") -> Pose:
    x, y, theta = (_number(found, prefix + name, name) for name in ("x", "y", "theta"))
    if not max(abs(x), abs(y), abs(theta)) <= LARGEST_COORDINATE:
        raise ValueError(f"pose {x:g} {y:g} {theta:g}, expected at most 1e+09 m")
    return Pose(x, y, float(wrap_angle(theta)))


def _ranges(words: list[bytes]) -> Float:
    try:
        ranges = np.array([float(word) for word in words])
    except ValueError as error:
        word = str(error).rpartition(": ")[2].lstrip("b")
        raise ValueError(f"reading {word[:40]}, expected a number") from None
    if (ranges < 0.0).any():
        raise ValueError(f"reading {ranges[ranges < 0.0][0]:g}, expected metres")
    return ranges


def _angles(found: Mapping[str, list[bytes]], count: int) -> Float:
    start, step = front_fan(count)
    if "step" in found:
        start = _number(found, "start")
        step = _number(found, "step")
        if not 0.0 < step * (count - 1) < 2.1 * pi:
            raise ValueError(f"{count} beams {step} rad apart, expected at most a full turn")
    return even_angles(count, start, step)


def _laser_of(name: bytes) -> tuple[bytes, int]:
    """The kind of the message of a scan, as in `LAYOUTS`, and the number of its laser; or 0."""
    if name in OLD:
        return b"FLASER", OLD[name]
    if numbered := NUMBERED(name):
        return numbered[1] + b"1", int(numbered[2])
    return name, int(name in LAYOUTS)


class _Row(NamedTuple):
    """A scan, the number of its laser, its robot if that is known, and the odometry before it."""

    scan: LaserScan
    laser: int
    robot: Pose | None
    place: int
    not_numbers: int
    timed: bool


class _Reading:
    """What the messages so far contain."""

    def __init__(self, intake: Intake) -> None:
        self._intake = intake
        self.rows = list[_Row]()
        self._counts = Counter[int]()
        self.offset = 0.0
        self.placed = False
        self._pose = CENTRE
        self.fans: tuple[tuple[float, float], ...] = ()
        self._kinds = dict[int, tuple[bytes, int]]()
        self.stamped: dict[str, list[tuple[float, Pose]]] = {"odom": [], "truth": []}

    def take(self, words: list[bytes]) -> int:
        """Read a message, and return how many readings it takes in memory; or a ValueError."""
        words = _translated(words)
        name = words[0] if words else b"#"
        if words[:2] == [b"PARAM", b"robot_frontlaser_offset"]:
            offset = _number({"offset": words[2:3]}, "offset")
            if abs(offset) > FARTHEST_LASER:
                raise ValueError(f"robot_frontlaser_offset {offset:g} m, expected at most 10 m")
            self.offset = offset
        elif name in TRACKS or name == b"Odometry":
            found, _ = _by_name(words, name, 0)
            self._pose = _pose(found)
            self.placed = True
            if name in TRACKS:
                self.stamped[TRACKS[name]].append((_number(found, "time"), self._pose))
                return A_MESSAGE // 2
        elif _laser_of(name)[1]:
            return self._take_scan(words)
        elif not name.startswith(b"#") and not (name.isupper() and name[:1].isalpha()):
            raise ValueError("not a CARMEN message")
        return 0

    def _take_scan(self, words: list[bytes]) -> int:
        """Read a scan, unless scans of another kind came first."""
        kind, laser = _laser_of(words[0])
        first, lacking = self._kinds.get(laser, (kind, None))
        if first != kind:
            if first not in RAW or kind in RAW:
                return 0
            # What has poses is better than what comes without.
            self.rows = [row for row in self.rows if row.laser != laser]
            lacking = None
            self._counts[laser] = 0
        # All lines of a log are alike; one that ends before is cut.
        found, lacking = _by_name(words, kind, lacking)
        range_max = _number(found, "range_max") if "range_max" in found else 0.0
        if range_max > LARGEST_COORDINATE:
            raise ValueError(f"a range of {range_max:g} m, expected at most 1e+09 m")
        # A message without a range holds 0; the user's limit holds where it is nearer.
        limits = [each for each in (range_max, self._intake.largest_range or 0.0) if each > 0.0]
        farthest = min(limits, default=LARGEST_RANGE)
        ranges = _ranges(found["n"])
        not_numbers = int(np.isnan(ranges).sum())
        # Some drivers write NaN for a beam without a return, and 0 for one without a valid range.
        ranges[~(ranges < farthest)] = inf
        ranges[ranges == 0.0] = -inf
        pose = self._pose if kind in RAW else _pose(found)
        robot = None
        timed = bool(found.get("time"))
        stamp = _number(found, "time") if timed else UNTIMED * self._counts[laser]
        if "robot_x" in found:
            robot = _pose(found, "robot_")
        elif found.get("odom_theta"):
            # Lines that leave out the odometry may have something else there.
            with suppress(ValueError):
                robot = _pose(found, "odom_")
        angles = _angles(found, len(ranges))
        name = f"laser{laser}" if laser > 1 else "laser"
        scan = LaserScan(pose, angles, ranges, range_max=farthest, time=stamp, laser=name)
        place = len(self.stamped["odom"]) - 1
        self.rows.append(_Row(scan, laser, robot, place, not_numbers, timed))
        self._counts[laser] = self._counts[laser] + 1
        self._kinds[laser] = (kind, lacking)
        self.placed |= kind not in RAW
        return len(ranges) + A_MESSAGE

    def settle(self) -> None:
        """Give the scans the mounts of their lasers, and leave out lasers whose mount is unknown.

        Of one laser alone the poses of FLASER messages are taken for those of its robot.
        """
        notes = self._intake.notes
        numbers = sorted({row.laser for row in self.rows})
        without_fan = (b"FLASER", b"Laser")
        usual = {180, 181, 360, 361}
        counts = {len(r.scan.ranges) for r in self.rows if self._kinds[r.laser][0] in without_fan}
        if unusual := ", ".join(map(str, sorted(counts - usual))):
            notes.append(f"scans of {unusual} beams assumed to be 180° wide, as these messages are")
        # Angles between the first beam and the last that fans may have beside this one [°]; those
        # of usual counts are half a turn or a whole one.
        wide = (240, 270, 360) if unusual else (360,)
        for angle in wide if len(counts) == 1 else ():
            self.fans += (front_ends(max(counts), radians(angle)),)
        mounts = {laser: self._mount(laser) for laser in numbers}
        first = numbers[0]
        if len(numbers) == 1 or mounts[first] is None:
            alone = self._kinds[first][0] != b"FLASER" and self.stamped["odom"]
            offset = Pose(0.0 if self.stamped["odom"] else self.offset, 0.0, 0.0)
            mounts = {first: (mounts[first] if alone else None) or offset}
        unknown = Counter(row.scan.laser for row in self.rows if not mounts.get(row.laser))
        if unknown:
            lines = ", ".join(f"{count} of {name}" for name, count in sorted(unknown.items()))
            notes.append(f"left out: scans of lasers with unknown mounts ({lines})")
        rows = [(row, mounts.get(row.laser)) for row in self.rows]
        self.rows = [
            row._replace(scan=replace(row.scan, mount=mount) if mount != CENTRE else row.scan)
            for row, mount in rows
            if mount is not None
        ]
        if len(known := {row.scan.laser: row.scan.mount for row in self.rows}) > 1:
            self.offset = 0.0
            places = [f"{name} at {x:.3g}, {y:.3g} m, {degrees(turn):.0f}°"
                      for name, (x, y, turn) in known.items()]  # fmt: skip
            notes.append(f"{len(known)} lasers: {'; '.join(places)}")

    def _mount(self, laser: int) -> Pose | None:
        """The pose of a laser on its robot, if all its scans agree on one."""
        rows = [row for row in self.rows if row.laser == laser]
        if any(row.robot is None for row in rows):
            return None
        robots = np.array([row.robot for row in rows])
        mounts = between(robots, np.array([row.scan.pose for row in rows]))
        # About half a turn headings may have either sign.
        mounts[:, 2] += 2.0 * pi * np.round((mounts[0, 2] - mounts[:, 2]) / (2.0 * pi))
        far = float(np.hypot(*mounts[0, :2]))
        # How far mounts of one laser may differ [m], [rad]: logs round their numbers.
        steady = 1e-3
        if np.abs(mounts - mounts[0]).max() > steady or far > FARTHEST_LASER:
            return None
        mount: Float = np.where(np.abs(mounts[0]) > steady, np.median(mounts, axis=0), 0.0)
        return Pose(*mount.tolist())

    def tracks(self) -> dict[str, Trajectory]:
        """The trajectories of ODOM and TRUEPOS messages.

        A pose that is no later than the one before is left out.
        """
        tracks = {}
        for name, stamped in self.stamped.items():
            if stamped:
                times, poses = (np.array(column) for column in zip(*stamped, strict=True))
                later = np.diff(np.maximum.accumulate(times), prepend=-inf) > 0.0
                tracks[name] = Trajectory(times[later], poses[later])
        return tracks
