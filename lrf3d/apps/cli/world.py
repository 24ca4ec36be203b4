"""``lrf3d world`` and ``crosscheck``: worlds, and how exact ranges are in them."""

from argparse import Namespace
from typing import Any

from lrf3d.apps.cli.console import Console, print_json, print_text
from lrf3d.apps.cli.folder import draw_figure, new_file
from lrf3d.apps.cli.inputs import on_collision, options_of, routed
from lrf3d.base.text import counted
from lrf3d.geometry.lines import lengths
from lrf3d.simulation.scenario import Scenario
from lrf3d.world import World, load_world, save_world, world_names
from lrf3d.world.files import is_picture


def show(found: tuple[Scenario | None, Any], args: Namespace, console: Console) -> None:
    """Describe a world and its plan, and draw it; without one list the built-in worlds."""
    scenario, plan = found
    if scenario is None:
        names = world_names()
        print_json(names) if console.json else print_text("\n".join([*names, ""]))
        return
    route = scenario.route
    poses = scenario.poses
    figures: dict[str, Any] = {
        "route_points": None if route is None else len(route),
        "scan_poses": None if poses is None else len(poses),
    }
    rows = [] if route is None else [("route", counted(len(route), "way-point"))]
    rows += [] if poses is None else [("poses", str(len(poses)))]
    if plan is not None:
        from lrf3d.planning.rooms import rooms_of

        plan = plan._replace(rooms=rooms_of(scenario.world))
        rows += _plan_rows(plan)
        figures |= _plan_figures(plan)
    if args.out is not None:
        with new_file(args, args.out, [args.world]) as place:
            draw_figure("scenario", scenario, place, plan=plan)
        figures["picture"] = str(args.out)
        rows.append(("picture", str(args.out)))
    _describe(console, scenario.world, {"name": scenario.name}, figures, rows)


def _plan_figures(plan: Any) -> dict[str, Any]:
    return {
        "layers": [layer._asdict() for layer in plan.layers],
        "doors_m": [door.width for door in plan.doors],
        "rooms_m2": [area for area, _ in plan.rooms],
        "left_out": plan.left_out,
    }


def _plan_rows(plan: Any) -> list[tuple[str, str]]:
    layers = [
        ("layer" if number == 0 else "", f"{name or '(none)'}  {length:.1f} m: {roles}")
        for number, (name, length, roles) in enumerate(plan.layers)
    ]
    doors = [
        f"{door.width:.2f} m at ({x:.1f}, {y:.1f})"
        for door in plan.doors
        for x, y in [door.opening.mean(axis=0)]
    ]
    rooms = [f"{area:.1f}" for area, _ in plan.rooms]
    return [
        *layers,
        ("doors", ", ".join([str(len(doors)), *doors[:20]])),
        ("rooms", f"{len(rooms)}: {', '.join(rooms[:20])} m²" if rooms else "0"),
        ("left out", plan.left_out or "nothing"),
    ]


def convert(_: None, args: Namespace, console: Console) -> None:
    """Read a world from one format and write it in another."""
    # The resolution is that of a picture, or of the cells to write.
    bare = is_picture(args.from_)
    options = options_of(args)
    if not bare:
        options.pop("resolution", None)
    world = load_world(args.from_, **options)
    cells = args.to.suffix.lower() == ".yaml" or not bare
    with new_file(args, args.to, [args.from_]) as place:
        save_world(world, place, resolution=args.resolution if cells else None)
    written = {"written": str(args.to)}
    _describe(console, world, {"from": args.from_}, written, list(written.items()))


def generate(_: None, args: Namespace, console: Console) -> None:
    """Generate a world that a robot can drive in."""
    from lrf3d.world.generators import generate as generate_world

    world = generate_world(args.kind, size=args.size, seed=args.seed)
    with new_file(args, args.out, [args.kind]) as place:
        save_world(world, place)
    written = {"written": str(args.out)}
    figures = {"kind": args.kind, "seed": args.seed, **written}
    _describe(console, world, {"name": world.name}, figures, list(written.items()))


def _describe(
    console: Console,
    world: World,
    name: dict[str, str],
    more: dict[str, Any],
    more_rows: list[tuple[str, str]],
) -> None:
    """Print the name and the properties of a world, and more."""
    long = float(lengths(world.segments).sum())
    low = float(world.heights.min())
    high = float(world.heights.max())
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
    console.print(figures | more, [*rows, *more_rows])


def crosscheck(scenario: Scenario, args: Namespace, console: Console) -> int:
    """Compare bare Embree in float32 with the exact ranges; 1 if a difference is unexplained."""
    from lrf3d.casting import crosscheck as compare
    from lrf3d.casting.comparison import CAUSES, UNEXPLAINED

    scenario = routed(scenario, args, console)
    world = scenario.world
    lrf = scenario.lrf
    poses = scenario.trajectory(on_collision=on_collision(args)).poses
    with console.progress("crosscheck") as progress:
        result = compare(world, lrf, poses, progress)
    figures = {"world": scenario.name, "scans": len(poses), **result.as_dict()}
    unexplained = result.counts.get(UNEXPLAINED, 0)
    agree = result.beams - len(result.causes)
    rows = [
        ("beams", f"{result.beams:,} in {len(poses)} scans"),
        ("agree", f"{agree:,}, the largest difference {result.largest_difference:.1e} m"),
        (
            "differ",
            f"{len(result.causes)}, by up to {result.largest_error:.2g} m,"
            f" {unexplained} unexplained",
        ),
        *((f"  {cause}", f"{n}: {CAUSES[cause]}") for cause, n in result.counts.items()),
    ]
    if args.figure is not None:
        with new_file(args, args.figure, [args.world]) as place:
            draw_figure("crosscheck", world, lrf, poses, result, place)
        figures["picture"] = str(args.figure)
        rows.append(("picture", str(args.figure)))
    console.print(figures, rows)
    return 1 if unexplained else 0
