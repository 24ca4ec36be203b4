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

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float
from lrf3d.io.intake import Intake
from lrf3d.io.table import ANGLES, ROLES, SETTINGS, Table
from lrf3d.io.text_layout import PRESETS, Form, Layout

MOTORS = "stamp:ms@2, left@3, right@7, tick=0.349mm, track=0.15m, offset=0.03m"
"""The format of a LEGO robot's second file: the motors, named as the scans but for that word."""

PARTNERS = "motors odometry odom poses pose trajectory groundtruth gt".split()
"""Words in the names of files of poses, in place of one of the next in that of the scans."""

SCANS = re.compile("scans?|lasers?|lidar|ranges?|lrf", re.IGNORECASE)


def text_table(intake: Intake, format: str | None) -> Table:
    """The table of a text file."""
    path, notes = intake.path, intake.notes
    form = Form.of(path)
    preset = (format or form.preset).strip()
    spec = PRESETS.get(preset, format)
    if format is None and preset:
        notes.append(f"read as --format {preset}, by its columns")
    layout = Layout.parsed(spec, form.header) if spec else Layout.found(path, form)
    if "ranges" not in layout.columns:
        raise InputError(f"--format: {shown(spec)}: no column of ranges; expected 'ranges'")
    if not spec:
        found = ", ".join(f"{role} {column + 1}" for role, column in layout.columns.items())
        notes.append(f"columns found by {layout.reason}: {found}; --format says otherwise")
    rows = layout.read(intake, form)
    if not rows["ranges"]:
        raise InputError(
            f"{path}: no scan in it, expected a scan of numbers a line{intake.first_bad}"
        )
    values = {role: np.concatenate(each) for role, each in rows.items() if role != "ranges"}
    table = Table(intake, values, layout.units, layout.settings, layout.clockwise)
    if "angles" in layout.columns:
        _gather(table, np.concatenate(rows["ranges"]))
    else:
        values["ranges"] = _padded(rows["ranges"], notes)
        for role in SETTINGS.keys() & values.keys():
            table.settings[role] = float(np.median(values.pop(role)))
    if layout.angles is not None:
        values["angles"] = layout.angles
    if values["ranges"].shape[1] < 2:
        raise InputError(f"{path}: one beam in each scan; name the columns of ranges by --format")
    _add_partner(table, MOTORS if preset == "lego" else None)
    return table


def _padded(rows: list[Float], notes: list[str]) -> Float:
    """Ranges (k, n) of scans that may have fewer; what is missing is not measured, −inf."""
    beams = max(map(len, rows))
    ranges = np.full((len(rows), beams), -np.inf)
    for row, values in zip(ranges, rows, strict=True):
        row[: len(values)] = values
    if short := sum(len(values) < beams for values in rows):
        notes.append(
            f"{short} scans with fewer than {beams} ranges: what is missing is not measured"
        )
    return ranges


def _gather(table: Table, readings: Float) -> None:
    """Make scans of lines that hold a reading each, at bearings that differ from scan to scan.

    A scan begins with another stamp, or where the bearings start again. The beams are those of a
    fan; what was not measured is −inf.
    """
    values, units = table.values, table.units
    angles = values["angles"]
    unit = units.get("angles", "deg" if np.abs(angles).max() > 2.1 * np.pi else "rad")
    angles = angles * ANGLES[unit]
    stamps = values.get("stamp", np.empty(0))
    again = np.abs(np.diff(angles)) > np.pi
    if len(stamps) and 2 * len(np.unique(stamps)) < len(stamps):
        again = np.diff(stamps) != 0.0
    begins = np.concatenate([[0], np.flatnonzero(again) + 1, [len(angles)]])
    sizes = np.diff(begins)
    beams = int(np.median(sizes))
    kept = np.flatnonzero(2 * sizes > beams)
    low, wide = float(angles.min()), float(np.ptp(angles))
    step = 2.0 * np.pi / beams if wide > 1.9 * np.pi else wide / max(beams - 1, 1)
    ranges = np.full((len(kept), beams), -np.inf)
    for row, number in zip(ranges, kept.tolist(), strict=True):
        own = slice(begins[number], begins[number + 1])
        row[np.rint((angles[own] - low) / max(step, 1e-9)).astype(int) % beams] = readings[own]
    for role in values:
        values[role] = values[role][begins[kept]]
    if "quality" in values and wide > 1.9 * np.pi and "clockwise" not in table.settings:
        table.clockwise = True
    values["ranges"], values["angles"] = ranges, np.asarray(low + step * np.arange(beams))
    units["angles"] = "rad"
    way = "clockwise, as RPLIDARs with their qualities" if table.clockwise else "counter-clockwise"
    table.intake.notes.append(
        f"a reading a line: gathered to {len(kept)} scans of {beams} beams from {unit},"
        f" {way}; {len(sizes) - len(kept)} partial scans left out"
    )


def _add_partner(table: Table, spec: str | None) -> None:
    """Add the odometry in a file that is named as that of the scans but for a word, if it is there.

    Its poses are those at the stamps of the scans; without stamps, there is one for each.
    """
    path, values, notes = table.intake.path, table.values, table.intake.notes
    found = SCANS.search(path.name)
    names = [path.name.replace(found[0], word) for word in PARTNERS] if found else []
    partner = next((path.with_name(name) for name in names if path.with_name(name).exists()), None)
    if {"x", "dx", "left"} & values.keys() or partner is None:
        if spec:
            notes.append(f"no odometry: there is no {names[0] if names else 'file'} beside it")
        return
    form, intake = Form.of(partner), Intake(partner)
    layout = Layout.parsed(spec, []) if spec else _of_poses(form)
    rows = {role: np.concatenate(each) for role, each in layout.read(intake, form).items() if each}
    other = Table(intake, rows, layout.units, dict(layout.settings))
    poses = other.poses()
    if poses is None:
        notes.append(f"{partner.name} beside it holds no poses that are understood: not used")
        return
    if "stamp" in rows and "stamp" in values:
        at, own = (one._times() for one in (table, other))
        poses[:, 2] = np.unwrap(poses[:, 2])
        poses = np.column_stack([np.interp(at, own, column) for column in poses.T])
    elif len(poses) != len(values["ranges"]):
        notes.append(f"{partner.name} beside it has {len(poses)} poses and no stamps: not used")
        return
    for role, column in zip(("x", "y", "theta"), poses.T, strict=True):
        values[role], table.units[role] = column, next(iter(ROLES[role]))
    table.settings |= layout.settings
    notes.append(f"odometry from {partner.name}")


def _of_poses(form: Form) -> Layout:
    """The layout of a text of poses: by its header, or as TUM files or tables usually have it."""
    length = len(form.sample[0])
    layout = Layout.by_header(form.header, length) if form.header else Layout()
    if not {"x", "dx"} & layout.columns.keys():
        usual = {8: "stamp x y - qx qy qz qw", 4: "stamp x y theta", 3: "x y theta"}
        names = usual.get(length, "").split()
        layout = Layout(columns={name: k for k, name in enumerate(names) if name != "-"})
    layout.columns.pop("ranges", None)
    return layout
