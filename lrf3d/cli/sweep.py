"""``lrf3d sweep``: runs over worlds, settings and seeds, on this machine or a cluster."""

from argparse import Namespace
from typing import Any

from lrf3d.cli.console import Report, print_text, warn
from lrf3d.cli.folder import results_folder
from lrf3d.cli.inputs import on_collision, side_of
from lrf3d.errors import InputError
from lrf3d.sweeping.plan import BEAMS, SIGMA, SIGMAS, USUAL, make_plan
from lrf3d.sweeping.running import executor_of, known_rows, run_plan
from lrf3d.sweeping.table import SweepTable, figures_of
from lrf3d.world.schema import value_of


def sweep(mappers: dict[str, Any] | None, args: Namespace, report: Report) -> None:
    """Compare mappers over worlds, noises, settings and seeds."""
    axes: dict[str, Any] = {
        SIGMA: args.sigma or SIGMAS,
        **({BEAMS: args.beams} if args.beams else {}),
    }
    for text in args.vary or ():
        key, _, values = text.partition("=")
        axes[key.strip()] = [value_of(part) for part in values.split(",") if part.strip()]
        if not axes[key.strip()]:
            raise InputError(
                f"--vary {text}: expected TABLE.KEY=VALUE,VALUE,…, as mapper.gap=1,2.5"
            )
    plan = make_plan(
        args.world,
        axes,
        mappers=mappers or USUAL,
        seeds=args.seeds,
        collision=on_collision(args),
        where=side_of(args),
        say=report.note,
        warn=warn,
    )
    job = args.shard
    output = results_folder(
        report, args.world, f"{plan.worlds[0]}_sweep", args.out, alone=job is None
    )
    if args.merge:
        rows = known_rows(plan, output.path)
        result = SweepTable(plan, [rows[run.key] for run in plan.runs if run.key in rows])
    else:
        with report.progress("runs") as bar, executor_of(args.workers, args.scheduler) as executor:
            result = run_plan(
                plan, output.path, executor, resume=args.resume, shard=job, progress=bar
            )
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
