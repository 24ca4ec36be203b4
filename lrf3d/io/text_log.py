"""Scans in text files: a scan a line, in columns.

A format, a header or the number of columns says what they hold. Numbers are separated by spaces,
tabs, commas or semicolons, and may have decimal commas. A format is a list of columns and settings,
such as ``stamp:us, x@3, y, theta:deg, ranges:mm@25, first=-120deg, last=120deg``:

- ``NAME:UNIT@COLUMN``: the column, from 1 or by its name in the header, is the next one if it is
  left out; ranges go on to the end, or over as many columns as ``ranges*682`` says;
- ``-`` is a column without meaning;
- ``first=``, ``last=``, ``step=``: the bearings of the beams; ``clockwise``, if they go that way;
- ``tick=``, ``track=``: how far the robot moves with a tick of the encoders ``left`` and ``right``,
  and how far apart its wheels are; ``offset=``: how far the laser stands ahead of its centre.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.io.carmen import lines_of
from lrf3d.io.columns import ANGLES, Columns
from lrf3d.io.laser_log import MOST_READINGS, NAMED, BadLine, LaserLog, log_name
from lrf3d.io.text_layout import PRESETS, Form, Layout, found_layout, is_number, plain

MOTORS = "stamp:ms@2, left@3, right@7, tick=0.349mm, track=0.15m, offset=0.03m"
"""The format of a LEGO robot's second file: the motors, named as the scans but for that word."""


def load_text(path: Path, format: str | None, largest_range: float | None) -> LaserLog:
    """Read the scans of a text file; see `load_log`."""
    form = Form.of(path)
    notes: list[str] = []
    preset = (format or form.preset).strip()
    spec = PRESETS.get(preset, format)
    if format is None and preset:
        notes.append(f"read as --format {preset}, by its columns")
    layout = Layout.parsed(spec, form.header) if spec else found_layout(path, form)
    if not spec:
        found = ", ".join(f"{role} {column + 1}" for role, column in layout.columns.items())
        notes.append(f"columns found by {layout.reason}: {found}; --format says otherwise")
    rows, bad, count = _read(path, form, layout)
    if not rows["ranges"]:
        why = f"; {count} bad lines, first {bad[0]}" if bad else ""
        raise InputError(f"{path}: no scan in it, expected a scan of numbers a line{why}")
    if "angles" in rows:
        _gather(rows, layout, notes)
    beams = max(map(len, rows["ranges"]))
    if beams < 2:
        raise InputError(f"{path}: one beam in each scan; name the columns of ranges by --format")
    ranges = np.full((len(rows["ranges"]), beams), -np.inf)
    for row, values in zip(ranges, rows["ranges"], strict=True):
        row[: len(values)] = values
    short = sum(len(values) < beams for values in rows["ranges"])
    if short:
        notes.append(
            f"{short} scans with fewer than {beams} ranges: what is missing is not measured"
        )
    values = {role: np.array(each) for role, each in rows.items() if role != "ranges"}
    columns = Columns(
        log_name(path), values | {"ranges": ranges}, layout.units, layout.settings, notes,
        layout.clockwise,
    )  # fmt: skip
    if layout.angles is not None:
        columns.values["angles"] = layout.angles
    if preset == "lego":
        _add_motors(columns, path)
    return columns.log(largest_range, bad, count)


def _read(
    path: Path, form: Form, layout: Layout
) -> tuple[dict[str, list[Any]], list[BadLine], int]:
    """The numbers of the lines by what they are, and the first and the number of bad lines."""
    rows: dict[str, list[Any]] = {role: [] for role in layout.columns}
    bad: list[BadLine] = []
    count = readings = 0
    for number, data, fault in lines_of(path):
        text = plain(data)
        words = form.words(text)
        if not fault and (
            not text or text.startswith("#") or (form.word and words[0] != form.word)
        ):
            continue
        if not any(rows.values()) and sum(map(is_number, words)) <= 0.5 * len(words):
            # What comes before the numbers.
            continue
        try:
            if fault:
                raise ValueError(fault)
            found = layout.values(words)
        except ValueError as error:
            count += 1
            bad += [BadLine(number, str(error))] if len(bad) < NAMED else []
            continue
        for role, value in found.items():
            rows[role].append(value)
        readings += len(words)
        if readings > MOST_READINGS:
            raise InputError(f"{path}: line {number}: more than {MOST_READINGS:,} readings; cut it")
    return rows, bad, count


def _gather(rows: dict[str, list[Any]], layout: Layout, notes: list[str]) -> None:
    """Make scans of lines that hold a reading each, at bearings that differ from scan to scan.

    A scan begins with another stamp, or where the bearings start again. The beams are those of a
    fan; what was not measured is −inf.
    """
    angles = np.array(rows.pop("angles"))
    unit = layout.units.pop("angles", "deg" if np.abs(angles).max() > 2.1 * np.pi else "rad")
    angles = angles * ANGLES[unit]
    stamps = np.array(rows.get("stamp", []))
    again = np.abs(np.diff(angles)) > np.pi
    if len(stamps) and 2 * len(np.unique(stamps)) < len(stamps):
        again = np.diff(stamps) != 0.0
    begins = np.concatenate([[0], np.flatnonzero(again) + 1, [len(angles)]])
    sizes = np.diff(begins)
    beams = int(np.median(sizes))
    kept = np.flatnonzero(2 * sizes > beams).tolist()
    low, wide = float(angles.min()), float(np.ptp(angles))
    step = 2.0 * np.pi / beams if wide > 1.9 * np.pi else wide / max(beams - 1, 1)
    readings, scans = np.concatenate(rows["ranges"]), []
    for number in kept:
        own = slice(begins[number], begins[number + 1])
        scan = np.full(beams, -np.inf)
        scan[np.rint((angles[own] - low) / max(step, 1e-9)).astype(np.int64) % beams] = readings[
            own
        ]
        scans.append(scan)
    for role in rows:
        rows[role] = scans if role == "ranges" else [rows[role][begins[k]] for k in kept]
    layout.angles = np.asarray(low + step * np.arange(beams), dtype=np.float64)
    layout.units["angles"] = "rad"
    notes.append(
        f"a reading a line: gathered to {len(kept)} scans of {beams} beams from {unit},"
        f" counter-clockwise; {len(sizes) - len(kept)} partial scans left out"
    )


def _add_motors(columns: Columns, path: Path) -> None:
    """Add what the motors did by the file of them beside that of the scans, if it is there."""
    partner = path.with_name(path.name.replace("scan", "motors"))
    if partner == path or not partner.exists():
        columns.notes.append(f"no odometry: there is no {partner.name} beside it")
        return
    layout = Layout.parsed(f"{MOTORS}, ranges*1@4", [])
    rows, *_ = _read(partner, Form.of(partner), layout)
    stamps = np.array(rows["stamp"])
    for side in ("left", "right"):
        columns.values[side] = np.interp(columns.values["stamp"], stamps, np.array(rows[side]))
    columns.settings |= layout.settings
    columns.notes.append(f"odometry from {partner.name}")
