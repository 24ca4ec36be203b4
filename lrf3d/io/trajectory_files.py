"""Trajectories in files: TUM files for other tools, and relations as references to score them by.

A line of a TUM file, which evo reads, is ``t x y z qx qy qz qw``: time [s], position [m] and
orientation as a unit quaternion. Relations are relative poses of a robot between lines of a log,
one a line::

    odom_line_a odom_line_b dx dy dtheta [certain]

The lines are the log's ODOM lines, counted from 0; the pose [m, rad] is that at line b as seen from
the one at line a. ``certain`` is 0 where the lines may be others nearby, and 1 if not given.
"""

from pathlib import Path

import numpy as np

from lrf3d.errors import InputError
from lrf3d.files import read_text, replacing
from lrf3d.geometry import Float
from lrf3d.io.intake import MOST_LINES
from lrf3d.robot import Trajectory
from lrf3d.scoring.trajectory_score import Relations


def load_relations(path: str | Path) -> Relations:
    """Read relations from a text file."""
    rows: list[list[float]] = []
    for number, line in enumerate(read_text(path).split("\n"), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        lines = all(0.0 <= value <= MOST_LINES and value == int(value) for value in row[:2])
        if len(row) not in (5, 6) or not np.isfinite(row).all() or not lines:
            raise InputError(
                f"{path}:{number}: expected two line numbers, of at most {MOST_LINES:,}, dx, dy,"
                " dtheta and perhaps 0 or 1"
            )
        rows.append(row if len(row) == 6 else [*row, 1.0])
    if not rows:
        raise InputError(f"{path}: no relation in it, expected lines: a b dx dy dtheta")
    table = np.array(rows)
    return Relations(
        table[:, 0].astype(np.int64),
        table[:, 1].astype(np.int64),
        table[:, 2:5],
        table[:, 5] > 0.0,
    )


def save_tum(times: Float, poses: Float, path: str | Path) -> None:
    """Write poses (k, 3) x, y [m], theta [rad] at times (k,) [s] to a file, whole or not at all."""
    half = 0.5 * poses[:, 2]
    table = np.column_stack([times, poses[:, :2], np.sin(half), np.cos(half)])
    with replacing(path) as unfinished:
        np.savetxt(unfinished, table, fmt="%.6f %.6f %.6f 0 0 0 %.9f %.9f")


def load_tum(path: str | Path) -> Trajectory:
    """Read the trajectory in a TUM file; its stamps must rise.

    Raises:
        InputError: A line is not eight finite numbers with a unit quaternion, or stamps do not
            rise; the message names the line.
    """
    rows = list[list[float]]()
    for number, line in enumerate(read_text(path).split("\n"), 1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != 8 or not np.isfinite(row).all() or not 0.5 < np.linalg.norm(row[4:]) < 2.0:
            raise InputError(f"{path}:{number}: expected t x y z and a quaternion qx qy qz qw")
        if rows and row[0] <= rows[-1][0]:
            raise InputError(f"{path}:{number}: the stamp {row[0]:.6f} s is not after the last")
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: no pose in it, expected lines t x y z qx qy qz qw")
    table = np.array(rows)
    x, y, z, w = table[:, 4:].T
    theta = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    return Trajectory(table[:, 0], np.column_stack([table[:, 1:3], theta]))
