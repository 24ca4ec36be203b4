"""Logs of messages, one a line: CARMEN's and those of related programs, Player's, and SICK's.

A log may be gzipped. Its scans have the logged poses, or those of odometry or ground truth at their
times. In a log that a SLAM system has corrected, the logged poses are the corrected ones. Old and
related programs leave out the end of FLASER messages, from the stamp or from odom_x on. Lines that
cannot be read are skipped and reported. If a log holds each scan twice, as an old and as a new
message, only the kind that comes first is read. If there are several lasers, such as those of
FLASER and RLASER messages, the mount of each is computed from its poses and those of its robot.
"""

import re
from bisect import bisect
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from math import degrees, inf, isfinite, pi, radians
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.text import counted
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, usual_step, wrap_angle
from lrf3d.geometry.pose import Pose, between
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import CENTRE
from lrf3d.recordings.formats.related import translated
from lrf3d.recordings.formats.text.fans import WIDEST_FAN, even_angles, front_ends, front_fan
from lrf3d.recordings.log import (
    AT_ONCE,
    COARSE,
    LARGEST_RANGE,
    UNTIMED,
    Intake,
    LaserLog,
    WheelRecord,
)
from lrf3d.recordings.repair.stamps import order_of

if TYPE_CHECKING:
    from lrf3d.robot import Trajectory

# The names of the words that describe a fan.
_FAN = "type start fov step range_max accuracy mode n m "

# The names of the words of a pose.
_POSE = "x y theta "

# The names of the words that messages end with.
_END = "time host end"

# The names of the words of each message; ``n`` stands for the number of readings and the readings
# after it, ``m`` for the same of remissions. Laser and Odometry are messages of DP-SLAM.
LAYOUTS = {
    b"FLASER": "n " + _POSE + "odom_x odom_y odom_theta " + _END,
    b"ROBOTLASER1": _FAN + _POSE + "robot_x robot_y robot_theta v w safety safety turn " + _END,
    b"RAWLASER1": _FAN + _END,
    b"Laser": "n",
    b"CMU": "n " + _POSE + "robot_x robot_y robot_theta " + _END,
    b"ODOM": _POSE + "v w acceleration " + _END,
    b"TRUEPOS": _POSE + "odom_x odom_y odom_theta " + _END,
    b"Odometry": _POSE,
}

# The numbers of the lasers, by the old messages, which are all laid out as FLASER.
OLD = {b"FLASER": 1, b"RLASER": 2, b"LLASER": 3}

# Messages of lasers by their numbers.
NUMBERED = re.compile(rb"(ROBOTLASER|RAWLASER)([1-9])").fullmatch

# Messages of scans without a pose: they get that of the last odometry before them.
RAW = (b"RAWLASER1", b"Laser")

# Messages of stamped poses, and the names of the tracks that they make.
TRACKS = {b"ODOM": "odom", b"TRUEPOS": "truth"}

# Numbers of words that may be missing at the end of a line: those of the host, the stamp, and the
# pose by odometry.
SHORT_ENDS = {b"FLASER": (0, 1, 2, 3, 6)}

# Finds what lines of such logs begin with.
WORDS = re.compile(
    rb"(?m)^(?:(?:[FRL]LASER|(?:ROBOT|RAW)LASER\d|LASER_READING|ODOM|PARAM|TRUEPOS|Laser|Odometry) "
    rb"|[\d.]+ \S+ \d+ (?:laser|position2d) \d+ |\x02?s(?:RA|SN) LMDscandata "
    rb"|[LO](?: -?[\d.]+){4,} *\r?$)"
).search

# Usual numbers of beams, for a fan of half a turn; the only alternative is a whole turn.
HALF_TURNS = {180, 181, 360, 361}

# Alternative widths [°] of fans with other numbers of beams, from the first beam to the last.
WIDE_FANS = (100, 240, 270, 360)

# Messages that do not say how wide their fans are.
WITHOUT_FAN = (b"FLASER", b"Laser", b"CMU")

# How far the poses of one laser on its robot may differ [m], [rad]: logs round their numbers.
STEADY = 1e-3

# How far a laser may stand from its robot's centre [m]: farther, the number is in other units.
FARTHEST_LASER = 10.0


def load_carmen(intake: Intake, poses: str = "auto") -> LaserLog:
    """Read the scans of a CARMEN log; see `load_log`.

    Readings from the largest range on mean no return. If it is not given, it is the range that the
    message names for its range finder, else 50 m, or less if the largest reading stands out.
    """
    reading = _Reading(intake)
    for number, line in intake.lines():
        try:
            reading.take(line.split())
        except ValueError as error:
            intake.refuse(number, error)
    if not reading.rows:
        raise InputError(
            f"{intake.path}: no laser scan in it, expected FLASER or ROBOTLASER1 lines"
            f"{intake.first_bad}"
        )
    log = reading.log()
    # Where odometry is rare, the pose of the line before a scan is not its own.
    is_coarse = usual_step(reading.odom_times) >= COARSE
    if poses == "auto" and (is_coarse or reading.is_out_of_order):
        poses = "odom"
    return log if poses == "auto" else _placed_by(log, reading.tracks(), poses, intake.path)


def _placed_by(
    log: LaserLog, tracks: "Mapping[str, Trajectory]", name: str, path: Path
) -> LaserLog:
    """The log with the poses of one of the tracks; what lies before or after it is left out."""
    if name not in tracks:
        raise InputError(
            f"{path}: no poses from {name} in it; there are {', '.join(['auto', *tracks])}"
        )
    track = tracks[name]
    inside = (log.times >= track.times[0]) & (log.times <= track.times[-1])
    if not inside.any():
        raise InputError(f"{path}: no scan within the time of the poses from {name}")
    ahead = Pose(log.odometry.laser_offset, 0.0, 0.0)
    mounts = {mount: ahead if mount == CENTRE else mount for mount in {s.mount for s in log.scans}}
    rows = zip(log.scans, track.at(log.times).tolist(), inside, strict=True)
    scans = [
        replace(scan, pose=Pose(*pose) @ mounts[scan.mount]) for scan, pose, known in rows if known
    ]
    wheels = log.wheels and replace(log.wheels, places=log.wheels.places[inside])
    source = "ODOM messages" if name == "odom" else "TRUEPOS messages"
    lost = f"{counted(len(log) - len(scans), 'scan')} before or after the {source} left out"
    notes = (*log.notes, lost) if len(scans) < len(log) else log.notes
    return replace(log, scans=scans, source=source, wheels=wheels, placed=True, notes=notes)


def _by_name(
    words: list[bytes], kind: bytes, lacking: int | None
) -> tuple[dict[str, list[bytes]], int]:
    """The words of a message by name, and how many its end lacks; raises ValueError if invalid."""
    found = dict[str, list[bytes]]()
    place = 1
    for name in LAYOUTS[kind].split():
        found[name] = words[place : place + 1]
        place += 1
        if name in ("n", "m"):
            count = _number(found, name, "the number of readings")
            if count < 2 * (name == "n") or count != int(count):
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
        return np.array([float(word) for word in words])
    except ValueError as error:
        word = str(error).rpartition(": ")[2].lstrip("b")
        raise ValueError(f"reading {word[:40]}, expected a number") from None


def _robot(found: Mapping[str, list[bytes]]) -> Pose | None:
    """The pose of the robot that a message of a scan holds, if it does."""
    if "robot_x" in found:
        return _pose(found, "robot_")
    if found.get("odom_theta"):
        # Lines that leave out the odometry may have something else there.
        with suppress(ValueError):
            return _pose(found, "odom_")
    return None


def _angles(found: Mapping[str, list[bytes]], count: int) -> Float:
    start, step = front_fan(count)
    if "step" in found:
        start = _number(found, "start")
        step = _number(found, "step")
        if not 0.0 < step * (count - 1) < WIDEST_FAN:
            raise ValueError(f"{count} beams {step} rad apart, expected at most a full turn")
    return even_angles(count, start, step)


def _laser_of(name: bytes) -> tuple[bytes, int]:
    """The kind of a message, as in `LAYOUTS`, and its laser's number; 0 if it is not a scan."""
    if name in OLD:
        return b"FLASER", OLD[name]
    if numbered := NUMBERED(name):
        return numbered[1] + b"1", int(numbered[2])
    return name, int(name in LAYOUTS)


class _Row(NamedTuple):
    """A scan, its laser's number, its robot's pose if known, and the last ODOM line before it."""

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
        self._note = intake.notes.append
        self.rows = list[_Row]()
        self._counts = Counter[int]()
        self._offset = 0.0
        self._placed = False
        self._pose = CENTRE
        self._kinds = dict[int, tuple[bytes, int]]()
        self._stamped: dict[str, list[tuple[float, Pose]]] = {"odom": [], "truth": []}

    def take(self, words: list[bytes]) -> None:
        """Read a message; raises ValueError if it is invalid."""
        words = translated(words)
        name = words[0] if words else b"#"
        if words[:2] == [b"PARAM", b"robot_frontlaser_offset"]:
            offset = _number({"offset": words[2:3]}, "offset")
            if abs(offset) > FARTHEST_LASER:
                raise ValueError(f"robot_frontlaser_offset {offset:g} m, expected at most 10 m")
            self._offset = offset
        elif name in TRACKS or name == b"Odometry":
            self._take_pose(words)
        elif _laser_of(name)[1]:
            self._take_scan(words)
        elif not name.startswith(b"#") and not (name.isupper() and name[:1].isalpha()):
            raise ValueError("not a CARMEN message")

    def _take_pose(self, words: list[bytes]) -> None:
        found, _ = _by_name(words, words[0], 0)
        self._pose = _pose(found)
        self._placed = True
        if words[0] in TRACKS:
            self._stamped[TRACKS[words[0]]].append((_number(found, "time"), self._pose))

    def _take_scan(self, words: list[bytes]) -> None:
        """Read a scan, unless scans of another kind came first."""
        kind, laser = _laser_of(words[0])
        first, lacking = self._kinds.get(laser, (kind, None))
        if first != kind:
            if first not in RAW or kind in RAW:
                return
            # Scans with poses replace the earlier ones without poses.
            self.rows = [row for row in self.rows if row.laser != laser]
            lacking = None
            self._counts[laser] = 0
        # All messages of a laser lack the same words; a shorter one was cut.
        found, lacking = _by_name(words, kind, lacking)
        farthest = self._farthest(found)
        ranges = _ranges(found["n"])
        not_numbers = int(np.isnan(ranges).sum())
        # Some drivers write NaN for a beam without a return, and 0 or less for one without a valid
        # range.
        ranges[~(ranges < farthest)] = inf
        ranges[ranges <= 0.0] = -inf
        pose = self._pose if kind in RAW else _pose(found)
        timed = bool(found.get("time"))
        stamp = _number(found, "time") if timed else UNTIMED * self._counts[laser]
        robot = _robot(found)
        angles = _angles(found, len(ranges))
        name = f"laser{laser}" if laser > 1 else "laser"
        scan = LaserScan(pose, angles, ranges, range_max=farthest, time=stamp, laser=name)
        place = len(self._stamped["odom"]) - 1
        self.rows.append(_Row(scan, laser, robot, place, not_numbers, timed))
        self._counts[laser] = self._counts[laser] + 1
        self._kinds[laser] = (kind, lacking)
        self._placed |= kind not in RAW

    def _farthest(self, found: Mapping[str, list[bytes]]) -> float:
        """Least reading of a message that means no return [m]; the user's limit may be nearer."""
        range_max = _number(found, "range_max") if "range_max" in found else 0.0
        if range_max > LARGEST_COORDINATE:
            raise ValueError(f"a range of {range_max:g} m, expected at most 1e+09 m")
        # A message that does not know its largest range holds 0.
        limits = (range_max, self._intake.largest_range or 0.0)
        return min((each for each in limits if each > 0.0), default=LARGEST_RANGE)

    def log(self) -> LaserLog:
        """The log of what was read."""
        if untimed := sum(not row.timed for row in self.rows):
            self._note(f"no stamps on {untimed} scans: one each {UNTIMED:g} s assumed")
        fans = self._other_fans()
        if self.is_out_of_order:
            self._note("scans and ODOM messages were not in the order of their stamps: put in it")
            self._stamped["odom"].sort(key=lambda stamped: stamped[0])
            times = np.sort(self.odom_times).tolist()
            self.rows = [
                row._replace(place=bisect(times, row.scan.time) - 1)
                for row in sorted(self.rows, key=lambda row: row.scan.time)
            ]
        else:
            self._take_later_lines()
        scans = self._mounted()
        wheels = None
        if odom := self._stamped["odom"]:
            stamps, driven = (np.array(column) for column in zip(*odom, strict=True))
            places = np.array([row.place for row in self.rows])
            wheels = WheelRecord(stamps, driven, places, self._offset)
        return self._intake.log(
            scans,
            wheels=wheels,
            not_numbers=sum(row.not_numbers for row in self.rows),
            placed=self._placed,
            source="as logged" if self._placed else "none",
            fans=fans,
        )

    def _take_later_lines(self) -> None:
        """Give scans without poses that of the line after them, if it is the one of their stamp.

        Scans before the first line have no other. Poses of TRUEPOS and Odometry messages are kept.
        """
        odom = self._stamped["odom"]
        for number, row in enumerate(self.rows):
            if self._kinds[row.laser][0] not in RAW or row.place + 1 >= len(odom):
                continue
            time, pose = odom[row.place + 1]
            before, last = odom[row.place] if row.place >= 0 else (-inf, CENTRE)
            if row.scan.pose == last and (
                row.place < 0 or abs(row.scan.time - time) < AT_ONCE < row.scan.time - before
            ):
                self.rows[number] = row._replace(
                    scan=replace(row.scan, pose=pose), place=row.place + 1
                )

    @cached_property
    def odom_times(self) -> Float:
        """Stamps (n,) of ODOM messages, if scans have their clock and no poses of their own."""
        times = np.array([time for time, _ in self._stamped["odom"]])
        stamps = [row.scan.time for row in self.rows]
        raw = all(self._kinds[row.laser][0] in RAW for row in self.rows)
        is_known = raw and len(times) and times.min() <= np.median(stamps) <= times.max()
        return times if is_known else np.empty(0)

    @cached_property
    def is_out_of_order(self) -> bool:
        """Whether scans and the odometry of their poses stand apart, or are out of order."""
        count = len(self.odom_times)
        if min(count, len(self.rows)) < 2:
            return False
        poses = [pose for _, pose in self._stamped["odom"]]
        # Poses of TRUEPOS and Odometry messages, which are others, are kept.
        own = {row.scan.pose for row in self.rows}
        places = {row.place for row in self.rows}
        if len(own) == 1 and places in ({-1}, {count - 1}):
            return True
        return own <= {CENTRE, *poses} and order_of(self.odom_times, np.array(poses)) is not None

    def _other_fans(self) -> tuple[tuple[float, float], ...]:
        """First and last bearings of other fans that scans may have, if messages do not say."""
        rows = (row for row in self.rows if self._kinds[row.laser][0] in WITHOUT_FAN)
        counts = {len(row.scan.ranges) for row in rows}
        if unusual := ", ".join(map(str, sorted(counts - HALF_TURNS))):
            self._note(f"scans of {unusual} beams assumed to be 180° wide, as these messages are")
        if len(counts) != 1:
            return ()
        wide = WIDE_FANS if unusual else WIDE_FANS[-1:]
        return tuple(front_ends(max(counts), radians(angle)) for angle in wide)

    def _mounted(self) -> list[LaserScan]:
        """The scans with the mounts of their lasers; those with unknown mounts are left out."""
        mounts = self._mounts()
        unknown = Counter(row.scan.laser for row in self.rows if row.laser not in mounts)
        if unknown:
            lines = ", ".join(f"{count} of {name}" for name, count in sorted(unknown.items()))
            self._note(f"left out: scans of lasers with unknown mounts ({lines})")
        self.rows = [row for row in self.rows if row.laser in mounts]
        scans = [self._on(mounts[row.laser], row) for row in self.rows]
        if len(known := {scan.laser: scan.mount for scan in scans}) > 1:
            self._offset = 0.0
            places = [f"{name} at {x:.3g}, {y:.3g} m, {degrees(turn):.0f}°"
                      for name, (x, y, turn) in known.items()]  # fmt: skip
            self._note(f"{len(known)} lasers: {'; '.join(places)}")
        return scans

    def _on(self, mount: Pose, row: _Row) -> LaserScan:
        """A scan with its laser's mount; raw scans have the robot's pose, others the laser's."""
        raw = self._kinds[row.laser][0] in RAW
        pose = row.scan.pose @ mount if raw else row.scan.pose
        return row.scan if mount == CENTRE else replace(row.scan, pose=pose, mount=mount)

    def _mounts(self) -> dict[int, Pose]:
        """The mounts of the lasers on their robot, where they are known.

        If there is one laser, the poses of its FLASER messages are taken for those of its robot.
        """
        mounts = {laser: self._mount(laser) for laser in sorted({row.laser for row in self.rows})}
        first, *others = mounts
        if not others or mounts[first] is None:
            odometry = self._stamped["odom"]
            kind = self._kinds[first][0]
            own = mounts[first] if odometry and kind != b"FLASER" else None
            ahead = self._offset if kind in RAW or not odometry else 0.0
            return {first: own or Pose(ahead, 0.0, 0.0)}
        return {laser: mount for laser, mount in mounts.items() if mount is not None}

    def _mount(self, laser: int) -> Pose | None:
        """The pose of a laser on its robot, if all its scans agree on one."""
        rows = [row for row in self.rows if row.laser == laser]
        if any(row.robot is None for row in rows):
            return None
        robots = np.array([row.robot for row in rows])
        mounts = between(robots, np.array([row.scan.pose for row in rows]))
        # Near half a turn, a heading may have either sign.
        mounts[:, 2] += 2.0 * pi * np.round((mounts[0, 2] - mounts[:, 2]) / (2.0 * pi))
        far = np.hypot(*mounts[0, :2]) > FARTHEST_LASER
        if far or np.abs(mounts - mounts[0]).max() > STEADY:
            return None
        mount: Float = np.where(np.abs(mounts[0]) > STEADY, np.median(mounts, axis=0), 0.0)
        return Pose(*mount.tolist())

    def tracks(self) -> "dict[str, Trajectory]":
        """The trajectories of ODOM and TRUEPOS messages.

        A pose that is no later than the one before is left out.
        """
        from lrf3d.robot import Trajectory

        tracks = {}
        for name, stamped in self._stamped.items():
            if stamped:
                times, poses = (np.array(column) for column in zip(*stamped, strict=True))
                later = np.diff(np.maximum.accumulate(times), prepend=-inf) > 0.0
                tracks[name] = Trajectory(times[later], poses[later])
        return tracks
