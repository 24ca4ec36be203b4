"""Recording: a simulation is written to a run.npz scan by scan, and can be resumed.

Until ``run.npz`` is complete, ``run.journal`` stands beside it, with the scans so far (see
`journal`). To resume, the mapper is given them again, a millisecond each; the result is the same,
byte for byte, as without the interruption. However many scans there are, only a few megabytes of
them are in memory.
"""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lrf3d.errors import InputError, OutputError
from lrf3d.input import check_ordinary
from lrf3d.interrupts import check, noting, stoppable
from lrf3d.io.journal import Array, Journal, columns_of, fingerprint_of, read_fingerprint
from lrf3d.io.npz import DAMAGES, Column, read_arrays, write_npz
from lrf3d.io.run_file import (
    estimate_columns,
    head_columns,
    load_run,
    map_columns,
    obstacle_columns,
)
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap
from lrf3d.output import lock_of, locked
from lrf3d.pose import Pose
from lrf3d.progress import Progress, silent
from lrf3d.run import LIGHT, Run, SnapshotSchedule, keep_light, run_bytes
from lrf3d.world.cameras import FilmPlan

if TYPE_CHECKING:
    from lrf3d.simulation import Simulation, Step

CHUNK_BYTES = 1 << 22
"""Approximate size of the scans that are in memory before they are written [bytes]."""

JOURNAL = ".journal"
"""Ending of the auxiliary file that stands beside a run until it is complete."""


@stoppable()
def record(
    simulation: "Simulation",
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
    with locked(lock_of(path), path):
        for name in (path, path.with_suffix(JOURNAL)):
            # Files that cannot be replaced are found now, not after hours of work.
            if name.exists():
                check_ordinary(name, what="a file of an earlier run")
        yield


def _record(
    simulation: "Simulation",
    path: Path,
    fingerprint: dict[str, str],
    *,
    resume: bool,
    progress: Progress,
) -> None:
    """Run a simulation, from the end of its journal if resumed, and write the finished run."""
    total, journal_path = simulation.total, path.with_suffix(JOURNAL)
    if resume:
        _check_same(journal_path, fingerprint)
    journal: Journal | None = None

    def kept() -> str:
        # If somebody has deleted the folder, nothing is kept.
        if journal is None or not journal_path.exists():
            return ""
        return f"{journal.scans} of {total} scans kept; go on with --resume"

    with noting(kept):
        try:
            columns = columns_of(simulation.world, simulation.lrf)
            journal = Journal(journal_path, fingerprint, columns, keep=resume)
            with closing(journal):
                recorder = _Recorder(simulation, journal, SnapshotSchedule(total))
                if resume:
                    recorder.catch_up()
                recorder.run(lambda done: progress(done, total))
                recorder.write(path, json.dumps(fingerprint, sort_keys=True))
        except OSError as error:
            if isinstance(error, OutputError) or error.errno is None:
                raise
            reason = error.strerror or str(error)
            raise OutputError(
                f"{journal_path}: cannot be written: {reason}; make room or choose another place"
            ) from error


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


class _Unwritten(NamedTuple):
    """The scans that are not yet in the journal.

    It is replaced as a whole, so that it is consistent whenever an interrupt comes.

    Attributes:
        first: Number of the first of them.
        scans: How many there are.
        rng: State of the random numbers after the last one.
    """

    first: int
    scans: int
    rng: dict[str, Any]


class _Recorder:
    """Writes the scans of a simulation to its journal in chunks, and then the finished run.

    `catch_up`, if the run is resumed, `run` and `write` are called once each, in this order.

    Args:
        simulation: The simulation.
        journal: The journal of its run.
        schedule: The scans after which the map is kept.
    """

    def __init__(
        self,
        simulation: "Simulation",
        journal: Journal,
        schedule: SnapshotSchedule,
    ) -> None:
        self.simulation, self.journal, self.schedule = simulation, journal, schedule
        size = run_bytes(1, simulation.world, simulation.lrf)
        self._room = min(max(1, CHUNK_BYTES // size), schedule.scans)
        self._columns: dict[str, Array] = {
            name: np.empty((self._room, *part), dtype)
            for name, (dtype, part) in journal.columns.items()
        }
        self._light = {name: rows for name, rows in self._columns.items() if name in LIGHT}
        self._unwritten = _Unwritten(0, 0, {})
        self._maps: dict[int, LineMap] = {}

    def run(self, progress: Callable[[int], None]) -> None:
        """Run to the end; scans before an interrupt are written."""
        try:
            for step in self.simulation:
                self._add(step)
                progress(step.index + 1)
                check()
        except (Exception, KeyboardInterrupt):
            # After a collision or an error of the user's code the scans before it are kept.
            self._flush()
            raise
        self._flush()

    def catch_up(self) -> None:
        """Bring the simulation to the end of the journal."""
        simulation, journal = self.simulation, self.journal
        if journal.chunks:
            for scan in self._recorded_scans():
                simulation.take(scan)
            simulation.rng.bit_generator.state = journal.chunks[-1].rng
            self._unwritten = _Unwritten(journal.scans, 0, {})

    def _recorded_scans(self) -> Iterator[LaserScan]:
        """The scans in the journal."""
        lrf, journal = self.simulation.lrf, self.journal
        columns = zip(*(journal.column(name) for name in journal.columns), strict=True)
        for times, poses, ranges, _, walls, *light in columns:
            # The journal holds the walls of the true scan; a measured beam without return has none.
            walls = np.where(np.isfinite(ranges), walls, -1)
            for row in range(len(times)):
                pose = Pose(*poses[row].tolist())
                lit = [values[row].copy() for values in light]
                scan = LaserScan.unchecked(lrf, pose, ranges[row].copy(), walls[row], *lit)
                yield scan.at_time(float(times[row]))

    def write(self, path: Path, fingerprint: str) -> None:
        """Write the finished run, chunk by chunk."""
        journal, simulation = self.journal, self.simulation
        scans = journal.scans
        maps: dict[int, LineMap] = {}
        for chunk in journal.chunks:
            maps.update(chunk.snapshots)
        # A controller may end before all scans are done.
        if scans - 1 not in maps and isinstance(line_map := simulation.map, LineMap):
            maps[scans - 1] = line_map
        columns = [
            Column(name, (scans, *part), dtype, journal.column(name))
            for name, (dtype, part) in journal.columns.items()
        ]
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

    def _add(self, step: "Step") -> None:
        first, row, _ = self._unwritten
        columns = self._columns
        columns["times"][row], columns["poses"][row] = step.time, step.pose
        columns["ranges"][row], columns["truth"][row] = step.scan.ranges, step.true_scan.ranges
        columns["walls"][row] = step.true_scan.walls
        keep_light(self._light, row, step.scan)
        if self.schedule.holds(step.index) and isinstance(line_map := step.map, LineMap):
            self._maps[step.index] = line_map
        rng = dict(self.simulation.rng.bit_generator.state)
        self._unwritten = _Unwritten(first, row + 1, rng)
        if row + 1 == self._room:
            self._flush()

    def _flush(self) -> None:
        first, count, rng = self._unwritten
        # If an interrupt comes when they are in the journal already, this is called once more.
        if count and self.journal.scans == first:
            columns = {name: column[:count] for name, column in self._columns.items()}
            maps = {scan: kept for scan, kept in self._maps.items() if scan < first + count}
            self.journal.add(columns, rng, maps)
        self._unwritten, self._maps = _Unwritten(self.journal.scans, 0, {}), {}


def _finished(path: Path, fingerprint: Mapping[str, str]) -> bool:
    """Whether a file is the finished run."""
    if not path.exists():
        return False
    try:
        return str(read_arrays(path)["origin"]) == json.dumps(fingerprint, sort_keys=True)
    except (*DAMAGES, KeyError):
        return False


def _check_same(path: Path, fingerprint: Mapping[str, str]) -> None:
    """Check that a journal, if there is one, belongs to this run."""
    if not path.exists():
        return
    with path.open("rb") as file:
        other = read_fingerprint(file)
    if other is not None and other != fingerprint:
        parts = sorted(
            name for name in {*fingerprint, *other} if fingerprint.get(name) != other.get(name)
        )
        raise InputError(
            f"{path}: of another run, whose {', '.join(parts)} differ; give the same settings, or"
            " leave out --resume to begin anew"
        )
