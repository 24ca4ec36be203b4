"""``lrf3d sweep``: runs over worlds, settings and seeds, on this machine or a cluster."""

import re
from typing import Annotated, Any

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report


def sweep(
    report: Report,
    worlds: Annotated[list[str], typer.Argument(metavar="WORLD…")],
    sigma: Annotated[str | None, typer.Option(metavar="S,S,…")] = None,
    beams: Annotated[str | None, typer.Option(metavar="N,N,…")] = None,
    mapper: Annotated[str, typer.Option(metavar="M,M,…")] = "robust,paper",
    vary: Annotated[list[str] | None, typer.Option(metavar="TABLE.KEY=V,V,…")] = None,
    seeds: options.Count = 20,
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
    results. Writes runs.csv, summary.json, means.csv, means.tex and a figure for each world and
    setting.

    Options:
        worlds: Built-in worlds or world files.
        sigma: Noise levels [m] at range_max; six from 0.01 to 0.63 if not given.
        beams: Numbers of beams.
        mapper: robust, paper, or your own as FILE.py:NAME.
        vary: Values for any key of world files; repeatable.
        seeds: Number of seeds for each setting.
        scheduler: A Dask scheduler instead of this machine.
        shard: Make only the runs of job I of N, such as 2/8.
        merge: Make no runs; collect those of all jobs in the folder.
        resume: Keep the runs in the folder and do the missing ones.
    """
    from lrf3d.cli.console import print_text, warn
    from lrf3d.errors import InputError
    from lrf3d.world.files import find_world

    # An unknown name is reported before the simulation is imported.
    for world in worlds:
        find_world(world)
    job = None if shard is None else _job(shard)

    from lrf3d.cli.folder import results_folder
    from lrf3d.cli.plugins import load_plugin
    from lrf3d.sweeping import plan as plans
    from lrf3d.sweeping.running import executor_of, known_rows, run_plan
    from lrf3d.sweeping.table import SweepTable, figures_of

    axes: dict[str, Any] = {plans.SIGMA: plans.SIGMAS}
    for key, flag, text in ((plans.SIGMA, "sigma", sigma), (plans.BEAMS, "beams", beams)):
        axes |= {} if text is None else {key: _values(text, f"--{flag}")}
    for text in vary or ():
        key, equals, values = text.partition("=")
        if not equals:
            raise InputError(
                f"--vary {text}: expected TABLE.KEY=VALUE,VALUE,…, as mapper.gap=1,2.5"
            )
        axes[key.strip()] = _values(values, f"--vary {key.strip()}")
    labels = [label.strip() for label in mapper.split(",")]
    plan = plans.make_plan(
        worlds,
        axes,
        # A mode of the LineMapper, or the class or object that a user names.
        mappers={name: load_plugin("mapper", name) if ":" in name else name for name in labels},
        seeds=seeds,
        collision=warn if ignore_collisions else None,
        where=options.side_of(inside),
        say=report.note,
        warn=warn,
    )
    name = f"{plan.worlds[0]}_sweep"
    output = results_folder(report, worlds, name, out, alone=job is None)
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
    files = {"runs": "runs.csv", "means": "means.csv", "means in LaTeX": "means.tex"}
    result.runs_to_csv(output.path / files["runs"])
    result.to_csv(output.path / files["means"])
    result.to_latex(output.path / files["means in LaTeX"])
    if report.shows:
        print_text(f"{result}\n\n")
    output.finish(
        result.summary(),
        files,
        figures_of(result),
        rows=done,
        kept="all runs kept; go on with --resume",
    )


def _values(text: str, flag: str) -> tuple[Any, ...]:
    """Comma-separated values, each a number, a word, true or false."""
    from lrf3d.errors import InputError
    from lrf3d.world.schema import value_of

    if not text.strip(", "):
        raise InputError(f"{flag} {text!r}: expected values with commas between them")
    return tuple(value_of(part) for part in text.split(",") if part.strip())


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
