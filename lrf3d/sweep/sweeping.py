"""The sweep: all runs of a plan over a cluster, into a folder, and what they amount to.

Runs are sent in batches that take about as long as is worth sending.
"""

import time
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, Lrf3dError
from lrf3d.interrupts import noting
from lrf3d.progress import Progress, silent
from lrf3d.sweep.cluster import connected, hold
from lrf3d.sweep.plan import Cell, Plan, PlannedRun, digest
from lrf3d.sweep.store import TABLE, Store
from lrf3d.sweep.summary import summarise
from lrf3d.sweep.task import Row, carry_out, unpack

AHEAD = 3
"""Batches for each worker that are under way: one at work and some in line, so that none waits."""

FLUSH_SECONDS = 2.0
"""How often rows are written [s]: what a killed sweep loses at most."""

BATCH_SECONDS = 0.5
"""How long a batch should take [s]: a hundred times what sending it costs, and short enough that
little is lost with a worker or at the end."""

LARGEST_BATCH = 256
"""Runs of a batch at most."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Runs of one place that are sent together."""

    place: str
    runs: tuple[PlannedRun, ...]


class Batches:
    """Cuts runs into batches, by how long those before them took.

    Args:
        runs: The runs, in order.
        cells: The cells that they belong to.
        workers: How many workers share them.
    """

    def __init__(self, runs: Iterable[PlannedRun], cells: Sequence[Cell], *, workers: int) -> None:
        self._waiting = deque(runs)
        self._cells, self._workers = cells, workers
        self._pace: dict[object, float] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def take(self) -> Batch | None:
        """The next batch; None when there is none."""
        if not self._waiting:
            return None
        place = self._cells[self._waiting[0].cell].place
        # Towards the end batches get smaller, so that all workers end at about one time.
        most = min(LARGEST_BATCH, max(1, len(self._waiting) // (2 * self._workers)))
        runs: list[PlannedRun] = []
        seconds = 0.0
        while self._waiting and len(runs) < most and seconds < BATCH_SECONDS:
            if self._cells[self._waiting[0].cell].place != place:
                break
            runs.append(self._waiting.popleft())
            seconds += self._expected(runs[-1])
        return Batch(place, tuple(runs))

    def learn(self, batch: Batch, seconds: float) -> None:
        """Take in how long a batch took [s].

        Only the last counts: the first in a process also load what was compiled.
        """
        for name in {each for run in batch.runs for each in self._names(run)}:
            self._pace[name] = seconds / len(batch.runs)

    def _expected(self, run: PlannedRun) -> float:
        """How long a run will take [s]; a whole batch where nothing like it has been made."""
        return next((self._pace[n] for n in self._names(run) if n in self._pace), BATCH_SECONDS)

    def _names(self, run: PlannedRun) -> tuple[object, ...]:
        """What a run is like: its cell, or else its world and mode."""
        cell = self._cells[run.cell]
        return run.cell, (cell.world, cell.columns["mode"])


@dataclass(frozen=True)
class Sweep:
    """A sweep that is done.

    Args:
        plan: What was run.
        rows: The table, a row for each run.
        table: The file of the table.
        summary: The means with their confidence intervals, in JSON's types.
        resumed: Runs that had been made before.
        took: How long the others took [s].
    """

    plan: Plan
    rows: list[Row]
    table: Path
    summary: dict[str, Any]
    resumed: int
    took: float


def sweep(
    plan: Plan,
    folder: Path,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> Sweep:
    """Make all runs of a plan; what comes out does not depend on where, when or in what order.

    Args:
        plan: What to run.
        folder: Where rows are kept as they come, and where ``sweep.parquet`` is written.
        scheduler: Address of a Dask scheduler; processes on this machine where None.
        workers: Processes on this machine; one a core where None.
        resume: Go on with the runs that are in the folder.
        progress: Called with the runs that are done and all.

    Raises:
        InputError: The folder holds runs that are not to be gone on with, the scheduler cannot
            be used, or a run kills every worker that it is given to.
        OutputError: The folder cannot be written to.
    """
    begin = time.perf_counter()
    store = Store(folder, plan, resume=resume)
    with noting(lambda: f"{store.kept} of {len(plan.runs)} runs kept; go on with --resume"), store:
        resumed = len(store)
        missing = [run for run in plan.runs if run.order.key not in store]
        progress(resumed, len(plan.runs))
        if missing:
            with connected(scheduler, workers) as client:
                _work(client, plan, missing, store, progress)
        rows = store.finish()
    took = time.perf_counter() - begin
    return Sweep(plan, rows, folder / TABLE, summarise(plan, rows), resumed, took)


def _work(client: Any, plan: Plan, runs: list[Any], store: Store, progress: Progress) -> None:
    """Send batches, a few for each worker at a time, and keep what comes back."""
    from distributed import CancelledError, KilledWorker, as_completed

    count = sum(client.nthreads().values())
    batches = Batches(runs, plan.cells, workers=count)
    under_way: dict[str, Batch] = {}
    places: dict[str, Any] = {}

    def send(batch: Batch) -> Any:
        if batch.place not in places:
            packed = plan.places[batch.place].packed()
            places[batch.place] = hold(client, unpack, packed, key=f"lrf3d-place-{batch.place}")
        orders = [run.order for run in batch.runs]
        key = f"lrf3d-runs-{digest([order.key for order in orders])}"
        future = client.submit(carry_out, places[batch.place], orders, key=key)
        under_way[future.key] = batch
        return future

    first = [send(batch) for batch in iter(lambda: _next(batches, under_way, AHEAD * count), None)]
    flow, flushed = as_completed(first), time.monotonic()
    try:
        for future in flow:
            batch = under_way.pop(future.key)
            report = future.result()
            batches.learn(batch, report.seconds)
            store.add(report.rows)
            progress(len(store), len(plan.runs))
            if time.monotonic() > flushed + FLUSH_SECONDS:
                store.flush()
                flushed = time.monotonic()
                # Workers may have come or gone.
                count = max(1, sum(client.nthreads().values()))
            while (fresh := _next(batches, under_way, AHEAD * count)) is not None:
                flow.add(send(fresh))
    except KilledWorker as error:
        raise InputError(
            f"runs at {plan.cells[batch.runs[0].cell].world} end their workers, perhaps for want of"
            " memory; give them more, and go on with --resume"
        ) from error
    except CancelledError as error:
        raise Lrf3dError(
            "the connection to the scheduler is lost; go on with --resume when it is back"
        ) from error


def _next(batches: Batches, under_way: dict[str, Batch], most: int) -> Batch | None:
    """The next batch to send, unless enough are under way."""
    return batches.take() if len(under_way) < most else None
