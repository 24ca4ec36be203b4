"""Recording: a simulation is written to a run.npz scan by scan, and can be resumed.

Until ``run.npz`` is complete, ``run.journal`` stands next to it, with the scans so far (see
`journal`). To resume, the mapper is given them again, a millisecond each; the result is the same,
byte for byte, as without the interruption. However many scans there are, only a few megabytes of
them are in memory.
"""

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import InputError, OutputError
from lrf3d.files import check_ordinary, locked
from lrf3d.interrupts import check, noting, stoppable
from lrf3d.io.fingerprint import fingerprint_of
from lrf3d.io.journal import Journal, row_type
from lrf3d.io.npz import DAMAGES, Column, read_arrays, write_npz
from lrf3d.io.run_file import (
    estimate_columns,
    head_columns,
    load_run,
    map_columns,
    obstacle_columns,
)
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.mapping import LineMap
from lrf3d.pose import Pose
from lrf3d.progress import Progress, silent
from lrf3d.run import LIGHT, Run, SnapshotSchedule, run_bytes
from lrf3d.simulation import Simulation
from lrf3d.world.cameras import FilmPlan

JOURNAL = ".journal"
"""Ending of the auxiliary file that stands next to a run until it is complete."""


@stoppable()
def record(
    simulation: Simulation,
    path: str | Path,
    *,
    resume: bool = False,
    film: FilmPlan | None = None,
    progress: Progress = silent,
) -> Run:
    """Run a simulation into a file, in constant memory and safe from crashes.

    Args:
        simulation: The simulation, at its beginning.
        path: The file; its ending is ``.npz``.
        resume: Continue an interrupted run of the same simulation into this file, if there is one;
            otherwise it is discarded.
        film: How the run is filmed if nothing else is given, instead of the simulation's
            plan; it is kept beside the run.
        progress: Called with the number of scans that are done, and of all.

    Returns:
        The run, whose large arrays are mapped from the file.

    Raises:
        InputError: The number of scans is unknown, the file has another ending, the run to resume
            is a different one, or another process writes to the file.
        OutputError: The file cannot be written.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> simulation = lrf3d.Simulation(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> run = lrf3d.record(simulation, "run.npz")
        >>> len(run), len(lrf3d.load_run("run.npz"))
        (2, 2)
    """
    path = Path(path)
    if path.suffix != ".npz":
        raise InputError(f"{path}: expected a name that ends in .npz")
    _check_room(path, run_bytes(simulation.total, simulation.world, simulation.lrf))
    fingerprint = fingerprint_of(simulation)
    if film is not None:
        simulation.film = film
    with _writing(path):
        if not (resume and _finished(path, fingerprint)):
            _record(simulation, path, fingerprint, resume=resume, progress=progress)
        # A program that was stopped may have left it even beside a finished run.
        path.with_suffix(JOURNAL).unlink(missing_ok=True)
        return load_run(path)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Lock a run and its auxiliary file until it is complete."""
    with locked(path):
        for name in (path, path.with_suffix(JOURNAL)):
            # Files that cannot be replaced are found now, not after hours of work.
            if name.exists():
                check_ordinary(name, what="a file of an earlier run")
        yield


def _record(
    simulation: Simulation,
    path: Path,
    fingerprint: dict[str, str],
    *,
    resume: bool,
    progress: Progress,
) -> None:
    """Run a simulation, from the end of its journal if resumed, and write the finished run."""
    total, journal_path = simulation.total, path.with_suffix(JOURNAL)
    journal: Journal | None = None

    def kept() -> str:
        # If somebody has deleted the folder, nothing is kept.
        if journal is None or not journal_path.exists():
            return ""
        return f"{journal.kept()} of {total} scans kept; go on with --resume"

    with noting(kept):
        try:
            dtype = row_type(simulation.world, simulation.lrf)
            journal = Journal(journal_path, fingerprint, dtype, keep=resume)
            with _closed(journal):
                maps = _run(simulation, journal, progress)
                _write(simulation, journal, maps, path, json.dumps(fingerprint, sort_keys=True))
        except OSError as error:
            if isinstance(error, OutputError) or error.errno is None:
                raise
            reason = error.strerror or str(error)
            raise OutputError(
                f"{journal_path}: cannot be written: {reason}; make room or choose another place"
            ) from error


@contextmanager
def _closed(journal: Journal) -> Iterator[None]:
    """Close a journal at the end, with all rows that the disk has room for."""
    try:
        yield
    except BaseException:
        # An error of closing would replace the one that ended the run.
        with suppress(OSError):
            journal.close()
        raise
    journal.close()


def _run(simulation: Simulation, journal: Journal, progress: Progress) -> dict[int, LineMap]:
    """Run a simulation to its end, from the end of its journal; returns the map snapshots."""
    schedule, maps = SnapshotSchedule(simulation.total), dict[int, LineMap]()

    def keep_map(index: int) -> None:
        if schedule.holds(index) and isinstance(line_map := simulation.map, LineMap):
            maps[index] = line_map

    rng = simulation.rng
    for rows in journal.blocks():
        for row in rows:
            simulation.take(_scan_of(row, simulation.lrf))
            keep_map(simulation.done - 1)
            check()
        rng.bit_generator.state = json.loads(rows["rng"][-1])
    for step in simulation:
        journal.add(step, rng)
        keep_map(step.index)
        progress(step.index + 1, simulation.total)
        check()
    # A controller may end before all scans are done.
    last = journal.scans - 1
    if last not in maps and isinstance(line_map := simulation.map, LineMap):
        maps[last] = line_map
    return maps


def _scan_of(row: Any, lrf: LaserRangeFinder) -> LaserScan:
    """The measured scan in a row of a journal."""
    names = row.dtype.names
    ranges = row["ranges"].copy()
    # The journal holds the walls of the true scan; a measured beam without return has none.
    walls = np.where(np.isfinite(ranges), row["walls"], -1)
    light = [row[name].copy() for name in LIGHT if name in names]
    scan = LaserScan.unchecked(lrf, Pose(*row["poses"].tolist()), ranges, walls, *light)
    return scan.at_time(float(row["times"]))


def _write(
    simulation: Simulation,
    journal: Journal,
    maps: Mapping[int, LineMap],
    path: Path,
    fingerprint: str,
) -> None:
    """Write the finished run, some rows of a column at a time."""

    def blocks(name: str) -> Iterator[NDArray[Any]]:
        return (rows[name] for rows in journal.blocks())

    columns = []
    for name in journal.columns:
        dtype, shape = journal.dtype[name].base, journal.dtype[name].shape
        columns.append(Column(name, (journal.scans, *shape), dtype, blocks(name)))
    write_npz(
        path,
        [
            *head_columns(simulation.world, simulation.lrf, simulation.film),
            *obstacle_columns(simulation.obstacles),
            *columns,
            *map_columns(maps, list(maps.values())),
            *estimate_columns(simulation.estimate),
            Column.of("origin", np.array(fingerprint)),
        ],
    )


def _check_room(path: Path, size: int) -> None:
    """Check that the disk has room for a file.

    Raises:
        OutputError: It has not.
    """
    try:
        free = shutil.disk_usage(path.parent).free
    except OSError:
        # A missing folder is reported when the file is made.
        return
    if size > free:
        raise OutputError(
            f"{path}: would take {1e-9 * size:,.1f} GB, {1e-9 * free:,.1f} GB are free; take fewer"
            " scans or beams, or choose another place"
        )


def _finished(path: Path, fingerprint: Mapping[str, str]) -> bool:
    """Whether a file is the finished run."""
    if not path.exists():
        return False
    try:
        return str(read_arrays(path)["origin"]) == json.dumps(fingerprint, sort_keys=True)
    except (*DAMAGES, KeyError):
        return False
