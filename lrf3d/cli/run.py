"""``lrf3d run``: simulate, map and draw a world."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report
from lrf3d.cli.film import Film
from lrf3d.cli.options import Drive

Named = Annotated[str | None, typer.Option(metavar="MODULE:OBJECT")]


@dataclass(frozen=True)
class Own:
    """A user's own parts, imported from a file, the current folder or the installed modules.

    Options:
        mapper: Your mapper: update(scan).
        controller: Your controller: command(time, pose, scan) -> (v, w).
        noise: Your noise: noise(scan, rng).
    """

    title: ClassVar[str | None] = "Your own algorithms"
    mapper: Named = None
    controller: Named = None
    noise: Named = None


def run(
    context: typer.Context,
    world: options.WorldArgument,
    drive: Drive,
    own: Own,
    film: Film,
    report: Report,
    out: options.Out = None,
    sigma: Annotated[list[str] | None, typer.Option(metavar="S,S,…")] = None,
    mode: options.Mode = None,
    slam: bool = False,
    seed: options.Seed = 0,
    caster: Literal["embree", "planar"] = "embree",
    scans: options.MaybeCount = None,
    resume: bool = False,
    video: bool = True,
) -> None:
    """Drive through a world, scan it, map it, and draw the results.

    Writes run.npz, map.geojson, map.png, world.png, summary.json and run.mp4. MODULE:OBJECT is
    imported from a file, the current folder or the installed modules.

    Options:
        sigma: Noise [m] at range_max; of several, maps are compared in a figure.
        mode: Mode of the mapper.
        slam: Map without true poses: from the scans and wheels that slip and drift.
        caster: Caster of the beams.
        scans: Number of scans; the route is driven there and back until then.
        resume: Continue this run where it was stopped.
        video: Make the film.
    """
    from lrf3d.errors import InputError

    sigmas = _numbers(sigma)
    film.check()
    if own.controller is not None and drive.inside is not None:
        raise InputError("--inside, --outside: a controller drives, so no route is planned")
    if slam and (own.mapper is not None or mode is not None):
        raise InputError("--slam: it is a mapper itself; leave out --mapper and --mode")
    if own.controller is None:
        scenario = drive.read(world, report)
    else:
        scenario = options.read_world(
            world, drive.settings, scale=drive.scale, resolution=drive.resolution
        )

    from lrf3d.cli.folder import results_folder
    from lrf3d.cli.plugins import load_plugin
    from lrf3d.world.cameras import check_view

    check_view(scenario.view if film.view is None else film.view, scenario.world.cameras)
    plugins: dict[str, Any] = {
        kind: load_plugin(kind, name) for kind, name in vars(own).items() if name is not None
    }
    named = {kind: name for kind, name in vars(own).items() if name and kind != "noise"}
    if slam:
        from lrf3d.slam.simulated import SlamMapper

        plugins["mapper"], named["mapper"] = partial(SlamMapper, rng=seed), "lrf3d.slam:SlamMapper"
    settings: dict[str, Any] = {
        "mode": mode, "caster": caster, "scans": scans, "on_collision": drive.on_collision
    }  # fmt: skip
    if own.controller is None:
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
