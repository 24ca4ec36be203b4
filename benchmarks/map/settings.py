"""How do thresholds, beams and noise change the error of a map, and the time that it takes?

One thing at a time is varied from what is usual, along the drive through the built-in city, in
both modes of the mapper. What leaves are map scores, averaged over seeds, with
the time of an update and of working out the map.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from benchmarks.timing import TimedMapper, Timing
from lrf3d.casting import PlanarCaster
from lrf3d.laser import ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.mapping.line_mapper import MODES
from lrf3d.robot import Trajectory
from lrf3d.scenario import SIGMA, Scenario, load_scenario
from lrf3d.scoring import score_run
from lrf3d.simulation import simulate
from lrf3d.study.experiment import trajectory_of

USUAL_BEAMS = 181
"""Beams where they are not what is varied: those of the paper."""

SWEEPS: dict[str, tuple[float, ...]] = {
    "merge_distance": (0.01, 0.03, 0.12, 0.5, 2.0),
    "merge_length": (0.03, 0.1, 0.5, 2.0, 8.0),
    "gap": (0.5, 1.0, 2.5, 5.0, 10.0),
    "beams": (91, 181, 361, 721, 1441),
    "sigma": (0.01, 0.04, 0.07, 0.21, 0.42, 0.63),
}
"""What is varied, and over which values: thresholds and noise in metres, on both sides of what is
usual. The noise has the levels of the paper's figures and some between."""

EVERY = 4
"""Every fourth scan of the drive is used: they are then 3.2 m apart, which shows all walls and
lets all settings take half a minute."""

SCORES = (
    "segment_f1", "length_f1", "segment_ratio", "object_purity", "perpendicular_rms",
)  # fmt: skip
"""Scores of a map that are reported."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A mapper with one thing set.

    Args:
        mode: Mode of the mapper.
        varied: What is set: beams, sigma or a threshold of the mapper.
        value: What to.
    """

    mode: str
    varied: str
    value: float

    @property
    def name(self) -> str:
        """Words for a list."""
        return f"{self.varied} {self.value:g}, {self.mode} mode"


@dataclass
class MapEntry:
    """What a setting gave.

    Args:
        setting: The setting.
        scores: For each name of a score one value a seed; None where a map has none.
        updates: For each seed, the times of all updates [s].
        builds: For each seed, the time in which the final map was worked out [s].
    """

    setting: Setting
    scores: dict[str, list[float | None]] = field(default_factory=dict)
    updates: list[list[float]] = field(default_factory=list)
    builds: list[float] = field(default_factory=list)

    @property
    def update(self) -> Timing:
        """The time of an update, with the seed that was disturbed least by other programs."""
        return min(map(Timing.of, self.updates), key=lambda timing: timing.median)

    @property
    def build(self) -> float:
        """Least time in which a final map was worked out [s]."""
        return min(self.builds)

    def score(self, name: str) -> float:
        """The average of a score over the seeds; NaN where no map has it."""
        values = [value for value in self.scores[name] if value is not None]
        return float(np.mean(values)) if values else np.nan

    def as_dict(self) -> dict[str, Any]:
        return {
            "mode": self.setting.mode,
            "varied": self.setting.varied,
            "value": self.setting.value,
            "seeds": len(self.builds),
            **{name: self.score(name) for name in SCORES},
            "scores_of_seeds": self.scores,
            "update": self.update,
            "work_out_map_s": self.build,
        }


class CityDrive:
    """The drive through the built-in city.

    Args:
        every: Use each scan whose number is a multiple of this.
        scans: How many scans from the beginning; all where not given.
        sigma: Noise [m] at range_max where it is not what is varied.
    """

    def __init__(self, *, every: int = 1, scans: int | None = None, sigma: float = SIGMA) -> None:
        self.sigma = sigma
        self.scenario: Scenario = load_scenario("city")
        drive, used = trajectory_of(self.scenario), slice(None, None, every)
        self.trajectory = Trajectory(drive.times[used][:scans], drive.poses[used][:scans])
        self._caster = PlanarCaster(self.scenario.world)

    def measure(self, entry: MapEntry, seed: int) -> None:
        """Add to an entry what its setting gives with a seed of the noise."""
        setting = entry.setting
        choice: dict[str, Any] = {
            "beams": USUAL_BEAMS,
            "sigma": self.sigma,
            setting.varied: setting.value,
        }
        lrf = replace(self.scenario.lrf, beams=int(choice.pop("beams")))
        mapper = TimedMapper(LineMapper(setting.mode, **choice))
        run = simulate(
            self.scenario.world,
            self.trajectory,
            lrf,
            caster=self._caster,
            noise=ProportionalNoise(choice["sigma"]),
            mapper=mapper,
            rng=seed,
        )
        start = time.perf_counter()
        len(run.map)  # In robust mode the map is worked out only now.
        entry.builds.append(time.perf_counter() - start)
        entry.updates.append(mapper.spent)
        scores = score_run(run).as_dict()
        for name in SCORES:
            entry.scores.setdefault(name, []).append(scores[name])


def settings(sweeps: dict[str, tuple[float, ...]]) -> list[Setting]:
    """Both modes with each value; the modes take turns, so that time stops neither first."""
    return [
        Setting(mode, varied, value)
        for varied, values in sweeps.items()
        for value in values
        for mode in reversed(MODES)
    ]


def measure_accuracy(
    drive: CityDrive, chosen: Sequence[Setting], *, seeds: int, until: float
) -> Iterator[MapEntry | Setting]:
    """Measure settings, all with one seed before any with the next.

    Args:
        drive: Where to drive.
        chosen: The settings.
        seeds: Seeds of the noise for each, from 0.
        until: When to stop [s], on the clock of time.monotonic; what has begun is finished.

    Yields:
        After each step the entry that grew, or the setting that the time did not suffice for.
    """
    # Compiling, or loading what was compiled, is no part of an update.
    for mode in MODES:
        drive.measure(MapEntry(Setting(mode, "sigma", SIGMA)), 0)
    entries = [MapEntry(setting) for setting in chosen]
    for seed in range(seeds):
        for entry in entries:
            if time.monotonic() < until:
                drive.measure(entry, seed)
                yield entry
            else:
                yield entry.setting
