"""Measuring all baselines in one city: how long they take, and how far they are off."""

import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import Any
from unittest.mock import patch

from benchmarks.scan.accuracy import Accuracy, corner_trial, judge, scan_trial
from benchmarks.scan.baselines import BASELINES, OWN, Baseline, Call, Planar
from benchmarks.scan.processes import resident_bytes
from benchmarks.timing import Timing, take_turns
from lrf3d.casting import PlanarCaster, threads
from lrf3d.laser import LaserRangeFinder
from lrf3d.world.generate import city_crossings, generate_city

USUAL = 400
"""Walls of the usual city. PlanarCaster is timed there too beside larger ones, so that nothing
that slows the machine comes between the two."""

DRIVE, NEAR = 64, 3
"""Poses that single scans are timed at, and how many crossings a way they lie around the middle:
as on a drive, the same walls come into view again and again."""

BATCH = 4000
"""Poses of a batch."""

AWAKE = 0.1
"""How long a turn of several batches may take [s]: cores that a baseline left idle take some time
to be at full speed again."""

JUDGED_SCANS, JUDGED_CORNERS = 200, 20_000
"""Scans, and beams aimed at corners, that baselines are judged by; the slow ones by fewer."""

WEIGHED_WALLS = 100_000
"""Worlds from which on an index stands out from the noise of the process's memory."""

SLOW_BATCH = ("numpy", "mujoco")
"""Baselines whose batch is a loop over single scans: it would show nothing new."""


@dataclass(frozen=True, slots=True)
class Entry:
    """How one baseline did in one world.

    Args:
        baseline: Its kind.
        walls: How many walls the world has.
        build: Time to build what is built once [s].
        index: Memory of that [bytes], where it is known.
        single: Timing of one scan [s].
        scans: Accuracy on plain scans.
        corners: Accuracy on beams aimed at corners.
        usual: Timing of one scan in a city of the usual size [s], taken in the same turns; None
            but for PlanarCaster in larger cities.
        batch: Timing of a batch on all its cores; None where it has none.
        alone: Timing of the same batch on one core, for those that use several.
    """

    baseline: type[Baseline]
    walls: int
    build: float
    index: int | None
    single: Timing
    scans: Accuracy
    corners: Accuracy
    usual: Timing | None = None
    batch: Timing | None = None
    alone: Timing | None = None

    @property
    def largest_error(self) -> float:
        """Largest error [m] over all beams."""
        return max(self.scans.largest_error_m, self.corners.largest_error_m)

    def rate(self, batch: Timing | None) -> float | None:
        """Rays a second of a batch."""
        return None if batch is None else BATCH * LaserRangeFinder().beams / batch.median

    def as_dict(self) -> dict[str, Any]:
        batches = {"batch": self.batch, "batch_one_core": self.alone}
        return {
            "caster": self.baseline.key,
            "walls": self.walls,
            "build_s": self.build,
            "index_bytes_per_wall": None if self.index is None else self.index / self.walls,
            "scan": self.single,
            "scan_in_usual_city": self.usual,
            "scan_rays_per_s": LaserRangeFinder().beams / self.single.median,
            "largest_error_m": self.largest_error,
            "on_scans": self.scans,
            "at_corners": self.corners,
        } | {
            name: timing and {**timing.as_dict(), "rays_per_s": self.rate(timing)}
            for name, timing in batches.items()
        }


def missing() -> dict[str, str]:
    """Load what all baselines need, which is no part of building an index.

    Returns:
        For each baseline that cannot take part its key and why.
    """
    absent = {}
    for kind in BASELINES:
        try:
            lrf = LaserRangeFinder()
            kind(generate_city(4), lrf).single(lrf, city_crossings(4, 1)[0])()
        except ImportError as error:
            absent[kind.key] = (
                f"{kind.title}: not installed ({error}); .venv/bin/pip install -e '.[bench]'"
            )
    return absent


@dataclass
class CityMeasurement:
    """Baselines in one city, measured in three steps that share the given time.

    Args:
        walls: How many walls the city is asked to have.
        seconds: Time for all turns and judgements [s]; building comes on top.
        skipped: Keys of the baselines that do not take part.
        lrf: The range finder.
    """

    walls: int
    seconds: float
    skipped: Collection[str] = ()
    lrf: LaserRangeFinder = field(default_factory=LaserRangeFinder)
    build_seconds: float = field(default=0.0, init=False)

    def run(self, step: Callable[[], None]) -> list[Entry]:
        """Build, time and judge all baselines; `step` is called after each of the three steps."""
        world = generate_city(self.walls)
        self.walls = len(world.segments)
        start = time.perf_counter()
        built = {baseline.key: made for baseline, made in self._build(world)}
        self.build_seconds = time.perf_counter() - start
        step()
        share = self.seconds / 3.0
        drive = city_crossings(self.walls, DRIVE, spread=NEAR)
        turns = {
            key: _by_turn([baseline.single(self.lrf, pose) for pose in drive])
            for key, (baseline, _, _) in built.items()
        }
        if self.walls > USUAL:
            guest = Planar(generate_city(USUAL), self.lrf)
            drive = city_crossings(USUAL, DRIVE, spread=NEAR)
            turns["usual"] = _by_turn([guest.single(self.lrf, pose) for pose in drive])
        singles = take_turns(turns, seconds=share)
        batches = self._batches({key: each for key, (each, _, _) in built.items()}, share)
        step()
        caster = PlanarCaster(world)
        everywhere = city_crossings(self.walls, JUDGED_CORNERS, seed=1)
        on_scans = scan_trial(caster, self.lrf, everywhere[:JUDGED_SCANS])
        at_corners = corner_trial(caster, world, everywhere)
        each_s = 0.5 * share / len(built)
        entries = [
            Entry(
                type(baseline),
                self.walls,
                took,
                index,
                singles[key],
                judge(baseline, on_scans, seconds=each_s),
                judge(baseline, at_corners, seconds=each_s),
                usual=singles.get("usual") if key == Planar.key else None,
                batch=batches.get(key),
                alone=batches.get(f"{key}, one core"),
            )
            for key, (baseline, took, index) in built.items()
        ]
        step()
        return entries

    def _build(
        self, world: Any
    ) -> Iterator[tuple[type[Baseline], tuple[Baseline, float, int | None]]]:
        """The baselines that take part, with their time to build [s] and memory [bytes]."""
        for kind in BASELINES:
            if self.walls > kind.most_walls or kind.key in self.skipped:
                continue
            before, start = _weigh(self.walls), time.perf_counter()
            baseline = kind(world, self.lrf)
            took = time.perf_counter() - start
            baseline.single(self.lrf, city_crossings(self.walls, 1)[0])()
            grown = None if before is None else (_weigh(self.walls) or 0) - before
            yield kind, (baseline, took, baseline.index_bytes or grown)

    def _batches(self, baselines: dict[str, Baseline], seconds: float) -> dict[str, Timing]:
        poses = city_crossings(self.walls, BATCH, seed=2)
        turns: dict[str, Callable[[int], object]] = {}
        for key, baseline in baselines.items():
            if key in SLOW_BATCH:
                continue
            call = baseline.scans(self.lrf, poses)
            turns[key] = _by_turn([call])
            if isinstance(baseline, OWN):
                turns[f"{key}, one core"] = _by_turn([_on_one_core(call)])
        return take_turns(turns, seconds=seconds, burst_seconds=AWAKE)


def _by_turn(calls: list[Call]) -> Callable[[int], object]:
    """The calls one after the other, by the number of the turn."""
    return lambda turn: calls[turn % len(calls)]()


def _on_one_core(call: Call) -> Call:
    """The call with casters that take the machine to have one core."""

    def alone() -> object:
        with patch.object(threads, "core_count", lambda: 1):
            return call()

    return alone


def _weigh(walls: int) -> int | None:
    """Memory of this process [bytes], where it is known and an index stands out from noise."""
    if walls < WEIGHED_WALLS:
        return None
    try:
        return resident_bytes()
    except OSError:
        return None
