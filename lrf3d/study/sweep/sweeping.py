"""The sweep: all runs of a plan over a cluster, into a folder, and what they amount to."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lrf3d.cluster.connection import connected
from lrf3d.cluster.holding import hold
from lrf3d.errors import InputError, Lrf3dError
from lrf3d.interrupts import noting
from lrf3d.study.sweep.batches import Batch, Batches
from lrf3d.study.sweep.content import digest
from lrf3d.study.sweep.plan import Plan
from lrf3d.study.sweep.store import TABLE, Store
from lrf3d.study.sweep.summary import summarise
from lrf3d.study.sweep.task import Row, carry_out, unpack

Progress = Callable[[int, int], None]

AHEAD = 3
"""Batches for each worker that are under way: one at work and some in line, so that none waits."""

FLUSH_SECONDS = 2.0
"""How often rows are written [s]: what a killed sweep loses at most."""


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
    progress: Progress = lambda done, total: None,
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
            f"runs at {plan.cells[batch.runs[0].cell].world} kill the workers that they are given"
            " to; give these more memory, and go on with --resume"
        ) from error
    except CancelledError as error:
        raise Lrf3dError(
            "the connection to the scheduler is lost; go on with --resume when it is back"
        ) from error


def _next(batches: Batches, under_way: dict[str, Batch], most: int) -> Batch | None:
    """The next batch to send, unless enough are under way."""
    return batches.take() if len(under_way) < most else None
