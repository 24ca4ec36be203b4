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

    given = _numbers(sigma)
    film.check()
    if own.controller is not None and drive.inside is not None:
        raise InputError("--inside, --outside: a controller drives, so no route is planned")
    if slam and (own.mapper is not None or mode is not None):
        raise InputError("--slam: it is a mapper itself; leave out --mapper and --mode")
    scenario = drive.read(world, report, planned=own.controller is None)

    from lrf3d.cli.folder import results_folder
    from lrf3d.cli.plugins import load_plugin, made
    from lrf3d.world.cameras import check_view

    check_view(scenario.view if film.view is None else film.view, scenario.world.cameras)
    named = {kind: name for kind, name in vars(own).items() if name is not None}
    plugins: dict[str, Any] = {kind: load_plugin(kind, name) for kind, name in named.items()}
    named.pop("noise", None)
    if slam:
        from lrf3d.slam.simulated import SlamMapper

        plugins["mapper"], named["mapper"] = partial(SlamMapper, rng=seed), "lrf3d.slam:SlamMapper"
    settings: dict[str, Any] = {
        "mode": mode, "caster": caster, "scans": scans, "on_collision": drive.on_collision,
        "rng": seed,
    }  # fmt: skip
    if own.controller is None:
        # All noise levels have the same drive, which is computed and checked once.
        settings["drive"] = scenario.trajectory(scans=scans, on_collision=drive.on_collision)
    else:
        plugins["drive"] = plugins.pop("controller")
    output = results_folder(context, report, [world], scenario.name, out)

    from lrf3d.cli.results import KEPT, pictures_of, rows_of, simulated
    from lrf3d.mapping import save_map

    def simulation(sigma: float | None) -> Any:
        parts = {kind: made(found) for kind, found in plugins.items()}
        return scenario.simulation(sigma=sigma, **settings, **parts)

    levels = [None, *scenario.compared] if not given else given
    runs, figures = simulated(
        [partial(simulation, level) for level in levels],
        output.path,
        progress=report.progress,
        resume=resume,
    )
    run, sigmas = runs[0], given or scenario.sigmas
    about = {"name": scenario.name, "seed": seed, "caster": caster, **named}
    summary = {**about, "sigma_m": sigmas[0], "planned": scenario.planned, **figures}
    if own.controller is None and scenario.poses is not None:
        # The robot did not drive between the poses.
        summary["drive"]["length_m"] = 0.0
    if len(runs) > 1:
        summary["noise_levels"] = [
            {"sigma_m": level, "segments": len(run.map), "objects": run.map.object_count}
            for level, run in zip(sigmas, runs, strict=True)
        ]
    files = {"run": "run.npz"}
    # A user's mapper may make no LineMap.
    if run.maps:
        files["map"] = "map.geojson"
        save_map(run.map, output.path / files["map"], free=run.free_cells())
    pictures = pictures_of(runs, sigmas, scenario)
    if video:
        pictures["video"] = "run.mp4", lambda path: film.write(run, path, report)
    output.finish(
        summary,
        files,
        pictures,
        rows=rows_of(runs, summary),
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
