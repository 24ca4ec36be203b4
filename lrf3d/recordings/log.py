"""LaserLog: the scans of a recorded drive, from any format; and Intake, which its readers fill.

An `Intake` collects notes and bad lines while a file is read, and makes the log.
"""

import gzip
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.base.files import opened, own_name
from lrf3d.base.formats import GZIP
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Bool, Float, Int, Value, sealed
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserScan
from lrf3d.laser.unrolling import together, with_motions
from lrf3d.recordings.repair.no_return import NO_RETURN


@dataclass(frozen=True, slots=True)
class BadLine:
    """A line, a message or a scan that could not be read, by its kind and its number from 1."""

    number: int
    reason: str
    kind: str = "line"

    def __str__(self) -> str:
        return f"{self.kind} {self.number}: {self.reason}"


@dataclass(frozen=True, eq=False, repr=False)
class WheelRecord(Value):
    """The raw odometry of a log: stamps (n,) [s] as logged, and poses (n, 3) of the robot's base.

    ``places`` (k,) holds for each scan the index of the last odometry line before it, −1 if there
    is none; the laser stands ``laser_offset`` [m] ahead of the base's centre.
    """

    times: Float
    poses: Float
    places: Int
    laser_offset: float = 0.0

    def __post_init__(self) -> None:
        self._hold("times", "poses")
        self._hold("places", dtype=np.int64)


@dataclass(frozen=True, eq=False, repr=False)
class LaserLog(Value):
    """Scans with their logged poses, and the lines that could not be read.

    Args:
        name: Name of the log.
        scans: The scans in the order of the file; one whose beams were sent over some time gets
            the motion of its robot meanwhile.
        bad_count: Number of lines that could not be read.
        bad_lines: The first few of these lines, with reasons.
        source: Where the poses come from, in words.
        wheels: The raw odometry; None where the log has none.
        not_numbers: Number of readings that are not numbers, such as NaN; they mean no return.
        notes: What was assumed, and what was left out, a sentence each.
        placed: Whether the poses of the scans are known.
        parts: For each scan, the scans of several lasers that it joins; empty if none are joined.
        fans: Alternative first and last bearings [rad] of beams, where those of scans are assumed.
        path: The file that it was read from; "" if it is not of one.
    """

    name: str
    scans: list[LaserScan]
    bad_count: int = 0
    bad_lines: tuple[BadLine, ...] = ()
    source: str = "as logged"
    wheels: WheelRecord | None = None
    not_numbers: int = 0
    notes: tuple[str, ...] = ()
    placed: bool = True
    parts: tuple[tuple[LaserScan, ...], ...] = ()
    fans: tuple[tuple[float, float], ...] = ()
    path: str = ""

    def __post_init__(self) -> None:
        if getattr(self, "placed", True):
            object.__setattr__(self, "scans", with_motions(self.scans))

    def __len__(self) -> int:
        return len(self.scans)

    def __repr__(self) -> str:
        counts = f"{counted(len(self), 'scan')}, {counted(self.bad_count, 'bad line')}"
        return f"LaserLog({self.name!r}, {counts})"

    @property
    def odometry(self) -> WheelRecord:
        """The raw odometry; the poses of the robot at the scans where the log has none."""
        if self.wheels is not None:
            return self.wheels
        robots = np.array([scan.robot for scan in self.scans]).reshape(-1, 3)
        return WheelRecord(self.times, robots, np.arange(len(self)))

    @property
    def mount(self) -> Pose:
        """Pose of the first laser on its robot."""
        return self.scans[0].mount

    @property
    def lasers(self) -> list[str]:
        """The names of the lasers, the first one first."""
        return list(dict.fromkeys(scan.laser for scan in self.scans))

    @property
    def is_odd(self) -> Bool:
        """Which scans (k,) have an odd number among those of their laser, counted from 0."""
        odd = np.zeros(len(self), dtype=np.bool_)
        for laser in self.lasers:
            odd[np.flatnonzero(self.is_of(laser))[1::2]] = True
        return odd

    def is_of(self, name: str) -> Bool:
        """Which scans (k,) are those of a laser."""
        return np.array([scan.laser == name for scan in self.scans], dtype=np.bool_)

    def of_laser(self, name: str) -> "LaserLog":
        """The log with the scans of one laser; the others are counted in a note."""
        scans = [scan for scan in self.scans if scan.laser == name]
        if not (others := len(self) - len(scans)):
            return self
        note = f"{counted(others, 'scan')} of other lasers not used"
        return replace(self, scans=scans, notes=(*self.notes, note))

    def of_moments(self) -> "LaserLog":
        """The log in which scans that all lasers took at one moment are joined to one scan.

        If fewer than half of the scans can be joined, or some have beam times but no motion by
        which to unroll (deskew) them, those of the first laser alone are kept. What is left out is
        counted in a note.
        """
        lasers = len(self.lasers)
        rows = self._moments()
        if not rows or 2 * len(rows) * lasers < len(self):
            return self.of_laser(self.lasers[0])
        note = f"scans of {lasers} lasers at one moment taken together"
        if left_out := len(self) - len(rows) * lasers:
            note += f", {counted(left_out, 'scan')} without all others left out"
        wheels = self.wheels
        if wheels is not None:
            places = wheels.places[[first for first, *_ in rows]]
            wheels = replace(wheels, places=places, laser_offset=0.0)
        parts = tuple(tuple(self.scans[row] for row in moment) for moment in rows)
        scans = [together(moment) for moment in parts]
        notes = (*self.notes, note)
        return replace(self, scans=scans, wheels=wheels, notes=notes, parts=parts)

    def _moments(self) -> list[list[int]]:
        """Scan numbers of each moment of all lasers; none for one laser or scans to be unrolled."""
        names = self.lasers
        rolling = any(scan.time_increment and scan.motion is None for scan in self.scans)
        if len(names) == 1 or rolling:
            return []
        moments = dict[int, dict[str, int]]()
        for row, scan in enumerate(self.scans):
            moments.setdefault(round(scan.time / AT_ONCE), {})[scan.laser] = row
        return [[at[name] for name in names] for at in moments.values() if len(at) == len(names)]

    @property
    def counts(self) -> dict[str, Any]:
        """What was read and what was not, for summaries."""
        return {
            "scans": len(self),
            "beams": max(len(scan.ranges) for scan in self.scans),
            "bad_lines": self.bad_count,
            "readings_not_numbers": self.not_numbers,
            "notes": list(self.notes),
        }

    @cached_property
    def times(self) -> Float:
        """When each of the scans (k,) was taken [s]."""
        return sealed(np.array([scan.time for scan in self.scans]))

    @cached_property
    def poses(self) -> Float:
        """Poses (k, 3) of the laser, x, y [m], theta [rad], as they were logged."""
        return sealed(np.array([scan.pose for scan in self.scans]).reshape(-1, 3))


def log_name(path: Path) -> str:
    """The name of a log without the endings that mark its format."""
    if path.is_dir():
        return own_name(path, stem=path.resolve().name)
    name = path.name.removesuffix(".gz")
    return own_name(path, stem=name.rsplit(".", 1)[0] or name)


# Angles that differ by at most this [rad] are the same, as drivers round them; also the least step
# of the fan on which `on_one_fan` resamples scans.
FINEST = 1e-4

# Largest number of beams of the fan on which scans are resampled.
MOST_BEAMS = 100_000


def on_one_fan(scans: Sequence[LaserScan]) -> tuple[Float, Float]:
    """Rising angles (beams,) [rad] and ranges (k, beams) [m] of scans, whose own angles may differ.

    If they differ, all scans are resampled on one fan with the finest step of all: a bearing gets
    the range of the nearest beam, or −inf where the scan has no beam near it.
    """
    rows = [scan.angles.argsort(kind="stable") for scan in scans]
    fans = [(scan.angles[row], scan.ranges[row]) for scan, row in zip(scans, rows, strict=True)]
    angles = fans[0][0]
    if all(np.array_equal(own, angles) for own, _ in fans):
        return angles, np.array([ranges for _, ranges in fans])
    step = max(min(float(np.ptp(own)) / max(len(own) - 1, 1) for own, _ in fans), FINEST)
    ends = np.array([own[[0, -1]] for own, _ in fans])
    wide = float(np.ptp(ends))
    angles = np.linspace(ends.min(), ends.max(), min(round(wide / step) + 1, MOST_BEAMS))
    return angles, np.array([_resampled(*fan, angles, 0.51 * step) for fan in fans])


def _resampled(own: Float, ranges: Float, angles: Float, reach: float) -> Float:
    """Ranges (beams,) of the beams nearest to rising angles [rad]; −inf where none is in reach."""
    at = np.clip(np.searchsorted(own, angles), 1, max(len(own) - 1, 1))
    nearest = at - (angles - own[at - 1] < own[at] - angles) if len(own) > 1 else 0 * at
    return np.where(np.abs(own[nearest] - angles) <= reach, ranges[nearest], -np.inf)


# Readings from this one on [m] mean no return where a log names no largest range: range finders of
# CARMEN's time report about 81.9 m or 50 m for no return, and none of them measures as far.
LARGEST_RANGE = 50.0

# Time [s] within which messages are of one moment.
AT_ONCE = 0.001

# Time that is assumed between scans without stamps [s].
UNTIMED = 0.1

# Interval of odometry [s] from which the poses of scans are interpolated by their stamps instead of
# taken from the last line: a robot may turn by ten degrees in this time.
COARSE = 0.3


@dataclass
class Intake:
    """Notes and bad lines that are collected while a log is read, and the user's limits.

    Readings of ``largest_range`` [m] or more mean no return, if the user gave it; those of
    ``smallest_range`` [m] or less, and those between the first and last bearings [rad] of ``mask``,
    are left out. ``without`` names the repairs that are left out.
    """

    path: Path
    largest_range: float | None = None
    without: Sequence[str] = ()
    smallest_range: float = 0.0
    mask: Sequence[tuple[float, float]] = ()
    notes: list[str] = field(default_factory=list)
    bad: list[BadLine] = field(default_factory=list)
    bad_count: int = 0

    @property
    def first_bad(self) -> str:
        """The number of bad lines and the first one, to end the error about a log without scans."""
        return (
            f"; {self.bad_count} bad {self.bad[0].kind}s, first {self.bad[0]}" if self.bad else ""
        )

    def refuse(self, number: int, why: object, kind: str = "line") -> None:
        """Count a line that cannot be used; the first few are kept with their reasons."""
        self.bad_count += 1
        named = 5  # Number of bad lines that are kept; the others are only counted.
        if len(self.bad) < named:
            self.bad.append(BadLine(number, str(why), kind))

    def lines(self) -> Iterator[tuple[int, bytes]]:
        """Numbers and bytes of the lines of the file, gzipped or not; damage is a bad line."""
        number = 0
        with opened(self.path, what="a log") as file:
            packed = file.read(len(GZIP)) == GZIP
            file.seek(0)
            stream: Any = gzip.open(file) if packed else file
            try:
                for number, line in enumerate(stream, 1):
                    yield number, line
            except (EOFError, zlib.error, gzip.BadGzipFile) as error:
                why = f"the packed data are damaged from here on ({error})"
                self.refuse(number + 1, why)

    def log(self, scans: Sequence[LaserScan], **more: Any) -> LaserLog:
        """The log of these scans; what means no return becomes ±inf, for each laser by itself."""
        scans = self._unmasked(scans)
        found = dict(enumerate(scans))
        for laser in dict.fromkeys(scan.laser for scan in scans):
            numbers = [k for k, scan in enumerate(scans) if scan.laser == laser]
            own = [scans[k] for k in numbers]
            limits = NO_RETURN.find(own, self.largest_range)
            if limits is not None and NO_RETURN.name not in self.without:
                self.notes += filter(None, [NO_RETURN.sentence(limits)])
                found |= zip(numbers, NO_RETURN.apply(own, limits), strict=True)
        notes = tuple(self.notes)
        return LaserLog(
            log_name(self.path), [*found.values()], self.bad_count, tuple(self.bad), notes=notes,
            path=str(self.path), **more,
        )  # fmt: skip

    def _unmasked(self, scans: Sequence[LaserScan]) -> Sequence[LaserScan]:
        """The scans; readings that the user leaves out become −inf and are counted."""
        if not self.smallest_range and not self.mask:
            return scans
        turn = 2.0 * np.pi
        kept = []
        left = 0
        for scan in scans:
            out = np.isfinite(scan.ranges) & (scan.ranges <= self.smallest_range)
            for first, last in self.mask:
                out |= (scan.angles - first) % turn <= (last - first) % turn
            left += int((out & scan.hits).sum())
            kept.append(replace(scan, ranges=np.where(out, -np.inf, scan.ranges)))
        self.notes.append(f"{counted(left, 'reading')} left out, near the laser or masked")
        return kept
