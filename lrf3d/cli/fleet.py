"""``lrf3d run --robots N``: several robots on one route, each with its scans and its map."""

from argparse import Namespace
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from lrf3d.cli.console import Report, json_text, warn
from lrf3d.cli.folder import results_folder
from lrf3d.cli.inputs import on_collision, routed
from lrf3d.cli.plugins import made
from lrf3d.cli.runs import write_film
from lrf3d.collision import Body, find_collision
from lrf3d.errors import InputError
from lrf3d.files import make_folder, write_text
from lrf3d.fleet import before_touching, giving_way, parts_of, simulate_fleet
from lrf3d.io import save_run
from lrf3d.mapping import save_map
from lrf3d.render.figures import draw_map, draw_world
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scoring import seen_share
from lrf3d.scoring.map_score import drawn_part, judged_part, summarise
from lrf3d.text import counted
from lrf3d.world import World


def run_fleet(
    scenario: Scenario, own: dict[str, Any], named: dict[str, Any], args: Namespace, report: Report
) -> None:
    """Drive several robots along the route of a world, scan it, map it, and draw the results."""
    _check(scenario, own, args)
    scenario = routed(scenario, args, report)
    drives = _drives(scenario, args)
    output = results_folder(report, [args.world], scenario.name, args.out)
    sigma, noise = (args.sigma or [None])[0], made(own.get("noise"))

    def mapper() -> Any:
        return made(own["mapper"]) if "mapper" in own else measuring()[1]

    measuring = partial(scenario.measuring, sigma, noise, args.mode)
    begin = perf_counter()
    with report.progress("scans") as progress:
        runs = simulate_fleet(
            scenario.world, drives, scenario.lasers, radius=scenario.radius,
            outline=scenario.outline, obstacles=scenario.obstacles, mapper=mapper, rng=args.seed,
            progress=progress, noise=measuring()[0], caster=args.caster,
            odometry=scenario.odometry, imu=scenario.imu,
        )  # fmt: skip
    runs = [replace(run, film=scenario.film) for run in runs]
    common = {
        "name": scenario.name, "seed": args.seed, "caster": args.caster, **named,
        "sigma_m": scenario.sigmas[0] if sigma is None else sigma, "planned": scenario.planned,
        "seconds": perf_counter() - begin,
    }  # fmt: skip
    files, pictures, rows, robots = dict[str, str](), dict[str, Any](), [], []
    for number, run in enumerate(runs, 1):
        name = f"robot{number}"
        folder = make_folder(output.path / name)
        save_run(run, folder / "run.npz")
        files[name] = f"{name}/run.npz"
        # A user's mapper may make no LineMap.
        if run.maps:
            save_map(run.map, folder / "map.geojson", free=run.free_cells())
            files[f"{name} map"] = f"{name}/map.geojson"
            pictures[f"{name} map picture"] = f"{name}/map.png", partial(draw_map, drawn_part(run))
        figures = {"robot": name, **summarise(run), "seen_share": seen_share(judged_part(run))}
        write_text(folder / "summary.json", json_text({**common, **figures}))
        files[f"{name} summary"] = f"{name}/summary.json"
        robots.append(figures)
        rows.append((name, _row(run, figures)))
    first = drawn_part(runs[0])
    pictures["world picture"] = (
        "world.png",
        lambda path: draw_world(first.world, path, scan=first.scan(0), route=scenario.route),
    )
    if args.video:
        pictures["video"] = "run.mp4", lambda path: write_film(runs[0], path, args, report)
    output.finish(
        {**common, "robots": robots},
        files,
        pictures,
        rows=[*rows, ("time", f"{common['seconds']:.1f} s")],
        following=f"lrf3d {'view' if args.video else 'render'} {output.path / 'robot1'}",
        kept=f"the runs are kept in {output.path}",
    )


def _check(scenario: Scenario, own: dict[str, Any], args: Namespace) -> None:
    """Refuse what several robots cannot do."""
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
        if len(drive) > 1 and (drive.poses[-1] == drive.poses[-2]).all():
            still = int((drive.poses == drive.poses[-1]).all(axis=1).argmax())
            warn(f"robot{number}: waits for another one from t = {drive.times[still]:.1f} s on")
        hit = find_collision(drive, World(np.empty((0, 4))), body, scenario.obstacles)
        if hit is not None:
            warn(f"robot{number}: {hit}; its route takes no notice of it")
    return drives


def _row(run: Run, figures: dict[str, Any]) -> str:
    """What most users ask of the run of a robot."""
    drive = figures["drive"]
    text = f"{drive['length_m']:.1f} m in {drive['duration_s']:.1f} s,"
    text += f" {counted(drive['scans'], 'scan')}"
    if (share := figures["seen_share"]) is not None:
        text += f", {100 * share:.0f} % of the walls seen"
    return f"{text}; {run.map.counts}" if run.maps else text
