"""Unions in localisation: fewer comparisons of lines, and a robot that finds itself."""

from math import degrees

from benchmarks.map.benchmark import pair_row, search_curves
from benchmarks.map.pairs import PairEntry, measure_pairs, measure_town
from benchmarks.page import embed_figure
from benchmarks.panels import draw_panels
from benchmarks.paper.city import Drive
from benchmarks.paper.claim import Claim, Extent, Picture, Table
from benchmarks.results import as_json
from lrf3d.localization import OdometryNoise
from lrf3d.scenario import load_scenario
from lrf3d.study.localisation import LocalisationTask, score_localisation

SAME = 0.99
"""Least share of the scans in which unions give just the pairs of all lines."""

NEAR = 0.05
"""Largest mean error [m] of a robot that is said to find itself."""


def search_claim(drive: Drive, extent: Extent) -> Claim:
    """Looking among the unions that were seen before takes fewer comparisons."""
    run = drive.run
    entries = measure_pairs("city", run.world, run.trajectory.poses, run.lrf)
    for walls in extent.towns:
        entries += measure_town(walls, scans=extent.scans)
    by_place: dict[tuple[str, int], dict[str, PairEntry]] = {}
    for entry in entries:
        by_place.setdefault((entry.place, entry.known_lines), {})[entry.strategy] = entry
    ratios = {
        place: both["all"].comparisons_a_scan / max(both["unions-first"].comparisons_a_scan, 1e-9)
        for place, both in by_place.items()
    }
    same = {
        place: both["unions-first"].scans_with_the_pairs_of_all for place, both in by_place.items()
    }
    towns = [place for place in ratios if place[0] == "town"]
    told = min(towns, key=lambda place: abs(place[1] - 1_000)) if towns else ("city", len(run.map))
    figure = draw_panels(
        [[search_curves("", entries)]],
        titles=(
            "Comparisons of lines a scan",
            "beside each point the time in which a scan is paired",
        ),
    )
    return Claim(
        "search",
        "With unions, line pairs are found with fewer comparisons",
        "Sections 3.1 and 5",
        "To find the pairs of 10 local and 1,000 global lines takes 1000 × 10 comparisons. It could"
        " be faster to look first among the lines of those objects that the previous scan showed.",
        f"On a town of {told[1]:,} lines, unions-first takes"
        f" {by_place[told]['unions-first'].comparisons_a_scan:,.0f} comparisons a scan instead of"
        f" {by_place[told]['all'].comparisons_a_scan:,.0f}, {ratios[told]:.0f} times fewer, and"
        f" finds the same pairs in {100 * same[told]:.1f} % of the scans."
        if told in by_place
        else "Only the city was measured.",
        "there are fewer comparisons everywhere, and the same pairs in at least"
        f" {100 * SAME:.0f} % of the scans",
        {"lrf3d": all(ratios[place] > 1.0 and same[place] >= SAME for place in ratios)},
        (
            Table(
                ("known lines", "strategy", "pairs", "comparisons", "time", "same pairs"),
                tuple(pair_row(entry) for entry in entries),
            ),
        ),
        (
            Picture(
                embed_figure(figure), "Comparisons by the size of the map, both axes logarithmic."
            ),
        ),
        {"entries": as_json(entries)},
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
