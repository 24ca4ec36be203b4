"""``lrf3d sweep``: runs over worlds, settings and seeds, on this machine or a cluster."""

from pathlib import Path
from typing import Annotated

import typer

from lrf3d.cli import options


def sweep(
    context: typer.Context,
    worlds: Annotated[
        list[str] | None,
        typer.Argument(metavar="[WORLD]…", help="Built-in worlds or world files; not with --grid."),
    ] = None,
    grid: Annotated[
        Path | None, typer.Option(help="A TOML file: a world file's tables with lists of values.")
    ] = None,
    sigma: Annotated[
        str | None, typer.Option(metavar="S,S,…", help="Noise levels [m] at range_max.")
    ] = None,
    beams: Annotated[str | None, typer.Option(metavar="N,N,…", help="Numbers of beams.")] = None,
    mode: Annotated[
        str | None, typer.Option(metavar="M,M", help="Modes of the mapper; both if not given.")
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TABLE.KEY=V,V,…", help="Values for any key of world files; repeatable."
        ),
    ] = None,
    seeds: Annotated[
        int | None, typer.Option(min=1, help="Number of seeds for each setting; 20 if not given.")
    ] = None,
    every: Annotated[
        int | None, typer.Option(min=1, help="Use every n-th scan of a drive.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="A Dask scheduler instead of this machine."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, max=512, help="Processes on this machine; one for each core if not given."
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep the runs in the folder and do the missing ones.")
    ] = False,
    inside: options.Inside = None,
    ignore_collisions: options.IgnoreCollisions = False,
    out: options.Out = None,
    json: options.Json = False,
) -> None:
    """Run every combination of worlds, noises, beams, thresholds and modes with many seeds.

    Results are saved as they are made; --resume continues a sweep that was stopped, with the same
    results. Writes sweep.parquet, summary.json and a figure for each world and setting.
    """
    from lrf3d.cli.console import progress_bar, say, warn
    from lrf3d.cli.folder import results_folder
    from lrf3d.errors import InputError
    from lrf3d.input import own_name
    from lrf3d.sweep.cluster import check_address
    from lrf3d.sweep.drawing import figures_of, table_text
    from lrf3d.sweep.grid import BEAMS, MODE, SIGMA, SweepGrid, parse_axis, parse_values, read_grid
    from lrf3d.sweep.plan import make_plan
    from lrf3d.sweep.sweeping import sweep as run

    flags = {MODE: ("--mode", mode), SIGMA: ("--sigma", sigma), BEAMS: ("--beams", beams)}
    axes = {
        key: parse_values(text, flag) for key, (flag, text) in flags.items() if text is not None
    }
    axes.update(parse_axis(text) for text in vary or ())
    counts = {name: n for name, n in (("seeds", seeds), ("every", every)) if n is not None}
    if scheduler is not None:
        check_address(scheduler)
    if grid is not None:
        chosen = read_grid(grid, axes, worlds=tuple(worlds or ()), **counts)
    elif worlds:
        chosen = SweepGrid.usual(*worlds, axes=axes, **counts)
    else:
        raise InputError("sweep: no world; name one, such as city, or give --grid FILE")
    plan = make_plan(
        chosen,
        collision=warn if ignore_collisions else None,
        where=options.side_of(inside),
        say=say,
        warn=warn,
    )
    name = plan.worlds[0] if grid is None else own_name(grid)
    sources = chosen.worlds if grid is None else [grid]
    output = results_folder(context, sources, f"{name}_sweep", out)
    with progress_bar("runs") as bar:
        result = run(
            plan, output.path, scheduler=scheduler, workers=workers, resume=resume, progress=bar
        )
    made = len(result.rows) - result.resumed
    if not json:
        print(table_text(plan, result.rows), end="\n\n", flush=True)
    output.finish(
        result.summary,
        {"table": result.table},
        figures_of(plan, result.rows, output.path),
        rows=[("runs", f"{len(result.rows)}, of them {made} made now in {result.took:.1f} s")],
        kept=f"{result.table} holds the runs, the same command with --resume draws them",
        note="all runs kept; go on with --resume",
        json=json,
    )
