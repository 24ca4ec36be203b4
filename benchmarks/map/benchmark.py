"""``bench map``: what error does a map have, and what does it cost to make, keep and look up?

Four questions, each in a module of its own: accuracy over thresholds, beams and noise; updates by
the size of the map; numbers to store; line pairs for localisation.
"""

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from lrf3d.cores import core_count
from lrf3d.mapping.line_mapper import MODES
from lrf3d.scenario import SIGMA
from lrf3d.study.bench.map_accuracy import (
    EVERY,
    SWEEPS,
    USUAL_BEAMS,
    CityDrive,
    MapEntry,
    Setting,
    measure_accuracy,
    settings,
)
from lrf3d.study.bench.map_memory import MemoryEntry, measure_memory
from lrf3d.study.bench.map_pairs import TOWNS, PairEntry, measure_pairs, measure_town
from lrf3d.study.bench.map_speed import SIZES, SizeEntry, measure_sizes

SECONDS = 125.0
"""Time for all [s], where none is given."""

SEEDS = 2
"""Seeds of the noise for each setting, where nothing is said."""

ACCURACY_SHARE = 0.63
"""Part of the time for the settings of the mapper; the rest is for sizes, memory and pairs."""

UPDATE_SHARE = 0.015
"""Part of the time for the updates of one map of some size; building it comes on top."""


@dataclass(frozen=True, slots=True)
class Extent:
    """How much is measured.

    Args:
        sweeps: What is varied, over which values.
        every: Of so many scans of the drive one is used for each setting.
        sizes: Walls of the towns whose maps are updated.
        towns: Walls of the towns in which lines are paired.
        scans: Scans of a drive at most; all of the drive where None.
    """

    sweeps: dict[str, tuple[float, ...]] = field(default_factory=lambda: SWEEPS)
    every: int = EVERY
    sizes: tuple[int, ...] = SIZES
    towns: tuple[int, ...] = TOWNS
    scans: int | None = None


@dataclass
class MapBenchmark:
    """What was measured.

    Args:
        scans: Scans of each setting.
        entries: Each setting of the mapper.
        sizes: Maps of each size.
        memory: What maps take to store.
        pairs: Each strategy in each place.
        skipped: What was left out, and why.
        took: How long all took [s].
    """

    scans: int = 0
    entries: list[MapEntry] = field(default_factory=list)
    sizes: list[SizeEntry] = field(default_factory=list)
    memory: list[MemoryEntry] = field(default_factory=list)
    pairs: list[PairEntry] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    took: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """The benchmark in JSON's types."""
        return {
            "benchmark": "map",
            "machine": {"system": platform.platform(), "cores": core_count()},
            "world": "city",
            "scans_of_each_setting": self.scans,
            "usual": {"beams": USUAL_BEAMS, "sigma_m": SIGMA},
            "settings": [entry.as_dict() for entry in self.entries],
            "map_sizes": [entry.as_dict() for entry in self.sizes],
            "memory": [entry.as_dict() for entry in self.memory],
            "line_pairs": [entry.as_dict() for entry in self.pairs],
            "skipped": self.skipped,
            "took_s": self.took,
        }


def bench_map(
    *,
    seeds: int = SEEDS,
    seconds: float = SECONDS,
    extent: Extent | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> MapBenchmark:
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
    result = MapBenchmark(len(drive.trajectory))
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
            result.entries.append(found)
        step()
    result.skipped += _left_out(late, seeds)
    until = start + seconds
    for mode in MODES:
        if time.monotonic() < until:
            result.memory.append(measure_memory(mode, scans=extent.scans))
        else:
            result.skipped.append(f"numbers to store, {mode} mode: the time does not suffice")
        step()
    for place in places:
        if time.monotonic() < until:
            result.pairs += place()
        else:
            result.skipped.append("line pairs: the time does not suffice")
        step()
    for size in measure_sizes(extent.sizes, seconds=UPDATE_SHARE * seconds, until=until):
        if isinstance(size, SizeEntry):
            result.sizes.append(size)
        else:
            result.skipped.append(size)
        step()
    result.took = time.monotonic() - start
    return result


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
