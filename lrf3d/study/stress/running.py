"""Running the cases: shared over processes, repeatable, and within a time."""

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from itertools import islice
from time import perf_counter

import numpy as np

from lrf3d.cores import core_count
from lrf3d.study.stress.casting import CASTING
from lrf3d.study.stress.report import Report
from lrf3d.study.stress.tally import Tally

CASES = CASTING
"""All cases of all parts, in the order of the table."""

TASK = 5_000
"""Beams that a process tries at a time: 0.1 s, so that a stop comes soon and after each case."""


@dataclass(frozen=True, slots=True)
class Task:
    """Some beams of one case.

    Args:
        case: Index of the case.
        beams: How many beams to try.
        outright: How many of them rationals shall decide anyway.
        seed: Seeds of the random numbers: those of the run, the case, and the task.
    """

    case: int
    beams: int
    outright: int
    seed: tuple[int, int, int]


def stress(
    beams: int,
    *,
    rationals: int = 0,
    seconds: float = float("inf"),
    seed: int = 0,
    processes: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Report:
    """Try all cases, each with the same number of beams.

    Args:
        beams: Beams to try in all, at least.
        rationals: How many of them rationals shall decide whatever error bounds say.
        seconds: Time after which no more are begun [s].
        seed: The same seed gives the same beams.
        processes: How many share the work; one a core where not given, fewer for few beams.
        progress: Called with the beams done and the beams in all.
    """
    begin = perf_counter()
    tasks = _tasks(beams, rationals, seed)
    total = sum(task.beams for task in tasks)
    tallies = [Tally() for _ in CASES]
    finished = 0
    if processes is None:
        # A process takes longer to start than to try the beams of a task.
        processes = min(core_count(), max(1, total // TASK))
    for task, tally in _done(tasks, processes, begin + seconds):
        tallies[task.case] += tally
        finished += 1
        progress(min(total, sum(one.tried for one in tallies)), total)
    return Report(
        list(zip(CASES, tallies, strict=True)),
        asked=beams,
        seed=seed,
        seconds=perf_counter() - begin,
        complete=finished == len(tasks),
    )


def perform(task: Task) -> Tally:
    """Try the beams of a task."""
    return CASES[task.case].attempt(np.random.default_rng(task.seed), task.beams, task.outright)


def _tasks(beams: int, rationals: int, seed: int) -> list[Task]:
    """Tasks of about equal size, case after case, so that a stop leaves no case untried."""
    each = -(-beams // len(CASES))
    rounds = -(-each // TASK)
    size = -(-each // rounds)
    outright = -(-rationals // (rounds * len(CASES)))
    return [
        Task(case, size, min(size, outright), (seed, case, number))
        for number in range(rounds)
        for case in range(len(CASES))
    ]


def _done(tasks: list[Task], processes: int, end: float) -> Iterator[tuple[Task, Tally]]:
    """The tasks with their tallies, as they finish; none is begun after the end."""
    if processes == 1:
        for task in tasks:
            if perf_counter() > end:
                return
            yield task, perform(task)
        return
    # Forked processes could inherit a lock that a thread of Embree or numba holds just then.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context, initializer=_quiet) as pool:
        waiting = iter(tasks)
        running = {pool.submit(perform, task): task for task in islice(waiting, 2 * processes)}
        try:
            while running:
                done, _ = wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
                late = perf_counter() > end
                for future in done:
                    yield running.pop(future), future.result()
                    if not late:
                        for task in islice(waiting, 1):
                            running[pool.submit(perform, task)] = task
                if late:
                    for future in [one for one in running if one.cancel()]:
                        del running[future]
        finally:
            pool.shutdown(cancel_futures=True)


def _quiet() -> None:
    """Leave an interrupt to the process that all others work for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
