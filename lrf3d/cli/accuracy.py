"""``lrf3d crosscheck`` and ``lrf3d localise``: how exact ranges are, and poses on a known map."""

from math import radians
from pathlib import Path
from typing import Annotated, Literal

import typer

from lrf3d.cli.console import Report
from lrf3d.cli.options import Count, Drive, Workers, WorldArgument

Noise = Annotated[float, typer.Option(min=0.0)]


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
    from lrf3d.casting.comparison import CAUSES, UNEXPLAINED

    with report.progress("crosscheck") as progress:
        result = compare(scenario.world, scenario.lrf, trajectory.poses, progress)
    figures = {"world": scenario.name, "scans": len(trajectory), **result.as_dict()}
    if figure is not None:
        from lrf3d.render.figures import draw_crosscheck

        draw_crosscheck(scenario.world, scenario.lrf, trajectory.poses, result, figure)
        figures["picture"] = str(figure)
    unexplained = result.counts.get(UNEXPLAINED, 0)
    agree, largest = result.beams - len(result.causes), result.largest_difference
    report.print(
        figures,
        [
            ("beams", f"{result.beams:,} in {len(trajectory)} scans"),
            ("agree", f"{agree:,}, the largest difference {largest:.1e} m"),
            ("differ", f"{len(result.causes)}, {unexplained} of them unexplained"),
            *((f"  {cause}", f"{n}: {CAUSES[cause]}") for cause, n in result.counts.items()),
            *([] if figure is None else [("picture", str(figure))]),
        ],
    )
    if unexplained:
        raise typer.Exit(1)


def localise(
    world: WorldArgument,
    drive: Drive,
    report: Report,
    known: Literal["walls", "map"] = "walls",
    strategy: Literal["seen-objects-first", "all"] = "seen-objects-first",
    seeds: Count = 10,
    sigma: float | None = None,
    position: Noise = 0.1,
    heading: Noise = 2.0,
    workers: Workers = None,
) -> None:
    """Localise the robot on a known map, and score it.

    The NEES is the squared error in units of the filter's own covariance, 3 on average.

    Options:
        known: The known map: the true walls, or the map of a first run.
        strategy: Which known lines are compared with those of a scan.
        seeds: Number of drives, each with its own noise.
        sigma: Noise [m] at range_max.
        position: Odometry noise [m] per step, ahead and sideways.
        heading: Odometry noise [deg] per step.
    """
    scenario = drive.read(world, report)
    sigma = scenario.sigmas[0] if sigma is None else sigma

    from lrf3d.localization import OdometryNoise
    from lrf3d.localization.monte_carlo import score_localisation

    odometry = OdometryNoise(position, radians(heading))
    with report.progress("first run") as progress:
        run = scenario.run(
            mode="robust", sigma=sigma, rng=0, snapshots=1, on_collision=drive.on_collision,
            progress=progress,
        )  # fmt: skip
    with report.progress("seeds") as progress:
        score = score_localisation(
            run, sigma, odometry, known=known, strategy=strategy, seeds=seeds, workers=workers,
            progress=progress,
        )  # fmt: skip
    noise = {"position_m": position, "heading_deg": heading}
    report.print(
        {"name": scenario.name, "sigma_m": sigma, "odometry_noise": noise, **score},
        [
            ("known", f"{score['lines']} lines: the {known} of {scenario.name}"),
            ("drives", f"{score['seeds']} of {score['scans']} scans"),
            ("position", f"{score['mean_position_error_m']:.4f} m off on average, at most"
                         f" {score['largest_position_error_m']:.3f} m"),
            ("heading", f"{score['mean_heading_error_deg']:.4f}° off on average"),
        ],
    )  # fmt: skip
