"""LaserLog: the scans of a recorded drive, from any format."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.files import own_name
from lrf3d.geometry import Bool, Float, Int, Value, sealed
from lrf3d.laser import LaserScan
from lrf3d.laser.unrolling import with_motions
from lrf3d.pose import Pose
from lrf3d.text import counted

FINEST, MOST_BEAMS = 1e-4, 100_000
"""Least step [rad] and most beams of a fan on which scans are resampled."""


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

    ``places`` (k,) holds for each scan the index of the last odometry line before it; the laser
    stands ``laser_offset`` [m] ahead of the base's centre.
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
        scans: The scans in the order of the file; those that took some time get their motion.
        bad_count: Number of lines that could not be read.
        bad_lines: The first few of them.
        source: Where the poses come from, in words.
        wheels: The raw odometry; None where the log has none.
        not_numbers: Number of readings that are no number, such as NaN: taken for no return.
        notes: What was assumed, and what was left out, a sentence each.
        placed: Whether the poses of the scans are known.
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

    def __post_init__(self) -> None:
        if getattr(self, "placed", True):
            object.__setattr__(self, "scans", with_motions(self.scans))

    def __len__(self) -> int:
        return len(self.scans)

    def __repr__(self) -> str:
        return f"LaserLog({self.name!r}, {len(self)} scans, {self.bad_count} bad lines)"

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
        """Which scans (k,) are the odd ones of their laser, counted from 0."""
        odd = np.zeros(len(self), dtype=np.bool_)
        for laser in self.lasers:
            odd[[k for k, scan in enumerate(self.scans) if scan.laser == laser][1::2]] = True
        return odd

    def of_laser(self, name: str) -> "LaserLog":
        """The log with the scans of one laser; the others are counted in a note."""
        scans = [scan for scan in self.scans if scan.laser == name]
        if not (others := len(self) - len(scans)):
            return self
        note = f"{counted(others, 'scan')} of other lasers not used"
        return replace(self, scans=scans, notes=(*self.notes, note))

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


def on_one_fan(scans: Sequence[LaserScan]) -> tuple[Float, Float]:
    """Rising angles (beams,) [rad] and ranges (k, beams) [m] of scans, whose own angles may differ.

    Then it is the finest fan of all, and a range lies at the nearest of its bearings. What a scan
    did not measure is −inf.
    """
    rows = [scan.angles.argsort(kind="stable") for scan in scans]
    sorted_rows = [(s.angles[row], s.ranges[row]) for s, row in zip(scans, rows, strict=True)]
    angles = sorted_rows[0][0]
    if all(own is angles or np.array_equal(own, angles) for own, _ in sorted_rows):
        return angles, np.array([ranges for _, ranges in sorted_rows])
    first, last = min(own[0] for own, _ in sorted_rows), max(own[-1] for own, _ in sorted_rows)
    step = min(float(np.ptp(own)) / max(len(own) - 1, 1) for own, _ in sorted_rows)
    count = min(round((last - first) / max(step, FINEST)) + 1, MOST_BEAMS)
    angles = np.linspace(first, last, count)
    resampled = np.full((len(scans), count), -np.inf)
    for row, (own, ranges) in zip(resampled, sorted_rows, strict=True):
        at = np.clip(np.searchsorted(own, angles), 1, max(len(own) - 1, 1))
        nearest = at - (angles - own[at - 1] < own[at] - angles) if len(own) > 1 else 0 * at
        near = np.abs(own[nearest] - angles) <= 0.51 * max(step, FINEST)
        row[near] = ranges[nearest][near]
    return angles, resampled
