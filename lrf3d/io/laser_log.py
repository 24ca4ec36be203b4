"""LaserLog: the scans of a recorded drive, from any format."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from lrf3d.files import own_name
from lrf3d.geometry import Float, Int, Value, sealed
from lrf3d.laser import LaserScan
from lrf3d.laser.unrolling import with_motions
from lrf3d.pose import Pose

LARGEST_RANGE = 50.0
"""Least reading [m] that means no return: range finders of CARMEN's time then report about 81.9 m
or 50 m, and none of them measures as far."""

LEAST_READINGS, LEAST_SHARE = 50, 0.001
"""Readings of the largest range, and their share of all readings, from which on it means no
return."""

BELOW, CROWDED = 0.5, 5.0
"""It stands out if it is read more often, by the second, than all ranges down to this below it [m].
A wall at the end of a corridor is read at many ranges."""

BESIDE = 0.3
"""Share of these readings beside another one: what is open is open to more than one beam, and a
robot that stands still reads the corner of a room again and again."""

EQUAL = 0.011
"""Readings that differ by less are the same [m]: logs are written in centimetres."""

NAMED = 5
"""Number of bad lines that are kept; the others are only counted."""

MOST_READINGS = 50_000_000
"""Largest number of readings in memory: 400 MB. Scans and poses count as some more."""

A_MESSAGE, A_POSE = 64, 8
"""What a message, as an object, and a packed pose take in memory, in readings."""

MOST_LINES, LARGEST_LOG = 10_000_000, 1 << 31
"""Largest numbers of lines and of bytes of a text log, of which a gzipped one may hold a thousand
for each of its own; a day's log has a tenth."""


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
        mount: Pose of the laser on the robot's base, where the poses of the scans are the laser's.
        not_numbers: Number of readings that are no number, such as NaN: taken for no return.
    """

    name: str
    scans: list[LaserScan]
    bad_count: int = 0
    bad_lines: tuple[BadLine, ...] = ()
    source: str = "as logged"
    wheels: WheelRecord | None = None
    mount: Pose = Pose(0.0, 0.0, 0.0)  # noqa: RUF009  It is a value that nothing changes.
    not_numbers: int = 0

    def __post_init__(self) -> None:
        if getattr(self, "placed", True):
            object.__setattr__(self, "scans", with_motions(self.scans))

    def __len__(self) -> int:
        return len(self.scans)

    def __repr__(self) -> str:
        return f"LaserLog({self.name!r}, {len(self)} scans, {self.bad_count} bad lines)"

    @property
    def odometry(self) -> WheelRecord:
        """The raw odometry; the poses of the scans where the log has none."""
        return self.wheels or WheelRecord(self.times, self.poses, np.arange(len(self)))

    @property
    def counts(self) -> dict[str, int]:
        """What was read and what was not, for summaries."""
        return {
            "scans": len(self),
            "beams": len(self.scans[0].ranges),
            "bad_lines": self.bad_count,
            "readings_not_numbers": self.not_numbers,
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


def without_no_returns(scans: Sequence[LaserScan]) -> list[LaserScan]:
    """The scans of a log whose readings of the largest range are +inf, if that means no return.

    Range finders write their largest range, such as 4, 8, 30 or 80 m, for beams that met nothing;
    a log does not name it. Taken for walls, such readings are an arc that moves with the robot.
    """
    finite = [scan.ranges[np.isfinite(scan.ranges)] for scan in scans]
    largest = max((float(ranges.max()) for ranges in finite if len(ranges)), default=0.0)
    near = np.concatenate([np.empty(0), *(r[r > largest - BELOW] for r in finite)])
    most = int((near > largest - EQUAL).sum())
    least = max(LEAST_READINGS, LEAST_SHARE * sum(map(len, finite)))
    if most < least or most < CROWDED * (len(near) - most):
        return list(scans)
    without = [np.isfinite(scan.ranges) & (scan.ranges > largest - EQUAL) for scan in scans]
    if sum(int((beams[1:] & beams[:-1]).sum()) for beams in without) < BESIDE * most:
        return list(scans)
    return [
        replace(scan, ranges=np.where(beams, np.inf, scan.ranges))
        for scan, beams in zip(scans, without, strict=True)
    ]
