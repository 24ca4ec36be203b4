"""``lrf3d run``: simulate, map and draw a world, with one robot or several on one route."""

import json
import re
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from lrf3d.apps.cli.console import Console, json_text, warn
from lrf3d.apps.cli.folder import Drawing, draw_figure, results_folder
from lrf3d.apps.cli.inputs import made, on_collision, routed
from lrf3d.apps.cli.runs import write_film
from lrf3d.base.errors import InputError
from lrf3d.base.files import make_folder, write_text
from lrf3d.base.interrupts import noting
from lrf3d.base.text import counted
from lrf3d.casting.collision import Body, find_collision
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.mapping import save_map
from lrf3d.recordings import record, save_run
from lrf3d.robot import Trajectory
from lrf3d.scoring.map_score import drawn_part, found_words, summarise
from lrf3d.simulation.fleet import before_touching, giving_way, parts_of, simulate_fleet
from lrf3d.simulation.loop import Simulation
from lrf3d.simulation.mappers import OptionalParts
from lrf3d.simulation.recorder import collect
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import Scenario
from lrf3d.world import World

# Most robots whose maps the film shows.
_MAPPED = 3

# The note on a run that is stopped after its last scan.
KEPT = "all scans kept; go on with --resume"


def run(source: tuple[Scenario, dict[str, Any]], args: Namespace, console: Console) -> None:
    """Drive through a world, scan it, map it, and draw the results."""
    scenario, own = source
    named = {kind: vars(args)[kind] for kind in own if kind != "noise"}
    if args.slam:
        from lrf3d.slam.simulated import SlamMapper

        own["mapper"] = partial(SlamMapper, rng=args.seed)
        named["mapper"] = "SLAM"
    if args.robots > 1:
        _run_fleet(scenario, own, named, args, console)
        return
    # All noise levels have the same drive, which is computed and checked once.
    if "controller" in own:
        own["drive"] = own.pop("controller")
    else:
        scenario = routed(scenario, args, console)
        drive = scenario.trajectory(scans=args.scans, on_collision=on_collision(args), say=warn)
        own["drive"] = drive
    output = results_folder(args, console, [args.world], scenario.name)
    simulations = _simulations(scenario, own, args)
    main = simulations[0]
    begin = perf_counter()
    with console.progress("scans") as progress:
        runs = [record(main, output.path / "run.npz", resume=args.resume, progress=progress)]
        with noting(lambda: KEPT):
            runs += [collect(each, progress) for each in simulations[1:]]
    run = runs[0]
    sigmas = args.sigma or scenario.sigmas
    seconds = perf_counter() - begin
    updates = sum(each.done for each in simulations)
    summary = {
        "name": scenario.name, "seed": args.seed, "caster": args.caster, **named,
        "sigma_m": _sigma(scenario, args), "planned": scenario.planned,
        **_figures(main, run, output.path),
        "seconds": seconds, "milliseconds_a_scan": 1000 * seconds / updates if updates else None,
        "milliseconds_an_update": main.milliseconds_an_update,
    }  # fmt: skip
    del main, simulations
    if scenario.poses is not None and "controller" not in named:
        # The robot did not drive between the poses.
        summary["drive"]["length_m"] = 0.0
    files, pictures = _map_files(run, output.path)
    pictures |= _pictures(runs, scenario, args, console)
    if len(runs) > 1:
        summary["noise_levels"] = [
            {"sigma_m": level, "segments": len(each.map), "objects": each.map.object_count}
            for level, each in zip(sigmas, runs, strict=True)
        ]
        pictures["noise picture"] = "noise.png", partial(draw_figure, "noise_levels", runs, sigmas)
    output.finish(
        summary,
        {"run": "run.npz", **files},
        pictures,
        rows=_rows(runs, summary),
        following=["view" if args.video else "render", output.path],
        kept=KEPT,
    )


def _simulations(scenario: Scenario, own: dict[str, Any], args: Namespace) -> list[Simulation]:
    """A simulation for each noise level, each with new parts of the user's own."""
    return [
        scenario.simulation(
            sigma=level, mode=args.mode, caster=args.caster, scans=args.scans,
            on_collision=on_collision(args), rng=args.seed,
            **{kind: made(part) for kind, part in own.items()},
        )
        for level in args.sigma or [None, *scenario.compared]
    ]  # fmt: skip


def _map_files(
    run: Run, folder: Path, robot: str = ""
) -> tuple[dict[str, str], dict[str, Drawing]]:
    """Write the map of a robot's run; its file, and its picture, which is drawn later."""
    if not run.maps:  # A user's mapper may make no LineMap.
        return {}, {}
    place = f"{robot}/" if robot else ""
    name = f"{robot} map".strip()
    save_map(run.map, folder / f"{place}map.geojson", free=run.free_cells())
    draw = partial(draw_figure, "map", drawn_part(run))
    return {name: f"{place}map.geojson"}, {f"{name} picture": (f"{place}map.png", draw)}


def _pictures(
    runs: list[Run], scenario: Scenario, args: Namespace, console: Console
) -> dict[str, Drawing]:
    """The picture of the world, and the film, in which all noise levels or robots are seen."""
    run = runs[0]
    shown = drawn_part(run)
    beside: dict[str, Any] = {}
    if args.robots > 1:
        robots = {f"robot {number}": each for number, each in enumerate(runs[:_MAPPED], 1)}
        beside = {"maps": robots}
    elif len(runs) > 1:
        reach = f"{scenario.lrf.range_max:g} m"
        levels = [f"noise ±{100 * level:g} cm" for level in args.sigma or scenario.sigmas]
        beside["columns"] = dict(zip(levels, runs, strict=True))
        beside["title"] = f"The same drive; only the laser's noise at {reach} differs"
    seen = {"scan": shown.scan(0), "route": scenario.route, "poses": scenario.poses}
    pictures: dict[str, Drawing] = {
        "world picture": ("world.png", partial(draw_figure, "world", shown.world, **seen))
    }
    if args.video:
        film = partial(write_film, run, args=args, console=console, **beside)
        pictures["video"] = "run.mp4", film
    return pictures


def _figures(main: Simulation, run: Run, folder: Path) -> dict[str, Any]:
    """The figures of a run, and what a user's mapper reports of it, in JSON's types."""
    mapper = OptionalParts(main.mapper)
    figures = {"mode": mapper.mode, **summarise(run)}
    if mapper.report is None:
        return figures
    if not main.done:
        # The run was finished before, so this mapper has no scans yet.
        for index in range(len(run)):
            mapper.update(run.scans_at(index))
    report = mapper.report(run, folder)
    try:
        return {**figures, "report": dict(json.loads(json.dumps(report, allow_nan=False)))}
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{main.mapper!r}: report: {error}; expected a dict of texts and finite numbers"
        ) from None


def _sigma(scenario: Scenario, args: Namespace) -> float | None:
    """The noise [m] at range_max; None for a noise of the user's."""
    return None if args.noise and not args.sigma else (args.sigma or scenario.sigmas)[0]


def _rows(runs: Sequence[Run], summary: dict[str, Any]) -> list[tuple[str, str]]:
    run = runs[0]
    drive = summary["drive"]
    score = summary["score"]
    scans = f"{counted(drive['scans'], 'scan')} of {counted(run.ranges.shape[1], 'beam')}"
    rows = [("drive", f"{drive['length_m']:.1f} m in {drive['duration_s']:.1f} s, {scans}")]
    if not drive["length_m"]:
        rows = [("scans", f"{scans}, from single poses")]
    few_seen = 0.6  # Share of the walls below which a run says that it saw few of them.
    if (share := summary["seen_share"]) is not None:
        side = summary["planned"] or "there"
        doors = "see the doors above, or " if summary["planned"] else ""
        few = f"; the map shows the smaller part: {doors}drive on with more --scans"
        rows.append(("seen", f"{100 * share:.0f} % of the walls {side}{few * (share < few_seen)}"))
    if score is not None:
        found = found_words(score)
        if score["visible_segments"]:
            found += f"; the world has {counted(summary['world']['walls'], 'wall')}"
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
        time += f", {summary['milliseconds_an_update']:.1f} ms of it "
        time += summary.get("mapper", "mapping")
    return [*rows, ("time", time)]


def _run_fleet(
    scenario: Scenario,
    own: dict[str, Any],
    named: dict[str, Any],
    args: Namespace,
    console: Console,
) -> None:
    """Drive several robots along the route of a world, scan it, map it, and draw the results."""
    _check_fleet(scenario, own, args)
    scenario = routed(scenario, args, console)
    drives = _drives(scenario, args)
    output = results_folder(args, console, [args.world], scenario.name)
    sigma = (args.sigma or [None])[0]
    noise = made(own.get("noise"))

    def mapper() -> Any:
        return made(own["mapper"]) if "mapper" in own else measuring()[1]

    measuring = partial(scenario.measuring, sigma, noise, args.mode)
    begin = perf_counter()
    with console.progress("scans") as progress:
        runs = simulate_fleet(
            scenario.world, drives, scenario.lasers, radius=scenario.radius,
            outline=scenario.outline, obstacles=scenario.obstacles, mapper=mapper, rng=args.seed,
            progress=progress, noise=measuring()[0], caster=args.caster,
            odometry=scenario.odometry, imu=scenario.imu, lidars=scenario.lidars,
            depth_cameras=scenario.depth_cameras,
            attitude=scenario.attitude,
        )  # fmt: skip
    runs = [replace(run, film=scenario.film) for run in runs]
    common = {
        "name": scenario.name, "seed": args.seed, "caster": args.caster, **named,
        "sigma_m": _sigma(scenario, args), "planned": scenario.planned,
        "seconds": perf_counter() - begin,
    }  # fmt: skip
    files = dict[str, str]()
    pictures = dict[str, Drawing]()
    rows = []
    robots = []
    for number, run in enumerate(runs, 1):
        name = f"robot{number}"
        folder = make_folder(output.path / name)
        save_run(run, folder / "run.npz")
        maps, drawings = _map_files(run, output.path, name)
        figures = {"robot": name, **summarise(run)}
        write_text(folder / "summary.json", json_text({**common, **figures}))
        files |= {name: f"{name}/run.npz", **maps, f"{name} summary": f"{name}/summary.json"}
        pictures |= drawings
        robots.append(figures)
        rows.append((name, _fleet_row(run, figures)))
    output.finish(
        {**common, "robots": robots},
        files,
        pictures | _pictures(runs, scenario, args, console),
        rows=[*rows, ("time", f"{common['seconds']:.1f} s")],
        following=["view" if args.video else "render", output.path / "robot1"],
        kept=f"the runs are kept in {output.path}",
    )


def _check_fleet(scenario: Scenario, own: dict[str, Any], args: Namespace) -> None:
    for given, what in (
        ("controller" in own, "--controller: give lrf3d.simulate_fleet its controllers"),
        (args.resume, "--resume: runs of several robots are written when they end"),
        (len(args.sigma or ()) > 1, "--sigma: give one"),
        (scenario.poses is not None, f"{scenario.name}: it has poses, and no route to drive"),
    ):
        if given:
            raise InputError(f"--robots {args.robots}: {what}")
    if scenario.compared:
        warn(f"{scenario.name}: --robots compares no noise levels; the first one is taken")


def _drives(scenario: Scenario, args: Namespace) -> list[Any]:
    """The drives of all robots on their parts of the route, cut where two touch."""
    body = Body(scenario.radius, scenario.outline)
    assert scenario.route is not None
    parts = parts_of(scenario.route, args.robots, body)
    each = [scenario.changed(route=part) for part in parts]
    scans = args.scans or max(len(one.trajectory(on_collision=lambda note: None)) for one in each)
    drives = [one.trajectory(scans=scans, on_collision=on_collision(args)) for one in each]
    drives = giving_way(drives, body)
    kept, touch = before_touching(drives, body)
    if touch and args.ignore_collisions:
        warn(f"{touch}; they drive through each other")
    elif touch:
        warn(f"{touch}; all drives end before, after {len(kept[0]):,} of {scans:,} scans each")
        drives = kept
    for number, drive in enumerate(drives, 1):
        _warn_of(f"robot{number}", drive, body, scenario.obstacles)
    return drives


def _warn_of(
    robot: str, drive: Trajectory, body: Body, obstacles: Sequence[DynamicObstacle]
) -> None:
    """Warn of a drive that ends waiting, or that meets an obstacle."""
    if len(drive) > 1 and (drive.poses[-1] == drive.poses[-2]).all():
        still = int((drive.poses == drive.poses[-1]).all(axis=1).argmax())
        warn(f"{robot}: waits for another one from t = {drive.times[still]:.1f} s on")
    hit = find_collision(drive, World(np.empty((0, 4))), body, obstacles)
    if hit is not None:
        warn(f"{robot}: {hit}; its route takes no notice of it")


def _fleet_row(run: Run, figures: dict[str, Any]) -> str:
    drive = figures["drive"]
    text = f"{drive['length_m']:.1f} m in {drive['duration_s']:.1f} s,"
    text += f" {counted(drive['scans'], 'scan')}"
    if (share := figures["seen_share"]) is not None:
        text += f", {100 * share:.0f} % of the walls seen"
    return f"{text}; {run.map.counts}" if run.maps else text
