"""``scripts/bench scan``: what does an exact scan cost, compared with other methods?

Every caster is timed and judged in cities of one density, from a room's number of walls to a
million; in a table and a picture each is a point of run time and largest error.
"""

import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from benchmarks.panels import COLOURS, OWN, Curve, Curves, Rows, TradeOff
from benchmarks.results import Ratio, Result
from benchmarks.scan.measuring import BATCH, USUAL, CityMeasurement, Entry, missing
from benchmarks.scan.processes import probe
from benchmarks.scan.savings import ablate
from benchmarks.text import duration, metres, percent
from benchmarks.timing import Method
from lrf3d.cores import core_count
from lrf3d.laser import LaserRangeFinder
from lrf3d.tables import table

WALLS = (40, 400, 10_000, 100_000, 1_000_000)
"""Sizes of the worlds, where none are given."""

HUGE = 1_000_000
"""Walls of the huge city, measured in addition to the usual one."""

SECONDS = 150.0
"""Time for all [s], where none is given."""

TURNS_SHARE, ABLATION_SHARE = 0.5, 0.12
"""Parts of the time for the cities and for the ablation; the rest is for building and probes."""

STEPS = 3
"""Steps that a city reports."""

BUSY = 0.5
"""Processes of others, on average, above which figures of all cores are too low to be trusted."""

PROBED = ("planar", "embree")
"""Casters whose first call and memory are measured in processes of their own."""

CASTER_COLOURS = {
    "PlanarCaster": OWN, "EmbreeCaster": "#e8890c", "Embree float32": COLOURS[2],
    "trimesh location": COLOURS[4], "Open3D": COLOURS[0], "MuJoCo": COLOURS[1],
    "NumPy determinants": COLOURS[5],
}  # fmt: skip
"""Colours of casters by their title: lrf3d's own are warm."""


@dataclass(kw_only=True)
class ScanResult(Result):
    """What was measured of scans.

    Args:
        entries: Each caster in each world.
        first_calls: For each of lrf3d's casters the times of its first call [s].
        batch_memory: For each of lrf3d's casters the bytes of a batch and of its output.
    """

    benchmark = "scan"
    entries: list[Entry] = field(default_factory=list)
    first_calls: dict[str, dict[str, float]] = field(default_factory=dict)
    batch_memory: dict[str, dict[str, float]] = field(default_factory=dict)

    def facts(self) -> dict[str, Any]:
        lrf = LaserRangeFinder()
        return {
            "beams": lrf.beams,
            "range_max_m": lrf.range_max,
            "batch_poses": BATCH,
            "exact_answers": "PlanarCaster's, certified by scripts/stress",
        }

    def methods(self, walls: int | None = None) -> list[Method]:
        """Casters by the time of a scan and the largest error, of plain scans and at corners.

        Args:
            walls: A size; the baselines take part in the world nearest to it only. If not given,
                they do in all, each with the number of its walls.
        """
        sizes = {entry.walls for entry in self.entries}
        usual = None if walls is None else min(sizes, key=lambda size: abs(size - walls), default=0)
        found = []
        for words in ("plain scans", "beams aimed at corners"):
            for entry in self.entries:
                if usual not in (None, entry.walls) and entry.baseline.key not in PROBED:
                    continue
                accuracy = entry.scans if words == "plain scans" else entry.corners
                error = accuracy.largest_error_m
                size = f"{entry.walls:,}"
                thing, setting = (words, size) if usual is None else (f"{words}, {size} walls", "")
                own = entry.baseline.key == "embree"
                title = entry.baseline.title
                found.append(Method.of(thing, title, setting, entry.single, error, default=own))
        return found

    def tables(self) -> Iterable[str]:
        yield self._casters()
        lrf = LaserRangeFinder()
        yield (
            f"scan: {lrf.beams} beams, range_max {lrf.range_max:g} m, the median. largest error:"
            " of all beams, against\nthe exact ranges, which scripts/stress certifies. wrong walls,"
            " over 1 cm: of beams aimed within\n1e-9 to 1e-5 rad of corners. batch, one core: rays"
            f" a second of {BATCH} scans in one call."
        )
        head = ("fresh process", "import", "first scan", "next scan", "batch output", "batch peak")
        rows = []
        for caster, times in self.first_calls.items():
            memory = self.batch_memory.get(caster, {})
            sizes = [memory.get(name) for name in ("output_bytes", "peak_bytes")]
            rows.append((
                caster,
                *(duration(times[f"{name}_s"]) for name in ("import", "first_scan", "second_scan")),
                *("" if size is None else f"{size / 1e6:.1f} MB" for size in sizes),
            ))  # fmt: skip
        if rows:
            yield table(head, rows)
        if self.load is not None and self.load > BUSY:
            yield (
                f"Others used this machine (load {self.load:.1f} before the start): the rates on"
                " all cores are too low."
            )

    def _casters(self) -> str:
        head = (
            "caster", "walls", "scan", "largest error", "wrong walls", "over 1 cm", "batch",
            "one core", "index",
        )  # fmt: skip
        rows = []
        for entry in self.entries:
            wrong = entry.corners.wrong_wall_share
            rates = [entry.rate(batch) for batch in (entry.batch, entry.alone)]
            rows.append((
                entry.baseline.title,
                f"{entry.walls:,}",
                duration(entry.single.median),
                metres(entry.largest_error),
                "?" if wrong is None else percent(wrong),
                percent(entry.corners.over_1_cm_share),
                *("" if rate is None else f"{rate / 1e6:.1f} M/s" for rate in rates),
                "" if entry.index is None else f"{entry.index / entry.walls:.0f} B/wall",
            ))  # fmt: skip
        return table(head, rows)

    def panels(self) -> tuple[Rows, tuple[str, str]]:
        lrf = LaserRangeFinder()
        methods = self.methods()
        row: list[TradeOff | Curves] = [
            TradeOff(
                thing, "time of a scan", "largest error [m]",
                [method for method in methods if method.thing == thing], CASTER_COLOURS,
            )
            for thing in ("plain scans", "beams aimed at corners")
        ]  # fmt: skip
        curves = []
        for title, colour in CASTER_COLOURS.items():
            for alone in (False, True):
                rates = [
                    (entry.walls, rate)
                    for entry in self.entries
                    if entry.baseline.title == title
                    and (rate := entry.rate(entry.alone if alone else entry.batch))
                ]
                x, y = [float(walls) for walls, _ in rates], [rate for _, rate in rates]
                name = "" if alone else title
                curves.append(Curve(name, x, y, colour, dashed=alone))
        name = "batches; dashed: on one core"
        row.append(Curves(name, "walls of the world, at one density", "rays a second", curves))
        return [row], (
            "Scans: run time against error",
            f"{lrf.beams} beams, range_max {lrf.range_max:g} m, in cities of one density  ·  a"
            f" point for each caster and world  ·  batches of {BATCH:,} scans",
        )


def bench_scan(
    walls: Sequence[int] = WALLS,
    *,
    seconds: float = SECONDS,
    with_ablation: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> ScanResult:
    """Measure all casters in cities of given numbers of walls.

    Args:
        walls: Sizes of the cities; a size for which the time does not suffice is skipped.
        seconds: Time for all [s]; a step that has begun is finished.
        with_ablation: Also time each piece of skipped work on and off.
        progress: Called with the steps done, and of how many.
    """
    start = time.monotonic()
    result = ScanResult()
    total = STEPS * len(walls) + 2 * len(PROBED) + (1 if with_ablation else 0)
    done = 0

    def step(steps: int = 1) -> None:
        nonlocal done
        done += steps
        progress(done, total)

    absent = missing()
    result.skipped += absent.values()
    built = 0.0
    for number, count in enumerate(sorted(walls)):
        # Building grows with the walls; all else takes the time that it is given.
        share = TURNS_SHARE * seconds / len(walls)
        expected = built * count + share
        if number and time.monotonic() - start + expected > seconds:
            result.skipped.append(f"{count:,} walls: {seconds:g} s do not suffice")
            step(STEPS)
            continue
        city = CityMeasurement(count, share, absent)
        result.entries += city.run(step)
        built = city.build_seconds / count
    for caster in PROBED:
        _probe(result, caster)
        step(2)
    if with_ablation:
        result.savings = ablate(
            seconds=ABLATION_SHARE * seconds, huge=max(walls), progress=lambda done, total: None
        )
        step()
    result.ratios = [*ratios(result.entries), *_process_ratios(result)]
    result.took_s = time.monotonic() - start
    return result


def _probe(result: ScanResult, caster: str) -> None:
    """Measure a caster in fresh processes."""
    try:
        probe("first_call", caster, USUAL)  # The kernels are on disk after this one.
        calls = [probe("first_call", caster, USUAL) for _ in range(3)]
        result.first_calls[caster] = sorted(calls, key=lambda call: call["until_first_scan_s"])[1]
        result.batch_memory[caster] = probe("memory", caster, USUAL)
    except (OSError, subprocess.SubprocessError) as error:
        result.skipped.append(f"fresh processes of {caster}: {error}")


def ratios(entries: list[Entry]) -> list[Ratio]:
    """The promised ratios that can be formed from what was measured."""
    by = {(entry.baseline.key, entry.walls): entry for entry in entries}
    found = []
    here = f"one scan, {USUAL} walls"
    for name, key, other, bound in (
        ("PlanarCaster / Embree float32", "planar", "raw", 0.7),
        ("EmbreeCaster / Embree float32", "embree", "raw", 1.6),
        ("EmbreeCaster / trimesh location", "embree", "location", 0.5),
    ):
        if (key, USUAL) in by and (other, USUAL) in by:
            value = by[key, USUAL].single.median / by[other, USUAL].single.median
            found.append(Ratio(f"{here}: {name}", value, bound))
    huge = by.get(("planar", HUGE))
    if huge is not None and huge.usual is not None:
        name = f"one scan: PlanarCaster at {HUGE:,} / {USUAL} walls"
        found.append(Ratio(name, huge.single.median / huge.usual.median, 1.3))
    for key in PROBED:
        entry, peer = by.get((key, USUAL)), by.get(("open3d", USUAL))
        if entry is None or entry.batch is None or entry.alone is None:
            continue
        title = f"batch, {USUAL} walls: {entry.baseline.title}"
        if peer is not None and peer.batch is not None:
            faster = peer.batch.median / entry.batch.median
            found.append(Ratio(f"{title} / Open3D, rays a second", faster, 1.5, at_least=True))
        gain = entry.alone.median / entry.batch.median / core_count()
        found.append(Ratio(f"{title}, all cores / (cores × one core)", gain, 0.8, at_least=True))
    if huge is not None and huge.index is not None:
        per_wall = huge.index / huge.walls
        found.append(Ratio(f"index of PlanarCaster, {HUGE:,} walls, bytes a wall", per_wall, 100.0))
    return found


def _process_ratios(result: ScanResult) -> list[Ratio]:
    found = []
    for caster, report in result.batch_memory.items():
        share = report["peak_bytes"] / report["output_bytes"]
        found.append(Ratio(f"memory of a batch / its output, {caster}", share, 1.5))
    for caster, times in result.first_calls.items():
        name = f"import to first scan in a fresh process [s], {caster}"
        found.append(Ratio(name, times["until_first_scan_s"], 1.0))
    return found
