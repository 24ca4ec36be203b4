"""The parts of the whole benchmark: each runs the benchmark of its own and tells its ways.

Every function takes its time [s] and whether the run is a short one, for tests.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from lrf3d.laser import LaserRangeFinder
from lrf3d.scenario import SIGMA
from lrf3d.study.bench.ablation import Saving
from lrf3d.study.bench.part import Part, Way

Progress = Callable[[int, int], None]

LEAST_MISSED = 1e-4
"""Parts of F1 below which a map counts as without error: scores are measured every 5 cm."""


@dataclass(frozen=True, slots=True)
class Extent:
    """How much the parts measure.

    Args:
        walls: Sizes of the cities that scans are cast in.
        every: Of so many scans of the city's drive one makes the maps.
        seeds: Seeds of the noise of maps.
        buildings: Sizes of the cities that frames are drawn of.
        driven: Length of the drives [s].
        whole: Whether everything else is measured too: ablations, sizes of maps, line pairs.
    """

    walls: tuple[int, ...] = (40, 400, 10_000, 100_000, 1_000_000)
    every: int = 4
    seeds: int = 3
    buildings: tuple[int, ...] = (40, 400, 4000)
    driven: float = 3600.0
    whole: bool = True


def ranges(seconds: float, extent: Extent, progress: Progress) -> Part:
    """Scans: casters against the exact ranges."""
    from lrf3d.study.bench.contest import USUAL, Entry
    from lrf3d.study.bench.figure import draw_scan_benchmark
    from lrf3d.study.bench.scan import bench_scan

    result = bench_scan(
        extent.walls, seconds=seconds, with_ablation=extent.whole, progress=progress
    )
    usual = min(extent.walls, key=lambda walls: abs(walls - USUAL))
    things: dict[str, Callable[[Entry], float]] = {
        "plain scans": lambda entry: entry.scans.largest,
        "beams aimed at corners": lambda entry: entry.corners.largest,
    }
    ways = tuple(
        Way(
            f"{thing}, {entry.walls:,} walls",
            entry.rival.title,
            "",
            entry.single,
            error(entry),
            (error(entry),) * 2,
            entry.rival.key == "embree",
        )
        for thing, error in things.items()
        for entry in result.entries
        if entry.walls == usual or entry.rival.key in ("planar", "embree")
    )
    return Part(
        "ranges",
        "Ranges",
        f"How long does a scan of {LaserRangeFinder().beams} beams take, and how far is its worst"
        " range off the exact one, which lrf3d stress certifies with rationals?",
        "time of a scan",
        "largest error [m]",
        ways,
        tuple(result.savings),
        tuple(result.skipped),
        partial(draw_scan_benchmark, result),
        result.as_dict(),
    )


def maps(seconds: float, extent: Extent, progress: Progress) -> Part:
    """Maps of the city without noise and with it, in both modes over numbers of beams."""
    from lrf3d.study.bench.map_accuracy import (
        USUAL_BEAMS,
        CityDrive,
        MapEntry,
        Setting,
        measure_accuracy,
    )
    from lrf3d.study.bench.map_bench import Extent as MapExtent
    from lrf3d.study.bench.map_bench import bench_map
    from lrf3d.study.bench.map_figure import draw_map_benchmark
    from lrf3d.study.timing import Timing

    begin = time.monotonic()
    # Compiling, where nothing is compiled yet, would use up the first noise's time.
    for mode in ("robust", "paper"):
        CityDrive(scans=2).measure(MapEntry(Setting(mode, "beams", USUAL_BEAMS)), 0)
    ways: list[Way] = []
    savings: list[Saving] = []
    skipped: list[str] = []
    noises = {"no noise": 0.0, f"σ = {SIGMA:g} m": SIGMA}
    beams = (91, 181, 361, 721) if extent.whole else (91, 181)
    for thing, sigma in noises.items():
        drive = CityDrive(every=extent.every, sigma=sigma)
        chosen = [Setting(mode, "beams", count) for count in beams for mode in ("robust", "paper")]
        seeds = extent.seeds if sigma else 1
        share = 0.3 * seconds * (1.0 if sigma else 0.5)
        found: dict[Setting, Any] = {}
        for step in measure_accuracy(drive, chosen, seeds=seeds, until=time.monotonic() + share):
            if not isinstance(step, Setting):
                found[step.setting] = step
        for setting in chosen:
            entry = found.get(setting)
            if entry is None:
                skipped.append(f"{thing}: {setting.name}: the time does not suffice")
                continue
            missed = [1.0 - (value or 0.0) for value in entry.scores["segment_f1"]]
            missed = [value if value > LEAST_MISSED else 0.0 for value in missed]
            # What a scan costs until its map is there: its update, and its part of the last.
            scans = len(drive.trajectory)
            spent = [t + entry.build / scans for updates in entry.updates for t in updates]
            ways.append(
                Way(
                    thing,
                    f"{setting.mode} mode",
                    f"{setting.value:g} beams",
                    Timing.of(spent),
                    float(np.mean(missed)),
                    (min(missed), max(missed)),
                    setting.mode == "robust" and setting.value == USUAL_BEAMS,
                )
            )
            if setting.mode == "robust" and setting.value == USUAL_BEAMS:
                name = f"working out the map after every scan, {thing}"
                update = entry.update.median
                savings.append(Saving(name, update, update + entry.build))
    left = max(1.0, seconds - (time.monotonic() - begin))
    if not extent.whole:
        return _map_part(ways, savings, skipped)
    usual = MapExtent(every=extent.every, sizes=(100, 1_000, 10_000), towns=(1_000,))
    result = bench_map(seeds=1, seconds=left, extent=usual, progress=progress)
    for place in dict.fromkeys(entry.place for entry in result.pairs):
        by = {e.strategy: e.pairing.median for e in result.pairs if e.place == place}
        if {"all", "unions-first"} <= set(by):
            name = f"comparing lines with those of all unions, {place}"
            savings.append(Saving(name, by["unions-first"], by["all"]))
    skipped += result.skipped
    part = _map_part(ways, savings, skipped)
    return replace(part, draw=partial(draw_map_benchmark, result), details=result.as_dict())


def _map_part(ways: list[Way], savings: list[Saving], skipped: list[str]) -> Part:
    return Part(
        "maps",
        "Maps",
        "What does a map of the city cost a scan, and how much of it is missing or wrong? Both"
        " modes of the mapper over numbers of beams, without noise and with it.",
        "time a scan",
        "1 − segment F1",
        tuple(ways),
        tuple(savings),
        tuple(skipped),
    )


def poses(seconds: float, extent: Extent, progress: Progress) -> Part:
    """Driving: integrators against the true end."""
    from lrf3d.study.bench.drive_bench import bench_drive

    result = bench_drive(seconds=seconds, driven=extent.driven, progress=progress)
    ways = tuple(
        Way(
            entry.inputs,
            entry.integrator.family,
            entry.integrator.setting,
            entry.timing,
            entry.position,
            (entry.position,) * 2,
            entry.integrator.chosen,
        )
        for entry in result.entries
    )
    return Part(
        "poses",
        "Poses",
        f"How far is the robot off its true place after {extent.driven:,.0f} s of driving, and"
        " how long does it take to tell?",
        "time of the whole drive",
        "end off by [m]",
        ways,
        tuple(result.savings),
        details=result.as_dict(),
    )


def frames(seconds: float, extent: Extent, progress: Progress) -> Part:
    """Frames of films: renderers against 16 times the pixels."""
    from lrf3d.render.gl import require_gl

    require_gl()
    from lrf3d.study.bench.render_bench import bench_render
    from lrf3d.study.bench.render_figure import draw_render_benchmark
    from lrf3d.study.bench.render_result import PICTURE

    size = PICTURE if extent.whole else (160, 90)
    result = bench_render(
        extent.buildings,
        seconds=seconds,
        size=size,
        with_ablation=extent.whole,
        progress=progress,
    )
    ways = tuple(
        Way(
            "the city",
            "lrf3d" if entry.title.startswith("lrf3d") else "stock pyrender",
            _drawn(entry.title, entry.samples),
            entry.timing,
            entry.error,
            (entry.error,) * 2,
            (entry.title, entry.samples) == ("lrf3d", 4),
        )
        for entry in result.entries
        if entry.error is not None
    )
    return Part(
        "frames",
        "Frames",
        f"How long does a frame of {size[0]} × {size[1]} take in software OpenGL, and how far is it"
        " off the same frame drawn with 16 times the pixels?",
        "time of a frame",
        "root mean square error [of 255]",
        ways,
        tuple(result.savings),
        (),
        partial(draw_render_benchmark, result),
        result.as_dict(),
    )


def _drawn(title: str, samples: int) -> str:
    """What is special about a way to draw."""
    _, _, words = title.partition(", ")
    return words or (f"{samples} samples" if samples else "1 sample")


PARTS: dict[str, tuple[Callable[[float, Extent, Progress], Part], float]] = {
    "ranges": (ranges, 0.25),
    "maps": (maps, 0.36),
    "poses": (poses, 0.15),
    "frames": (frames, 0.24),
}
"""The parts in their order, each with its share of the time."""
