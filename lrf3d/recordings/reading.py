"""Reading logs: the name of a file or a folder, or else its content, selects the reader."""

import re
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from lrf3d.base.errors import InputError, shown
from lrf3d.base.files import as_path, opened, own_name
from lrf3d.base.interrupts import reading
from lrf3d.geometry.lines import number
from lrf3d.recordings.formats.arrays import RECORDS, array_table, is_foreign, record_table
from lrf3d.recordings.formats.bags.files import FILES, MCAP, OLD, SQLITE, ZSTD
from lrf3d.recordings.formats.carmen import WORDS, load_carmen
from lrf3d.recordings.formats.text.layout import described
from lrf3d.recordings.formats.text.text_log import add_partner, text_table
from lrf3d.recordings.log import GZIPPED, Intake, LaserLog
from lrf3d.world import world_names

# Endings of CARMEN logs; the last two are what the University of Freiburg calls them.
CARMEN_ENDINGS = (".log", ".log.gz", ".clf", ".clf.gz")

# What files look like that are no text of a log, by their first bytes.
LOOKS = {
    b"PK": "arrays of NumPy or a zip: name it .npz", b"\x93NUMPY": "an array: name it .npy",
    b"\xff\xfe": "text in UTF-16: save it as UTF-8",
    b"MATLAB 5": "a .mat file: name it .mat", b"ply": "a point cloud without scans",
    b"LASF": "a point cloud without scans", b"# .PCD": "a point cloud without scans",
    b"\x89PNG": "a picture", b"<": "XML", b"%PDF": "a document",
}  # fmt: skip

# Endings of files of arrays.
ARRAYS = (".npz", ".npy", ".mat")

# Bytes at the beginning of a file that say what it is.
HEAD = 1 << 16


def is_run(name: str) -> bool:
    """Whether a name is that of a run, a ``.npz`` or a folder, and not of a world.

    A built-in world comes before a folder of the same name, as everywhere.
    """
    if name in world_names():
        return False
    return Path(name).is_dir() or Path(name).suffix.lower() == ".npz"


def odometry_of(path: str | Path) -> str:
    """The source of poses for SLAM: a bag may know the truth, others keep the odometry apart."""
    is_bag = as_path(path).is_dir() or str(path).lower().endswith((*FILES, ".npz"))
    return "odom" if is_bag else "auto"


@reading()
def load_log(
    path: str | Path,
    *,
    largest_range: float | None = None,
    poses: str = "auto",
    scan_topic: str | None = None,
    part: int | None = None,
    format: str | None = None,
    without_repairs: Sequence[str] = (),
) -> LaserLog:
    """Read the scans of a log; the ending of its name gives the format.

    Args:
        path: A CARMEN log or a text of a scan a line, gzipped or not; a ROS bag, as .mcap, .db3,
            .bag or a folder; a .npz or .mat file of arrays; or a run.npz or its folder.
        largest_range: Least reading that means no return [m]; if not given, that of the range
            finder, or the largest reading where it stands out.
        poses: Source of the poses: ``auto`` for the best that the format has, or ``truth``, ``tf``
            or ``odom``.
        scan_topic: Bags: the topic of the scans; if not given, those of all lasers of the robot
            of ``/scan``, or of the first one.
        format: Text: its columns; found if not given. Arrays: units and bearings.
        part: Bags whose stamps go back: the part that is read, from 1; the longest if not given.
        without_repairs: With ``no_return`` the largest and smallest readings are kept as they are.

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
    sources = ("auto", "truth", "tf", "odom")  # Where the poses of a log may come from.
    if not isinstance(poses, str) or poses not in sources:
        raise InputError(f"poses from {shown(poses)}: expected one of {', '.join(sources)}")
    in_columns = format and not path.name.lower().endswith(ARRAYS)
    intake = Intake(path, largest_range, without_repairs)
    kind = "text" if in_columns else _kind(path)
    if kind != "bag" and (scan_topic or part):
        name = "scan topic" if scan_topic else "part"
        raise InputError(f"{path}: no bag, so that there is no {name} to choose")
    if kind == "CARMEN":
        return load_carmen(intake, poses)
    if kind == "run":
        from lrf3d.recordings.formats.run_file import load_run

        if poses not in ("auto", "truth"):
            raise InputError(
                f"{path}: no poses from {poses} in it; a run has only true poses (--poses truth);"
                " for SLAM write its log: lrf3d export RUN --to carmen"
            )
        run = load_run(path)
        # Another name than the run's, so that its map does not replace that of the run.
        name = own_name(path.resolve().parent if path.name == "run.npz" else path)
        return LaserLog(f"{name}_map", list(run.scans), source="the run")
    if kind == "bag":
        from lrf3d.recordings.formats.bags.reader import load_bag

        return load_bag(intake, poses=poses, scan_topic=scan_topic, part=part)
    if poses not in ("auto", "odom"):
        raise InputError(f"{path}: no poses from {poses} in it; there are auto, odom")
    if kind == "arrays":
        table = array_table(intake)
        if format:
            described(format, []).settle(table)
        return table.log()
    table = record_table(intake) if kind == "records" else text_table(intake, format)
    add_partner(table)
    return table.log()


def _kind(path: Path) -> str:
    """The kind of a log, by its name, or else by what it looks like."""
    ending = path.name.lower()
    if (path / "run.npz").exists():
        return "run"
    if ending.endswith(FILES) or path.is_dir():
        return "bag"
    with opened(path, what="a log") as file:
        head = file.read(HEAD)
    if ending.endswith(ARRAYS):
        return "run" if ending.endswith(".npz") and not is_foreign(path) else "arrays"
    if head.startswith((MCAP, SQLITE, OLD, ZSTD)):
        return "bag"
    if head.startswith(GZIPPED):
        # What a packed file begins with is enough.
        with suppress(zlib.error):
            head = zlib.decompressobj(31).decompress(head, HEAD)
    is_text = b"\0" not in head and not head.startswith(tuple(LOOKS))
    if is_text and re.search(WORDS, head):
        return "CARMEN"
    if is_text and RECORDS(head):
        return "records"
    if ending.endswith(CARMEN_ENDINGS) and not re.search(rb"(?m)^\s*[-+.\d]+[\s,;]", head):
        return "CARMEN"
    if is_text:
        return "text"
    looks = next((what for magic, what in LOOKS.items() if head.startswith(magic)), "no text")
    known = ", ".join((*CARMEN_ENDINGS, *FILES, *ARRAYS))
    raise InputError(f"{path}: not a log: it looks like {looks}; expected text, or {known}")
