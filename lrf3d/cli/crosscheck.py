"""``lrf3d crosscheck``: the same beams through the plane and through the 3D mesh."""

import typer

from lrf3d.cli import options


def crosscheck(
    world: options.WorldArgument,
    ignore_collisions: options.IgnoreCollisions = False,
    json: options.Json = False,
) -> None:
    """Cast the beams of a whole drive with both casters, and compare every range.

    Ends with the status 1 where they differ and no end of a wall explains it.
    """
    from lrf3d.casting import crosscheck as compare
    from lrf3d.cli.console import print_json, print_table, progress_bar, warn
    from lrf3d.scenario import load_scenario
    from lrf3d.study.experiment import trajectory_of, with_route

    scenario = with_route(load_scenario(world))
    trajectory = trajectory_of(scenario, ignore_collisions=warn if ignore_collisions else None)
    with progress_bar("crosscheck") as progress:
        result = compare(scenario.world, scenario.lrf, trajectory.poses, progress)
    report = {"world": scenario.name, "scans": len(trajectory), **result.as_dict()}
    if json:
        print_json(report)
    else:
        agree = result.beams - len(result.differences)
        rows = [
            ("beams", f"{result.beams} in {len(trajectory)} scans, {result.hits} returned"),
            ("agree", f"{agree}, the largest difference {result.largest_difference:.1e} m"),
            (
                "edge cases",
                f"{len(result.edge_cases)} ({len(result.edge_cases) / max(1, result.beams):.2e}"
                " of all): beams by the end of a wall, where float32 may choose either side",
            ),
            ("unexplained", str(len(result.unexplained))),
        ]
        print_table(rows)
    if result.unexplained:
        raise typer.Exit(1)
