"""``lrf3d world``: look at worlds, convert and generate them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report

if TYPE_CHECKING:
    from lrf3d.world import World


def show(
    report: Report,
    world: Annotated[str | None, typer.Argument(metavar="[WORLD]")] = None,
    out: options.OutFile = None,
    scale: options.Scale = 1.0,
    resolution: options.Resolution = None,
) -> None:
    """Describe a world, and draw it.

    Options:
        world: A world; lists the built-in ones if not given.
        out: Draw the world to this .png.
    """
    from lrf3d.cli.console import print_json, print_text
    from lrf3d.text import counted
    from lrf3d.world import world_names

    if world is None:
        names = world_names()
        print_json(names) if report.json else print_text("\n".join([*names, ""]))
        return
    scenario = options.read_world(world, scale=scale, resolution=resolution)
    route, poses = scenario.route, scenario.poses
    figures, rows = _described(scenario.world, name=scenario.name)
    figures["route_points"] = None if route is None else len(route)
    figures["scan_poses"] = None if poses is None else len(poses)
    rows += [] if route is None else [("route", counted(len(route), "way-point"))]
    rows += [] if poses is None else [("poses", str(len(poses)))]
    if out is not None:
        from lrf3d.render.figures import draw_world

        draw_world(scenario.world, out, route=route, poses=poses)
        figures["picture"] = str(out)
        rows.append(("picture", str(out)))
    report.print(figures, rows)


def convert(
    source: Annotated[str, typer.Argument(metavar="FROM")],
    target: Annotated[Path, typer.Argument(metavar="TO")],
    report: Report,
    scale: options.Scale = 1.0,
    resolution: float | None = None,
    trees: bool = False,
) -> None:
    """Read a world from one format and write it in another.

    Options:
        source: A built-in world, or a file.
        target: The file to write: .toml, .geojson, .glb or .yaml.
        resolution: Side of a cell [m] of a ROS map (0.05), or of a pixel of a bare picture.
        trees: Make walls of the trunks of trees in a .osm file, too.
    """
    from lrf3d.world import load_world, save_world
    from lrf3d.world.files import is_picture

    bare = is_picture(source)
    read = load_world(source, trees=trees, resolution=resolution if bare else None).scaled(scale)
    cells = target.suffix.lower() == ".yaml"
    save_world(read, target, resolution=None if bare and not cells else resolution)
    figures, rows = _described(read, **{"from": source})
    report.print(figures | {"written": str(target)}, [*rows, ("written", str(target))])


def generate(
    kind: Literal["city", "maze", "office", "rooms"],
    out: Annotated[Path, typer.Option("--out", "-o")],
    report: Report,
    seed: options.Seed = 0,
    size: float | None = None,
) -> None:
    """Generate a world that a robot can drive in.

    Options:
        kind: Kind of world.
        out: The file to write: .toml, .geojson, .glb or .yaml.
        size: Approximate width [m]; depends on the kind if not given.
    """
    from lrf3d.world import save_world
    from lrf3d.world.generators import generate as generate_world

    made = generate_world(kind, size=size, seed=seed)
    save_world(made, out)
    figures, rows = _described(made, name=made.name)
    figures |= {"kind": kind, "seed": seed, "written": str(out)}
    report.print(figures, [*rows, ("written", str(out))])


def _described(world: "World", **name: str) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """The name and the properties of a world, in JSON's types and as a table."""
    from lrf3d.geometry import lengths

    long = float(lengths(world.segments).sum())
    low, high = float(world.heights.min()), float(world.heights.max())
    (x1, y1), (x2, y2) = world.bounds
    figures = {
        **name,
        "objects": world.object_count,
        "walls": len(world.segments),
        "wall_length_m": long,
        "bounds_m": world.bounds.tolist(),
        "heights_m": [low, high],
        "place": None if world.place is None else list(world.place),
    }
    heights = f"{low:g} m" if low == high else f"{low:g} to {high:g} m"
    rows = [
        *name.items(),
        ("objects", f"{world.object_count:,}"),
        ("walls", f"{len(world.segments):,}, {long:.1f} m long, {heights} high"),
        ("bounds", f"x {x1:.2f} to {x2:.2f} m, y {y1:.2f} to {y2:.2f} m"),
    ]
    if world.place is not None:
        longitude, latitude = world.place
        rows.append(("place", f"(0, 0) is at longitude {longitude:.7f}°, latitude {latitude:.7f}°"))
    return figures, rows
