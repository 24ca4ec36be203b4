"""The sweep: all runs of a plan on a cluster, their results in a folder, and the summary.

Runs are sent in batches, so that sending them takes a small share of the time.
"""

import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, Lrf3dError
from lrf3d.interrupts import check, noting, stoppable
from lrf3d.progress import Progress, silent
from lrf3d.sweep.cluster import connected, hold
from lrf3d.sweep.plan import Cell, Plan, PlannedRun, digest
from lrf3d.sweep.store import TABLE, Store
from lrf3d.sweep.summary import summarise
from lrf3d.sweep.task import Row, carry_out, unpack

AHEAD = 3
"""Batches sent for each worker: one in progress and some queued, so that no worker waits."""

POLL_SECONDS = 0.02
"""Interval of looking for results [s]: far shorter than a batch."""

FLUSH_SECONDS = 2.0
"""Interval between writing rows [s]: the most that a killed sweep loses."""

BATCH_SECONDS = 0.5
"""Target duration of a batch [s]: a hundred times that of sending it, and short enough that little
is lost with a worker or at the end."""

LARGEST_BATCH = 256
"""Largest number of runs in a batch."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Runs of one place that are sent together."""

    place: str
    runs: tuple[PlannedRun, ...]


class Batches:
    """Divides runs into batches, by the durations of earlier ones.

    Args:
        runs: The runs, in order.
        cells: The cells that they belong to.
        workers: Number of workers.
    """

    def __init__(self, runs: Iterable[PlannedRun], cells: Sequence[Cell], *, workers: int) -> None:
        self._waiting = deque(runs)
        self._cells, self._workers = cells, workers
        self._pace: dict[object, float] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def take(self) -> Batch | None:
        """The next batch; None at the end."""
        if not self._waiting:
            return None
        place = self._cells[self._waiting[0].cell].place
        # Towards the end batches get smaller, so that all workers finish at about the same time.
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
        """Record the duration of a batch [s].

        Only the latest one counts: the first ones in a process also load compiled code.
        """
        for name in {each for run in batch.runs for each in self._similar(run)}:
            self._pace[name] = seconds / len(batch.runs)

    def _expected(self, run: PlannedRun) -> float:
        """Expected duration of a run [s]; that of a batch if there was no similar run."""
        return next((self._pace[n] for n in self._similar(run) if n in self._pace), BATCH_SECONDS)

    def _similar(self, run: PlannedRun) -> tuple[object, ...]:
        """Keys of similar runs: the same cell, or else the same world and mode."""
        cell = self._cells[run.cell]
        return run.cell, (cell.world, cell.columns["mode"])


@dataclass(frozen=True)
class Sweep:
    """A finished sweep.

    Args:
        plan: The plan.
        rows: The table, a row for each run.
        table: The file of the table.
        summary: The means with their confidence intervals, in JSON's types.
        resumed: Number of runs that were stored before.
        took: Duration of the others [s].
    """

    plan: Plan
    rows: list[Row]
    table: Path
    summary: dict[str, Any]
    resumed: int
    took: float


@stoppable()
def sweep(
    plan: Plan,
    folder: Path,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> Sweep:
    """Make all runs of a plan; the results do not depend on where, when or in what order.

    Args:
        plan: The plan.
        folder: The folder for the rows and for ``sweep.parquet``.
        scheduler: Address of a Dask scheduler; None for processes on this machine.
        workers: Number of processes on this machine; None for one for each core.
        resume: Continue with the runs that are in the folder.
        progress: Called with the number of finished runs, and of all.

    Raises:
        InputError: The folder holds other runs, the scheduler cannot be used, or a run kills every
            worker that it is sent to.
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
    """Send batches, a few for each worker at a time, and store their results."""
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
    futures, flushed = as_completed(first), time.monotonic()
    try:
        for future in _finished(futures):
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
                futures.add(send(fresh))
    except KilledWorker as error:
        raise InputError(
            f"runs at {plan.cells[batch.runs[0].cell].world} end their workers, perhaps for want of"
            " memory; give them more, and go on with --resume"
        ) from error
    except CancelledError as error:
        raise Lrf3dError(
            "the connection to the scheduler is lost; go on with --resume when it is back"
        ) from error


def _finished(futures: Any) -> Iterator[Any]:
    """The futures as they finish; a signal does not end the wait of distributed itself."""
    while not futures.is_empty():
        yield from futures.next_batch(block=False)
        check()
        time.sleep(POLL_SECONDS)


def _next(batches: Batches, under_way: dict[str, Batch], most: int) -> Batch | None:
    """The next batch to send, unless enough are under way."""
    return batches.take() if len(under_way) < most else None
