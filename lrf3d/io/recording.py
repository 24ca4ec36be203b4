"""Recording: a simulation is written to a run.npz scan by scan, and can be resumed.

Until ``run.npz`` is complete, two other files stand beside it: ``run.journal``, with the scans so
far (see `journal`), and ``run.checkpoint``, with the state of the mapper after some of them. To
resume, the mapper is given the scans since the checkpoint again, or all of them if it has none; the
result is the same, byte for byte, as without the interruption. However many scans there are, only a
few megabytes of them are in memory.
"""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lrf3d.errors import InputError, OutputError
from lrf3d.input import check_ordinary
from lrf3d.interrupts import noting
from lrf3d.io.journal import COLUMNS, Array, Journal, column_shape, fingerprint_of, read_fingerprint
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
from lrf3d.run import Run, SnapshotSchedule, run_bytes
from lrf3d.steering import ControlledDrive
from lrf3d.world.cameras import FilmPlan

if TYPE_CHECKING:
    from lrf3d.simulation import Simulation, Step

CHUNK_BYTES = 1 << 22
"""Approximate size of the scans that are in memory before they are written [bytes]."""

CHECKPOINT_SCANS = 1 << 14
"""Scans from one checkpoint to the next: mapping them again takes some seconds."""


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
    if film is not None:
        simulation.film = film
    if path.suffix != ".npz":
        raise InputError(f"{path}: expected a name that ends in .npz")
    total = simulation.total
    _check_room(path, run_bytes(total, simulation.lrf.beams))
    fingerprint = fingerprint_of(simulation)
    with _writing(path):
        return _record(simulation, path, total, fingerprint, resume, progress)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Lock a run and its auxiliary files until it is complete."""
    with locked(lock_of(path), path):
        for name in (path, path.with_suffix(".journal"), path.with_suffix(".checkpoint")):
            # Files that cannot be replaced are found now, not after hours of work.
            if name.exists():
                check_ordinary(name, what="a file of an earlier run")
        yield


def _record(
    simulation: "Simulation",
    path: Path,
    total: int,
    fingerprint: dict[str, str],
    resume: bool,
    progress: Progress,
) -> Run:
    journal_path, checkpoint = path.with_suffix(".journal"), path.with_suffix(".checkpoint")
    if resume and _finished(path, fingerprint):
        # It may have been stopped before these were removed.
        return _tidied(path, journal_path, checkpoint)
    if resume:
        _check_same(journal_path, fingerprint)
    try:
        journal = Journal(journal_path, fingerprint, simulation.lrf.beams, keep=resume)
        kept = noting(lambda: f"{journal.scans} of {total} scans kept; go on with --resume")
        with kept, closing(journal):
            recorder = _Recorder(simulation, journal, checkpoint, SnapshotSchedule(total))
            if resume:
                recorder.catch_up()
            else:
                checkpoint.unlink(missing_ok=True)
            recorder.run(lambda done: progress(done, total))
            recorder.write(path, json.dumps(fingerprint, sort_keys=True))
    except OSError as error:
        if isinstance(error, OutputError) or error.errno is None:
            raise
        reason = error.strerror or str(error)
        raise OutputError(
            f"{journal_path}: cannot be written: {reason}; make room or choose another place"
        ) from error
    return _tidied(path, journal_path, checkpoint)


def _tidied(path: Path, *beside: Path) -> Run:
    """Remove the auxiliary files, and load the finished run."""
    for each in beside:
        each.unlink(missing_ok=True)
    return load_run(path)


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


class _Recorder:
    """Collects scans and writes them in chunks."""

    def __init__(
        self,
        simulation: "Simulation",
        journal: Journal,
        checkpoint: Path,
        schedule: SnapshotSchedule,
    ) -> None:
        self.simulation, self.journal, self.checkpoint = simulation, journal, checkpoint
        self.schedule = schedule
        beams = simulation.lrf.beams
        scans = max(1, CHUNK_BYTES // (8 * (4 + 3 * beams)))
        scans = min(scans, schedule.scans)
        self._columns: dict[str, Array] = {
            name: np.empty(column_shape(name, scans, beams), dtype)
            for name, (dtype, _) in COLUMNS.items()
        }
        self._room = scans
        # First scan not yet written, their number, and the state of the random numbers after the
        # last one: assigned together, so that they are consistent at an interrupt.
        self._waiting: tuple[int, int, dict[str, Any]] = 0, 0, {}
        self._maps: dict[int, LineMap] = {}
        self._checked = 0

    def run(self, progress: Callable[[int], None]) -> None:
        """Run to the end; scans before an interrupt are written."""
        try:
            for step in self.simulation:
                self._add(step)
                progress(step.index + 1)
        except (Exception, KeyboardInterrupt):
            # After a collision or an error of the user's code the scans before it are kept.
            self._flush()
            raise
        self._flush()

    def catch_up(self) -> None:
        """Bring the simulation to the end of the journal."""
        simulation, journal = self.simulation, self.journal
        if not journal.chunks:
            return
        self._checked = self._restore_mapper()
        steered = isinstance(simulation.drive, ControlledDrive)
        # A trajectory does not depend on scans, so those before the checkpoint are skipped.
        simulation.done = 0 if steered else self._checked
        columns = [journal.column(name, first=simulation.done) for name in COLUMNS]
        for times, poses, ranges, _, walls in zip(*columns, strict=True):
            first = self._first_of(simulation.done)
            walls = np.where(np.isfinite(ranges), walls, -1)
            for row in range(simulation.done - first, len(times)):
                scan = LaserScan.unchecked(
                    simulation.lrf, Pose(*poses[row].tolist()), ranges[row].copy(), walls[row]
                ).at_time(float(times[row]))
                simulation.take(scan, mapped=simulation.done < self._checked)
        simulation.rng.bit_generator.state = journal.chunks[-1].rng
        self._waiting = journal.scans, 0, {}

    def write(self, path: Path, fingerprint: str) -> None:
        """Write the finished run, chunk by chunk."""
        journal, simulation = self.journal, self.simulation
        scans, beams = journal.scans, simulation.lrf.beams
        maps: dict[int, LineMap] = {}
        for chunk in journal.chunks:
            maps.update(chunk.snapshots)
        # A controller may end before all scans are done.
        if scans - 1 not in maps and isinstance(line_map := simulation.map, LineMap):
            maps[scans - 1] = line_map
        columns = [
            Column(name, column_shape(name, scans, beams), dtype, journal.column(name))
            for name, (dtype, _) in COLUMNS.items()
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

    def _first_of(self, scan: int) -> int:
        """First scan of the chunk that holds a scan."""
        return next(c.first for c in self.journal.chunks if scan < c.first + c.scans)

    def _add(self, step: "Step") -> None:
        first, row, _ = self._waiting
        columns = self._columns
        columns["times"][row], columns["poses"][row] = step.time, step.pose
        columns["ranges"][row], columns["truth"][row] = step.scan.ranges, step.true_scan.ranges
        columns["walls"][row] = step.true_scan.walls
        if self.schedule.holds(step.index) and isinstance(line_map := step.map, LineMap):
            self._maps[step.index] = line_map
        self._waiting = first, row + 1, dict(self.simulation.rng.bit_generator.state)
        if row + 1 == self._room:
            self._flush()
            if self.journal.scans - self._checked >= CHECKPOINT_SCANS:
                self._keep_mapper()

    def _flush(self) -> None:
        first, count, rng = self._waiting
        # An interrupt may come when they are in the journal already, and then flushes once more.
        if count and self.journal.scans == first:
            columns = {name: column[:count] for name, column in self._columns.items()}
            maps = {scan: kept for scan, kept in self._maps.items() if scan < first + count}
            self.journal.add(columns, rng, maps)
        self._waiting, self._maps = (self.journal.scans, 0, {}), {}

    def _keep_mapper(self) -> None:
        """Write the state of the mapper, if it can return one."""
        state = getattr(self.simulation.mapper, "state", None)
        if not callable(state):
            return
        self._checked = self.journal.scans
        arrays = {f"mapper_{name}": np.asarray(value) for name, value in state().items()}
        arrays["scans"] = np.array(self._checked)
        arrays["journal"] = np.array(self._name())
        write_npz(self.checkpoint, [Column.of(name, array) for name, array in arrays.items()])

    def _restore_mapper(self) -> int:
        """Give the mapper what it had learnt; gives how many scans it knows then."""
        mapper: Any = self.simulation.mapper
        if not callable(getattr(mapper, "restore", None)):
            return 0
        try:
            arrays = read_arrays(self.checkpoint)
            scans = int(arrays.pop("scans"))
            if scans > self.journal.scans or str(arrays.pop("journal")) != self._name():
                return 0
        except (*DAMAGES, KeyError):
            # Without it, all scans are mapped again.
            return 0
        mapper.restore({name.removeprefix("mapper_"): value for name, value in arrays.items()})
        return scans

    def _name(self) -> str:
        """The fingerprint by which a checkpoint identifies its journal."""
        with self.journal.path.open("rb") as file:
            return json.dumps(read_fingerprint(file), sort_keys=True)


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
