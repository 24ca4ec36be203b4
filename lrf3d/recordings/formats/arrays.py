"""Scans in files of named arrays or records: .npz, .mat, JSON, and ROS messages printed as YAML.

Ranges (k, n) are needed, which a .npy file holds alone; angles (n,), stamps (k,), poses (k, 3), or
x, y and theta, may be there. Records, which are lines or an array of JSON, lines that Python
prints, YAML documents or lines of a CSV with lists, hold what arrays hold a row of.
"""

import json
import re
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, one_line
from lrf3d.base.formats import head_of
from lrf3d.base.units import NANO
from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import heading_of
from lrf3d.recordings.formats.npz import DAMAGES, read_arrays
from lrf3d.recordings.formats.table import CUT, WHOLE, Table, meaning, padded
from lrf3d.recordings.formats.text.dialects import DIALECTS, Words
from lrf3d.recordings.formats.text.guesses import (
    LARGEST_SWEEP,
    LEAST_SWEEP,
    SERIES,
    TURNS,
    by_names,
    has_several_negative,
    swept,
)
from lrf3d.recordings.formats.text.layout import Form, Layout, described
from lrf3d.recordings.formats.text.lines import SHORT, in_seconds, named, untyped
from lrf3d.recordings.log import Intake

# Matches what JSON and printed messages of ROS begin with.
DOCUMENTS = re.compile(
    rb"(?:\xef\xbb\xbf)?(?:\s*+\[?\s*+\{|\s*+(?:---\s++)?(?:header|seq|stamp):(?!\d+,\w+:))"
).match

# Matches what a dict begins with that Python prints: its names are in single quotes, or numbers.
PRINTED = re.compile(r"\s*\{['\d]").match

# Lists for the tuples that Python prints.
LISTED = str.maketrans("()", "[]")

# Matches what a CSV of lists begins with; no byte twice, since a header may have thousands of
# columns.
LISTS = re.compile(
    rb"(?=[^\n\[(]*?[A-Za-z]{3})[^\n\[(]*+\n[^\n\w]*+(?=\w)(?:[^\n,;]*+[,;])+?[^\w,;\[(]*+[\[(]"
).match

# Finds the topic of a message in the first bytes of a file.
TOPIC = re.compile(rb'\s*+\[?\s*+\{[^\0]*?"topic"\s*:\s*"').match

# Bytes of a file that show whether it holds records.
BEGINNING = 4096

# Number of first bytes of a file in which a topic must occur; a long scan may come before it.
LONG_BEGINNING = 1 << 16

# Matches a cell of a CSV: what stands in quotes, a list, or what comes before the next comma.
CELLS = re.compile(r"""\s*(?:"([^"]*(?:""[^"]*)*)"|[\[(]([^\[\](){}]*)[\])]|([^,]*))\s*,""")

# Matches a line of a CSV: what stands in quotes may have line ends.
LINES = re.compile(r"""(?:[^\n"]|"[^"]*+")++""")


def is_foreign(path: Path) -> bool:
    """Whether a .npz file is not a run of lrf3d."""
    try:
        with zipfile.ZipFile(path) as file:
            return "settings.npy" not in file.namelist()
    except DAMAGES:
        return False


def are_records(head: bytes) -> bool:
    """Whether records begin with these bytes."""
    return bool(DOCUMENTS(head) or LISTS(head))


def is_messages(path: Path) -> bool:
    """Whether a file holds messages with topics as JSON."""
    return path.is_file() and bool(TOPIC(head_of(path, LONG_BEGINNING)))


def array_table(intake: Intake, format: str | None) -> Table:
    """The table of a file of arrays."""
    path = intake.path
    try:
        arrays = _arrays_in(path)
    except NotImplementedError:
        raise InputError(f"{path}: a .mat file of version 7.3; save it with -v7") from None
    except DAMAGES as error:
        text = one_line(str(error) or type(error).__name__, 200)
        raise InputError(f"{path}: no file of arrays of numbers, or damaged ({text})") from None
    return _named(intake, arrays, "arrays", format)


def _arrays_in(path: Path) -> dict[str, Any]:
    if path.suffix.lower() == ".npz":
        return read_arrays(path)
    if path.suffix.lower() == ".npy":
        # What is mapped is checked against the size of the file.
        whole = np.load(path, mmap_mode="r", allow_pickle=False)
        return {name: whole[name] for name in whole.dtype.names or ()} or {"ranges": whole}
    from scipy.io import loadmat

    # Arrays in structures, and in arrays of these or of cells, are taken out of them.
    whole = loadmat(path, simplify_cells=True)
    found = _flat({name: each for name, each in whole.items() if name[:2] != "__"}, "")
    return {_last(name): each for name, each in found}


def _last(name: str) -> str:
    """The name within a structure, if it says what it holds; the name of all of them may not."""
    last = name.split(".")[-1]
    return last if meaning(last)[0] else name


def _named(intake: Intake, arrays: dict[str, Any], what: str, format: str | None) -> Table:
    """The table of arrays whose names, or a format, say what they are."""
    numbers = {
        name: np.asarray(array, dtype=np.float64)
        for name, array in arrays.items()
        if array.dtype.kind in "fiu"
    }
    numbers, layout = _joined(numbers)
    table = Table.named(intake, numbers)
    layout.settle(table)
    if format:
        _given(format, what).settle(table)
    _shape(table)
    if table.values.get("ranges", np.empty(0)).ndim != 2:
        names = one_line(", ".join(f"{name} {array.shape}" for name, array in arrays.items()), 200)
        raise InputError(
            f"{intake.path}: no ranges (scans, beams) among {names};"
            f" name one of the {what} 'ranges'"
        )
    return table


def _given(format: str, what: str) -> Layout:
    """The settings and units that a format gives for arrays, which names tell apart."""
    layout = described(format, [])
    if others := sorted(layout.columns.keys() - layout.units.keys() - {"ranges"}):
        raise InputError(f"--format: {others[0]}: {what} are found by their names; expected a unit")
    return layout


def _joined(arrays: dict[str, Float]) -> tuple[dict[str, Float], Layout]:
    """Arrays with one of ranges (k, n) for those of records that have a name for each beam."""
    # Names that were sorted may have range_10 before range_2.
    columns = {name: arrays[name] for name in sorted(arrays, key=_place) if arrays[name].ndim == 1}
    wide = any(each.ndim > 1 and meaning(name)[0] == "ranges" for name, each in arrays.items())
    if wide or len({*map(len, columns.values())}) != 1:
        return arrays, Layout()
    rows = np.column_stack([*columns.values()])
    header = named(columns)
    layout = by_names(Form(DIALECTS[-1], header, "", 0, [header]))
    if not _has_beams(layout, header):
        return arrays, Layout()
    begin = layout.columns["ranges"]
    beams = layout.beams or 0
    series = {*[*columns][begin : begin + beams]}
    others = {name: each for name, each in arrays.items() if name not in series}
    return others | {"ranges": rows[:, begin : begin + beams]}, layout


def _has_beams(layout: Layout, header: Words) -> bool:
    """Whether a scan of named beams was found: the names are bearings, or say that they are."""
    if (layout.beams or 0) <= SHORT:
        return False
    return layout.bearings is not None or meaning(header[layout.columns["ranges"]])[0] == "ranges"


def _place(name: str) -> tuple[str, float]:
    """The place of a name: the series that it belongs to, if any, and its number in this."""
    found = SERIES(name.lower())
    return (found[1], float(found[2])) if found else ("", -np.inf)


def _shape(table: Table) -> None:
    """Give ranges the shape of scans: of one scan, single readings, or pairs with bearings."""
    ranges = table.values.get("ranges", np.empty(0))
    bearings = table.values.get("angles", np.empty(0))
    if ranges.shape[2:] == (2,):
        _part_pairs(table, ranges)
    elif ranges.ndim == 2 and _are_columns(table, *ranges.shape):
        table.values["ranges"] = ranges.T
        if bearings.size == ranges.size:
            table.values["angles"] = bearings.reshape(ranges.shape).T.ravel()
    elif ranges.ndim == 1 and (table.settings or _is_scan(table)):
        table.values["ranges"] = ranges[None]
    elif ranges.ndim == 1 and 0 < len(ranges) == len(bearings):
        table.gather(ranges)


def _is_scan(table: Table) -> bool:
    """Whether readings are one scan: bearings go a turn at most, and there is one stamp."""
    bearings = table.values.get("angles", np.empty(0))
    others = table.values.keys() - {"ranges", "angles"}
    return (
        len(bearings) > 1
        and swept(bearings) > 0.0
        and all(len(table.values[role]) == 1 for role in others)
    )


def _part_pairs(table: Table, pairs: Float) -> None:
    """Enter the bearings and the ranges of pairs (k, n, 2), which are either of the two."""
    # Bearings rise, or fall, from beam to beam; the coordinates of points do both.
    ways = np.nan_to_num(np.sign(np.diff(pairs, axis=1)))
    even = np.abs(ways.sum(axis=(0, 1))) / np.maximum(np.abs(ways).sum(axis=(0, 1)), 1.0)
    # Scans with fewer pairs are filled up with NaN.
    known = np.isfinite(pairs).all(axis=2)
    if even.max() < 0.5 or _are_points(pairs[known], int(even.argmax())):
        found = f"pairs {pairs.shape} without bearings"
        raise InputError(f"{table.intake.path}: {found}; expected bearings and ranges, (k, n)")
    table.values["angles"] = pairs[known][:, even.argmax()]
    table.gather(pairs[known][:, even.argmin()], np.append(0, np.cumsum(known.sum(axis=1))))


def _are_points(pairs: Float, place: int) -> bool:
    """Whether pairs (k, 2) are points: both change sign, and those at a place are no sweep."""
    bearings = pairs[:, place]
    ranges = pairs[:, 1 - place]
    wide = np.ptp(bearings) if len(bearings) else 0.0
    radians, degrees = TURNS
    is_sweep = wide <= LARGEST_SWEEP * radians or wide >= LEAST_SWEEP * degrees
    signed = has_several_negative(ranges) and (ranges > 0.0).any()
    return bool(signed and not is_sweep and bearings.min() < 0.0 < bearings.max())


def _are_columns(table: Table, rows: int, columns: int) -> bool:
    """Whether scans are columns of ranges: each has a stamp or a pose, or each row its bearing."""
    others = table.values.keys() - {"ranges", "angles"}
    counts = {len(table.values[role]) for role in others}
    bearings = table.values.get("angles", np.empty(0))
    if bearings.size == rows * columns:
        if rows != columns and counts in ({rows}, {columns}):
            return counts == {columns}
        # Bearings differ from beam to beam, not from scan to scan.
        apart = bearings.reshape(rows, columns)
        return bool(np.nanmedian(np.ptp(apart, axis=1)) < np.nanmedian(np.ptp(apart, axis=0)))
    beams = len(bearings)
    is_known = bool(beams or counts) and rows != columns
    return is_known and beams in (0, rows) and counts <= {columns}


def record_table(intake: Intake, format: str | None) -> Table:
    """The table of a file of records."""
    return _named(intake, records(intake), "fields", format)


def records(intake: Intake) -> dict[str, Float]:
    """The columns of a file of records; those that lack what the first one has are counted."""
    text = b"".join(line for _, line in intake.lines()).decode("utf-8-sig", "replace")
    parts, read = _parts(text)
    rows: list[dict[str, Float]] = []
    for number, part in enumerate(parts, 1):
        if isinstance(part, str) and not part.strip():
            continue
        try:
            row = dict(_flat(read(part), ""))
            if rows and _kinds(row) != _kinds(rows[0]):
                raise ValueError("other fields than the first")
        except (ValueError, TypeError, RecursionError) as error:
            intake.refuse(number, one_line(str(error), 90), "record")
            continue
        rows.append(row)
    if not rows:
        raise InputError(f"{intake.path}: no record in it{intake.first_bad}")
    return _columns(rows, intake.notes)


def _kinds(row: dict[str, Float]) -> dict[str, bool]:
    """The names of the fields of a record, and whether each is a scan."""
    return {name: each.ndim > 0 and meaning(name)[0] == "ranges" for name, each in row.items()}


def _parts(text: str) -> tuple[Sequence[Any], Callable[[Any], Any]]:
    """The records in a text, and what reads one of them."""
    if text.lstrip()[:1] in "[{":
        found = _json_parts(untyped(text))
        plain = in_seconds(text)
        return found if plain is text or _are_stamped(*found) else _json_parts(untyped(plain))
    documents = re.split(r"(?m)^---[ \r]*$", text)
    if len(documents) > 1 or re.match(r"\s*\w+:", text):
        return documents, _yaml
    lines = LINES.findall(untyped(text))
    if "," not in lines[0]:
        # Numbers may be separated by semicolons as well.
        lines = [line.replace(";", ",") for line in lines]
    return lines[1:], partial(_cells, lines[0].split(","))


def _json_parts(text: str) -> tuple[Sequence[Any], Callable[[Any], Any]]:
    """The records in a text of JSON; what Python prints has other quotes."""
    if not PRINTED(text):
        return json_parts(text)
    parts, _ = json_parts(text.translate(LISTED))
    return parts, _yaml


def _are_stamped(parts: Sequence[Any], read: Callable[[Any], Any]) -> bool:
    """Whether a number of the first record is its stamp."""
    with suppress(ValueError, TypeError, RecursionError):
        roles = {meaning(name)[0] for part in parts[:1] for name, _ in _flat(read(part), "")}
        return bool(roles & {"stamp", "nanosec", "dt"})
    return True


def json_parts(text: str) -> tuple[Sequence[Any], Callable[[Any], Any]]:
    """The values of an array or a table of JSON, else the lines of a text, and what reads one."""
    with suppress(ValueError, RecursionError):
        return _values(json.loads(text)), lambda value: value
    # The lines of an array that was cut short end in commas.
    lines = (line.strip().rstrip(",") for line in text.splitlines())
    return [line for line in lines if line not in ("", "[", "]")], json.loads


def _values(document: Any) -> Sequence[Any]:
    """The records in a document of JSON: an array of them, a table of alike ones, or one."""
    if not isinstance(document, dict):
        return list(document)
    values = list(document.values())
    kinds = {tuple(each) if isinstance(each, dict) else () for each in values}
    if len(values) < 2 or len(kinds) > 1 or () in kinds:
        return [document]
    return values if "".join(document).isdigit() else _rows(document, *kinds)


def _rows(columns: dict[str, Any], names: Sequence[str]) -> Sequence[Any]:
    """The rows of a table of columns, as pandas writes it; other tables are rows already."""
    if not "".join(names).isdigit():
        return [*columns.values()]
    return [{key: column[name] for key, column in columns.items()} for name in names]


def _columns(rows: Sequence[dict[str, Float]], notes: list[str]) -> dict[str, Float]:
    """The numbers of records by their names; a record alone holds whole columns."""
    if len(rows) == 1:
        return rows[0]
    return {name: _stacked(name, [row[name] for row in rows], notes) for name in rows[0]}


def _stacked(name: str, parts: list[Float], notes: list[str]) -> Float:
    """Values of records, one below the other."""
    if {part.ndim for part in parts} == {1}:
        return padded(parts, notes if meaning(name)[0] == "ranges" else [])
    if {part.shape[1:] for part in parts} == {(2,)}:
        # Some scans have fewer pairs of a bearing and a range.
        pairs = np.dstack([padded([part[:, k] for part in parts], []) for k in (0, 1)])
        return np.where(np.isfinite(pairs), pairs, np.nan)
    return np.array(parts) if len({part.shape for part in parts}) == 1 else np.empty(0)


def _cells(names: list[str], line: str) -> dict[str, Any]:
    """The cells of a line of a CSV, some of which are lists; what is left out is NaN.

    Names with dots are those of messages in messages.
    """
    cells = [match[match.lastindex or 0].strip("\"' ") for match in CELLS.finditer(line + ",")]
    if len(cells) != len(names):
        raise ValueError(f"{len(cells)} cells for {len(names)} names")
    found: dict[str, Any] = {}
    for name, cell in zip(names, cells, strict=True):
        *above, last = name.strip(". \"'").split(".")
        place = found
        for each in above:
            place = place.setdefault(each, {})
        words = cell.strip("[()]").replace(",", " ").split()
        many = len(words) > 1 or cell.startswith(("[", "("))
        place[last] = _yaml(cell) if cell.startswith("{") else words if many else cell or np.nan
    return found


def _yaml(text: str) -> Any:
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        return yaml.load(text, Loader=loader)
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split())) from None


def _flat(value: Any, name: str) -> Iterator[tuple[str, Float]]:
    """The numbers in a record by their names: of messages, stamps and quaternions are one each."""
    if isinstance(value, dict):
        yield from _of_message(value, name)
    elif isinstance(value, list) and value and all(isinstance(each, dict) for each in value):
        parts = [dict(_flat(each, name)) for each in value]
        for key in _names(parts):
            yield key, np.array([part.get(key, np.nan) for part in parts], dtype=np.float64)
    else:
        yield from _of_numbers(value, name)


def _names(parts: Sequence[dict[str, Float]]) -> dict[str, None]:
    """The names in the first of some records, and those of numbers that only later ones have."""
    later = (key for part in parts for key, each in part.items() if not each.ndim)
    return dict.fromkeys(chain(parts[0], later))


def _of_message(message: dict[str, Any], name: str) -> Iterator[tuple[str, Float]]:
    keys = set(message)
    if keys in ({"sec", "nanosec"}, {"secs", "nsecs"}):
        sec, nanosec = map(_floats, message.values())
        yield name, np.array(sec + NANO * nanosec)
    elif keys == {"x", "y", "z", "w"}:
        yield f"{name}.theta_rad", heading_of(*(_floats(message[axis]) for axis in "xyzw"))
    else:
        for key, each in message.items():
            yield from _flat(each, f"{name}.{key}" if name else str(key))


def _floats(value: Any) -> Float:
    """A number, or an array of them; what is missing is an error."""
    return np.asarray(value).astype(np.float64)


def _of_numbers(value: Any, name: str) -> Iterator[tuple[str, Float]]:
    if isinstance(value, list) and CUT in value:
        raise ValueError(WHOLE)
    # A beam without return has no number.
    if value is not None or (SERIES(name) and meaning(name)[0] in ("", "ranges")):
        with suppress(ValueError, TypeError):
            # None marks a missing reading; an array of arrays holds cells of MATLAB.
            cells = isinstance(value, np.ndarray) and value.dtype.kind == "O"
            yield name, np.array([*value] if cells else value, dtype=np.float64)
