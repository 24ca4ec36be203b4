"""Scans in text files: a scan a line, or a reading a line, in columns.

A format, a header or the numbers themselves say what columns hold: `dialects` lists how lines may
be written, and `guesses` the methods to find columns without a format. A format is a list of
columns and settings, such as
``stamp:us, x@3, y, theta:deg, ranges:mm@25, first=-120deg, last=120deg``:

- ``NAME:UNIT@COLUMN``: the column, from 1 or by its name in the header, is the next one if it is
  left out; ranges go on to the end, or over as many columns as ``ranges*682`` says;
- ``-`` is a column without meaning;
- ``first=``, ``last=``, ``step=``: the bearings of the beams; ``clockwise``, if they go that way;
- ``tick=``, ``track=``: how far the robot moves with a tick of the encoders ``left`` and ``right``,
  and how far apart its wheels are; ``offset=``: how far the laser stands ahead of its centre;
- after a semicolon: the format of the file of odometry that lies next to that of the scans.
"""

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from lrf3d.base.errors import InputError, shown
from lrf3d.base.formats import head_of
from lrf3d.geometry.lines import Float
from lrf3d.recordings.formats.arrays import BEGINNING, are_records, records
from lrf3d.recordings.formats.table import ROLES, SETTINGS, Table, padded
from lrf3d.recordings.formats.text.guesses import by_names, formats_for, layout_of
from lrf3d.recordings.formats.text.layout import Form, Layout, described, form_of
from lrf3d.recordings.log import Intake

# Words in the name of a file of poses, where the file of its scans has a word of `SCANS`.
PARTNERS = "motors robot odometry odom poses pose trajectory groundtruth gt".split()

SCANS = re.compile("scans?|lasers?|lidar|ranges?|lrf", re.IGNORECASE)

# Roles of columns of odometry, which have their own lines in tables of merged topics.
MOVING = set("x y theta dx dy dtheta left right qx qy qz qw".split())

# Formats of files of poses without a header, by the number of columns: TUM files, tables, and
# odometry as `ros2 topic echo --csv` prints it, with covariances of its pose and its speed.
POSES = {
    8: "stamp, x, y, -, qx, qy, qz, qw",
    4: "stamp, x, y, theta",
    3: "x, y, theta",
    89: "stamp, nanosec, -, -, x, y, -, qx, qy, qz, qw",
}


def text_table(intake: Intake, format: str | None) -> Table:
    """The table of a text file."""
    form = form_of(intake.path)
    table = Table(intake, {})
    spec, _, partner = (format or "").partition(";")
    layout = described(spec, form.header) if spec else Layout()
    if layout.columns.keys() <= {"ranges"} and not {"@", "*"} & {*spec}:
        layout = _found(form, intake, layout)
    if "ranges" not in layout.columns:
        raise InputError(f"--format: {shown(spec)}: no column of ranges; expected 'ranges'")
    poses = layout.only(MOVING, keep=True)
    scans = [words for words in form.sample if not layout.lacks(words, ["ranges"])]
    merged = len(poses.columns) > 1 and all(poses.lacks(words, poses.columns) for words in scans)
    if merged:
        layout = layout.only(MOVING, keep=False)
    ranges = layout.read(form, table)
    if not ranges and "ranges" not in table.values:
        expected = f"no scan in it, expected a scan of numbers a line{intake.first_bad}"
        raise InputError(f"{intake.path}: {expected}")
    if layout.paired:
        table.gather(np.concatenate(ranges), np.cumsum([0, *map(len, ranges)]))
    elif "angles" in layout.columns:
        table.gather(np.concatenate(ranges) if ranges else table.values["ranges"])
    else:
        _stack(table, ranges)
    if table.values["ranges"].shape[1] < 2:
        one = "one beam in each scan; name the columns of ranges by --format"
        raise InputError(f"{intake.path}: {one}")
    if merged:
        other = Table(Intake(intake.path), {})
        # Lines of poses are short.
        poses.read(replace(form, least=0), other)
        _take_poses(table, other, "its own lines")
    add_partner(table, partner)
    return table


def _found(form: Form, intake: Intake, given: Layout) -> Layout:
    """The layout that is found, with given settings and units; if none is, the given columns."""
    try:
        layout = layout_of(form, intake).with_settings(given)
    except InputError as error:
        if given.columns:
            return given
        spec = next(
            (f", such as '{each}'" for each in formats_for(form) if _reads(intake, each)), ""
        )
        raise InputError(f"{error}{spec}") from None
    if form.grouped and "ranges" not in layout.units and layout.has_hundreds(form):
        why = "numbers grouped in thousands; save them without marks between the groups"
        raise InputError(f"{intake.path}: {form.grouped}: {why}")
    return layout


def _reads(intake: Intake, spec: str) -> bool:
    """Whether a format reads a file, so that it may be advised."""
    with suppress(InputError):
        return bool(text_table(Intake(intake.path), spec).log().scans)
    return False


def _stack(table: Table, ranges: list[Float]) -> None:
    """Enter the ranges of scans into the table, and the settings that each line repeats."""
    spread = {"first", "last"} <= table.settings.keys() and "step" not in table.settings
    table.values["ranges"] = padded(ranges, table.intake.notes, spread=spread)
    for role in SETTINGS.keys() & table.values.keys():
        table.settings[role] = float(np.median(table.values.pop(role)))


def add_partner(table: Table, spec: str = "") -> None:
    """Add the odometry from the file whose name differs from the scans' by one word, if it exists.

    Poses are interpolated at the stamps of the scans; without stamps, each scan has one pose.
    """
    path = table.intake.path
    notes = table.intake.notes
    found = SCANS.search(path.name)
    names = [path.name.replace(found[0], word) for word in PARTNERS] if found else []
    partner = next(filter(Path.exists, map(path.with_name, names)), None)
    if partner is None or {"x", "dx", "left"} & table.values.keys():
        notes += [f"no odometry: there is no {(*names, 'file')[0]} beside it"] if spec else []
        return
    _take_poses(table, _partner_table(partner, spec), partner.name)


def _take_poses(table: Table, other: Table, name: str) -> None:
    """Enter the poses of another table at the stamps of the scans, or note why there are none."""
    placed = _at_scans(table, other, other.poses())
    if isinstance(placed, str):
        table.intake.notes.append(f"{name} beside it {placed}: not used")
        return
    for role, column in zip(("x", "y", "theta"), placed.T, strict=True):
        table.values[role] = column
        table.units[role] = next(iter(ROLES[role]))
    table.settings |= other.settings
    table.intake.notes.append(f"odometry from {name}")


def _partner_table(path: Path, spec: str) -> Table:
    """The table of a file of odometry, by its format, its header or its number of columns."""
    intake = Intake(path)
    if are_records(head_of(path, BEGINNING)):
        return Table.named(intake, records(intake))
    form = form_of(path)
    layout = described(spec, []) if spec else by_names(form)
    if not spec and not {"x", "dx"} & layout.columns.keys():
        usual = described(POSES.get(len(form.sample[0]), "-"), [])
        # Encoder ticks are no poses, however many columns there are.
        layout = (
            usual
            if layout.only(MOVING, keep=True).columns.items() <= usual.columns.items()
            else Layout()
        )
    layout.columns.pop("ranges", None)
    table = Table(intake, {})
    layout.read(form, table)
    return table


def _at_scans(table: Table, other: Table, poses: Float | None) -> Float | str:
    """The poses of another table at the scans of this one, or why there are none.

    Scans outside of the time of the poses are left out.
    """
    if poses is None:
        return "holds no poses that are understood"
    if not ("stamp" in other.values and "stamp" in table.values):
        if len(poses) == len(table.values["ranges"]):
            return poses
        return f"has {len(poses)} poses and no stamps"
    at = table.times()
    own = other.times()
    poses[:, 2] = np.unwrap(poses[:, 2])
    # A scan may be half a step of the odometry early or late.
    reach = 0.5 * float(np.median(np.diff(own))) if len(own) > 1 else 0.0
    known = (at >= own[0] - reach) & (at <= own[-1] + reach)
    if not known.any():
        return "is of another time"
    if not known.all():
        table.intake.notes.append(f"{(~known).sum()} scans outside of the time of poses left out")
    for role in table.values.keys() - {"angles"}:
        table.values[role] = table.values[role][known]
    return np.column_stack([np.interp(at[known], own, column) for column in poses.T])
