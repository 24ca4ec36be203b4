"""``lrf3d sweep``: runs over worlds, settings and seeds, on this machine or a cluster."""

from argparse import Namespace
from typing import Any

from lrf3d.apps.cli.console import Console, print_text
from lrf3d.apps.cli.folder import results_folder
from lrf3d.apps.cli.inputs import on_collision, routed
from lrf3d.apps.sweeping.plan import BEAMS, SIGMA, SIGMAS, USUAL, make_plan
from lrf3d.apps.sweeping.running import executor_of, kept_rows, run_plan, table_of
from lrf3d.apps.sweeping.table import figures_of
from lrf3d.base.errors import InputError
from lrf3d.world.schema import value_of
from lrf3d.world.toml_file import WorldFile


def _axes(args: Namespace) -> dict[str, Any]:
    """The values of settings that a sweep varies."""
    axes: dict[str, Any] = {SIGMA: args.sigma or SIGMAS}
    if args.beams:
        axes[BEAMS] = args.beams
    for text in args.vary or ():
        key, _, values = text.partition("=")
        axes[key.strip()] = [value_of(part) for part in values.split(",") if part.strip()]
        if not values.strip(", "):
            raise InputError(
                f"--vary {text}: expected TABLE.KEY=VALUE,VALUE,…, as mapper.gap=1,2.5"
            )
    return axes


def sweep(
    source: tuple[list[WorldFile], dict[str, Any]], args: Namespace, console: Console
) -> None:
    """Compare mappers over worlds, noises, settings and seeds."""
    files, mappers = source
    plan = make_plan(
        files,
        _axes(args),
        mappers or USUAL,
        args.seeds,
        routed=lambda scenario: routed(scenario, args, console),
        collision=on_collision(args),
    )
    job = args.shard
    name = f"{plan.worlds[0]}_sweep"
    output = results_folder(args, console, args.world, name, alone=job is None)
    if args.merge:
        result = table_of(plan, kept_rows(plan, output.path))
    else:
        with console.progress("runs") as bar, executor_of(args.workers, args.scheduler) as executor:
            result = run_plan(
                plan, output.path, executor, resume=args.resume, shard=job, progress=bar
            )
    rows = [("runs", f"{len(result.rows)}, of them {result.made} made now")]
    if job is not None:
        # Other jobs write to the folder, too: what they all made is written by --merge.
        console.print(result.summary(), rows)
        return
    if missing := len(plan.runs) - len(result.rows):
        raise InputError(f"{output.path}: {missing} runs are missing; make them, then --merge")
    written = {"runs": "runs.csv", "means": "means.csv", "means in LaTeX": "means.tex"}
    writers = (result.runs_to_csv, result.to_csv, result.to_latex)
    for write, file in zip(writers, written.values(), strict=True):
        write(output.path / file)
    if console.shows:
        print_text(f"{result}\n\n")
    kept = "all runs kept; go on with --resume"
    output.finish(result.summary(), written, figures_of(result), rows=rows, kept=kept)
