"""Scans in text files: a scan a line, or a reading a line, in columns.

A format, a header or the numbers themselves say what they hold. Numbers are separated by spaces,
tabs, commas or semicolons, and may have decimal commas. A format is a list of columns and settings,
such as ``stamp:us, x@3, y, theta:deg, ranges:mm@25, first=-120deg, last=120deg``:

- ``NAME:UNIT@COLUMN``: the column, from 1 or by its name in the header, is the next one if it is
  left out; ranges go on to the end, or over as many columns as ``ranges*682`` says;
- ``-`` is a column without meaning;
- ``first=``, ``last=``, ``step=``: the bearings of the beams; ``clockwise``, if they go that way;
- ``tick=``, ``track=``: how far the robot moves with a tick of the encoders ``left`` and ``right``,
  and how far apart its wheels are; ``offset=``: how far the laser stands ahead of its centre.
"""

import re

import numpy as np

from lrf3d.base.errors import InputError, shown
from lrf3d.recordings.formats.arrays import is_records, records
from lrf3d.recordings.formats.table import ROLES, SETTINGS, Table, padded
from lrf3d.recordings.formats.text.form import Form
from lrf3d.recordings.formats.text.layout import PRESETS, Layout, preset_of
from lrf3d.recordings.log import Intake

# The format of a LEGO robot's second file: the motors, named as the scans but for that word.
MOTORS = "stamp:ms@2, left@3, right@7, tick=0.349mm, track=0.15m, offset=0.03m"

# Words in the names of files of poses, in place of one of the next in that of the scans.
PARTNERS = "motors robot odometry odom poses pose trajectory groundtruth gt".split()

SCANS = re.compile("scans?|lasers?|lidar|ranges?|lrf", re.IGNORECASE)


def text_table(intake: Intake, format: str | None) -> Table:
    """The table of a text file."""
    path = intake.path
    notes = intake.notes
    form = Form(intake.path)
    table = Table(intake, {})
    preset = (format or preset_of(form)).strip()
    spec = PRESETS.get(preset, format)
    layout = Layout(table)
    if format is None and preset:
        notes.append(f"read as --format {preset}, by its columns")
    if spec:
        layout.parse(spec, form.header)
    else:
        layout.find(form)
    if "ranges" not in layout.columns:
        raise InputError(f"--format: {shown(spec)}: no column of ranges; expected 'ranges'")
    ranges = layout.read(form)
    values = table.values
    if not ranges and "ranges" not in values:
        raise InputError(
            f"{path}: no scan in it, expected a scan of numbers a line{intake.first_bad}"
        )
    if "angles" in layout.columns:
        angles = values["angles"]
        stamps = values.get("stamp", np.empty(0))
        # A scan begins with another stamp, or where the bearings start again.
        again = np.abs(np.diff(angles)) > 0.5 * np.ptp(angles)
        if len(stamps) and 2 * len(np.unique(stamps)) < len(stamps):
            again = np.diff(stamps) != 0.0
        begins = np.concatenate([[0], np.flatnonzero(again) + 1, [len(angles)]])
        table.gather(begins, np.concatenate(ranges) if ranges else values["ranges"])
    else:
        spread = {"first", "last"} <= table.settings.keys() and "step" not in table.settings
        values["ranges"] = padded(ranges, notes, spread=spread)
        for role in SETTINGS.keys() & values.keys():
            table.settings[role] = float(np.median(values.pop(role)))
    if values["ranges"].shape[1] < 2:
        raise InputError(f"{path}: one beam in each scan; name the columns of ranges by --format")
    if preset == "lego":
        add_partner(table, MOTORS)
    return table


def add_partner(table: Table, spec: str = "") -> None:
    """Add the odometry in a file that is named as that of the scans but for a word, if it is there.

    Its poses are those at the stamps of the scans; without stamps, there is one for each.
    """
    path = table.intake.path
    values = table.values
    notes = table.intake.notes
    found = SCANS.search(path.name)
    names = [path.name.replace(found[0], word) for word in PARTNERS] if found else []
    partner = next((path.with_name(name) for name in names if path.with_name(name).exists()), None)
    if {"x", "dx", "left"} & values.keys() or partner is None:
        if spec:
            notes.append(f"no odometry: there is no {names[0] if names else 'file'} beside it")
        return
    other = Table(Intake(partner), {})
    if is_records(partner):
        other = Table.named(other.intake, records(other.intake))
    else:
        form = Form(partner)
        layout = Layout(other)
        if spec:
            layout.parse(spec, [])
        else:
            _find_poses(layout, form)
        layout.read(form)
    poses = other.poses()
    if poses is None:
        notes.append(f"{partner.name} beside it holds no poses that are understood: not used")
        return
    if "stamp" in other.values and "stamp" in values:
        at = table.times()
        own = other.times()
        poses[:, 2] = np.unwrap(poses[:, 2])
        poses = np.column_stack([np.interp(at, own, column) for column in poses.T])
        reach = 0.5 * float(np.median(np.diff(own))) if len(own) > 1 else 0.0
        known = (at >= own[0] - reach) & (at <= own[-1] + reach)
        if not known.any():
            notes.append(f"{partner.name} beside it is of another time: not used")
            return
        if not known.all():
            notes.append(f"{(~known).sum()} scans outside of the time of poses left out")
        poses = poses[known]
        for role in values.keys() - {"angles"}:
            values[role] = values[role][known]
    elif len(poses) != len(values["ranges"]):
        notes.append(f"{partner.name} beside it has {len(poses)} poses and no stamps: not used")
        return
    for role, column in zip(("x", "y", "theta"), poses.T, strict=True):
        values[role] = column
        table.units[role] = next(iter(ROLES[role]))
    table.settings |= other.settings
    notes.append(f"odometry from {partner.name}")


def _find_poses(layout: Layout, form: Form) -> None:
    """Find the columns of poses: by a header, or as TUM files or tables usually have them."""
    length = len(form.sample[0])
    if form.header:
        layout.by_header(form.header, length)
    if not {"x", "dx"} & layout.columns.keys():
        usual = {8: "stamp x y - qx qy qz qw", 4: "stamp x y theta", 3: "x y theta"}
        # Odometry as ros2 topic echo --csv prints it, with covariances of its pose and speed.
        usual[89] = "stamp nanosec - - x y - qx qy qz qw"
        names = usual.get(length, "").split()
        layout.table.units = {}
        layout.columns = {name: k for k, name in enumerate(names) if name != "-"}
    layout.columns.pop("ranges", None)
