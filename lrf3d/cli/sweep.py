"""``lrf3d sweep``: runs over worlds, settings and seeds, on this machine or a cluster."""

import re
from pathlib import Path
from typing import Annotated, Any

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report


def sweep(
    context: typer.Context,
    report: Report,
    worlds: Annotated[list[str] | None, typer.Argument(metavar="[WORLD]…")] = None,
    grid: Path | None = None,
    sigma: Annotated[str | None, typer.Option(metavar="S,S,…")] = None,
    beams: Annotated[str | None, typer.Option(metavar="N,N,…")] = None,
    mapper: Annotated[str | None, typer.Option(metavar="M,M,…")] = None,
    vary: Annotated[list[str] | None, typer.Option(metavar="TABLE.KEY=V,V,…")] = None,
    seeds: options.MaybeCount = None,
    every: options.MaybeCount = None,
    scheduler: Annotated[str | None, typer.Option(metavar="tcp://HOST:PORT")] = None,
    workers: options.Workers = None,
    shard: Annotated[str | None, typer.Option(metavar="I/N")] = None,
    merge: bool = False,
    resume: bool = False,
    inside: options.Inside = None,
    ignore_collisions: options.IgnoreCollisions = False,
    out: options.Out = None,
) -> None:
    """Compare mappers over worlds, noises, settings and seeds.

    Each result is saved as it comes; --resume continues a sweep that was stopped, with the same
    results. Writes sweep.parquet, summary.json, means.csv, means.tex and a figure for each world
    and setting.

    Example: lrf3d sweep corridor --mapper robust,paper,mine.py:Mine --sigma 0.02,0.05

    Options:
        worlds: Built-in worlds or world files; not with --grid.
        grid: A TOML file: a world file's tables with lists of values.
        sigma: Noise levels [m] at range_max.
        beams: Numbers of beams.
        mapper: robust, paper, or your own as FILE.py:NAME; both modes if not given.
        vary: Values for any key of world files; repeatable.
        seeds: Number of seeds for each setting; 20 if not given.
        every: Use every n-th scan of a drive.
        scheduler: A Dask scheduler instead of this machine.
        shard: Make only the runs of job I of N, such as 2/8.
        merge: Make no runs; collect those of all jobs in the folder.
        resume: Keep the runs in the folder and do the missing ones.
    """
    from importlib.util import find_spec

    from lrf3d.cli.console import print_text, warn
    from lrf3d.errors import InputError
    from lrf3d.world.files import find_world

    if grid is None and not worlds:
        raise InputError("sweep: no world; name one, such as city, or give --grid FILE")
    # An unknown name is reported before the simulation is imported.
    for world in worlds or ():
        find_world(world)
    job = None if shard is None else _job(shard)

    from lrf3d.cli.folder import results_folder
    from lrf3d.cli.plugins import load_plugin
    from lrf3d.files import own_name
    from lrf3d.sweeping import grid as grids
    from lrf3d.sweeping.drawing import figures_of
    from lrf3d.sweeping.plan import make_plan
    from lrf3d.sweeping.running import executor_of, known_rows, run_plan
    from lrf3d.sweeping.table import SweepTable, missing_parquet

    if find_spec("pyarrow") is None:
        raise missing_parquet()
    flags = ((grids.SIGMA, "--sigma", sigma), (grids.BEAMS, "--beams", beams))
    axes = {key: grids.parse_values(text, flag) for key, flag, text in flags if text is not None}
    axes.update(grids.parse_axis(text) for text in vary or ())
    chosen: dict[str, Any] = {"worlds": tuple(worlds or ()), "seeds": seeds, "every": every}
    if mapper is not None:
        labels = [label.strip() for label in mapper.split(",")]
        # A mode of the LineMapper, or the class or object that a user names.
        chosen["mappers"] = {k: load_plugin("mapper", k) if ":" in k else k for k in labels}
    chosen = {name: value for name, value in chosen.items() if value is not None}
    if grid is not None:
        asked = grids.read_grid(grid, axes, **chosen)
    else:
        asked = grids.SweepGrid(axes={grids.SIGMA: grids.SIGMAS, **axes}, **chosen)
    plan = make_plan(
        asked,
        collision=warn if ignore_collisions else None,
        where=options.side_of(inside),
        say=report.note,
        warn=warn,
    )
    name = plan.worlds[0] if grid is None else own_name(grid)
    sources = asked.worlds if grid is None else [grid]
    output = results_folder(context, report, sources, f"{name}_sweep", out, alone=job is None)
    if merge:
        rows = known_rows(plan, output.path)
        result = SweepTable(plan, [rows[run.key] for run in plan.runs if run.key in rows])
    else:
        with report.progress("runs") as bar, executor_of(workers, scheduler) as executor:
            result = run_plan(plan, output.path, executor, resume=resume, shard=job, progress=bar)
    missing = len(plan.runs) - len(result.rows)
    if missing and job is None:
        raise InputError(f"{output.path}: {missing} runs are missing; make them, then --merge")
    done = [("runs", f"{len(result.rows)}, of them {result.made} made now")]
    if job is not None:
        # Other jobs write to the folder, too: what they all made is written by --merge.
        report.print(result.summary(), done)
        return
    files = {"table": "sweep.parquet", "means": "means.csv", "means in LaTeX": "means.tex"}
    result.to_parquet(output.path / files["table"])
    result.to_csv(output.path / files["means"])
    result.to_latex(output.path / files["means in LaTeX"])
    if not (report.json or report.quiet):
        print_text(f"{result}\n\n")
    output.finish(
        result.summary(),
        files,
        figures_of(result),
        rows=done,
        kept="all runs kept; go on with --resume",
    )


def _job(text: str) -> tuple[int, int]:
    """The number of a job and of all jobs."""
    from lrf3d.errors import InputError, shown

    given = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
    number, count = map(int, given.groups()) if given else (0, 0)
    if not 1 <= number <= count:
        raise InputError(
            f"--shard {shown(text)}: expected I/N, such as 2/8 for the second of eight jobs"
        )
    return number, count
