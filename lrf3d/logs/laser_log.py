"""LaserLog: the scans of a recorded drive, whatever format they were kept in."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.robot import Trajectory

CARMEN_ENDINGS = (".log", ".log.gz", ".clf", ".clf.gz")
"""Endings of CARMEN logs; the last two are what the University of Freiburg calls them."""

BAG_ENDINGS = (".mcap", ".db3")
"""Endings of the files of ROS 2 bags."""

LARGEST_RANGE = 50.0
"""Readings from here on mean that nothing returned [m]: range finders of CARMEN's time write
some 81.9 m or some 50 m then, and none of them sees as far."""


NAMED = 5
"""How many bad lines are kept to be named; the others are only counted."""

MOST_READINGS = 50_000_000
"""Readings that are held at most: 400 MB of them."""

POSES = ("auto", "truth", "tf", "odom")
"""Where the poses of a log may come from."""


@dataclass(frozen=True, slots=True)
class BadLine:
    """A line, or a message, that could not be read.

    Args:
        number: Which one of the file, from 1.
        reason: What is wrong with it.
        kind: What it is.
    """

    number: int
    reason: str
    kind: str = "line"

    def __str__(self) -> str:
        return f"{self.kind} {self.number}: {self.reason}"


@dataclass(frozen=True, eq=False)
class LaserLog:
    """Scans with the poses that were logged, and what could not be read.

    Args:
        name: What the log is called.
        scans: The scans in the order of the file.
        bad_count: How many lines could not be read.
        bad_lines: The first few of them.
        source: Where the poses come from, in words.
        tracks: What else was logged of the robot's way: ``odom`` by its wheels, ``truth``.
    """

    name: str
    scans: list[LaserScan]
    bad_count: int = 0
    bad_lines: tuple[BadLine, ...] = ()
    source: str = "as logged"
    tracks: Mapping[str, Trajectory] = field(default_factory=dict)

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


def load_log(
    path: str | Path,
    *,
    largest_range: float | None = None,
    poses: str = "auto",
    scan_topic: str | None = None,
) -> LaserLog:
    """Read the scans of a log; its name tells the format.

    Args:
        path: A CARMEN log, packed with gzip or not; a ROS 2 bag, as .mcap, .db3 or a folder; or
            a run.npz or its folder.
        largest_range: CARMEN: readings from here on are no return [m]; what the log says, or 50,
            where not given.
        poses: Where the poses come from: ``auto`` for what the format trusts most, or ``truth``,
            ``tf`` or ``odom``.
        scan_topic: Bags: the topic of the scans; ``/scan``, or the first there is, where not
            given.

    Raises:
        InputError: The file cannot be read, is of no known format, or holds no scan.
        MissingLibraryError: A bag needs rosbags, which is not installed.
    """
    path = Path(path)
    if poses not in POSES:
        raise InputError(f"poses from {poses!r}: expected one of {', '.join(POSES)}")
    ending = path.name.lower()
    if ending.endswith(CARMEN_ENDINGS):
        from lrf3d.logs.carmen import load_carmen

        return load_carmen(path, largest_range=largest_range, poses=poses)
    if ending.endswith(".npz") or (path / "run.npz").is_file():
        from lrf3d.logs.run_file import load_run

        if poses not in ("auto", "truth"):
            raise InputError(f"{path}: no poses from {poses} in it; a run knows the truth alone")
        # Not called like the run, so that its map does not take the place of the run's own.
        return LaserLog("run", list(load_run(path).scans), source="the run")
    if ending.endswith(BAG_ENDINGS) or path.is_dir():
        from lrf3d.logs.ros_bag import load_bag

        return load_bag(path, poses=poses, scan_topic=scan_topic)
    known = ", ".join((*CARMEN_ENDINGS, *BAG_ENDINGS, ".npz"))
    raise InputError(f"{path}: not a log by its name; expected a folder or an ending of {known}")


def log_name(path: Path) -> str:
    """The name of a log without the endings that tell its format."""
    if path.is_dir():
        return path.resolve().name
    name = path.name.removesuffix(".gz")
    return name.rsplit(".", 1)[0] or name
