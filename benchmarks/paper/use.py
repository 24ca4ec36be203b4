"""What the maps are good for: few numbers to store, few comparisons, and a robot that is found."""

from collections.abc import Mapping
from math import degrees

from benchmarks.chart import draw
from benchmarks.map.benchmark import search_panel, storage_panel
from benchmarks.map.pairs import PAIRS, measure_pairs, measure_town
from benchmarks.map.settings import MODES
from benchmarks.page import embed_figure
from benchmarks.paper.city import Drive
from benchmarks.paper.claim import Claim, Extent, Picture
from benchmarks.result import Result, Row, Table
from lrf3d.localization import OdometryNoise
from lrf3d.localization.monte_carlo import LocalisationTask, score_localisation
from lrf3d.scenario_file import load_scenario

SAME = 0.99
"""Least share of the scans in which unions give just the pairs of all lines."""

NEAR = 0.05
"""Largest mean error [m] of a robot that is said to find itself."""

STORED = Table(
    "stored",
    {"place": "place", "mode": "mode", "segments": "segments", "unions": "unions",
     "union_numbers": "numbers", "polyline_lines": "lines", "polylines": "polylines",
     "polyline_numbers": "numbers", "grid_cells": "cells of a grid"},
    left=2,
)  # fmt: skip
"""What the maps take to store."""


def grid_claim(city: Mapping[str, Drive], room: Mapping[str, Drive]) -> Claim:
    """Line segments take less memory than an occupancy grid."""
    places = {"room": room, "city": city}
    best = city["robust"].stored
    factor = best.grid_cells / max(best.union_numbers, 1)
    rows = {
        place: [{"place": place, "mode": mode, **drives[mode].stored.as_dict()} for mode in MODES]
        for place, drives in places.items()
    }
    bars = draw(
        [[storage_panel(mine, f"the {place}") for place, mine in rows.items()]],
        (
            "Numbers to store",
            "a segment takes 5 with the label of its union, a vertex of a polyline 2, a cell of a"
            " grid 1",
        ),
    )
    return Claim(
        "grid",
        "Line segments take far less memory than an occupancy grid",
        "Sections 1 and 4",
        "“Occupancy grids require a huge amount of computer memory and are therefore not"
        " appropriate when modelling a large environment.”",
        f"The map of the city in robust mode takes {best.union_numbers:,} numbers, five a segment"
        f" with the label of its union. A grid of 0.1 m over the same points has"
        f" {best.grid_cells:,} cells, {factor:,.0f} times as many.",
        "in both places the map takes at most a hundredth of the numbers of a grid",
        {
            mode: all(
                100 * drives[mode].stored.union_numbers <= drives[mode].stored.grid_cells
                for drives in places.values()
            )
            for mode in MODES
        },
        [(STORED, [row for mine in rows.values() for row in mine])],
        [
            Picture(
                embed_figure(bars),
                "What the maps take to store, on a logarithmic scale; red is robust mode, blue"
                " paper mode.",
            )
        ],
        {
            name: {mode: drive.stored.as_dict() for mode, drive in drives.items()}
            for name, drives in places.items()
        },
    )


def polyline_claim(city: Mapping[str, Drive], room: Mapping[str, Drive]) -> Claim:
    """Unions of segments may take less memory than polylines."""
    counts = {"room": room["robust"].stored, "city": city["robust"].stored}
    return Claim(
        "polylines",
        "Polylines could take more memory than unions of segments",
        "Section 4",
        "G3, six lines as a union, would be fourteen lines in four polylines, as views from"
        " different sides cannot be joined.",
        f"In the city, which is seen from many sides, the {counts['city'].segments:,} segments"
        f" stand against {counts['city'].polyline_lines:,} lines in"
        f" {counts['city'].polylines:,} polylines: {counts['city'].union_numbers:,} numbers against"
        f" {counts['city'].polyline_numbers:,}. In the room, seen from three poses,"
        f" {counts['room'].segments} segments stand against {counts['room'].polyline_lines} lines"
        f" in {counts['room'].polylines} polylines, and as neighbours in a polyline share a vertex,"
        f" these take {counts['room'].polyline_numbers} numbers and the unions"
        f" {counts['room'].union_numbers}.",
        "unions take fewer numbers than the polylines of the same scans, in robust mode",
        {place: count.union_numbers < count.polyline_numbers for place, count in counts.items()},
        data={place: count.as_dict() for place, count in counts.items()},
    )


def search_claim(drive: Drive, extent: Extent) -> Claim:
    """Looking among the unions that were seen before takes fewer comparisons."""
    run = drive.run
    result = Result("line pairs")
    measure_pairs(result, "city", run.world, run.trajectory.poses, run.lrf)
    for walls in extent.towns:
        measure_town(result, walls, scans=extent.scans)
    rows = result[PAIRS]
    by_place: dict[tuple[str, int], dict[str, Row]] = {}
    for row in rows:
        by_place.setdefault((row["place"], row["known_lines"]), {})[row["strategy"]] = row
    compared = {
        place: {strategy: row["comparisons_a_scan"] for strategy, row in both.items()}
        for place, both in by_place.items()
    }
    ratios = {
        place: both["all"] / max(both["seen-objects-first"], 1e-9)
        for place, both in compared.items()
    }
    same = {
        place: both["seen-objects-first"]["scans_with_the_pairs_of_all"]
        for place, both in by_place.items()
    }
    towns = [place for place in ratios if place[0] == "town"] or list(ratios)
    shown = min(towns, key=lambda place: abs(place[1] - 1_000))
    titles = (
        "Comparisons of lines a scan",
        "beside each point the time in which a scan is paired",
    )
    return Claim(
        "search",
        "With unions, line pairs are found with fewer comparisons",
        "Sections 3.1 and 5",
        "To find the pairs of 10 local and 1,000 global lines takes 1000 × 10 comparisons. It could"
        " be faster to look first among the lines of those objects that the previous scan showed.",
        f"On a {shown[0]} of {shown[1]:,} lines, seen-objects-first takes"
        f" {compared[shown]['seen-objects-first']:,.0f} comparisons a scan instead of"
        f" {compared[shown]['all']:,.0f}, {ratios[shown]:.0f} times fewer, and"
        f" finds the same pairs in {100 * same[shown]:.1f} % of the scans.",
        "there are fewer comparisons everywhere, and the same pairs in at least"
        f" {100 * SAME:.0f} % of the scans",
        {"lrf3d": all(ratios[place] > 1.0 and same[place] >= SAME for place in ratios)},
        [(PAIRS, rows)],
        [
            Picture(
                embed_figure(draw([[search_panel(rows, "")]], titles)),
                "Comparisons by the size of the map, both axes logarithmic.",
            )
        ],
        {"entries": rows},
    )


def localisation_claim(drive: Drive, extent: Extent) -> Claim:
    """The map can be used to find the robot on it."""
    sigma = load_scenario("city").sigmas[0]
    odometry = OdometryNoise()
    task = LocalisationTask(drive.run, sigma, odometry, known="map")
    score = score_localisation(task, seeds=extent.robots).as_dict()
    mean, largest = score["mean_position_error_m"], score["largest_position_error_m"]
    return Claim(
        "localisation",
        "The map can then be used to localise the robot",
        "Sections 1 and 3.1",
        "A map that was built at known poses can solve the localisation problem, by an extended"
        " Kalman filter over pairs of lines.",
        f"On the map of robust mode, with odometry that errs by"
        f" {100 * odometry.position:.0f} cm and {degrees(odometry.heading):.0f}° a step, the"
        f" robot is {1e3 * mean:.1f} mm off on average over {extent.robots} drives, and at most"
        f" {100 * largest:.0f} cm.",
        f"the mean error of the position is at most {100 * NEAR:g} cm",
        {"lrf3d": mean <= NEAR},
        data=score,
    )
