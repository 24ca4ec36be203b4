"""``lrf3d run``: simulate, map and draw a world."""

from typing import Annotated

import typer

from lrf3d.cli import options
from lrf3d.cli.console import progress_bar, warn


def run(
    context: typer.Context,
    world: options.WorldArgument,
    out: options.Out = None,
    mode: options.ModeOption = None,
    sigma: Annotated[
        list[float] | None,
        typer.Option(
            help="Noise [m] at range_max; repeat it to compare several maps in one figure."
        ),
    ] = None,
    settings: options.Settings = None,
    scale: options.Scale = 1.0,
    inside: options.Inside = None,
    seed: options.Seed = 0,
    caster: Annotated[
        options.CasterName, typer.Option(help="Caster of the beams.")
    ] = options.CasterName.EMBREE,
    ignore_collisions: options.IgnoreCollisions = False,
    mapper: Annotated[
        str | None, typer.Option(metavar="MODULE:OBJECT", help="Your mapper: update(scan).")
    ] = None,
    slam: Annotated[
        bool,
        typer.Option(
            "--slam", help="Map without true poses: from the scans and wheels that slip and drift."
        ),
    ] = False,
    controller: Annotated[
        str | None,
        typer.Option(
            metavar="MODULE:OBJECT", help="Your controller: command(time, pose, scan) -> (v, w)."
        ),
    ] = None,
    noise: Annotated[
        str | None, typer.Option(metavar="MODULE:OBJECT", help="Your noise: noise(scan, rng).")
    ] = None,
    scans: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Number of scans; the route is driven there and back until then.",
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue this run where it was stopped.")
    ] = False,
    video: Annotated[bool, typer.Option(help="Make the film.")] = True,
    view: options.ViewOption = None,
    size: options.Size = None,
    fps: options.Fps = None,
    playback: options.Playback = None,
    samples: options.Samples = 4,
    workers: options.Workers = None,
    renderer: options.RendererOption = None,
    json: options.Json = False,
) -> None:
    """Drive through a world, scan it, map it, and draw the results.

    Writes run.npz, map.geojson, map.png, world.png, summary.json and run.mp4. MODULE:OBJECT is
    imported from a file, the current folder or the installed modules.
    """
    import shlex

    from lrf3d.cli.film import make_film
    from lrf3d.cli.folder import results_folder
    from lrf3d.cli.plugins import load_plugin, slam_plugin
    from lrf3d.cli.results import KEPT, Results, pictures_of, write_results
    from lrf3d.errors import InputError
    from lrf3d.world.cameras import check_view

    film = options.film_options(
        size=size,
        fps=fps,
        playback=playback,
        view=view,
        samples=samples,
        workers=workers,
        renderer=renderer,
    )
    own = {"mapper": mapper, "noise": noise, "controller": controller}
    plugins = {kind: load_plugin(kind, name) for kind, name in own.items() if name is not None}
    if slam:
        if mapper is not None or mode is not None:
            raise InputError("--slam: it is a mapper itself; leave out --mapper and --mode")
        plugins["mapper"] = slam_plugin(seed)
    if controller is None:
        scenario = options.read_drive(world, settings, scale=scale, inside=inside)
    else:
        if inside is not None:
            raise InputError("--inside, --outside: a controller drives, so no route is planned")
        scenario = options.read_world(world, settings, scale=scale)
    check_view(scenario.view if view is None else view, scenario.world.cameras)
    output = results_folder(context, [world], scenario.name, out)
    folder = output.path
    sigmas = tuple(sigma) if sigma else scenario.sigmas
    results = Results.of(
        scenario,
        sigmas,
        folder,
        plugins=plugins,
        bar=progress_bar,
        resume=resume,
        seed=seed,
        mode=None if mode is None else mode.value,
        caster=caster.value,
        scans=scans,
        on_collision=warn if ignore_collisions else None,
    )
    drawings = pictures_of(results, folder)
    files = write_results(results, folder)
    kept = f"{files['run']} holds the run, "
    if video:
        drawings["video"] = folder / "run.mp4", lambda path: make_film(results.run, path, film)
        kept += f"`lrf3d render {shlex.quote(str(folder))}` draws its film"
    else:
        kept += "the same command with --resume draws it"
    output.finish(
        results.summary, files, drawings, rows=results.rows(), kept=kept, note=KEPT, json=json
    )
