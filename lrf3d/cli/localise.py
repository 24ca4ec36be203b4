"""``lrf3d localise``: how well the robot localises itself on a known map."""

from enum import StrEnum
from typing import Annotated

import typer

from lrf3d.cli import options
from lrf3d.cli.console import print_json, print_table, progress_bar, warn


class KnownMap(StrEnum):
    """Which map is known."""

    WALLS = "walls"
    MAP = "map"


class Strategy(StrEnum):
    """Which known lines the lines of a scan are compared with."""

    SEEN_OBJECTS_FIRST = "seen-objects-first"
    ALL = "all"


def localise(
    world: options.WorldArgument,
    known: Annotated[
        KnownMap, typer.Option(help="The known map: the true walls, or the map of a first run.")
    ] = KnownMap.WALLS,
    strategy: Annotated[
        Strategy, typer.Option(help="Which known lines are compared with those of a scan.")
    ] = Strategy.SEEN_OBJECTS_FIRST,
    seeds: Annotated[
        int, typer.Option(min=1, help="Number of drives, each with its own noise.")
    ] = 10,
    sigma: Annotated[float | None, typer.Option(help="Noise [m] at range_max.")] = None,
    position: Annotated[
        float, typer.Option(min=0.0, help="Odometry noise [m] per step, ahead and sideways.")
    ] = 0.1,
    heading: Annotated[float, typer.Option(min=0.0, help="Odometry noise [deg] per step.")] = 2.0,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes; one for each core if not given.")
    ] = None,
    scale: options.Scale = 1.0,
    inside: options.Inside = None,
    ignore_collisions: options.IgnoreCollisions = False,
    json: options.Json = False,
) -> None:
    """Localise the robot on a known map by odometry and scans, and compare with the truth.

    The NEES is the squared error in units of the filter's own covariance, 3 on average.
    """
    from math import radians

    from lrf3d.localization import OdometryNoise
    from lrf3d.localization.monte_carlo import LocalisationTask, score_localisation

    scenario = options.read_drive(world, scale=scale, inside=inside)
    sigma = scenario.sigmas[0] if sigma is None else sigma
    odometry = OdometryNoise(position, radians(heading))
    collision = warn if ignore_collisions else None
    with progress_bar("first run") as progress:
        run = scenario.run(
            mode="robust",
            sigma=sigma,
            rng=0,
            snapshots=1,
            on_collision=collision,
            progress=progress,
        )
    task = LocalisationTask(run, sigma, odometry, known.value, strategy.value)
    with progress_bar("seeds") as progress:
        score = score_localisation(task, seeds=seeds, workers=workers, progress=progress).as_dict()
    report = {
        "name": scenario.name,
        "known": known.value,
        "lines": len(task.known_lines()),
        "strategy": strategy.value,
        "sigma_m": sigma,
        "odometry_noise": {"position_m": position, "heading_deg": heading},
        **score,
    }
    if json:
        print_json(report)
        return
    nees = score["nees"]
    low, high = nees["bounds_of_average_over_seeds"]
    print_table(
        [
            ("known", f"{report['lines']} lines: the {known.value} of {scenario.name}"),
            ("drives", f"{score['seeds']} of {score['scans']} scans"),
            (
                "position",
                f"{score['mean_position_error_m']:.4f} m off on average, RMS"
                f" {score['rms_position_error_m']:.4f} m, at most"
                f" {score['largest_position_error_m']:.3f} m",
            ),
            ("heading", f"{score['mean_heading_error_deg']:.4f}° off on average"),
            (
                "NEES",
                f"{nees['mean']:.2f} on average; {100 * nees['scans_within_bounds']:.1f} % of the"
                f" scans within {low:.2f} to {high:.2f}",
            ),
            (
                "lines",
                f"{score['lines_a_scan']:.1f} a scan, by {score['comparisons_a_scan']:.0f}"
                " comparisons",
            ),
        ]
    )
