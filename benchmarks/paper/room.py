"""The room of Fig. 5: the scan, the maps at three noises, and how they bear more of it."""

from collections.abc import Sequence

import numpy as np

from benchmarks.map.settings import MODES
from benchmarks.page import embed_figure
from benchmarks.paper.claim import Claim, Extent, Picture
from benchmarks.result import Format, Row, Table
from lrf3d.casting import crosscheck
from lrf3d.render.figures import draw_noise_levels, draw_world
from lrf3d.render.sweep_figure import draw_sweep
from lrf3d.scenario_file import load_scenario
from lrf3d.sweeping import SweepTable, sweep
from lrf3d.sweeping.drawing import curves_of
from lrf3d.sweeping.table import INTERVAL_CONFIDENCE, CellMean, Mean

ROOM = "paper_room"
"""The built-in world of Fig. 5."""

OBJECTS = 3
"""Objects in the room: the paper's G1, G2 and G3."""

AGREED = 1e-9
"""Largest difference [m] of casters that are said to agree."""

MOST_OFF = 0.5
"""Largest mean difference of the number of unions from that of objects."""

ENOUGH = 0.8
"""Least length F1 of a map that is still one."""

FIGURES = ("map_segments", "map_objects", "segment_f1", "length_f1")
"""Figures of the maps of the room that are averaged over the seeds."""

ROBUSTNESS = Table(
    "robustness",
    {
        "place": "place",
        "sigma_m": ("noise σ", "{:g} m".format),
        "mapper": "mode",
        "length_f1": ("length F1", "{:.2f}".format),
        "segment_f1": ("segment F1", "{:.2f}".format),
        "perpendicular_rms": ("RMS", lambda rms: f"{1e3 * rms:.1f} mm"),
        "object_purity": ("purity", "{:.2f}".format),
    },
)
"""Scores over the noise, both modes."""


def _spread(digits: int) -> Format:
    """What writes a mean and half of its interval."""

    def write(mean: Mean) -> str:
        text = f"{mean.mean:.{digits}f}"
        return f"{text} ± {mean.half:.{digits}f}" if np.isfinite(mean.half) else text

    return write


MAPS = Table(
    "maps",
    {
        "sigma_m": ("noise σ", "{:g} m".format),
        "mapper": "mode",
        "map_segments": ("segments", _spread(1)),
        "map_objects": ("unions", _spread(1)),
        "segment_f1": ("segment F1", _spread(2)),
        "length_f1": ("length F1", _spread(2)),
    },
)
"""Maps of the room, means over the seeds."""


def scan_claim(extent: Extent) -> Claim:
    """Fig. 5a: the reflecting points of the range finder."""
    scenario = load_scenario(ROOM)
    trajectory = scenario.trajectory()
    scan = scenario.run(sigma=0.0, caster="planar").true_scan(0)
    city = load_scenario("city")
    drive = city.trajectory().poses[: extent.scans]
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
        pictures=[
            Picture(
                embed_figure(figure),
                "Fig. 5 a redone: the first scan in the room, 181 beams over 180°, from p1.",
            )
        ],
        data={"beams": beams, "beams_that_differ": differ, "largest_difference_m": largest},
    )


def maps_claim(swept: SweepTable) -> Claim:
    """Fig. 5 b, c and d: the maps at three noises.

    Args:
        swept: A sweep of the room over noises and modes.
    """
    scenario = load_scenario(ROOM)
    sigmas = scenario.sigmas
    pictures, holds = [], {}
    table: dict[tuple[float, str], Row] = {}
    for mode in MODES:
        runs = [scenario.run(mode=mode, sigma=sigma, rng=0, caster="planar") for sigma in sigmas]
        figure = draw_noise_levels(runs, sigmas)
        caption = f"Fig. 5 redone in {mode} mode; each union has its colour."
        pictures.append(Picture(embed_figure(figure), caption))
        for sigma in sigmas:
            mine = [row for row in swept.rows if row["mapper"] == mode and row["sigma_m"] == sigma]
            means = {name: Mean.of([row[name] for row in mine]) for name in FIGURES}
            table[sigma, mode] = {"sigma_m": sigma, "mapper": mode, **means}
        unions = [table[sigma, mode]["map_objects"].mean for sigma in sigmas]
        holds[mode] = all(abs(number - OBJECTS) <= MOST_OFF for number in unions)
    seeds = swept.plan.grid.seeds
    counts = {place: _spread(1)(row["map_objects"]) for place, row in table.items()}
    low, high = sigmas[0], sigmas[-1]
    listed = [table[place] for place in sorted(table, key=lambda place: place[0])]
    return Claim(
        "maps",
        "The map holds the objects of the room as unions, G = (G1, G2, G3)",
        "Section 4, Fig. 5 b–d",
        "At noises of 0.07, 0.42 and 0.63 m the scans from three poses give a map of three unions,"
        " which correspond to the three objects.",
        f"Over {seeds} seeds of the noise, robust mode finds {counts[low, 'robust']} unions at"
        f" {low:g} m and {counts[high, 'robust']} at {high:g} m; paper mode, the algorithm to the"
        f" letter, {counts[low, 'paper']} and {counts[high, 'paper']}. There are {OBJECTS} objects"
        f" of {len(scenario.world.segments)} walls. By the paper's rule two unions become one where"
        " two of their segments merge, so that walls that no scan shows as one polyline stay"
        " apart; robust mode also asks whether any beam has passed between them.",
        f"the number of unions is {OBJECTS}, within {MOST_OFF:g} on average, at all three noises",
        holds,
        [(MAPS, listed)],
        pictures,
        {"seeds": seeds, "rows": [MAPS.cells(row) for row in listed]},
    )


def robustness_claim(room: SweepTable, extent: Extent) -> Claim:
    """Scores over the noise.

    Args:
        room: The sweep of the room.
        extent: How much is measured in the city.
    """
    city = sweep("city", seeds=extent.city_seeds, every=extent.every, workers=1)
    means = {"room": room.means, "city": city.means}
    pictures = [_picture(name, each) for name, each in (("room", room), ("city", city))]
    rows = [
        {"place": place, **mean.columns, **{n: m.mean for n, m in mean.measures.items()}}
        for place, some in means.items()
        for mean in sorted(some, key=lambda mean: float(mean.columns["sigma_m"]))
    ]
    worst = {(place, mode): _last(means[place], mode) for place in means for mode in MODES}
    sigma = max(float(mean.columns["sigma_m"]) for mean in means["room"])
    f1 = {key: mean.measures["length_f1"].mean for key, mean in worst.items()}
    rms = {key: 1e3 * mean.measures["perpendicular_rms"].mean for key, mean in worst.items()}
    return Claim(
        "robustness",
        "The mapping is robust, even at a lot of noise",
        "Sections 2.3 and 4",
        "“The experiments shows that our mapping algorithm is robust, even at a lot of noise from"
        " the LRF.” The noise grows with the distance, so that robustness can be tested without"
        " knowing the real distribution of the noise.",
        f"At σ = {sigma:g} m the map of the room keeps a length F1 of {f1['room', 'robust']:.2f}"
        f" in robust mode and {f1['room', 'paper']:.2f} in paper mode; right parts of walls lie"
        f" {rms['room', 'robust']:.0f} and {rms['room', 'paper']:.0f} mm from the true ones."
        f" In the city it is {f1['city', 'robust']:.2f} and {f1['city', 'paper']:.2f}."
        " A sample of the map counts as right within 0.1 m and 5° of a true wall, whatever"
        " the noise.",
        f"the mean length F1 in the room is at least {ENOUGH:g} up to σ = {sigma:g} m",
        {
            mode: all(
                mean.measures["length_f1"].mean >= ENOUGH
                for mean in means["room"]
                if mean.columns["mapper"] == mode
            )
            for mode in MODES
        },
        [(ROBUSTNESS, rows)],
        pictures,
        {
            place: [
                {**mean.columns, **{n: m.as_dict() for n, m in mean.measures.items()}}
                for mean in some
            ]
            for place, some in means.items()
        },
    )


def _last(means: Sequence[CellMean], mode: str) -> CellMean:
    mine = [mean for mean in means if mean.columns["mapper"] == mode]
    return max(mine, key=lambda mean: float(mean.columns["sigma_m"]))


def _picture(name: str, swept: SweepTable) -> Picture:
    plan = swept.plan
    [world] = plan.worlds
    curves = curves_of(swept, world, "sigma_m")
    lrf = next(iter(plan.places.values())).scenario.lrf
    scans = len(next(iter(plan.places.values())).trajectory)
    words = (
        f"{scans} scans of {lrf.beams} beams  ·  {plan.grid.seeds} seeds  ·  mean and its"
        f" {100.0 * INTERVAL_CONFIDENCE:g} % interval"
    )
    figure = draw_sweep(
        curves,
        axis=f"noise σ at range_max = {lrf.range_max:g} m [m]",
        titles=(f"The {name} over the noise", words),
    )
    return Picture(
        embed_figure(figure), f"Error of the maps of the {name} over the noise, both modes."
    )


def room_sweep(extent: Extent) -> SweepTable:
    """Maps of the room over the usual noises, in both modes."""
    return sweep(ROOM, seeds=extent.seeds, workers=1)
