"""``lrf3d crosscheck``: bare Embree on the walls in 3D against the exact plane."""

from pathlib import Path
from typing import Annotated

import typer

from lrf3d.cli.console import Report
from lrf3d.cli.options import Drive, WorldArgument


def crosscheck(
    world: WorldArgument,
    drive: Drive,
    report: Report,
    figure: Annotated[Path | None, typer.Option("--figure", "-o")] = None,
) -> None:
    """Compare bare Embree in float32 with the exact ranges.

    Each difference over a whole drive is classified by its cause. The exit status is 1 if one is
    unexplained.

    Options:
        figure: Draw the beams that differ to this .png.
    """
    scenario = drive.read(world, report)
    trajectory = scenario.trajectory(on_collision=drive.on_collision)

    from lrf3d.casting import crosscheck as compare
    from lrf3d.casting.comparison import MEANING, Cause

    with report.progress("crosscheck") as progress:
        result = compare(scenario.world, scenario.lrf, trajectory.poses, progress)
    figures = {"world": scenario.name, "scans": len(trajectory), **result.as_dict()}
    if figure is not None:
        from lrf3d.render.figures import draw_crosscheck

        draw_crosscheck(scenario.world, scenario.lrf, trajectory.poses, result, figure)
        figures["picture"] = str(figure)
    unexplained = result.counts.get(Cause.UNEXPLAINED, 0)
    agree, largest = result.beams - len(result.causes), result.largest_difference
    report.print(
        figures,
        [
            ("beams", f"{result.beams:,} in {len(trajectory)} scans"),
            ("agree", f"{agree:,}, the largest difference {largest:.1e} m"),
            ("differ", f"{len(result.causes)}, {unexplained} of them unexplained"),
            *((f"  {cause}", f"{n}: {MEANING[cause]}") for cause, n in result.counts.items()),
            *([] if figure is None else [("picture", str(figure))]),
        ],
    )
    if unexplained:
        raise typer.Exit(1)
