"""LaserLog: the scans of a recorded drive, whatever format they were kept in."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.laser import LaserScan

CARMEN_ENDINGS = (".log", ".log.gz", ".clf", ".clf.gz")
"""Endings of CARMEN logs; the last two are what the University of Freiburg calls them."""

LARGEST_RANGE = 50.0
"""Readings from here on mean that nothing returned [m]: range finders of CARMEN's time write
some 81.9 m or some 50 m then, and none of them sees as far."""


@dataclass(frozen=True, slots=True)
class BadLine:
    """A line that could not be read.

    Args:
        number: Which line of the file, from 1.
        reason: What is wrong with it.
    """

    number: int
    reason: str

    def __str__(self) -> str:
        return f"line {self.number}: {self.reason}"


@dataclass(frozen=True, eq=False)
class LaserLog:
    """Scans with the poses that were logged, and what could not be read.

    Args:
        name: What the log is called.
        scans: The scans in the order of the file.
        bad_count: How many lines could not be read.
        bad_lines: The first few of them.
    """

    name: str
    scans: list[LaserScan]
    bad_count: int = 0
    bad_lines: tuple[BadLine, ...] = ()

    def __len__(self) -> int:
        return len(self.scans)

    @cached_property
    def times(self) -> Float:
        """When each of the scans (k,) was taken [s]."""
        return np.array([scan.time for scan in self.scans])

    @cached_property
    def poses(self) -> Float:
        """Poses (k, 3) of the laser, x, y [m], theta [rad], as they were logged."""
        return np.array([scan.pose for scan in self.scans]).reshape(-1, 3)


def load_log(path: str | Path, *, largest_range: float = LARGEST_RANGE) -> LaserLog:
    """Read the scans of a log; the ending of its name tells the format.

    Args:
        path: A CARMEN log, packed with gzip or not.
        largest_range: Readings from here on are no return [m].

    Raises:
        InputError: The file cannot be read, is of no known format, or holds no scan.
    """
    path = Path(path)
    if path.name.lower().endswith(CARMEN_ENDINGS):
        from lrf3d.logs.carmen import load_carmen

        return load_carmen(path, largest_range=largest_range)
    known = ", ".join(CARMEN_ENDINGS)
    raise InputError(f"{path}: not a log by its name; expected an ending of {known}")
