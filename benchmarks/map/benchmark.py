"""``scripts/bench map``: what error does a map have, and what does it cost to make and to keep?

Four questions: accuracy over thresholds, beams and noise; updates by the size of the map; numbers
to store; line pairs for localisation.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from benchmarks.map.pairs import TOWNS, PairEntry, measure_pairs, measure_town
from benchmarks.map.settings import (
    EVERY,
    SWEEPS,
    USUAL_BEAMS,
    CityDrive,
    MapEntry,
    Setting,
    measure_accuracy,
    settings,
)
from benchmarks.map.sizes import SIZES, SizeEntry, measure_sizes
from benchmarks.panels import Bars, Curve, Curves, Rows, TradeOff
from benchmarks.results import Result
from benchmarks.text import duration
from benchmarks.timing import Method
from lrf3d.casting import PlanarCaster
from lrf3d.laser import ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.render.chart import MODE_COLOURS as MODES
from lrf3d.render.page import FAINT
from lrf3d.scenario import SIGMA
from lrf3d.scoring import StorageCount, storage
from lrf3d.simulation import simulate
from lrf3d.study.summary import local_polylines
from lrf3d.tables import table

SECONDS = 125.0
"""Time for all [s], where none is given."""

SEEDS = 2
"""Seeds of the noise for each setting, where nothing is said."""

ACCURACY_SHARE = 0.63
"""Part of the time for the settings of the mapper; the rest is for sizes, memory and pairs."""

UPDATE_SHARE = 0.015
"""Part of the time for the updates of one map of some size; building it comes on top."""

VARIED = {
    "merge_distance": "merge distance R [m]",
    "merge_length": "merge length T [m]",
    "gap": "gap between clusters [m]",
    "beams": "beams over 180°",
    "sigma": "noise σ at 80 m [m]",
}
"""What is varied, as the axes name it."""

STRATEGY_COLOURS = {"unions-first": "#2a9187", "all": "#7a3fb0"}
"""Colours of the strategies of pairing."""


@dataclass(frozen=True, slots=True)
class Extent:
    """How much is measured.

    Args:
        sweeps: What is varied, over which values.
        every: Which scans of the drive are used for each setting.
        sizes: Walls of the towns whose maps are updated.
        towns: Walls of the towns in which lines are paired.
        scans: Scans of a drive at most; all of the drive where None.
    """

    sweeps: dict[str, tuple[float, ...]] = field(default_factory=lambda: SWEEPS)
    every: int = EVERY
    sizes: tuple[int, ...] = SIZES
    towns: tuple[int, ...] = TOWNS
    scans: int | None = None


@dataclass(frozen=True, slots=True)
class MemoryEntry:
    """What the map of a drive of some scans takes to store in a mode of the mapper."""

    mode: str
    scans: int
    count: StorageCount

    def as_dict(self) -> dict[str, Any]:
        return {"mode": self.mode, "scans": self.scans, **self.count.as_dict()}


@dataclass(kw_only=True)
class MapResult(Result):
    """What was measured of maps.

    Args:
        scans_of_each_setting: Scans of each setting.
        settings: Each setting of the mapper.
        map_sizes: Maps of each size.
        memory: What maps take to store.
        line_pairs: Each strategy in each place.
    """

    benchmark = "map"
    scans_of_each_setting: int = 0
    settings: list[MapEntry] = field(default_factory=list)
    map_sizes: list[SizeEntry] = field(default_factory=list)
    memory: list[MemoryEntry] = field(default_factory=list)
    line_pairs: list[PairEntry] = field(default_factory=list)

    def facts(self) -> dict[str, Any]:
        return {"world": "city", "usual": {"beams": USUAL_BEAMS, "sigma_m": SIGMA}}

    def tables(self) -> Iterable[str]:
        head: tuple[str, ...]
        if self.settings:
            head = (
                "varied", "value", "mode", "segment F1", "length F1", "ratio", "purity", "RMS",
                "update", "map", "seeds",
            )  # fmt: skip
            yield table(head, list(map(_setting_row, self.settings)))
            yield (
                f"city, {self.scans_of_each_setting} scans along all of its drive; {USUAL_BEAMS}"
                f" beams, σ = {SIGMA:g} m and the mapper's own thresholds\nwhere nothing else is"
                " said; the mapper knows σ. ratio: segments by visible walls. purity: unions\n"
                "against true objects. RMS: perpendicular distance from the true walls. update:"
                " the median, with the\nseed that was disturbed least. map: working out the final"
                " map, which robust mode does when it is\nlooked at."
            )
        if self.map_sizes:
            head = ("walls of a town", "mode", "segments", "update", "low", "high", "updates")
            yield table(head, list(map(_size_row, self.map_sizes)))
        if self.memory:
            head = (
                "to store", "mode", "segments", "unions", "numbers", "polylines", "numbers",
                "grid of 0.1 m",
            )  # fmt: skip
            yield table(head, list(map(_memory_row, self.memory)))
        if self.line_pairs:
            head = ("line pairs", "strategy", "pairs", "comparisons", "time", "same pairs")
            yield table(head, [pair_row(entry) for entry in self.line_pairs])

    def panels(self) -> tuple[Rows, tuple[str, str]]:
        scores, times = [], []
        for varied, words in VARIED.items():
            first = varied == next(iter(VARIED))
            of = [entry for entry in self.settings if entry.setting.varied == varied]
            lines = {mode: [entry for entry in of if entry.setting.mode == mode] for mode in MODES}
            curves = [
                Curve(
                    f"{score} F1, {mode} mode" if first else "",
                    _values(lines[mode]),
                    [entry.score(f"{score}_f1") for entry in lines[mode]],
                    colour,
                    dashed=score != "segment",
                )
                for mode, colour in MODES.items()
                for score in ("segment", "length")
            ]
            spent = [
                Curve(
                    f"{mode} mode" if first else "",
                    _values(lines[mode]),
                    [entry.update.median for entry in lines[mode]],
                    colour,
                )
                for mode, colour in MODES.items()
            ]
            scores.append(Curves("", "", "F1" if first else "", curves, top=1.04, legend=first))
            times.append(
                Curves("", words, "time of an update" if first else "", spent, times=True,
                       legend=first)
            )  # fmt: skip
        sizes = [
            Curve(f"{mode} mode", [float(e.walls) for e in mine], [e.update.median for e in mine],
                  colour, labels=[duration(e.update.median, 2) for e in mine])
            for mode, colour in MODES.items()
            if (mine := [entry for entry in self.map_sizes if entry.mode == mode])
        ]  # fmt: skip
        beams = [
            Method.of(
                "",
                f"{entry.setting.mode} mode",
                f"{entry.setting.value:g} beams",
                entry.update,
                1.0 - entry.score("segment_f1"),
            )
            for entry in self.settings
            if entry.setting.varied == "beams"
        ]
        counts = {entry.mode: entry.count for entry in self.memory}
        last: list[TradeOff | Curves | Bars] = [
            TradeOff("error against run time", "time of an update", "1 − segment F1", beams,
                     {f"{mode} mode": colour for mode, colour in MODES.items()}),
            Curves("update by size of the map", "segments of the map, at one density",
                   "time of an update", sizes, times=True),
            storage_bars("numbers to store the city", counts),
            search_curves("line pairs for localisation", self.line_pairs),
        ]  # fmt: skip
        return [scores, times, last], (
            "Maps: error against run time",
            f"{self.scans_of_each_setting} scans along the drive through the city  ·  {USUAL_BEAMS}"
            f" beams and σ = {SIGMA:g} m where nothing else is said",
        )


def _values(entries: Sequence[MapEntry]) -> list[float]:
    return [entry.setting.value for entry in entries]


def storage_bars(title: str, counts: dict[str, StorageCount]) -> Bars:
    """Numbers that the map of each mode takes as unions and as polylines, and a grid's cells."""
    groups: dict[str, tuple[str, Sequence[float | None]]] = {
        mode: (MODES[mode], (count.union_numbers, count.polyline_numbers, None))
        for mode, count in counts.items()
    }
    for count in list(counts.values())[:1]:
        # The grid spans the reflection points, whatever the mapper makes of them.
        groups["grid"] = (FAINT, (None, None, count.grid_cells))
    return Bars(title, "", ("unions of\nsegments", "polylines", "grid of\n0.1 m"), groups)


def search_curves(title: str, entries: Sequence[PairEntry]) -> Curves:
    """Comparisons of line pairs by the size of the known map, each with its time."""
    curves = []
    for strategy, colour in STRATEGY_COLOURS.items():
        mine = [entry for entry in entries if entry.strategy == strategy]
        x, y = [float(e.known_lines) for e in mine], [e.comparisons_a_scan for e in mine]
        times = [duration(entry.pairing.median, 2) for entry in mine]
        curves.append(Curve(strategy, x, y, colour, labels=times))
    return Curves(title, "lines of the known map", "comparisons a scan", curves)


def _setting_row(entry: MapEntry) -> tuple[str, ...]:
    setting = entry.setting
    return (
        setting.varied,
        f"{setting.value:g}" + ("" if setting.varied == "beams" else " m"),
        setting.mode,
        *(f"{entry.score(name):.3f}" for name in ("segment_f1", "length_f1")),
        f"{entry.score('segment_ratio'):.2f}",
        f"{entry.score('object_purity'):.3f}",
        f"{1e3 * entry.score('perpendicular_rms'):.1f} mm",
        duration(entry.update.median),
        duration(entry.build),
        f"{len(entry.builds)}",
    )


def _size_row(entry: SizeEntry) -> tuple[str, ...]:
    update = entry.update
    return (
        f"{entry.walls:,}",
        entry.mode,
        "" if entry.map_segments is None else f"{entry.map_segments:,}",
        *(duration(each) for each in (update.median, update.low, update.high)),
        f"{update.calls}",
    )


def _memory_row(entry: MemoryEntry) -> tuple[str, ...]:
    count = entry.count
    numbers = (
        count.segments, count.unions, count.union_numbers, count.polylines,
        count.polyline_numbers, count.grid_cells,
    )  # fmt: skip
    return f"city, {entry.scans} scans", entry.mode, *(f"{number:,}" for number in numbers)


def pair_row(entry: PairEntry) -> tuple[str, ...]:
    """A strategy as the cells of a table."""
    return (
        f"{entry.place}, {entry.known_lines:,} lines",
        entry.strategy,
        f"{entry.pairs_a_scan:.1f}",
        f"{entry.comparisons_a_scan:,.0f}",
        duration(entry.pairing.median),
        f"{100.0 * entry.scans_with_the_pairs_of_all:.4g} %",
    )


def bench_map(
    *,
    seeds: int = SEEDS,
    seconds: float = SECONDS,
    extent: Extent | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> MapResult:
    """Measure maps: their error, and the time and the numbers that they take.

    Args:
        seeds: Seeds of the noise for each setting.
        seconds: Time for all [s]; what does not fit is left out, and what has begun is finished.
        extent: How much is measured; the usual where not given.
        progress: Called with the steps done, and of how many.
    """
    extent = Extent() if extent is None else extent
    start = time.monotonic()
    drive = CityDrive(every=extent.every, scans=extent.scans)
    result = MapResult(scans_of_each_setting=len(drive.trajectory))
    chosen = settings(extent.sweeps)
    places: list[Callable[[], list[PairEntry]]] = [partial(_city_pairs, extent.scans)]
    places += [partial(measure_town, walls, scans=extent.scans) for walls in extent.towns]
    rest = len(MODES) + len(places) + 2 * len(extent.sizes)
    done, total = 0, seeds * len(chosen) + rest

    def step() -> None:
        nonlocal done
        done += 1
        progress(done, total)

    late: dict[str, int] = {}
    until = start + ACCURACY_SHARE * seconds
    for found in measure_accuracy(drive, chosen, seeds=seeds, until=until):
        if isinstance(found, Setting):
            late[found.name] = late.get(found.name, 0) + 1
        elif len(found.builds) == 1:
            result.settings.append(found)
        step()
    result.skipped += _left_out(late, seeds)
    until = start + seconds
    for mode in ("paper", "robust"):
        if time.monotonic() < until:
            result.memory.append(measure_memory(mode, scans=extent.scans))
        else:
            result.skipped.append(f"numbers to store, {mode} mode: the time does not suffice")
        step()
    for place in places:
        if time.monotonic() < until:
            result.line_pairs += place()
        else:
            result.skipped.append("line pairs: the time does not suffice")
        step()
    for size in measure_sizes(extent.sizes, seconds=UPDATE_SHARE * seconds, until=until):
        if isinstance(size, SizeEntry):
            result.map_sizes.append(size)
        else:
            result.skipped.append(size)
        step()
    result.took_s = time.monotonic() - start
    return result


def measure_memory(mode: str, *, scans: int | None = None) -> MemoryEntry:
    """Count what the map of a drive through the city takes (section 4 of Teslić et al.).

    Args:
        mode: Mode of the mapper.
        scans: How many scans from the beginning of the drive; all where not given.
    """
    drive = CityDrive(scans=scans)
    scenario, mapper = drive.scenario, LineMapper(mode, sigma=SIGMA)
    run = simulate(
        scenario.world,
        drive.trajectory,
        scenario.lrf,
        caster=PlanarCaster(scenario.world),
        noise=ProportionalNoise(SIGMA),
        mapper=mapper,
        rng=0,
    )
    polylines = [local_polylines(mapper.local_map(scan)) for scan in run.scans]
    return MemoryEntry(mode, len(run), storage(run, polylines))


def _city_pairs(scans: int | None) -> list[PairEntry]:
    """Strategies on the drive through the built-in city."""
    drive = CityDrive(scans=scans)
    scenario = drive.scenario
    return measure_pairs("city", scenario.world, drive.trajectory.poses, scenario.lrf)


def _left_out(late: dict[str, int], seeds: int) -> list[str]:
    """Words for settings that were measured with fewer seeds than asked for, or not at all."""
    never = [name for name, count in late.items() if count == seeds]
    fewer = len(late) - len(never)
    words = [f"{name}: the time does not suffice" for name in never]
    if fewer:
        words.append(f"some of the {seeds} seeds of {fewer} settings: the time does not suffice")
    return words
