"""``lrf3d run``: simulate, map and draw a world."""

from functools import partial
from typing import Annotated, Any, Literal

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report
from lrf3d.cli.film import Film
from lrf3d.cli.options import MAP, OWN, Drive


def run(
    context: typer.Context,
    world: options.WorldArgument,
    drive: Drive,
    film: Film,
    report: Report,
    out: options.Out = None,
    sigma: Annotated[
        list[str] | None,
        typer.Option(
            metavar="S,S,…",
            rich_help_panel=MAP,
            help="Noise [m] at range_max; of several, maps are compared in a figure.",
        ),
    ] = None,
    mode: options.ModeOption = None,
    slam: Annotated[
        bool,
        typer.Option(
            "--slam",
            rich_help_panel=MAP,
            help="Map without true poses: from the scans and wheels that slip and drift.",
        ),
    ] = False,
    seed: options.Seed = 0,
    caster: Annotated[
        Literal["embree", "planar"], typer.Option(help="Caster of the beams.")
    ] = "embree",
    scans: Annotated[
        int | None,
        typer.Option(
            min=1,
            rich_help_panel=options.DRIVE,
            help="Number of scans; the route is driven there and back until then.",
        ),
    ] = None,
    mapper: Annotated[
        str | None,
        typer.Option(
            metavar="MODULE:OBJECT", rich_help_panel=OWN, help="Your mapper: update(scan)."
        ),
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(
            metavar="MODULE:OBJECT",
            rich_help_panel=OWN,
            help="Your controller: command(time, pose, scan) -> (v, w).",
        ),
    ] = None,
    noise: Annotated[
        str | None,
        typer.Option(
            metavar="MODULE:OBJECT", rich_help_panel=OWN, help="Your noise: noise(scan, rng)."
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue this run where it was stopped.")
    ] = False,
    video: Annotated[
        bool, typer.Option(rich_help_panel=options.FILM, help="Make the film.")
    ] = True,
) -> None:
    """Drive through a world, scan it, map it, and draw the results.

    Writes run.npz, map.geojson, map.png, world.png, summary.json and run.mp4. MODULE:OBJECT is
    imported from a file, the current folder or the installed modules.
    """
    from lrf3d.errors import InputError

    sigmas = _numbers(sigma)
    film.check()
    if controller is not None and drive.inside is not None:
        raise InputError("--inside, --outside: a controller drives, so no route is planned")
    if slam and (mapper is not None or mode is not None):
        raise InputError("--slam: it is a mapper itself; leave out --mapper and --mode")
    if controller is None:
        scenario = drive.read(world, report)
    else:
        scenario = options.read_world(
            world, drive.settings, scale=drive.scale, resolution=drive.resolution
        )

    from lrf3d.cli.folder import results_folder
    from lrf3d.cli.plugins import load_plugin
    from lrf3d.world.cameras import check_view

    check_view(scenario.view if film.view is None else film.view, scenario.world.cameras)
    own = {"mapper": mapper, "noise": noise, "controller": controller}
    plugins: dict[str, Any] = {
        kind: load_plugin(kind, name) for kind, name in own.items() if name is not None
    }
    named = {kind: own[kind] for kind in plugins if kind != "noise"}
    if slam:
        from lrf3d.slam.simulated import SlamMapper

        plugins["mapper"], named["mapper"] = partial(SlamMapper, rng=seed), "lrf3d.slam:SlamMapper"
    settings: dict[str, Any] = {
        "mode": mode, "caster": caster, "scans": scans, "on_collision": drive.on_collision
    }  # fmt: skip
    if controller is None:
        # All noise levels have the same drive, which is computed and checked once.
        settings["drive"] = scenario.trajectory(scans=scans, on_collision=drive.on_collision)
    output = results_folder(context, report, [world], scenario.name, out)

    from lrf3d.cli.results import KEPT, files_of, pictures_of, rows_of, simulated, summary_of

    results = simulated(
        scenario,
        sigmas or scenario.sigmas,
        output.path,
        plugins=plugins,
        progress=report.progress,
        resume=resume,
        rng=seed,
        **settings,
    )
    summary = summary_of(results, {"seed": seed, "caster": caster, **named}, output.path)
    files, pictures = files_of(results, output.path), pictures_of(results)
    if video:
        pictures["video"] = "run.mp4", lambda path: film.write(results.run, path, report)
    rows, details = rows_of(results, summary)
    output.finish(
        summary,
        files,
        pictures,
        rows=rows,
        details=details,
        following=f"lrf3d {'view' if video else 'render'} {output.path}",
        kept=KEPT,
    )


def _numbers(words: list[str] | None) -> tuple[float, ...]:
    """The numbers of ``--sigma``, which commas separate."""
    try:
        return tuple(float(word) for each in words or () for word in each.split(","))
    except ValueError:
        raise typer.BadParameter(
            f"{','.join(words or ())!r}: expected numbers, such as 0.02,0.2", param_hint="--sigma"
        ) from None
