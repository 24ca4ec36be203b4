"""``scripts/bench map``: what error does a map have, and what does it cost to make and to keep?

Six questions: accuracy over thresholds, beams and noise; updates by the size of the map, and on a
drive without end; what dynamic obstacles leave; numbers to store; line pairs for localisation. In
the first, one thing at a time is varied from what is usual, along the drive through the built-in
city, in both modes of the mapper.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from matplotlib.figure import Figure

from benchmarks.chart import Panel, bars, draw, scatter
from benchmarks.map.drives import OBSTACLES, ROUNDS, measure_obstacles, measure_rounds
from benchmarks.map.pairs import PAIRS, TOWNS, measure_pairs, measure_town
from benchmarks.map.settings import (
    EVERY,
    MODES,
    NO_NOISE,
    SWEEPS,
    USUAL_BEAMS,
    CityDrive,
    settings,
)
from benchmarks.map.sizes import SIZES, UPDATES_BY_SIZE, measure_sizes
from benchmarks.result import Result, Row, Table
from lrf3d.laser.noise import SIGMA
from lrf3d.progress import Progress, silent
from lrf3d.scoring import storage
from lrf3d.scoring.summary import local_polylines
from lrf3d.sheet import MODE_COLOURS

SECONDS = 125.0
"""Time for all [s], if none is given."""

SEEDS = 2
"""Seeds of the noise for each setting, if not given."""

ACCURACY_SHARE = 0.5
"""Part of the time for the settings of the mapper; the rest is for the other questions."""

ROUNDS_SHARE = 0.08
"""Part of the time for the drive round the city with each number of beams."""

ROUNDS_BEAMS = (USUAL_BEAMS, 721)
"""Beams on the drive round the city."""

MOST_ROUNDS = 20_000
"""Scans of it, if the time suffices."""

UPDATE_SHARE = 0.015
"""Part of the time for the updates of one map of some size; building it comes on top."""

AXES = {
    "merge_distance": "merge distance R [m]",
    "merge_length": "merge length T [m]",
    "gap": "gap between clusters [m]",
    "beams": "beams over 180°",
    "sigma": "noise σ at 80 m [m]",
}
"""What is varied, as the axes name it."""

FAINT_GREY = "#68727f"
"""Colour of the grid."""

f3: Callable[[Any], str] = "{:.3f}".format

SETTINGS = Table(
    "settings",
    {
        "varied": "varied",
        "value": ("value", "{:g}".format),
        "mode": "mode",
        "segment_f1": ("segment F1", f3),
        "length_f1": ("length F1", f3),
        "segment_ratio": ("ratio", "{:.2f}".format),
        "object_purity": ("purity", f3),
        "perpendicular_rms": ("RMS", lambda rms: f"{1e3 * rms:.1f} mm"),
        "update": "update",
        "work_out_map_s": "map",
        "seeds": "seeds",
    },
    f"city; {USUAL_BEAMS} beams, σ = {SIGMA:g} m and the mapper's own thresholds where nothing else"
    " is said;\nthe mapper knows σ. ratio: segments by visible walls. purity: objects against true"
    " objects. RMS:\nperpendicular distance from the true walls. update: the median, with the seed"
    " that was disturbed\nleast. map: making the value of the final map.",
    names=("varied", "value", "mode"),
    time="scan_to_map",
    error="missed",
)
"""Each setting of the mapper."""

MEMORY = Table(
    "memory",
    {
        "place": "to store",
        "mode": "mode",
        "segments": "segments",
        "unions": "unions",
        "union_numbers": "numbers",
        "polylines": "polylines",
        "polyline_numbers": "numbers",
        "grid_cells": "grid of 0.1 m",
    },
    left=2,
)
"""What maps take to store."""


def bench_map(
    *,
    seeds: int = SEEDS,
    seconds: float = SECONDS,
    sweeps: Mapping[str, Sequence[float]] = SWEEPS,
    every: int = EVERY,
    sizes: Sequence[int] = SIZES,
    towns: Sequence[int] = TOWNS,
    scans: int | None = None,
    progress: Progress = silent,
) -> Result:
    """Measure maps: their error, and the time and the numbers that they take.

    Args:
        seeds: Seeds of the noise for each setting.
        seconds: Time for all [s]; what does not fit is left out, and what has begun is finished.
        sweeps: What is varied, over which values.
        every: Which scans of the drive are used for each setting.
        sizes: Walls of the towns whose maps are updated.
        towns: Walls of the towns in which lines are paired.
        scans: Scans of a drive at most; all of the drive where None.
        progress: Called with the steps done, and of how many.
    """
    # Compiling, or loading what was compiled, is no part of an update, nor of the given time.
    for mode in MODES:
        CityDrive(scans=2).map(mode, 0)
    start = time.monotonic()
    drive, whole = CityDrive(every=every, scans=scans), CityDrive(scans=scans)
    result = Result(
        "map",
        "What does a map of the city cost a scan, and how much of it is missing or wrong? Both"
        " modes of the mapper over thresholds, numbers of beams and noises.",
        {
            "world": "city",
            "usual": {"beams": USUAL_BEAMS, "sigma_m": SIGMA},
            "scans_of_each_setting": len(drive.trajectory),
        },
        chart,
        {table: [] for table in (SETTINGS, UPDATES_BY_SIZE, ROUNDS, OBSTACLES, MEMORY, PAIRS)},
    )
    chosen = settings(sweeps)
    city = whole.scenario
    rest: list[tuple[str, Callable[[], None]]] = [
        (f"numbers to store, {mode} mode", partial(measure_memory, result, mode, whole))
        for mode in MODES
    ]
    rest.append(("line pairs, city", lambda: measure_pairs(
        result, "city", city.world, whole.trajectory.poses, city.lrf
    )))  # fmt: skip
    rest += [
        (f"line pairs, town of {walls:,} walls", partial(measure_town, result, walls, scans=scans))
        for walls in towns
    ]
    rest += [
        (f"the city driven round, {beams} beams", partial(
            measure_rounds, result, beams, scans or MOST_ROUNDS, seconds=ROUNDS_SHARE * seconds
        ))
        for beams in ROUNDS_BEAMS
    ]  # fmt: skip
    rest.append(("dynamic obstacles", partial(measure_obstacles, result, seeds=seeds, scans=scans)))
    done, total = 0, seeds * len(chosen) + len(rest) + 2 * len(sizes)

    def step() -> None:
        nonlocal done
        done += 1
        progress(done, total)

    # All settings are measured with one seed before any with the next.
    for seed in range(seeds):
        for setting in chosen:
            if time.monotonic() < start + ACCURACY_SHARE * seconds:
                setting.measure(drive, seed)
            step()
    late = [setting for setting in chosen if len(setting.builds) < seeds]
    for setting in chosen:
        if setting.builds:
            result.add(SETTINGS, **setting.row())
        else:
            words = f"{setting.varied} {setting.value:g}, {setting.mode} mode"
            result.skipped.append(f"{words}: the time does not suffice")
    if fewer := sum(bool(setting.builds) for setting in late):
        words = f"some of the {seeds} seeds of {fewer} settings"
        result.skipped.append(f"{words}: the time does not suffice")
    until = start + seconds
    for words, measure in rest:
        if time.monotonic() < until:
            measure()
        else:
            result.skipped.append(f"{words}: the time does not suffice")
        step()
    measure_sizes(result, sizes, seconds=UPDATE_SHARE * seconds, until=until, step=step)
    for row in result[SETTINGS]:
        if row["default"]:
            update = row["update"].median
            name = f"working out the map after every scan, {row['varied']}"
            result.save(name, update, update + row["work_out_map_s"])
    for place in dict.fromkeys((row["place"], row["known_lines"]) for row in result[PAIRS]):
        time_of = {
            row["strategy"]: row["pairing"].median
            for row in result[PAIRS]
            if (row["place"], row["known_lines"]) == place
        }
        name = f"comparing lines with those of all unions, {place[0]} of {place[1]:,} lines"
        result.save(name, time_of["seen-objects-first"], time_of["all"])
    result.took_s = time.monotonic() - start
    return result


def measure_memory(result: Result, mode: str, drive: CityDrive) -> None:
    """Count what the map of a drive through the city takes (section 4 of Teslić et al.)."""
    run, mapper, _ = drive.map(mode, 0)
    polylines = [local_polylines(mapper.local_map(scan)) for scan in run.scans]
    count = storage(run, polylines).as_dict()
    result.add(MEMORY, place=f"city, {len(run)} scans", mode=mode, scans=len(run), **count)


def storage_panel(rows: Sequence[Row], title: str) -> Panel:
    """Numbers that the map of each mode takes as unions and as polylines, and a grid's cells."""
    kinds = {"union_numbers": "unions", "polyline_numbers": "polylines"}
    shown = [
        {"name": f"{words}, {row['mode']}", "numbers": row[kind],
         "colour": MODE_COLOURS[row["mode"]]}
        for kind, words in kinds.items()
        for row in rows
    ]  # fmt: skip
    for row in rows[:1]:
        # The grid spans the reflection points, whatever the mapper makes of them.
        shown.append({"name": "grid of 0.1 m", "numbers": row["grid_cells"], "colour": FAINT_GREY})
    return partial(
        bars, rows=shown, value="numbers", title=title, log=True,
        name=lambda row: row["name"], colour=lambda row: row["colour"],
    )  # fmt: skip


def search_panel(rows: Sequence[Row], title: str) -> Panel:
    """Comparisons of line pairs by the size of the known map, each with its time."""
    return partial(
        scatter, rows=rows, x="known_lines", y="comparisons_a_scan", by="strategy", title=title,
        labels=("lines of the known map", "comparisons a scan"),
        note=lambda row: f"{1e6 * row['pairing'].median:.2g} µs",
    )  # fmt: skip


def chart(result: Result) -> Figure:
    """Scores and times over what is varied, and the other three questions."""
    rows = result[SETTINGS]
    scores: list[Panel] = []
    times: list[Panel] = []
    for varied, label in AXES.items():
        common: dict[str, Any] = {
            "rows": [row for row in rows if row["varied"] == varied],
            "by": "mode", "x": "value", "colours": MODE_COLOURS,
        }  # fmt: skip
        first = not scores
        scores.append(partial(
            scatter, **common, y="segment_f1", dashed="length_f1", top=1.1,
            title="F1; dashed: by length" if first else "",
        ))  # fmt: skip
        times.append(partial(
            scatter, **common, y="update", labels=(label, "time of an update" if first else ""),
        ))  # fmt: skip
    trade: dict[str, Any] = {
        "x": "scan_to_map", "y": "missed", "by": "mode", "colours": MODE_COLOURS,
        "labels": ("time a scan", "1 − segment F1"),
        "note": lambda row: f"{row['value']:g} beams",
    }  # fmt: skip
    offs = [
        partial(
            scatter, rows=[row for row in rows if row["varied"] == varied], title=title, **trade
        )
        for varied, title in (("beams", f"σ = {SIGMA:g} m"), (NO_NOISE, "no noise"))
    ]
    sizes = partial(
        scatter, rows=result[UPDATES_BY_SIZE], x="walls", y="update", by="mode",
        title="update by size of the map", colours=MODE_COLOURS,
        labels=("segments of the map, at one density", "time of an update"),
    )  # fmt: skip
    last: list[Panel] = [
        sizes,
        storage_panel(result[MEMORY], "numbers to store the city"),
        search_panel(result[PAIRS], "line pairs for localisation"),
    ]
    return draw([offs, scores, times, last], (
        "Maps: error against run time",
        f"{result.facts['scans_of_each_setting']} scans along the drive through the city  ·"
        f"  {USUAL_BEAMS} beams and σ = {SIGMA:g} m where nothing else is said",
    ))  # fmt: skip
