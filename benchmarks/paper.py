"""``scripts/paper``: every figure and claim of the paper, measured with lrf3d.

Teslić, Škrjanc, Klančar, *Simulation of a Mobile Robot with a LRF and Map Building*. Each claim has
a criterion that was chosen here, since the paper gives no numbers; both modes of the mapper are
judged by it. A table and four pictures leave.
"""

from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from benchmarks.line_pairs import pair_drive
from benchmarks.report import Report, duration
from benchmarks.storage import Storage, storage
from benchmarks.timing import time_updates
from lrf3d.apps.sweeping import sweep
from lrf3d.base.files import make_folder
from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.geometry.lines import Float
from lrf3d.scoring import buildings_seen
from lrf3d.simulation.recorder import collect
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import load_scenario
from lrf3d.slam.places.monte_carlo import FilterSettings, score_localisation

ROOM, OBJECTS = "paper_room", 3
"""The world of Fig. 5, and its objects G1, G2 and G3."""

MODES = ("robust", "paper")


class Finding(NamedTuple):
    """A claim with its place in the paper, what was found, and whether it holds."""

    claim: str
    found: str
    holds: dict[str, bool | None]


class Drive(NamedTuple):
    """A drive mapped in one mode, the time of each update [s], and what its map takes to store."""

    run: Run
    updates: Float
    stored: Storage


def bench(
    *,
    out: Annotated[Path, "Folder for the pictures."] = Path("out/paper"),
    scans: Annotated[int | None, "Scans of the city at most."] = None,
    seeds: Annotated[int, "Seeds of the noise."] = 20,
) -> Report:
    """Redo every figure and claim of the paper: a table, and its figures as pictures."""
    make_folder(out)
    report = Report("What does the paper claim, and does it hold?")
    for finding in findings(scans, seeds):
        words = {True: "holds", False: "does not hold", None: "not measured"}
        verdict = ", ".join(f"{name}: {words[known]}" for name, known in finding.holds.items())
        report.add("claims", claim=finding.claim, found=finding.found, verdict=verdict)
    for name, draw in pictures(scans):
        draw(out / name)
        report.notes.append(f"picture {out / name}")
    return report


def findings(scans: int | None, seeds: int) -> Iterator[Finding]:
    """The claims, in the paper's order."""
    yield exact_ranges(scans)
    yield from room_maps(seeds)
    yield grid(scans)
    yield polylines(scans)
    yield buildings(scans)
    yield search(scans)
    yield localisation(scans)
    yield speed(scans)


@cache
def drive_through(world: str, mode: str, scans: int | None = None) -> Drive:
    """Drive through a built-in world, and map it in one mode."""
    scenario = load_scenario(world)
    poses = scenario.trajectory().poses[:scans]
    simulation = scenario.simulation(drive=poses, mode=mode, caster="planar", rng=0)
    mapper: Any = simulation.mapper
    spent = time_updates(mapper)
    run = collect(simulation)
    return Drive(run, np.array(spent), storage(run, [*map(mapper.local_map, run.scans)]))


def exact_ranges(scans: int | None) -> Finding:
    """Section 2.3, Fig. 5 a: each beam ends at the nearest intersection with a wall."""
    beams = differ = 0
    for name in (ROOM, "city"):
        scenario = load_scenario(name)
        poses = scenario.trajectory().poses[:scans]
        one, other = (
            caster(scenario.world).cast_batch(scenario.lrf, poses)
            for caster in (PlanarCaster, EmbreeCaster)
        )
        beams, differ = beams + one.size, differ + int((one != other).sum())
    return Finding(
        "2.3, Fig. 5 a: a beam ends at the nearest intersection",
        f"{beams:,} beams by two casters, {differ} differ",
        {"lrf3d": differ == 0},
    )


def room_maps(seeds: int) -> Iterator[Finding]:
    """Section 4, Fig. 5 b to d: three unions at three noises; robust at a lot of noise."""
    sigmas = load_scenario(ROOM).sigmas
    rows = sweep(ROOM, axes={"noise.sigma": sigmas}, seeds=seeds, workers=1).rows

    def mean(figure: str, mode: str, sigma: float) -> float:
        mine = [row for row in rows if (row["mapper"], row["sigma_m"]) == (mode, sigma)]
        return float(np.mean([row[figure] for row in mine]))

    found = {mode: [mean("map_objects", mode, sigma) for sigma in sigmas] for mode in MODES}
    f1 = {mode: mean("length_f1", mode, max(sigmas)) for mode in MODES}
    yield Finding(
        f"4, Fig. 5 b–d: {OBJECTS} unions at σ = {', '.join(map(str, sigmas))} m",
        "; ".join(f"{m}: " + ", ".join(f"{n:.1f}" for n in each) for m, each in found.items()),
        {m: all(abs(number - OBJECTS) <= 0.5 for number in each) for m, each in found.items()},
    )
    yield Finding(
        "4: robust at a lot of noise (length F1 ≥ 0.8)",
        f"σ = {max(sigmas)} m: " + ", ".join(f"{mode} {each:.2f}" for mode, each in f1.items()),
        {mode: each >= 0.8 for mode, each in f1.items()},
    )


def grid(scans: int | None) -> Finding:
    """Sections 1 and 4: segments take far less memory than an occupancy grid."""
    stored = {mode: drive_through("city", mode, scans).stored for mode in MODES}
    best = stored["robust"]
    return Finding(
        "1, 4: a hundredth of the numbers of a grid of 0.1 m",
        f"{best.union_numbers:,} numbers against {best.grid_cells:,} cells",
        {mode: 100 * each.union_numbers <= each.grid_cells for mode, each in stored.items()},
    )


def polylines(scans: int | None) -> Finding:
    """Section 4: polylines could take more memory than unions of segments."""
    stored = {"room": drive_through(ROOM, "robust").stored,
              "city": drive_through("city", "robust", scans).stored}  # fmt: skip
    words = (f"{place}: {each.union_numbers:,} numbers against {each.polyline_numbers:,}"
             for place, each in stored.items())  # fmt: skip
    return Finding(
        "4: unions take fewer numbers than polylines",
        "; ".join(words),
        {place: each.union_numbers < each.polyline_numbers for place, each in stored.items()},
    )


def buildings(scans: int | None) -> Finding:
    """Section 4, Fig. 7: each building of the city is four line segments."""
    counts = {mode: buildings_seen(drive_through("city", mode, scans).run) for mode in MODES}
    return Finding(
        "4, Fig. 7: each building seen on all sides is four segments (9 of 10)",
        ", ".join(f"{mode} {each.whole} of {each.seen_on_all_sides}"
                  for mode, each in counts.items()),
        {mode: each.whole >= 0.9 * each.seen_on_all_sides if each.seen_on_all_sides else None
         for mode, each in counts.items()},
    )  # fmt: skip


def search(scans: int | None) -> Finding:
    """Sections 3.1 and 5: looking among the unions seen before takes fewer comparisons."""
    city = load_scenario("city")
    rows = pair_drive(city.world, city.trajectory().poses[:scans], city.lrf)
    every, first = rows["all"], rows["seen-objects-first"]
    return Finding(
        "3.1, 5: fewer comparisons among the unions seen before",
        f"{first['comparisons']:,.0f} a scan instead of {every['comparisons']:,.0f}, the same pairs"
        f" in {100 * first['same_share']:.1f} % of the scans",
        {"lrf3d": first["comparisons"] < every["comparisons"] and first["same_share"] >= 0.99},
    )


def localisation(scans: int | None) -> Finding:
    """Sections 1 and 3.1: the map can be used to localise the robot."""
    drive, sigma = drive_through("city", "robust", scans), load_scenario("city").sigmas[0]
    score = score_localisation(drive.run, FilterSettings(sigma), known="map", seeds=8)
    mean = score["mean_position_error_m"]
    return Finding(
        "1, 3.1: a robot finds itself on the map (to 5 cm)",
        f"{1e3 * mean:.1f} mm off on average over 8 drives",
        {"lrf3d": mean <= 0.05},
    )


def speed(scans: int | None) -> Finding:
    """Section 5: fast enough for real time."""
    spent = {mode: drive_through("city", mode, scans) for mode in MODES}
    interval = {mode: np.median(np.diff(each.run.trajectory.times)) for mode, each in spent.items()}
    return Finding(
        "5: fast enough for real time (99 % of the updates in time)",
        ", ".join(f"{mode} {duration(float(np.median(each.updates)))}"
                  for mode, each in spent.items()) + " an update",
        {mode: float((each.updates < interval[mode]).mean()) >= 0.99
         for mode, each in spent.items()},
    )  # fmt: skip


def pictures(scans: int | None) -> Iterator[tuple[str, Callable[[Path], object]]]:
    """Fig. 5, 6 and 7 redone."""
    from PIL import Image

    from lrf3d.studio.figures.figures import draw_map, draw_noise_levels

    room = load_scenario(ROOM)
    for mode in MODES:
        runs = [room.run(mode=mode, sigma=sigma, rng=0, caster="planar") for sigma in room.sigmas]
        yield f"fig5_{mode}.png", partial(draw_noise_levels, runs, room.sigmas)
    city = drive_through("city", "robust", scans).run
    moment = 0.38 * city.trajectory.duration
    yield "fig6.png", lambda path: Image.fromarray(city.frame(moment)).save(path)
    yield "fig7.png", lambda path: draw_map(city, path)


if __name__ == "__main__":
    from benchmarks.report import program
    from lrf3d.apps.cli import main

    main(program(bench, "scripts/paper", "scripts/paper --json"), "scripts/paper")
