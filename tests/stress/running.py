"""Running the cases: shared over processes, repeatable, and within a time."""

from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass
from itertools import islice
from time import perf_counter

import numpy as np

from lrf3d.cores import core_count, process_pool
from lrf3d.progress import Progress, silent
from stress.angles import ANGLES
from stress.cases import Case, Findings, Report
from stress.casting import CASTING
from stress.drives import DRIVES
from stress.estimates import ESTIMATES
from stress.extremes import EXTREMES
from stress.fits import FITS
from stress.frames import FRAMES
from stress.light import LIGHT

CASES: tuple[Case, ...] = (
    *CASTING,
    *LIGHT,
    *FITS,
    *ANGLES,
    *DRIVES,
    *ESTIMATES,
    *EXTREMES,
    *FRAMES,
)
"""All cases of all parts, in the order of the table."""

TASK = 5_000
"""Beams that a process tries at a time: 0.1 s, so that a stop comes soon and after each case."""

FEW = 50
"""By what a short run divides the trials of checks."""


@dataclass(frozen=True, slots=True)
class Task:
    """Some beams, or other trials, of one case.

    Args:
        case: Index of the case.
        tries: How many to try.
        outright: How many of them, if beams, rationals shall decide anyway.
        seed: Seeds of the random numbers: those of the run, the case, and the task.
    """

    case: int
    tries: int
    outright: int
    seed: tuple[int, int, int]


def stress(
    beams: int,
    *,
    rationals: int = 0,
    quick: bool = False,
    parts: Collection[str] = (),
    seconds: float = float("inf"),
    seed: int = 0,
    processes: int | None = None,
    progress: Progress = silent,
) -> Report:
    """Try all cases: those of casters share the beams, the others have trials of their own.

    Args:
        beams: Beams to try in all, at least.
        rationals: How many of them rationals shall decide whatever error bounds say.
        quick: Whether checks make few trials, and leave enormous worlds out.
        parts: Names of the parts that are tried; all if none is given.
        seconds: Time after which no more are begun [s].
        seed: The same seed gives the same beams.
        processes: How many share the work; one a core if not given, fewer for few beams.
        progress: Called with the beams done and the beams in all.
    """
    begin = perf_counter()
    cases = [number for number, case in enumerate(CASES) if not parts or case.part in parts]
    if quick:
        cases = [number for number in cases if not CASES[number].heavy]
    tasks = list(_tasks(cases, beams, rationals, quick, seed))
    found = dict.fromkeys(cases, Findings())
    finished = 0
    if processes is None:
        # A process takes longer to start than to try the beams of a task.
        processes = min(core_count(), max(1, len(tasks)))
    for task, new in _done(tasks, processes, begin + seconds):
        found[task.case] += new
        finished += 1
        progress(finished, len(tasks))
    return Report(
        [(CASES[case], found[case]) for case in cases],
        asked=beams,
        seed=seed,
        seconds=perf_counter() - begin,
        complete=finished == len(tasks),
    )


def perform(task: Task) -> Findings:
    """Make the trials of a task."""
    return CASES[task.case].attempt(np.random.default_rng(task.seed), task.tries, task.outright)


def _tasks(
    cases: Sequence[int], beams: int, rationals: int, quick: bool, seed: int
) -> Iterator[Task]:
    """Tasks of the cases: checks first, the heaviest before, for they take the longest.

    Those of the casters are of about equal size, case after case, so that a stop leaves no case
    untried.
    """
    for case in sorted(cases, key=lambda case: not CASES[case].heavy):
        tries, each = CASES[case].tries, CASES[case].each
        if quick:
            tries = min(tries, -(-tries // FEW))
        for number in range(-(-tries // each)):
            yield Task(case, min(each, tries), 0, (seed, case, number))
    casters = [case for case in cases if not CASES[case].tries]
    share = -(-beams // max(1, len(casters)))
    rounds = -(-share // TASK)
    size, outright = -(-share // rounds), -(-rationals // (rounds * max(1, len(casters))))
    for number in range(rounds):
        for case in casters:
            yield Task(case, size, min(size, outright), (seed, case, number))


def _done(tasks: list[Task], processes: int, end: float) -> Iterator[tuple[Task, Findings]]:
    """The tasks with their tallies, as they finish; none is begun after the end."""
    if processes == 1:
        for task in tasks:
            if perf_counter() > end:
                return
            yield task, perform(task)
        return
    with process_pool(processes) as pool:
        waiting = iter(tasks)
        running = {pool.submit(perform, task): task for task in islice(waiting, 2 * processes)}
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
