"""``bench scan``: what does an exact scan cost, beside the ways that others cast it?

Every caster is timed and judged in cities of one density, from a room's number of walls to a
million; in a table and a plot each is a point of run time and largest error.
"""

import os
import platform
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from lrf3d.cores import core_count
from lrf3d.laser import LaserRangeFinder
from lrf3d.study.bench.ablation import Saving, ablate
from lrf3d.study.bench.contest import BATCH, USUAL, Contest, Entry, missing
from lrf3d.study.bench.probes import probe
from lrf3d.study.bench.ratios import Ratio, ratios

WALLS = (40, 400, 10_000, 100_000, 1_000_000)
"""Sizes of the worlds, where none are given."""

SECONDS = 150.0
"""Time for all [s], where none is given."""

TURNS_SHARE, ABLATION_SHARE = 0.5, 0.12
"""Parts of the time for the contests and for the ablation; the rest is for building and probes."""

STEPS = 3
"""Steps that a contest reports."""

BUSY = 0.5
"""Processes of others, on average, above which figures of all cores are too low to be trusted."""

PROBED = ("planar", "embree")
"""Casters whose first call and memory are measured in processes of their own."""


@dataclass
class ScanBenchmark:
    """What was measured.

    Args:
        entries: Each caster in each world.
        first_calls: For each of lrf3d's casters the times of its first call [s].
        memory: For each of lrf3d's casters the bytes of a batch and of its output.
        savings: What skipping work saves; empty where it was not asked for.
        skipped: What was left out, and why.
        load: How many processes of others waited or ran before, on average; None where the system
            does not tell.
        took: How long all took [s].
    """

    entries: list[Entry] = field(default_factory=list)
    first_calls: dict[str, dict[str, float]] = field(default_factory=dict)
    memory: dict[str, dict[str, float]] = field(default_factory=dict)
    savings: list[Saving] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    load: float | None = None
    took: float = 0.0

    @property
    def busy(self) -> bool:
        """Whether others used the machine."""
        return self.load is not None and self.load > BUSY

    @property
    def ratios(self) -> list[Ratio]:
        """The promised ratios, as far as they were measured."""
        found = ratios(self.entries)
        for caster, report in self.memory.items():
            share = report["peak_bytes"] / report["output_bytes"]
            found.append(Ratio(f"memory of a batch / its output, {caster}", share, 1.5))
        for caster, times in self.first_calls.items():
            name = f"import to first scan in a fresh process [s], {caster}"
            found.append(Ratio(name, times["until_first_scan_s"], 1.0))
        return found

    def as_dict(self) -> dict[str, Any]:
        """The benchmark in JSON's types."""
        lrf = LaserRangeFinder()
        return {
            "benchmark": "scan",
            "machine": {"system": platform.platform(), "cores": core_count(), "load": self.load},
            "beams": lrf.beams,
            "range_max_m": lrf.range_max,
            "batch_poses": BATCH,
            "exact_answers": "PlanarCaster's, certified by `lrf3d stress`",
            "entries": [entry.as_dict(lrf) for entry in self.entries],
            "first_calls": self.first_calls,
            "batch_memory": self.memory,
            "ratios": [ratio.as_dict() for ratio in self.ratios],
            "savings": [saving.as_dict() for saving in self.savings],
            "skipped": self.skipped,
            "took_s": self.took,
        }


def bench_scan(
    walls: Sequence[int] = WALLS,
    *,
    seconds: float = SECONDS,
    with_ablation: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> ScanBenchmark:
    """Measure all casters in cities of so many walls.

    Args:
        walls: Sizes of the cities; a size for which the time does not suffice is skipped.
        seconds: Time for all [s]; a step that has begun is finished.
        with_ablation: Also time each piece of skipped work on and off.
        progress: Called with the steps done, and of how many.
    """
    start = time.monotonic()
    result = ScanBenchmark(load=os.getloadavg()[0] if hasattr(os, "getloadavg") else None)
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
        contest = Contest(count, share, absent)
        result.entries += contest.run(step)
        built = contest.build_seconds / count
    for caster in PROBED:
        _probe(result, caster)
        step(2)
    if with_ablation:
        result.savings = ablate(
            seconds=ABLATION_SHARE * seconds, huge=max(walls), progress=lambda done, total: None
        )
        step()
    result.took = time.monotonic() - start
    return result


def _probe(result: ScanBenchmark, caster: str) -> None:
    """Measure a caster in fresh processes."""
    try:
        probe("first_call", caster, USUAL)  # The kernels are on disk after this one.
        calls = [probe("first_call", caster, USUAL) for _ in range(3)]
        result.first_calls[caster] = sorted(calls, key=lambda call: call["until_first_scan_s"])[1]
        result.memory[caster] = probe("memory", caster, USUAL)
    except (OSError, subprocess.SubprocessError) as error:
        result.skipped.append(f"fresh processes of {caster}: {error}")
