"""Reading logs: the name of a file or a folder, or else its content, selects the reader."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.base.files import as_path, own_name
from lrf3d.base.formats import Format, by_ending, by_looks, by_name, endings, function, head_of
from lrf3d.base.interrupts import reading
from lrf3d.base.isolation import read_file
from lrf3d.geometry.lines import as_rows, number, whole_number
from lrf3d.recordings.formats.arrays import (
    BEGINNING,
    DOCUMENTS,
    LONG_BEGINNING,
    TOPIC,
    are_records,
    is_foreign,
    is_messages,
)
from lrf3d.recordings.formats.carmen import WORDS
from lrf3d.recordings.formats.table import Table
from lrf3d.recordings.formats.text.text_log import add_partner
from lrf3d.recordings.log import Intake, LaserLog

# Formats of texts by the first bytes of a file, in this order; a text of numbers is none of them.
TEXTS: dict[str, Callable[[bytes], Any]] = {
    "messages": TOPIC,
    "CARMEN": WORDS,
    "records": are_records,
}

# Finds a line that begins with a number.
NUMBERS = re.compile(rb"(?m)^\s*[-+.\d]+[\s,;]").search


def is_run(name: str) -> bool:
    """Whether a name is that of a run, a ``.npz`` or a folder, and not of a world.

    A built-in world takes precedence over a folder of the same name, as everywhere.
    """
    from lrf3d.world import world_names

    if name in world_names():
        return False
    return Path(name).is_dir() or Path(name).suffix.lower() == ".npz"


def odometry_of(path: str | Path) -> str:
    """The source of poses for SLAM: odometry for bags and runs, whose ``auto`` may be the truth."""
    bags_and_runs = (*by_name("log", "bag").endings, *by_name("log", "run").endings)
    is_either = as_path(path).is_dir() or str(path).lower().endswith(bags_and_runs)
    return "odom" if is_either or is_messages(as_path(path)) else "auto"


@reading()
def load_log(
    path: str | Path,
    *,
    largest_range: float | None = None,
    smallest_range: float = 0.0,
    mask: Sequence[tuple[float, float]] = (),
    poses: str = "auto",
    scan_topic: str | None = None,
    part: int | None = None,
    height: Sequence[float] | None = None,
    format: str | None = None,
    without_repairs: Sequence[str] = (),
    isolated: bool = True,
) -> LaserLog:
    """Read the scans of a log; the ending of its name gives the format.

    Args:
        path: A CARMEN log or a text of a scan a line, gzipped or not; a ROS bag, as .mcap, .db3,
            .bag or a folder; a .npz or .mat file of arrays; or a run.npz or its folder.
        largest_range: Readings of this or more mean no return [m]; if not given, this is the range
            that the log names for its range finder, or the largest reading if it stands out.
        smallest_range: Readings of this or less are left out [m].
        mask: First and last bearings [rad] of beams that are left out, such as those that hit the
            robot itself.
        poses: Source of the poses: ``auto`` for the best that the format has, or ``truth``, ``tf``
            or ``odom``.
        scan_topic: Bags: the topic of the scans; if not given, the topics of all lasers of one
            robot: the robot of ``/scan``, or else of the first topic of scans.
        format: Text: its columns; found if not given. Arrays: units and bearings.
        part: Bags whose stamps go back: the part that is read, from 1; the longest if not given.
        height: Bags with point clouds: scans are made of the points between these heights [m] above
            the robot's frame; if not given, and there are no scans, of the ring nearest to the
            level, or of the points at the height of the lidar.
        without_repairs: Names of repairs that are left out. Reading makes only ``no_return``;
            without it the largest and smallest readings are kept as they are.
        isolated: Read the file in a process of its own, with limits on memory and time.

    Raises:
        InputError: The file cannot be read, has an unknown format, or holds no scan.
        MissingLibraryError: A bag needs rosbags, which is not installed.

    Examples:
        >>> import lrf3d
        >>> run = lrf3d.load_scenario("paper_room").run(rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> len(lrf3d.load_log("drive.log").scans)
        3
    """
    path = as_path(path)
    if largest_range is not None:
        number(largest_range, "largest range", "metres", positive=True)
    number(smallest_range, "smallest range", "metres")
    masked = as_rows(mask, "mask", 2).tolist() if len(mask) else []
    sources = ("auto", "truth", "tf", "odom")  # Where the poses of a log may come from.
    if not isinstance(poses, str) or poses not in sources:
        raise InputError(f"poses from {shown(poses)}: expected one of {', '.join(sources)}")
    for name, text in (("format", format), ("scan topic", scan_topic)):
        expect(text, str | None, name)
    if part is not None:
        part = whole_number(part, "part")
    row = by_ending(path, "log")
    options = {
        "poses": poses, "scan_topic": scan_topic, "part": part, "format": format,
        "height": _band(height), "largest_range": largest_range, "without_repairs": without_repairs,
        "smallest_range": smallest_range, "mask": masked,
    }  # fmt: skip
    known = row is None or row.apart
    reader = "lrf3d.recordings.reading:log_of_file"
    log: LaserLog = read_file(reader, path, options, isolated=isolated and known)
    return log


def _band(height: Any) -> Any:
    """The lowest and highest height [m] of points that make scans, checked; None if not given."""
    if height is None:
        return None
    band = as_rows([height], "height", 2, least=1)[0].tolist()
    if not band[0] < band[1]:
        raise InputError(f"height {shown(band)}: expected the lower one first, in metres")
    return band


def log_of_file(
    path: Path,
    *,
    largest_range: float | None,
    without_repairs: Sequence[str],
    smallest_range: float,
    mask: Any,
    **given: Any,
) -> LaserLog:
    """Read a log with the reader of its format, which gets the options that the format has."""
    row = _format_of(path, given["format"])
    of_bags = [name for name in ("scan_topic", "part", "height") if given[name]]
    if of_bags and "scan_topic" not in row.options:
        name = of_bags[0].replace("_", " ")
        raise InputError(f"{path}: no bag, so that there is no {name} to choose")
    if "poses" not in row.options and given["poses"] not in ("auto", "odom"):
        raise InputError(f"{path}: no poses from {given['poses']} in it; there are auto, odom")
    options = {name: given[name] for name in row.options}
    intake = Intake(path, largest_range, without_repairs, smallest_range, mask)
    found: LaserLog | Table = function(row.read)(intake, **options)
    if isinstance(found, LaserLog):
        return found
    if row.name == "records":
        add_partner(found)
    return found.log()


def run_log(intake: Intake, poses: str) -> LaserLog:
    """The log of a run."""
    from lrf3d.recordings.formats.run_file import load_run

    path = intake.path
    if poses not in ("auto", "truth"):
        raise InputError(
            f"{path}: no poses from {poses} in it; a run has only true poses (--poses truth);"
            " for SLAM write its log: lrf3d export RUN --to carmen"
        )
    run = load_run(path)
    # The log has a name of its own, so that its map does not overwrite that of the run.
    name = own_name(path.resolve().parent if path.name == "run.npz" else path)
    return LaserLog(f"{name}_map", list(run.scans), source="the run")


def _format_of(path: Path, columns: str | None) -> Format:
    """The format of a log, by its name, or else by what it looks like.

    Columns are those of a text; without places they may also be units of a file of records.
    """
    named = by_ending(path, "log")
    name = "" if named is None else named.name
    if columns and name not in ("arrays", "run"):
        is_document = DOCUMENTS(head_of(path, BEGINNING, "a log"))
        in_records = is_document and {"@", "*"}.isdisjoint(columns) and not is_messages(path)
        return by_name("log", "records" if in_records else "text")
    if path.is_dir():
        return by_name("log", "run" if (path / "run.npz").exists() else "bag")
    # Other formats use the endings of CARMEN logs, arrays and runs, too: the content decides.
    if named is not None and name not in ("CARMEN", "arrays", "run"):
        return named
    head = head_of(path, LONG_BEGINNING, "a log")
    if name in ("arrays", "run"):
        return by_name("log", "arrays" if name == "arrays" or is_foreign(path) else "run")
    return _format_by_looks(path, head, is_carmen=name == "CARMEN")


def _format_by_looks(path: Path, head: bytes, is_carmen: bool) -> Format:
    """The format of a log by its first bytes, and by whether it has the ending of a CARMEN log."""
    looks = by_looks(head)
    # Arrays are read only from files with their own endings.
    if looks is not None and looks[0].kind == "log" and looks[0].name != "arrays":
        return looks[0]
    name = ""
    if looks is None and b"\0" not in head:
        name = next((name for name, is_of in TEXTS.items() if is_of(head)), "text")
    if name in ("", "text") and is_carmen and not NUMBERS(head):
        name = "CARMEN"
    if name:
        return by_name("log", name)
    found = "no text" if looks is None else looks[1]
    known = ", ".join(endings("log"))
    raise InputError(f"{path}: not a log: it looks like {found}; expected text, or {known}")
