"""The sweep: all runs of a plan on an executor, their rows in a folder, and the table of them.

A row is a line of JSON, a pure function of its run. It is appended to a file as it comes, so a kill
loses none; a line that a crash cut off is left out and made again. Jobs have files of their own.
"""

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lrf3d.apps.sweeping.plan import USUAL, PlannedRun, Row, SettingValue, SweepPlan, make_plan
from lrf3d.apps.sweeping.table import MEASURES, SweepTable
from lrf3d.base.cores import core_count, process_pool, results
from lrf3d.base.errors import InputError, Lrf3dError, expect, missing_extra, shown
from lrf3d.base.files import as_path, locked, make_folder, opened_own, read_text, writing
from lrf3d.base.interrupts import Progress, check, noting, silent, stoppable
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import is_finite, whole_number
from lrf3d.scoring import buildings_seen, score_run, visible_walls
from lrf3d.simulation.scenario import read_scenario_file
from lrf3d.world.pieces import joined_objects

# Name of a file of rows, with the number of the job that writes it.
ROWS = "sweep{}.jsonl"


@stoppable()
def sweep(
    worlds: str | Sequence[str],
    *,
    mappers: Mapping[str, Any] | Sequence[str] | None = None,
    axes: Mapping[str, Sequence[SettingValue]] | None = None,
    seeds: int = 20,
    folder: str | Path | None = None,
    resume: bool = False,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: Progress = silent,
) -> SweepTable:
    """Run every combination of worlds, mappers and settings with many seeds.

    Args:
        worlds: Built-in worlds or world files.
        mappers: Mappers by their labels: a mode of the LineMapper, a dict of its settings, a class
            to instantiate for each run, or an object with ``update(scan)``, which is copied for
            each run. Both modes if not given.
        axes: Values of settings of world files, as ``{"noise.sigma": (0.02, 0.05)}``; the usual
            noise levels if not given.
        seeds: Number of seeds.
        folder: Where rows are appended as they come; they are only returned if not given.
        resume: Continue with the rows in the folder.
        workers: Number of processes on this machine, one for each core if not given. With 1 all
            runs are made in this process.
        executor: Makes the runs instead, such as ``distributed.Client(...).get_executor()``.
        progress: Called with the number of finished runs, and of all.

    Returns:
        The table: a row for each run, and the means over the seeds.

    Raises:
        InputError: Something is invalid, or the folder holds other runs.

    Examples:
        >>> import lrf3d
        >>> table = lrf3d.sweep(
        ...     "paper_room", mappers=["robust"], axes={"noise.sigma": (0.1,)}, seeds=2, workers=1
        ... )
        >>> [row["mapper"] for row in table.rows]
        ['robust', 'robust']
    """
    _check_kinds(worlds, mappers, axes)
    expect(progress, Callable, "progress")
    expect(executor, Executor | None, "executor")
    if not isinstance(mappers, Mapping):
        mappers = USUAL if mappers is None else {label: label for label in mappers}
    files = [read_scenario_file(each) for each in ([worlds] if isinstance(worlds, str) else worlds)]
    plan = make_plan(files, axes, mappers, seeds)
    workers = core_count() if workers is None else whole_number(workers, "sweep: workers")
    with ExitStack() as stack:
        if folder is None:
            folder = stack.enter_context(TemporaryDirectory(ignore_cleanup_errors=True))
        used = stack.enter_context(executor_of(workers)) if executor is None else executor
        return run_plan(plan, as_path(folder), used, resume=resume, progress=progress)


def _check_kinds(worlds: Any, mappers: Any, axes: Any) -> None:
    """Check the kinds of what a sweep is of."""
    varied = axes.items() if isinstance(axes, Mapping) else ()
    for name, value, kinds in (
        ("worlds", worlds, str | list | tuple),
        ("mappers", mappers, Mapping | list | tuple | None),
        ("axes", axes, Mapping | None),
        *((f"axes {key}", each, list | tuple) for key, each in varied),
    ):
        if not isinstance(value, kinds):
            raise InputError(f"sweep: {name} {shown(value)}: expected a list, or a dict of lists")
    for label in mappers or ():
        if not isinstance(label, str):
            raise InputError(f"sweep: mapper {shown(label)}: expected a name or a path")


def run_plan(
    plan: SweepPlan,
    folder: Path,
    executor: Executor | None,
    *,
    resume: bool = False,
    shard: tuple[int, int] | None = None,
    progress: Progress = silent,
) -> SweepTable:
    """Make the runs of a plan that a folder does not hold yet; without an executor here.

    With a shard, the number of this job from 1 and of all jobs, only every n-th run is made, and
    appended to a file of this job's own.
    """
    path = make_folder(folder) / ROWS.format("" if shard is None else ".{}of{}".format(*shard))
    mine = plan.runs if shard is None else plan.runs[shard[0] - 1 :: shard[1]]
    with locked(path):
        kept = kept_rows(plan, folder)
        missing = [run for run in mine if run.key not in kept]
        if len(missing) < len(mine) and not resume:
            raise InputError(
                f"{folder}: holds {len(kept)} runs of this sweep; go on with it by --resume,"
                " choose another folder with --out, or begin again with --force"
            )
        with writing(path, "remove it"), opened_own(path) as file:
            # The end of a line that a crash cut off.
            file.truncate(file.read().rfind(b"\n") + 1)
        done = len(mine) - len(missing)
        with noting(lambda: f"{len(kept)} of {len(plan.runs)} runs kept; go on with --resume"):
            progress(done, len(mine))
            for rows in _made(missing, executor):
                # They stay in the file even if this process is killed afterwards.
                with writing(path, "make room"), opened_own(path) as file:
                    file.seek(0, os.SEEK_END)
                    file.writelines(
                        f"{json.dumps(row, allow_nan=False)}\n".encode() for row in rows
                    )
                kept |= {row["key"]: row for row in rows}
                done += len(rows)
                progress(done, len(mine))
    return table_of(plan, kept, made=len(missing))


def table_of(plan: SweepPlan, kept: Mapping[str, Row], made: int = 0) -> SweepTable:
    """The table of the rows that are kept, by their keys."""
    return SweepTable(plan, [kept[run.key] for run in plan.runs if run.key in kept], made)


def kept_rows(plan: SweepPlan, folder: Path) -> dict[str, Row]:
    """The rows of all jobs in a folder, by their keys; all have to be of the plan."""
    found = dict[str, Row]()
    planned = {run.key: run.columns for run in plan.runs}
    largest_rows = 1 << 31  # Largest file of rows [bytes]: a row has some 600.
    for path in sorted(folder.glob(ROWS.format("*"))):
        text = read_text(path, what="the rows of a sweep", largest=largest_rows)
        for number, line in enumerate(text.split("\n")[:-1], start=1):
            try:
                row = json.loads(line)
                found[row["key"]] = row
                fits = row["key"] not in planned or _fits(row, planned[row["key"]])
            except (ValueError, TypeError, KeyError, RecursionError):
                fits = False
            if not fits:
                raise InputError(f"{path}: line {number} is not a row of a sweep; remove the line")
    if foreign := len(found.keys() - {run.key for run in plan.runs}):
        raise InputError(
            f"{folder}: holds {foreign} runs that this sweep does not ask for; give all options"
            " that it was started with, choose another folder with --out, or --force"
        )
    return found


def _fits(row: Row, columns: Row) -> bool:
    """Whether a row from a file is of a run with these columns, with all measures as numbers."""
    measures = {name: each for name, each in row.items() if name not in ("key", *columns)}
    if not (columns.items() <= row.items() and MEASURES.keys() <= measures.keys()):
        return False
    found = [each for each in measures.values() if each is not None]
    return all(type(each) in (int, float, bool) and is_finite(each) for each in found)


@contextmanager
def executor_of(workers: int | None, scheduler: str | None = None) -> Iterator[Executor | None]:
    """The executor of a sweep: that of a Dask scheduler, or processes here.

    None, for this process, where one worker is asked for.
    """
    if scheduler is not None:
        try:
            from distributed import Client

            client = Client(scheduler, timeout=30)
        except ImportError as error:
            raise missing_extra("--scheduler needs Dask", "sweep") from error
        except (OSError, ValueError) as error:
            raise InputError(
                f"--scheduler {scheduler}: no scheduler answers there; start one with dask"
                " scheduler, and give the tcp:// address that it prints"
            ) from error
        with client:
            yield client.get_executor()
    elif workers == 1:
        yield None
    else:
        with process_pool(workers or core_count()) as pool:
            yield pool


def _made(runs: Sequence[PlannedRun], executor: Executor | None) -> Iterator[list[Row]]:
    if executor is None:
        for run in runs:
            check()
            yield rows_of([run])
        return
    # Runs that are sent together: a crash costs at most these, and sending them next to nothing.
    batch_runs = 8
    batches = [runs[first : first + batch_runs] for first in range(0, len(runs), batch_runs)]
    futures = [executor.submit(rows_of, batch) for batch in batches]
    try:
        yield from results(futures)
    except BrokenProcessPool as error:
        raise Lrf3dError(
            "a process of the sweep has ended, perhaps for want of memory; go on with --resume and"
            " fewer --workers"
        ) from error
    finally:
        # Processes of this machine end with their pool.
        for future in () if isinstance(executor, ProcessPoolExecutor) else futures:
            future.cancel()


def rows_of(runs: Sequence[PlannedRun]) -> list[Row]:
    """Make some runs; the row of each is a pure function of what it is made of."""
    return [_row(run) for run in runs]


def _row(planned: PlannedRun) -> Row:
    mapper = planned.mapper
    scenario = planned.scenario
    if not isinstance(mapper, dict):
        # A user's class or function makes a mapper for each run; a mapper is copied.
        mapper = deepcopy(mapper) if hasattr(type(mapper), "update") else mapper()
    run = scenario.run(
        drive=planned.drive,
        mapper=mapper,
        rng=planned.columns["noise_seed"],
        caster=_caster(scenario.world),
        snapshots=1,
    )
    _, walls = visible_walls(run)
    visible = len(set(joined_objects(run.world)[walls].tolist()))
    buildings = buildings_seen(run)
    return {
        "key": planned.key,
        **planned.columns,
        **score_run(run).as_dict(),
        "map_objects": run.map.object_count,
        "visible_objects": visible,
        "object_ratio": run.map.object_count / visible if visible else None,
        "seen_on_all_sides": buildings.seen_on_all_sides,
        "whole": buildings.whole,
    }


# The caster of a world: runs that are sent together share their world.
_caster = lru_cache(maxsize=1)(PlanarCaster)
