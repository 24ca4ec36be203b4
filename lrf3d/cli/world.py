"""``lrf3d world``: look at worlds."""

from pathlib import Path
from typing import Annotated

import typer

from lrf3d.cli import options

world = typer.Typer(
    help="Look at worlds.", rich_markup_mode=None, no_args_is_help=True, add_completion=False
)


@world.callback()
def _group() -> None:
    """Look at worlds."""


@world.command(epilog="Example: lrf3d world show city --out city.png")
def show(
    world: Annotated[
        str | None,
        typer.Argument(metavar="[WORLD]", help="A world; without one, the built-in are listed."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="A picture .png to draw it to.")] = None,
    json: options.Json = False,
) -> None:
    """Say what a world holds, and draw it."""
    from lrf3d.cli.console import print_json, print_table
    from lrf3d.geometry import lengths
    from lrf3d.scenario import load_scenario
    from lrf3d.world import world_names

    if world is None:
        print_json(world_names()) if json else print("\n".join(world_names()))
        return
    scenario = load_scenario(world)
    walls = scenario.world
    (x1, y1), (x2, y2) = walls.bounds.tolist()
    low, high = float(walls.heights.min()), float(walls.heights.max())
    report = {
        "name": scenario.name,
        "objects": walls.object_count,
        "walls": len(walls.segments),
        "wall_length_m": float(lengths(walls.segments).sum()),
        "bounds_m": [[x1, y1], [x2, y2]],
        "heights_m": [low, high],
        "route_points": None if scenario.route is None else len(scenario.route),
        "scan_poses": None if scenario.poses is None else len(scenario.poses),
    }
    if out is not None:
        from lrf3d.render.figures import draw_world

        draw_world(walls, out, route=scenario.route, poses=scenario.poses)
        report["picture"] = str(out)
    if json:
        print_json(report)
        return
    rows = [
        ("name", scenario.name),
        ("objects", f"{walls.object_count} of {len(walls.segments)} walls"),
        ("walls", f"{report['wall_length_m']:.1f} m long, {low:g} to {high:g} m high"),
        ("bounds", f"x {x1:.2f} to {x2:.2f} m, y {y1:.2f} to {y2:.2f} m"),
    ]
    if scenario.route is not None:
        rows.append(("route", f"{len(scenario.route)} way-points"))
    if scenario.poses is not None:
        rows.append(("poses", f"{len(scenario.poses)}"))
    if out is not None:
        rows.append(("picture", str(out)))
    print_table(rows)
