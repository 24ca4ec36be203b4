"""``lrf3d world``: look at worlds, convert and generate them."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lrf3d.cli import options

if TYPE_CHECKING:
    from lrf3d.world import World

world = typer.Typer(
    help="Look at worlds, convert and generate them.",
    rich_markup_mode=None,
    no_args_is_help=True,
    add_completion=False,
)


class Kind(StrEnum):
    """Kinds of worlds that can be generated."""

    CITY = "city"
    MAZE = "maze"
    OFFICE = "office"
    ROOMS = "rooms"


@world.callback()
def _group() -> None:
    """Look at worlds, convert and generate them."""


@world.command(epilog="Example: lrf3d world show city --out city.png")
def show(
    world: Annotated[
        str | None,
        typer.Argument(metavar="[WORLD]", help="A world; lists the built-in ones if not given."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Draw the world to this .png.")] = None,
    scale: options.Scale = 1.0,
    json: options.Json = False,
) -> None:
    """Describe a world, and draw it."""
    from lrf3d.cli.console import print_json, print_text
    from lrf3d.world import world_names

    if world is None:
        print_json(world_names()) if json else print_text("\n".join([*world_names(), ""]))
        return
    scenario = options.read_world(world, scale=scale)
    report = {"name": scenario.name} | _report(scenario.world)
    report["route_points"] = None if scenario.route is None else len(scenario.route)
    report["scan_poses"] = None if scenario.poses is None else len(scenario.poses)
    if out is not None:
        from lrf3d.render.figures import draw_world

        draw_world(scenario.world, out, route=scenario.route, poses=scenario.poses)
        report["picture"] = str(out)
    _say(report, json)


@world.command(epilog="Example: lrf3d world convert plan.dxf plan.toml")
def convert(
    source: Annotated[str, typer.Argument(metavar="FROM", help="A built-in world, or a file.")],
    target: Annotated[
        Path,
        typer.Argument(metavar="TO", help="The file to write: .toml, .geojson, .glb or .yaml."),
    ],
    scale: options.Scale = 1.0,
    resolution: Annotated[
        float | None, typer.Option(help="Side of a cell of a ROS map [m]; 0.05 if not given.")
    ] = None,
    trees: Annotated[
        bool, typer.Option("--trees", help="Make walls of the trunks of trees in a .osm file, too.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Read a world from one format and write it in another."""
    from lrf3d.world import load_world, save_world

    read = load_world(source, trees=trees).scaled(scale)
    save_world(read, target, resolution=resolution)
    _say({"from": source} | _report(read) | {"written": str(target)}, json)


@world.command(epilog="Example: lrf3d world generate maze --seed 7 --out maze.toml")
def generate(
    kind: Annotated[Kind, typer.Argument(help="Kind of world.")],
    out: Annotated[Path, typer.Option(help="The file to write: .toml, .geojson, .glb or .yaml.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed; the same seed gives the same world.")] = 0,
    size: Annotated[
        float | None, typer.Option(help="Approximate width [m]; depends on the kind if not given.")
    ] = None,
    json: options.Json = False,
) -> None:
    """Generate a world that a robot can drive in."""
    from lrf3d.world import save_world
    from lrf3d.world.generators import generate as generate_world

    made = generate_world(kind.value, size=size, seed=seed)
    save_world(made, out)
    _say(
        {"kind": kind.value, "seed": seed, "name": made.name}
        | _report(made)
        | {"written": str(out)},
        json,
    )


def _report(world: "World") -> dict[str, Any]:
    """The properties of a world."""
    from lrf3d.geometry import lengths

    return {
        "objects": world.object_count,
        "walls": len(world.segments),
        "wall_length_m": float(lengths(world.segments).sum()),
        "bounds_m": world.bounds.tolist(),
        "heights_m": [float(world.heights.min()), float(world.heights.max())],
        "place": None if world.place is None else list(world.place),
    }


def _say(report: dict[str, Any], json: bool) -> None:
    """Print a report as JSON or as a table."""
    from lrf3d.cli.console import print_json, print_table
    from lrf3d.text import counted

    if json:
        print_json(report)
        return
    (x1, y1), (x2, y2) = report["bounds_m"]
    low, high = report["heights_m"]
    heights = f"{low:g} m" if low == high else f"{low:g} to {high:g} m"
    described: dict[str, str] = {
        "objects": f"{report['objects']:,}",
        "walls": f"{report['walls']:,}, {report['wall_length_m']:.1f} m long, {heights} high",
        "bounds": f"x {x1:.2f} to {x2:.2f} m, y {y1:.2f} to {y2:.2f} m",
    }
    rows: list[tuple[str, str]]
    rows = [(key, str(report[key])) for key in ("kind", "seed", "name", "from") if key in report]
    rows += list(described.items())
    if report["place"] is not None:
        longitude, latitude = report["place"]
        rows.append(("place", f"(0, 0) is at longitude {longitude:.7f}°, latitude {latitude:.7f}°"))
    if report.get("route_points") is not None:
        rows.append(("route", counted(report["route_points"], "way-point")))
    if report.get("scan_poses") is not None:
        rows.append(("poses", f"{report['scan_poses']}"))
    rows += [(key, report[key]) for key in ("picture", "written") if key in report]
    print_table(rows)
