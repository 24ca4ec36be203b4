"""Copies: scans and odometry lines that are in a log more than once are read once."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Int
from lrf3d.recordings.repair.recording import Recording
from lrf3d.recordings.repair.repair import Repair


class Copies(NamedTuple):
    """The numbers of the scans and lines that are read, and for each line the row of its first."""

    scans: Int
    lines: Int
    rows: Int
    doubled_scans: int
    doubled_lines: int


def find(recording: Recording) -> Copies | None:
    """Lines with the same stamp and pose, and scans with the same stamp and ranges."""
    count = len(recording.poses)
    table = np.arange(count)[:, None]
    # Without stamps of their own lines that are alike are no copies.
    if recording.stamped:
        table = np.column_stack([recording.times, recording.poses])
    _, first, group = np.unique(table, axis=0, return_index=True, return_inverse=True)
    lines = np.sort(first)
    rows = np.searchsorted(lines, first[group.reshape(-1)])
    scans = recording.scans
    # Of scans that are alike the first one counts.
    whole = {(scan.time, scan.ranges.tobytes()): -k for k, scan in enumerate(reversed(scans), 1)}
    chosen = len(scans) + np.sort(np.array(list(whole.values())))
    if len(chosen) < 2:
        raise InputError(f"one scan, {len(scans)} times; expected at least two")
    copies = len(scans) - len(chosen), count - len(lines)
    return Copies(chosen, lines, rows, *copies) if any(copies) else None


def apply(recording: Recording, copies: Copies) -> Recording:
    """The recording with each scan and each line once."""
    return replace(
        recording,
        scans=[recording.scans[k] for k in copies.scans.tolist()],
        poses=recording.poses[copies.lines],
        times=recording.times[copies.lines],
        places=copies.rows[recording.places[copies.scans]],
        rows=copies.rows,
        lags=recording.lags[copies.scans],
    )


def sentence(copies: Copies) -> str:
    """How many copies there were."""
    counts = (copies.doubled_scans, "scan"), (copies.doubled_lines, "odometry line")
    doubled = " and ".join(counted(count, name) for count, name in counts if count)
    return f"{doubled} in the log more than once: read once"


def figures(copies: Copies | None) -> dict[str, Any]:
    """The numbers of copies."""
    scans, lines = copies[-2:] if copies else (0, 0)
    return {"doubled_scans": scans, "doubled_odometry_lines": lines}


COPIES = Repair("copies", find, apply, sentence, figures)
