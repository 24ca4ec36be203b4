"""Copies: scans and odometry lines that are in a log more than once are read once."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Int
from lrf3d.recordings.repair import Repair
from lrf3d.recordings.repair.recording import Recording


class Copies(NamedTuple):
    """The numbers of the scans and odometry lines that are kept: of equal ones, the first.

    ``rows`` holds for each line of the log the index of its first copy among the lines that are
    kept; ``doubled`` the numbers of scans and odometry lines that are left out.
    """

    scans: Int
    lines: Int
    rows: Int
    doubled: dict[str, int]


def find(recording: Recording) -> Copies | None:
    """Lines with the same stamp and pose, and scans with the same stamp and ranges."""
    table = np.arange(len(recording.poses))[:, None]
    # Equal lines without stamps of their own are not copies: the robot may stand still.
    if recording.stamped:
        table = np.column_stack([recording.times, recording.poses])
    _, first, group = np.unique(table, axis=0, return_index=True, return_inverse=True)
    lines = np.sort(first)
    # Of equal scans the first one is kept.
    scans = dict[tuple[float, bytes], int]()
    for number, scan in enumerate(recording.scans):
        scans.setdefault((scan.time, scan.ranges.tobytes()), number)
    if len(scans) < 2:
        raise InputError(f"one scan, {len(recording.scans)} times; expected at least two")
    doubled = {"scan": len(recording.scans) - len(scans), "odometry line": len(table) - len(lines)}
    rows = np.searchsorted(lines, first[group.reshape(-1)])
    return (
        Copies(np.array([*scans.values()]), lines, rows, doubled) if any(doubled.values()) else None
    )


def sentence(copies: Copies) -> str:
    """How many copies there were."""
    doubled = (counted(count, name) for name, count in copies.doubled.items() if count)
    return f"{' and '.join(doubled)} in the log more than once: read once"


COPIES = Repair(
    "copies",
    find,
    lambda recording, copies: replace(
        recording,
        scans=[recording.scans[k] for k in copies.scans.tolist()],
        poses=recording.poses[copies.lines],
        times=recording.times[copies.lines],
        poses_before=copies.rows[recording.poses_before[copies.scans]],
        rows=copies.rows,
    ),
    sentence,
    lambda copies: {
        "doubled_scans": copies.doubled["scan"] if copies else 0,
        "doubled_odometry_lines": copies.doubled["odometry line"] if copies else 0,
    },
)
