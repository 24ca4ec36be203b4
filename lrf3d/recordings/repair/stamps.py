"""Stamps: a log that is out of order, such as one merged from two, is sorted by its stamps."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from lrf3d.geometry.lines import Float, Int
from lrf3d.recordings.repair import Repair

if TYPE_CHECKING:  # It imports scan matching, which readers of files do not need.
    from lrf3d.recordings.repair.recording import Recording

# A log is sorted by its stamps where that shortens the path by more than this [m], or where most
# stamps are earlier than the one before.
DETOUR = 0.5


def order_of(times: Float, poses: Float) -> Int | None:
    """The order (n,) that sorts odometry lines by their stamps; None if they stay as they are."""
    order = np.argsort(times, kind="stable")
    # Lengths of the paths as they are and sorted [m].
    driven, shortest = (
        float(np.hypot(*np.diff(each[:, :2], axis=0).T).sum()) for each in (poses, poses[order])
    )
    falls = int((np.diff(times) < 0.0).sum())
    sort = shortest < driven - DETOUR or 2 * falls > max(len(times) - 1, 1)
    return order if sort else None


def apply(recording: Recording, order: Int) -> Recording:
    """The recording with its lines in this order, and each scan after the line that it followed."""
    rank = np.argsort(order)
    before = rank[recording.poses_before]
    scans = np.lexsort([np.array([scan.time for scan in recording.scans]), before])
    return replace(
        recording,
        scans=[recording.scans[k] for k in scans.tolist()],
        poses=recording.poses[order],
        times=recording.times[order],
        poses_before=before[scans],
        rows=rank[recording.rows],
    )


STAMPS = Repair(
    "stamps",
    lambda recording: order_of(recording.times, recording.poses),
    apply,
    lambda _: "the log is out of order: sorted by its stamps",
    lambda order: {"put_in_order": order is not None},
)
