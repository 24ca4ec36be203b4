"""The parts of the whole benchmark: each runs a benchmark of its own and lists its methods."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.results import Result, Saving
from benchmarks.timing import Method, Timing
from lrf3d.laser import LaserRangeFinder
from lrf3d.scenario import SIGMA

LEAST_MISSED = 1e-4
"""Parts of F1 below which a map counts as without error: scores are measured every 5 cm."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Extent:
    """How much the parts measure.

    Args:
        walls: Sizes of the cities that scans are cast in.
        every: Each scan of the city's drive whose number is a multiple of this makes the maps.
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


@dataclass(frozen=True, slots=True)
class Part:
    """What one part measured, in one form for pages and comparisons.

    Args:
        key: Its name in JSON.
        title: Its name in words.
        question: What it asks, and how the answer is measured.
        time: What is timed.
        error: What the error is, with its unit.
        methods: All methods.
        savings: What each piece of skipped work saves.
        skipped: What was left out, and why.
        result: The result that has a picture of its own, where there is one.
        details: The benchmark's own result.
        calibration: Time of a fixed piece of work just before and after it [s].
        took: How long it took [s].
    """

    key: str
    title: str
    question: str
    time: str
    error: str
    methods: Sequence[Method] = ()
    savings: Sequence[Saving] = ()
    skipped: Sequence[str] = ()
    result: Result | None = None
    details: Result | None = None
    calibration: Timing | None = None
    took: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        return {
            "part": self.key,
            "title": self.title,
            "time": self.time,
            "error": self.error,
            "ways": self.methods,
            "savings": self.savings,
            "skipped": self.skipped,
            "yardstick": self.calibration,
            "took_s": self.took,
            "details": self.details or {},
        }


def ranges(seconds: float, extent: Extent, progress: Progress) -> Part:
    """Scans: casters against the exact ranges."""
    from benchmarks.scan.benchmark import bench_scan
    from benchmarks.scan.measuring import USUAL

    result = bench_scan(
        extent.walls, seconds=seconds, with_ablation=extent.whole, progress=progress
    )
    return Part(
        "ranges",
        "Ranges",
        f"How long does a scan of {LaserRangeFinder().beams} beams take, and how far is its worst"
        " range off the exact one, which scripts/stress certifies with rationals?",
        "time of a scan",
        "largest error [m]",
        result.methods(USUAL),
        result.savings,
        result.skipped,
        result,
        result,
    )


def maps(seconds: float, extent: Extent, progress: Progress) -> Part:
    """Maps of the city without noise and with it, in both modes over numbers of beams."""
    from benchmarks.map.benchmark import Extent as MapExtent
    from benchmarks.map.benchmark import bench_map
    from benchmarks.map.settings import USUAL_BEAMS, CityDrive, MapEntry, Setting, measure_accuracy

    begin = time.monotonic()
    # Compiling, where nothing is compiled yet, would use up the first noise's time.
    for mode in ("robust", "paper"):
        CityDrive(scans=2).measure(MapEntry(Setting(mode, "beams", USUAL_BEAMS)), 0)
    methods: list[Method] = []
    savings: list[Saving] = []
    skipped: list[str] = []
    beams = (91, 181, 361, 721) if extent.whole else (91, 181)
    chosen = [Setting(mode, "beams", count) for count in beams for mode in ("robust", "paper")]
    for thing, sigma in {"no noise": 0.0, f"σ = {SIGMA:g} m": SIGMA}.items():
        drive = CityDrive(every=extent.every, sigma=sigma)
        seeds, share = (extent.seeds, 0.3) if sigma else (1, 0.15)
        until = time.monotonic() + share * seconds
        found = {
            step.setting: step
            for step in measure_accuracy(drive, chosen, seeds=seeds, until=until)
            if isinstance(step, MapEntry)
        }
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
            default = setting.mode == "robust" and setting.value == USUAL_BEAMS
            words = f"{setting.mode} mode", f"{setting.value:g} beams"
            errors = float(np.mean(missed)), min(missed), max(missed)
            methods.append(Method(thing, *words, Timing.of(spent), *errors, default))
            if default:
                name = f"working out the map after every scan, {thing}"
                update = entry.update.median
                savings.append(Saving(name, update, update + entry.build))
    part = Part(
        "maps",
        "Maps",
        "What does a map of the city cost a scan, and how much of it is missing or wrong? Both"
        " modes of the mapper over numbers of beams, without noise and with it.",
        "time a scan",
        "1 − segment F1",
        methods,
        savings,
        skipped,
    )
    if not extent.whole:
        return part
    left = max(1.0, seconds - (time.monotonic() - begin))
    usual = MapExtent(every=extent.every, sizes=(100, 1_000, 10_000), towns=(1_000,))
    result = bench_map(seeds=1, seconds=left, extent=usual, progress=progress)
    for place in dict.fromkeys(entry.place for entry in result.line_pairs):
        pairs = [entry for entry in result.line_pairs if entry.place == place]
        by = {entry.strategy: entry.pairing.median for entry in pairs}
        name = f"comparing lines with those of all unions, {place}"
        savings.append(Saving(name, by["unions-first"], by["all"]))
    return replace(part, skipped=skipped + result.skipped, result=result, details=result)


def poses(seconds: float, extent: Extent, progress: Progress) -> Part:
    """Driving: integrators against the true end."""
    from benchmarks.drive.benchmark import bench_drive

    result = bench_drive(seconds=seconds, driven=extent.driven, progress=progress)
    return Part(
        "poses",
        "Poses",
        f"How far is the robot off its true place after {extent.driven:,.0f} s of driving, and"
        " how long does it take to compute?",
        "time of the whole drive",
        "end off by [m]",
        [entry.method for entry in result.entries],
        result.savings,
        details=result,
    )


def frames(seconds: float, extent: Extent, progress: Progress) -> Part:
    """Frames of films: renderers against 16 times the pixels."""
    from lrf3d.render.gl import require_gl

    require_gl()
    from benchmarks.render.benchmark import PICTURE, bench_render

    size = PICTURE if extent.whole else (160, 90)
    result = bench_render(
        extent.buildings,
        seconds=seconds,
        size=size,
        with_ablation=extent.whole,
        progress=progress,
    )
    return Part(
        "frames",
        "Frames",
        f"How long does a frame of {size[0]} × {size[1]} take in software OpenGL, and how far is it"
        " off the same frame drawn with 16 times the pixels?",
        "time of a frame",
        "root mean square error [of 255]",
        result.methods(),
        result.savings,
        result=result,
        details=result,
    )


PARTS: dict[str, tuple[Callable[[float, Extent, Progress], Part], float]] = {
    "ranges": (ranges, 0.25),
    "maps": (maps, 0.36),
    "poses": (poses, 0.15),
    "frames": (frames, 0.24),
}
"""The parts in their order, each with its share of the time."""
