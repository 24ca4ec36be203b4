"""Trajectories in files: TUM files for other tools, and relations as references to score them by.

A line of a TUM file, which evo reads, is ``t x y z qx qy qz qw``: time [s], position [m] and
orientation as a unit quaternion. Relations are relative poses of a robot between lines of a log,
one a line::

    odom_line_a odom_line_b dx dy dtheta [certain]

The lines are the log's ODOM lines, counted from 0; the pose [m, rad] is that at line b as seen from
the one at line a. ``certain`` is 0 where the lines may be others nearby, and 1 if not given.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.files import read_text, replacing
from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import heading_of
from lrf3d.recordings.formats.text.lines import values_of
from lrf3d.robot import Trajectory
from lrf3d.scoring.trajectory_score import Relations

# Largest line number in a relation.
LAST_LINE = 10_000_000

# Units that stamps above a number have, since they are counted from 1970.
UNITS = {"nano": 1e17, "micro": 1e14, "milli": 1e12}


def load_relations(path: str | Path) -> Relations:
    """Read relations from a text file."""
    rows = []
    expected = f"two line numbers, of at most {LAST_LINE:,}, dx, dy, dtheta and perhaps"
    for place, row in _rows(path, f"{expected} 0 or 1", (5, 6)):
        if not all(0.0 <= value <= LAST_LINE and value == int(value) for value in row[:2]):
            raise InputError(f"{place}: expected {expected} 0 or 1")
        rows.append([*row, 1.0][:6])
    if not rows:
        raise InputError(f"{path}: no relation in it, expected lines: a b dx dy dtheta")
    table = np.array(rows)
    first, second = table[:, :2].T.astype(np.int64)
    return Relations(first, second, table[:, 2:5], table[:, 5] > 0.0)


def save_tum(times: Float, poses: Float, path: str | Path) -> None:
    """Write poses (k, 3) x, y [m], theta [rad] at times (k,) [s] to a file, whole or not at all."""
    half = 0.5 * poses[:, 2]
    table = np.column_stack([times, poses[:, :2], np.sin(half), np.cos(half)])
    with replacing(path) as unfinished:
        np.savetxt(unfinished, table, fmt="%.6f %.6f %.6f 0 0 0 %.9f %.9f")


def load_tum(path: str | Path) -> Trajectory:
    """Read the trajectory in a TUM file; its stamps must rise.

    Quaternions may have any length but 0.

    Raises:
        InputError: A line is not eight finite numbers, stamps do not rise, or the poses are not
            those of a robot that stands upright; the message names the line.
    """
    rows = list[list[float]]()
    expected = "t x y z and a quaternion qx qy qz qw"
    for place, row in _rows(path, expected, (8,)):
        if not (size := float(np.linalg.norm(row[4:]))) > 0.0:
            raise InputError(f"{place}: a quaternion of length 0, expected {expected}")
        if rows and row[0] <= rows[-1][0]:
            raise InputError(f"{place}: the stamp {row[0]:.6f} s is not after the last")
        rows.append([*row[:4], *(value / size for value in row[4:])])
    if not rows:
        raise InputError(f"{path}: no pose in it, expected lines t x y z qx qy qz qw")
    table = np.array(rows)
    latest = float(table[-1, 0])
    if unit := next((unit for unit, least in UNITS.items() if latest > least), ""):
        raise InputError(f"{path}: stamps up to {latest:g}; expected seconds, not {unit}seconds")
    upright = 1.0 - 2.0 * (table[:, 4] ** 2 + table[:, 5] ** 2)
    if np.median(upright) < 0.5:
        raise InputError(
            f"{path}: poses that lie on their side; expected z upwards, as of a robot's base and"
            " not of a camera, and quaternions as qx qy qz qw"
        )
    theta = np.unwrap(heading_of(*table[:, 4:].T))
    return Trajectory(table[:, 0], np.column_stack([table[:, 1:3], theta]))


def _rows(
    path: str | Path, expected: str, lengths: tuple[int, ...]
) -> Iterator[tuple[str, list[float]]]:
    """The place and the finite numbers of each line of a text, but for comments."""
    first = True
    for number, line in enumerate(read_text(path).split("\n"), 1):
        if not (words := re.split("[#%]", line)[0].replace(",", " ").replace(";", " ").split()):
            continue
        row = values_of(words).tolist()
        if first and not np.isfinite(row).any():
            # A line with the names of the columns.
            first = False
            continue
        if len(row) not in lengths or not np.isfinite(row).all():
            found = "; found " + (f"{len(row)} numbers" if np.isfinite(row).all() else line[:40])
            if len(row) == 12:
                found += " without a stamp, as KITTI's: evo_traj kitti converts them"
            raise InputError(f"{path}:{number}: expected {expected}{found}")
        first = False
        yield f"{path}:{number}", row
