"""``lrf3d crosscheck``: bare Embree on the walls in 3D against the exact plane."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lrf3d.cli import options

if TYPE_CHECKING:
    from lrf3d.casting import CrossCheck


def crosscheck(
    world: options.WorldArgument,
    figure: Annotated[
        Path | None, typer.Option(help="Draw the beams that differ to this .png.")
    ] = None,
    scale: options.Scale = 1.0,
    inside: options.Inside = None,
    ignore_collisions: options.IgnoreCollisions = False,
    json: options.Json = False,
) -> None:
    """Compare Embree's own float32 hits with the exact ones, for the beams of a whole drive.

    Every difference is classified by its cause. The exit status is 1 if one is unexplained.
    """
    from lrf3d.casting import crosscheck as compare
    from lrf3d.casting.comparison import Cause
    from lrf3d.cli.console import print_json, print_table, progress_bar, warn

    scenario = options.read_drive(world, scale=scale, inside=inside)
    trajectory = scenario.trajectory(on_collision=warn if ignore_collisions else None)
    with progress_bar("crosscheck") as progress:
        result = compare(scenario.world, scenario.lrf, trajectory.poses, progress)
    report = {"world": scenario.name, "scans": len(trajectory), **result.as_dict()}
    if json:
        print_json(report if figure is None else {**report, "picture": str(figure)})
    else:
        rows = [("beams", f"{result.beams} in {len(trajectory)} scans, {result.hits} returned")]
        print_table([*rows, *_findings(result)])
    if figure is not None:
        from lrf3d.render.crosscheck_figure import draw_crosscheck

        draw_crosscheck(scenario.world, scenario.lrf, trajectory.poses, result, figure)
    if Cause.UNEXPLAINED in result.causes:
        raise typer.Exit(1)


def _findings(result: "CrossCheck") -> list[tuple[str, str]]:
    from lrf3d.casting.comparison import MEANING, Cause

    agree = result.beams - len(result.causes)
    rows = [("agree", f"{agree}, the largest difference {result.largest_difference:.1e} m")]
    counts = result.counts
    unexplained = counts.pop(Cause.UNEXPLAINED, 0)
    rows += [(str(cause), f"{count}: {MEANING[cause]}") for cause, count in counts.items()]
    if result.causes:
        rows.append(("largest error", f"{result.largest_error:.3g} m, of the beams that differ"))
    return [*rows, ("unexplained", str(unexplained))]
