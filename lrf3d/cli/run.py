"""``lrf3d run``: simulate, map and draw a world."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report
from lrf3d.cli.options import Drive
from lrf3d.cli.runs import Film
from lrf3d.errors import InputError

if TYPE_CHECKING:
    from lrf3d.run import Run
    from lrf3d.simulation import Simulation

KEPT = "all scans kept; go on with --resume"
"""The note on a run that is stopped after its last scan."""

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
    given = _numbers(sigma)
    if own.controller is not None and drive.inside is not None:
        raise InputError("--inside, --outside: a controller drives, so no route is planned")
    if slam and (own.mapper is not None or mode is not None):
        raise InputError("--slam: it is a mapper itself; leave out --mapper and --mode")
    scenario = drive.read(world, report, planned=own.controller is None)

    from lrf3d.cli.folder import results_folder
    from lrf3d.cli.plugins import load_plugin, made
    from lrf3d.world.cameras import check_view

    view = scenario.film.view if film.view is None else film.view
    check_view(view, scenario.world.cameras)
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
    output = results_folder(report, [world], scenario.name, out)

    from lrf3d.interrupts import noting
    from lrf3d.io import record
    from lrf3d.mapping import save_map
    from lrf3d.render.figures import draw_map, draw_noise_levels, draw_world
    from lrf3d.scoring.summary import drawn_part
    from lrf3d.simulation import collect

    simulations = [
        scenario.simulation(sigma=level, **settings, **{k: made(v) for k, v in plugins.items()})
        for level in given or [None, *scenario.compared]
    ]
    main, begin = simulations[0], perf_counter()
    with report.progress("scans") as progress:
        runs = [record(main, output.path / "run.npz", resume=resume, progress=progress)]
        with noting(lambda: KEPT):
            runs += [collect(each, progress) for each in simulations[1:]]
    run, sigmas, seconds = runs[0], given or scenario.sigmas, perf_counter() - begin
    updates = sum(each.updates for each in simulations)
    summary = {
        "name": scenario.name, "seed": seed, "caster": caster, **named, "sigma_m": sigmas[0],
        "planned": scenario.planned, **_figures(main, run, output.path), "seconds": seconds,
        "milliseconds_a_scan": 1e3 * seconds / updates if updates else None,
        "milliseconds_an_update": main.milliseconds_an_update,
    }  # fmt: skip
    if own.controller is None and scenario.poses is not None:
        # The robot did not drive between the poses.
        summary["drive"]["length_m"] = 0.0
    if len(runs) > 1:
        summary["noise_levels"] = [
            {"sigma_m": level, "segments": len(each.map), "objects": each.map.object_count}
            for level, each in zip(sigmas, runs, strict=True)
        ]
    files, pictures = {"run": "run.npz"}, dict[str, Any]()
    shown = drawn_part(run)
    # A user's mapper may make no LineMap.
    if run.maps:
        files["map"] = "map.geojson"
        save_map(run.map, output.path / files["map"], free=run.free_cells())
        pictures["map picture"] = "map.png", partial(draw_map, shown)
    pictures["world picture"] = (
        "world.png",
        lambda path: draw_world(
            shown.world, path, scan=shown.scan(0), route=scenario.route, poses=scenario.poses
        ),
    )
    if len(runs) > 1:
        pictures["noise picture"] = "noise.png", partial(draw_noise_levels, runs, sigmas)
    if video:
        pictures["video"] = "run.mp4", lambda path: film.write(run, path, report)
    output.finish(
        summary,
        files,
        pictures,
        rows=_rows(runs, summary),
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


def _figures(main: "Simulation", run: "Run", folder: Path) -> dict[str, Any]:
    """The figures of a run, and what a user's mapper reports of it, in JSON's types."""
    from lrf3d.geometry import lengths
    from lrf3d.scoring import visible_walls
    from lrf3d.scoring.summary import judged_part, summarise

    mapper: Any = main.mapper
    parts, _ = visible_walls(judged_part(run))
    seen = float(lengths(parts).sum() / lengths(run.world.segments).sum())
    figures = {"mode": getattr(mapper, "mode", None), **summarise(run), "walls_seen": seen}
    if not callable(getattr(mapper, "report", None)):
        return figures
    if not main.updates:
        # The run was finished before, so this mapper has no scans yet.
        for scan in run.scans:
            mapper.update(scan)
    report = mapper.report(run, folder)
    try:
        return {**figures, "report": dict(json.loads(json.dumps(report, allow_nan=False)))}
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{mapper!r}: report: {error}; expected a dict of texts and finite numbers"
        ) from None


def _rows(runs: "Sequence[Run]", summary: dict[str, Any]) -> list[tuple[str, str]]:
    """What most users ask of the runs, as a table."""
    from lrf3d.text import counted

    run, drive, score = runs[0], summary["drive"], summary["score"]
    scans = f"{counted(drive['scans'], 'scan')} of {counted(run.lrf.beams, 'beam')}"
    rows = [("drive", f"{drive['length_m']:.1f} m in {drive['duration_s']:.1f} s, {scans}")]
    if not drive["length_m"]:
        rows = [("scans", f"{scans}, from single poses")]
    rows.append(("seen", f"{100 * summary['walls_seen']:.0f} % of the walls' length"))
    if score is not None:
        found = f"{score['matched_segments']} of {score['visible_segments']} walls found"
        if score["length_recall"] is not None:
            found += f", {100 * score['length_recall']:.1f} % of their length"
        rows.append(("map", f"{run.map.counts}: {found}"))
    for level, other in zip(summary.get("noise_levels", ()), runs, strict=False):
        rows.append((f"σ {level['sigma_m']:g} m", other.map.counts))
    for name, value in summary.get("report", {}).items():
        shown = f"{value:.3g}" if isinstance(value, float) else str(value)
        rows.append((str(name).replace("_", " "), shown))
    time = f"{summary['seconds']:.1f} s"
    if summary["milliseconds_a_scan"] is not None:
        time += f", {summary['milliseconds_a_scan']:.1f} ms a scan"
    if summary["milliseconds_an_update"] is not None:
        by = summary.get("mapper", "mapping")
        time += f", {summary['milliseconds_an_update']:.1f} ms of it {by}"
    return [*rows, ("time", time)]
