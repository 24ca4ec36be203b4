"""``lrf3d run``: simulate, map and draw a world."""

import json
import re
from argparse import Namespace
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from lrf3d.cli.console import Report, warn
from lrf3d.cli.folder import results_folder
from lrf3d.cli.inputs import on_collision, routed
from lrf3d.cli.plugins import made
from lrf3d.cli.runs import write_film
from lrf3d.collecting import collect
from lrf3d.errors import InputError
from lrf3d.interrupts import noting
from lrf3d.io import record
from lrf3d.mapping import save_map
from lrf3d.render.figures import draw_map, draw_noise_levels, draw_world
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scoring import seen_share
from lrf3d.scoring.map_score import drawn_part, judged_part, summarise
from lrf3d.simulation import Simulation, update_mapper
from lrf3d.slam.simulated import SlamMapper
from lrf3d.text import counted

FEW = 0.6
"""Share of the walls below which a run says that it saw few of them."""

KEPT = "all scans kept; go on with --resume"
"""The note on a run that is stopped after its last scan."""


def run(source: tuple[Scenario, dict[str, Any]], args: Namespace, report: Report) -> None:
    """Drive through a world, scan it, map it, and draw the results."""
    scenario, own = source
    named = {kind: vars(args)[kind] for kind in own if kind != "noise"}
    if args.slam:
        own["mapper"], named["mapper"] = partial(SlamMapper, rng=args.seed), "SLAM"
    if args.robots > 1:
        from lrf3d.cli.fleet import run_fleet

        run_fleet(scenario, own, named, args, report)
        return
    # All noise levels have the same drive, which is computed and checked once.
    if "controller" in own:
        own["drive"] = own.pop("controller")
    else:
        scenario = routed(scenario, args, report)
        drive = scenario.trajectory(scans=args.scans, on_collision=on_collision(args), say=warn)
        own["drive"] = drive
    output = results_folder(report, [args.world], scenario.name, args.out)
    simulations = [
        scenario.simulation(
            sigma=level, mode=args.mode, caster=args.caster, scans=args.scans,
            on_collision=on_collision(args), rng=args.seed,
            **{kind: made(part) for kind, part in own.items()},
        )
        for level in args.sigma or [None, *scenario.compared]
    ]  # fmt: skip
    main, begin = simulations[0], perf_counter()
    with report.progress("scans") as progress:
        runs = [record(main, output.path / "run.npz", resume=args.resume, progress=progress)]
        with noting(lambda: KEPT):
            runs += [collect(each, progress) for each in simulations[1:]]
    run, sigmas, seconds = runs[0], args.sigma or scenario.sigmas, perf_counter() - begin
    updates = sum(each.done for each in simulations)
    summary = {
        "name": scenario.name, "seed": args.seed, "caster": args.caster, **named,
        "sigma_m": sigmas[0], "planned": scenario.planned, **_figures(main, run, output.path),
        "seconds": seconds, "milliseconds_a_scan": 1e3 * seconds / updates if updates else None,
        "milliseconds_an_update": main.milliseconds_an_update,
    }  # fmt: skip
    if scenario.poses is not None and "controller" not in named:
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
    if args.video:
        pictures["video"] = "run.mp4", lambda path: write_film(run, path, args, report)
    output.finish(
        summary,
        files,
        pictures,
        rows=_rows(runs, summary),
        following=f"lrf3d {'view' if args.video else 'render'} {output.path}",
        kept=KEPT,
    )


def _figures(main: Simulation, run: Run, folder: Path) -> dict[str, Any]:
    """The figures of a run, and what a user's mapper reports of it, in JSON's types."""
    mapper: Any = main.mapper
    seen = seen_share(judged_part(run))
    figures = {"mode": getattr(mapper, "mode", None), **summarise(run), "seen_share": seen}
    if not callable(getattr(mapper, "report", None)):
        return figures
    if not main.done:
        # The run was finished before, so this mapper has no scans yet.
        for index in range(len(run)):
            update_mapper(mapper, run.scans_at(index))
    report = mapper.report(run, folder)
    try:
        return {**figures, "report": dict(json.loads(json.dumps(report, allow_nan=False)))}
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{mapper!r}: report: {error}; expected a dict of texts and finite numbers"
        ) from None


def _rows(runs: Sequence[Run], summary: dict[str, Any]) -> list[tuple[str, str]]:
    """What most users ask of the runs, as a table."""
    run, drive, score = runs[0], summary["drive"], summary["score"]
    scans = f"{counted(drive['scans'], 'scan')} of {counted(run.ranges.shape[1], 'beam')}"
    rows = [("drive", f"{drive['length_m']:.1f} m in {drive['duration_s']:.1f} s, {scans}")]
    if not drive["length_m"]:
        rows = [("scans", f"{scans}, from single poses")]
    if (share := summary["seen_share"]) is not None:
        side = f"{summary['planned'] or 'there'}"
        few = "; the map shows the smaller part: see the doors above, or drive on with more --scans"
        rows.append(("seen", f"{100 * share:.0f} % of the walls {side}{few * (share < FEW)}"))
    if score is not None:
        found = "no wall is long enough to be looked for"
        if score["visible_segments"]:
            found = (
                f"{score['matched_segments']} of {score['visible_segments']} visible walls found"
            )
            found += f", {100 * score['length_recall']:.1f} % of their length"
            found += f"; the world has {summary['world']['walls']:,} walls"
        rows.append(("map", f"{run.map.counts}: {found}"))
    for level, other in zip(summary.get("noise_levels", ()), runs, strict=False):
        rows.append((f"σ {level['sigma_m']:g} m", other.map.counts))
    for name, value in summary.get("report", {}).items():
        shown = f"{value:.3g}" if isinstance(value, float) else str(value)
        rows.append((re.sub(r" (m|s|deg)$", r" [\1]", str(name).replace("_", " ")), shown))
    time = f"{summary['seconds']:.1f} s"
    if summary["milliseconds_a_scan"] is not None:
        time += f", {summary['milliseconds_a_scan']:.1f} ms a scan"
    if summary["milliseconds_an_update"] is not None:
        by = summary.get("mapper", "mapping")
        time += f", {summary['milliseconds_an_update']:.1f} ms of it {by}"
    return [*rows, ("time", time)]
