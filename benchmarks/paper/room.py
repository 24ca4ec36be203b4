"""The room of Fig. 5: the scan, the maps at three noises, and what they take to store."""

from collections.abc import Sequence

import numpy as np

from benchmarks.page import embed_figure
from benchmarks.paper.claim import MODES, Claim, Extent, Picture, Table
from lrf3d.casting import crosscheck
from lrf3d.render.figures import draw_noise_levels, draw_world
from lrf3d.scenario import load_scenario
from lrf3d.study.experiment import Experiment, trajectory_of
from lrf3d.study.sweep.grid import Grid
from lrf3d.study.sweep.plan import Plan, make_plan
from lrf3d.study.sweep.summary import Mean
from lrf3d.study.sweep.task import Row, carry_out

ROOM = "paper_room"
"""The built-in world of Fig. 5."""

OBJECTS = 3
"""Objects in the room: the paper's G1, G2 and G3."""

AGREED = 1e-9
"""Largest difference [m] of casters that are said to agree."""

MOST_OFF = 0.5
"""Largest mean difference of the number of unions from that of objects."""


def scan_claim(extent: Extent) -> Claim:
    """Fig. 5a: the reflecting points of the range finder."""
    scenario = load_scenario(ROOM)
    trajectory = trajectory_of(scenario)
    experiment = Experiment(scenario, sigma=0.0, caster="planar")
    scan = experiment.simulate(trajectory).true_scan(0)
    city = load_scenario("city")
    drive = trajectory_of(city).poses[: extent.scans]
    checks = {
        "paper_room": crosscheck(scenario.world, scenario.lrf, trajectory.poses),
        "city": crosscheck(city.world, city.lrf, drive),
    }
    beams = sum(check.beams for check in checks.values())
    differ = sum(len(check.differences) for check in checks.values())
    largest = max(check.largest_difference for check in checks.values())
    figure = draw_world(scenario.world, scan=scan, poses=trajectory.poses)
    return Claim(
        "scan",
        "The range finder returns the nearest intersection of each beam",
        "Section 2.3, Fig. 5 a",
        "Every beam is intersected with the lines of all walls by determinants; of the points that"
        " lie on a wall and in front of the robot, the nearest is the reflection.",
        f"Two casters, one in the plane and one that lets Embree find the walls in the extruded 3D"
        f" scene, cast {beams:,} beams of the room and of the city. "
        + (
            f"They name another wall or another distance for {differ} of them."
            if differ or largest
            else "They name the same wall and the very same distance for every one."
        ),
        "no beam meets another wall in 3D, and no range differs by more than a nanometre",
        {"lrf3d": differ == 0 and largest <= AGREED},
        pictures=(
            Picture(
                embed_figure(figure),
                "Fig. 5 a redone: the first scan in the room, 181 beams over 180°, from p1.",
            ),
        ),
        data={"beams": beams, "beams_that_differ": differ, "largest_difference_m": largest},
    )


def maps_claim(plan: Plan, rows: Sequence[Row]) -> Claim:
    """Fig. 5 b, c and d: the maps at three noises.

    Args:
        plan: A sweep of the room over noises and modes.
        rows: Its rows.
    """
    scenario = load_scenario(ROOM)
    trajectory = trajectory_of(scenario)
    sigmas = scenario.sigmas
    pictures, holds, lines = [], {}, []
    for mode in MODES:
        runs = [
            Experiment(scenario, mode=mode, sigma=sigma, caster="planar").simulate(trajectory)
            for sigma in sigmas
        ]
        figure = draw_noise_levels(runs, sigmas)
        caption = f"Fig. 5 redone in {mode} mode; each union has its colour."
        pictures.append(Picture(embed_figure(figure), caption))
        means = {}
        for sigma in sigmas:
            mine = _rows(plan, rows, mode, sigma)
            means[sigma] = [
                Mean.of([row[name] for row in mine])
                for name in ("map_segments", "unions", "segment_f1", "length_f1")
            ]
            words = (
                _told(means[sigma][0], 1), _told(means[sigma][1], 1),
                _told(means[sigma][2], 2), _told(means[sigma][3], 2),
            )  # fmt: skip
            lines.append((f"{sigma:g} m", mode, *words))
        holds[mode] = all(abs(mean[1].mean - OBJECTS) <= MOST_OFF for mean in means.values())
    seeds = plan.grid.seeds
    unions = {line[:2]: line[3] for line in lines}
    low, high = f"{sigmas[0]:g} m", f"{sigmas[-1]:g} m"
    return Claim(
        "maps",
        "The map holds the objects of the room as unions, G = (G1, G2, G3)",
        "Section 4, Fig. 5 b–d",
        "At noises of 0.07, 0.42 and 0.63 m the scans from three poses give a map of three unions,"
        " which correspond to the three objects.",
        f"Over {seeds} seeds of the noise, robust mode finds {unions[low, 'robust']} unions at"
        f" {low} and {unions[high, 'robust']} at {high}; paper mode, the algorithm to the letter,"
        f" {unions[low, 'paper']} and {unions[high, 'paper']}. There are {OBJECTS} objects of"
        f" {len(scenario.world.segments)} walls. By the paper's rule two unions become one where"
        " two of their segments merge, so that walls that no scan shows as one polyline stay"
        " apart; robust mode also asks whether any beam has passed between them.",
        f"the number of unions is {OBJECTS}, within {MOST_OFF:g} on average, at all three noises",
        holds,
        (
            Table(
                ("noise σ", "mode", "segments", "unions", "segment F1", "length F1"),
                tuple(sorted(lines, key=lambda line: float(line[0].split()[0]))),
            ),
        ),
        tuple(pictures),
        {"seeds": seeds, "rows": [list(line) for line in lines]},
    )


def room_sweep(extent: Extent) -> tuple[Plan, list[Row]]:
    """Maps of the room over the usual noises, in both modes."""
    return swept(Grid.usual(ROOM, axes={}, seeds=extent.seeds))


def swept(grid: Grid) -> tuple[Plan, list[Row]]:
    """All runs of a small grid, made in this process."""
    plan = make_plan(grid)
    rows = []
    for run in plan.runs:
        place = plan.places[plan.cells[run.cell].place]
        [row] = carry_out(place, [run.order]).rows
        rows.append({**plan.described(run), **row})
    return plan, rows


def _rows(plan: Plan, rows: Sequence[Row], mode: str, sigma: float) -> list[Row]:
    return [row for row in rows if row["mode"] == mode and row["sigma_m"] == sigma]


def _told(mean: Mean, digits: int) -> str:
    text = f"{mean.mean:.{digits}f}"
    return f"{text} ± {mean.half:.{digits}f}" if np.isfinite(mean.half) else text
