"""``lrf3d crosscheck`` and ``lrf3d localise``: how exact ranges are, and poses on a known map."""

from argparse import Namespace
from math import radians

from lrf3d.casting import crosscheck as compare
from lrf3d.casting.comparison import CAUSES, UNEXPLAINED
from lrf3d.cli.console import Report
from lrf3d.cli.inputs import MapAndLog, on_collision, routed
from lrf3d.cli.logs import localise_recorded
from lrf3d.localization import OdometryNoise
from lrf3d.localization.monte_carlo import score_localisation
from lrf3d.scenario import Scenario


def crosscheck(scenario: Scenario, args: Namespace, report: Report) -> int:
    """Compare bare Embree in float32 with the exact ranges; 1 if a difference is unexplained."""
    scenario = routed(scenario, args, report)
    world, lrf = scenario.world, scenario.lrf
    poses = scenario.trajectory(on_collision=on_collision(args)).poses
    with report.progress("crosscheck") as progress:
        result = compare(world, lrf, poses, progress)
    figures = {"world": scenario.name, "scans": len(poses), **result.as_dict()}
    unexplained = result.counts.get(UNEXPLAINED, 0)
    agree, largest = result.beams - len(result.causes), result.largest_difference
    furthest = result.largest_error
    rows = [
        ("beams", f"{result.beams:,} in {len(poses)} scans"),
        ("agree", f"{agree:,}, the largest difference {largest:.1e} m"),
        ("differ", f"{len(result.causes)}, by up to {furthest:.2g} m, {unexplained} unexplained"),
        *((f"  {cause}", f"{n}: {CAUSES[cause]}") for cause, n in result.counts.items()),
    ]
    if args.figure is not None:
        from lrf3d.render.figures import draw_crosscheck

        draw_crosscheck(world, lrf, poses, result, args.figure)
        figures["picture"] = str(args.figure)
        rows.append(("picture", str(args.figure)))
    report.print(figures, rows)
    return 1 if unexplained else 0


def localise(source: Scenario | MapAndLog, args: Namespace, report: Report) -> None:
    """Localise a recorded drive on a known map; or simulated ones, and score that."""
    if isinstance(source, tuple):
        return localise_recorded(*source, args, report)
    scenario = routed(source, args, report)
    sigma = scenario.sigmas[0] if args.sigma is None else args.sigma
    odometry = OdometryNoise(args.position, radians(args.heading))
    with report.progress("first run") as progress:
        run = scenario.run(
            mode="robust", sigma=sigma, rng=0, snapshots=1, on_collision=on_collision(args),
            progress=progress,
        )  # fmt: skip
    with report.progress("seeds") as progress:
        score = score_localisation(
            run, sigma, odometry, known=args.known, strategy=args.strategy, seeds=args.seeds,
            workers=args.workers, progress=progress,
        )  # fmt: skip
    noise = {"position_m": args.position, "heading_deg": args.heading}
    report.print(
        {"name": scenario.name, "sigma_m": sigma, "odometry_noise": noise, **score},
        [
            ("known", f"{score['lines']} lines: the {args.known} of {scenario.name}"),
            ("drives", f"{score['seeds']}, of {score['scans']} scans each"),
            ("position", f"{score['mean_position_error_m']:.4f} m off on average, at most"
                         f" {score['largest_position_error_m']:.3f} m"),
            ("heading", f"{score['mean_heading_error_deg']:.4f}° off on average"),
        ],
    )  # fmt: skip
