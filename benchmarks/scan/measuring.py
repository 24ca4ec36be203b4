"""A contest: all rivals in one world, how long they take and how far they are off."""

import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field, replace
from typing import Any
from unittest.mock import patch

from lrf3d.casting import PlanarCaster, threads
from lrf3d.laser import LaserRangeFinder
from lrf3d.study.bench.accuracy import Accuracy, Trial, corner_trial, judge, scan_trial
from lrf3d.study.bench.peers import MuJoCo, Open3D
from lrf3d.study.bench.probes import resident_bytes
from lrf3d.study.bench.rivals import Call, Determinants, Embree, Location, Planar, RawEmbree, Rival
from lrf3d.study.timing import Timing, take_turns
from lrf3d.world.generate import city_crossings, generate_city

RIVALS: tuple[type[Rival], ...] = (
    Determinants,
    Planar,
    RawEmbree,
    Location,
    Embree,
    Open3D,
    MuJoCo,
)
"""In the order of the table."""

USUAL = 400
"""Walls of the usual city. Larger ones are told how long a scan takes in this one too, so that
nothing that slows the machine comes between the two."""

DRIVE, NEAR = 64, 3
"""Poses that single scans are timed at, and how many crossings a way they lie around the middle:
as on a drive, the same walls come into view again and again."""

BATCH = 4000
"""Poses of a batch."""

AWAKE = 0.1
"""How long a turn of several batches may take [s]: cores that a rival left idle take some time to
be at full speed again."""

JUDGED_SCANS, JUDGED_CORNERS = 200, 20_000
"""Scans, and beams aimed at corners, that rivals are judged by: the slow ones by a part of them."""

WEIGHED_WALLS = 100_000
"""Worlds from which on an index stands out from the noise of the process's memory."""

SLOW_BATCH = ("numpy", "mujoco")
"""Rivals whose batch is a loop over single scans: it would tell nothing new."""


@dataclass(frozen=True, slots=True)
class Entry:
    """How one rival did in one world.

    Args:
        rival: Its kind.
        walls: How many walls the world has.
        build: Time to build what is built once [s].
        index: Memory of that [bytes], where it can be told.
        single: Timing of one scan [s].
        scans: Accuracy on plain scans.
        corners: Accuracy on beams aimed at corners.
        usual: Timing of one scan in a city of the usual size [s], taken in the same turns; None
            but for PlanarCaster in larger cities.
        batch: Timing of a batch on all its cores; None where it has none.
        alone: Timing of the same batch on one core, for those that use several.
    """

    rival: type[Rival]
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
        return max(self.scans.largest, self.corners.largest)

    def as_dict(self, lrf: LaserRangeFinder) -> dict[str, Any]:
        """The entry in JSON's types."""
        batches = {"batch": self.batch, "batch_one_core": self.alone}
        return {
            "caster": self.rival.key,
            "walls": self.walls,
            "build_s": self.build,
            "index_bytes_per_wall": None if self.index is None else self.index / self.walls,
            "scan": self.single.as_dict(),
            "scan_in_usual_city": None if self.usual is None else self.usual.as_dict(),
            "scan_rays_per_s": lrf.beams / self.single.median,
            "largest_error_m": self.largest_error,
            "on_scans": self.scans.as_dict(),
            "at_corners": self.corners.as_dict(),
        } | {
            name: None
            if timing is None
            else {**timing.as_dict(), "rays_per_s": BATCH * lrf.beams / timing.median}
            for name, timing in batches.items()
        }


def missing() -> dict[str, str]:
    """Load what all rivals need, which is no part of building an index, and say what is missing.

    Returns:
        For each rival that cannot take part its key and why.
    """
    absent = {}
    for kind in RIVALS:
        try:
            lrf = LaserRangeFinder()
            kind(generate_city(4), lrf).single(lrf, city_crossings(4, 1)[0])()
        except ImportError as error:
            absent[kind.key] = f"{kind.title}: not installed ({error})"
    return absent


@dataclass
class Contest:
    """Rivals in one city, met in three steps that share the given time.

    Args:
        walls: How many walls the city is asked to have.
        seconds: Time for all turns and judgements [s]; building comes on top.
        skipped: Keys of the rivals that do not take part.
        lrf: The range finder.
    """

    walls: int
    seconds: float
    skipped: Collection[str] = ()
    lrf: LaserRangeFinder = field(default_factory=LaserRangeFinder)
    build_seconds: float = field(default=0.0, init=False)

    def run(self, step: Callable[[], None]) -> list[Entry]:
        """Build all rivals, time and judge them; `step` is called after each of the three steps."""
        world = generate_city(self.walls)
        self.walls = len(world.segments)
        start = time.perf_counter()
        built = {rival.key: made for rival, made in self._build(world)}
        self.build_seconds = time.perf_counter() - start
        step()
        share = self.seconds / 3.0
        drive = city_crossings(self.walls, DRIVE, spread=NEAR)
        turns = {
            key: _by_turn([rival.single(self.lrf, pose) for pose in drive])
            for key, (rival, _, _) in built.items()
        }
        if self.walls > USUAL:
            guest = Planar(generate_city(USUAL), self.lrf)
            drive = city_crossings(USUAL, DRIVE, spread=NEAR)
            turns["usual"] = _by_turn([guest.single(self.lrf, pose) for pose in drive])
        singles = take_turns(turns, seconds=share)
        batches = self._batches({key: rival for key, (rival, _, _) in built.items()}, share)
        step()
        caster = PlanarCaster(world)
        everywhere = city_crossings(self.walls, JUDGED_CORNERS, seed=1)
        trials = (
            scan_trial(caster, self.lrf, everywhere[:JUDGED_SCANS]),
            corner_trial(caster, world, everywhere),
        )
        entries = []
        for key, (rival, took, index) in built.items():
            on_scans, at_corners = self._judge(rival, trials, share / len(built))
            entry = Entry(type(rival), self.walls, took, index, singles[key], on_scans, at_corners)
            entries.append(
                replace(
                    entry,
                    usual=singles.get("usual") if key == Planar.key else None,
                    batch=batches.get(key),
                    alone=batches.get(f"{key}, one core"),
                )
            )
        step()
        return entries

    def _build(self, world: Any) -> Iterator[tuple[type[Rival], tuple[Rival, float, int | None]]]:
        """The rivals that take part, each with its time to build [s] and its memory [bytes]."""
        for kind in RIVALS:
            if self.walls > kind.most_walls or kind.key in self.skipped:
                continue
            before, start = _weigh(self.walls), time.perf_counter()
            rival = kind(world, self.lrf)
            took = time.perf_counter() - start
            rival.single(self.lrf, city_crossings(self.walls, 1)[0])()
            grown = None if before is None else (_weigh(self.walls) or 0) - before
            yield kind, (rival, took, rival.index_bytes or grown)

    def _batches(self, rivals: dict[str, Rival], seconds: float) -> dict[str, Timing]:
        poses = city_crossings(self.walls, BATCH, seed=2)
        turns: dict[str, Callable[[int], object]] = {}
        for key, rival in rivals.items():
            if key in SLOW_BATCH:
                continue
            call = rival.scans(self.lrf, poses)
            turns[key] = _by_turn([call])
            if isinstance(rival, Planar | Embree):
                turns[f"{key}, one core"] = _by_turn([_on_one_core(call)])
        return take_turns(turns, seconds=seconds, burst_seconds=AWAKE)

    def _judge(
        self, rival: Rival, trials: tuple[Trial, Trial], seconds: float
    ) -> tuple[Accuracy, Accuracy]:
        return judge(rival, trials[0], seconds=seconds / 2), judge(
            rival, trials[1], seconds=seconds / 2
        )


def _by_turn(calls: list[Call]) -> Callable[[int], object]:
    """The calls one after the other, by the number of the turn."""
    return lambda turn: calls[turn % len(calls)]()


def _on_one_core(call: Call) -> Call:
    """The call with casters led to believe that there is one core."""

    def alone() -> object:
        with patch.object(threads, "core_count", lambda: 1):
            return call()

    return alone


def _weigh(walls: int) -> int | None:
    """Memory of this process [bytes], where it can be told and an index stands out from noise."""
    if walls < WEIGHED_WALLS:
        return None
    try:
        return resident_bytes()
    except OSError:
        return None
