"""How do thresholds, beams and noise change the error of a map, and the time that it takes?

A mapper with one thing set drives through the built-in city, once for each seed; the figures of a
row of the table leave.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.result import Row
from benchmarks.timing import Timing, time_updates, timed
from lrf3d.casting import PlanarCaster
from lrf3d.laser import ProportionalNoise
from lrf3d.laser.noise import SIGMA
from lrf3d.mapping import LineMapper
from lrf3d.robot import Trajectory
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scenario_file import load_scenario
from lrf3d.scoring import score_run
from lrf3d.simulation import simulate

MODES = ("robust", "paper")
"""Modes of the mapper, the default first."""

USUAL_BEAMS = 181
"""Beams where they are not what is varied: those of the paper."""

EVERY = 4
"""Every fourth scan of the drive is used: they are then 3.2 m apart, which shows all walls and
lets all settings take half a minute."""

NO_NOISE = "beams, no noise"
"""Beams are varied without noise too, where what is wrong is the mapper's own."""

SWEEPS: dict[str, tuple[float, ...]] = {
    "beams": (91, 181, 361, 721, 1441),
    NO_NOISE: (91, 181, 361, 721),
    "merge_distance": (0.01, 0.03, 0.12, 0.5, 2.0),
    "merge_length": (0.03, 0.1, 0.5, 2.0, 8.0),
    "gap": (0.5, 1.0, 2.5, 5.0, 10.0),
    "sigma": (0.01, 0.04, 0.07, 0.21, 0.42, 0.63),
}
"""What is varied, and over which values: thresholds and noise in metres, on both sides of what is
usual. The noise has the levels of the paper's figures and some between."""

SCORES = (
    "segment_f1", "length_f1", "segment_ratio", "object_purity", "perpendicular_rms",
)  # fmt: skip
"""Scores of a map that are reported."""

LEAST_MISSED = 1e-4
"""Parts of F1 below which a map counts as without error: scores are measured every 5 cm."""


class CityDrive:
    """The drive through the built-in city.

    Args:
        every: Use each scan whose number is a multiple of this.
        scans: How many scans from the beginning; all if not given.
    """

    def __init__(self, *, every: int = 1, scans: int | None = None) -> None:
        self.scenario: Scenario = load_scenario("city")
        drive, used = self.scenario.trajectory(), slice(None, None, every)
        self.trajectory = Trajectory(drive.times[used][:scans], drive.poses[used][:scans])
        self._caster = PlanarCaster(self.scenario.world)

    def map(
        self, mode: str, seed: int, *, beams: float = USUAL_BEAMS, sigma: float = SIGMA, **more: Any
    ) -> tuple[Run, LineMapper, list[float]]:
        """Map the drive; the run, its mapper and the time of each update [s] leave."""
        lrf = replace(self.scenario.lrf, beams=int(beams))
        mapper = LineMapper(mode, sigma=sigma, **more)
        spent = time_updates(mapper)
        run = simulate(
            self.scenario.world, self.trajectory, lrf, caster=self._caster,
            noise=ProportionalNoise(sigma), mapper=mapper, rng=seed, snapshots=1,
        )  # fmt: skip
        return run, mapper, spent


class Setting:
    """A mapper with one thing varied, and what it gave with each seed so far."""

    def __init__(self, varied: str, value: float, mode: str) -> None:
        self.varied, self.value, self.mode = varied, value, mode
        self.choice = (
            {"beams": value, "sigma": 0.0} if varied == NO_NOISE else {varied: value}
        )  # fmt: skip
        self.scores: list[Mapping[str, Any]] = []
        self.updates: list[list[float]] = []
        self.builds: list[float] = []

    def measure(self, drive: CityDrive, seed: int) -> None:
        """Map the drive with a seed of the noise."""
        run, mapper, spent = drive.map(self.mode, seed, **self.choice)
        # The run has its map already: it is computed once more.
        mapper._mapper._map = None
        self.builds.append(timed(lambda: len(mapper.map)))
        self.updates.append(spent)
        scores = score_run(run).as_dict()
        self.scores.append({name: scores[name] for name in SCORES})

    def row(self) -> Row:
        """Means over the seeds, with the time of the seed that was disturbed least."""
        scores = {
            name: float(np.mean(known)) if (known := [v for v in values if v is not None]) else None
            for name in SCORES
            for values in [[each[name] for each in self.scores]]
        }
        missed = [1.0 - (each["segment_f1"] or 0.0) for each in self.scores]
        missed = [value if value > LEAST_MISSED else 0.0 for value in missed]
        build = min(self.builds)
        # What a scan costs until its map is there: its update, and its part of the last.
        spent = [t + build / len(each) for each in self.updates for t in each]
        return {
            "mode": self.mode,
            "varied": self.varied,
            "value": self.value,
            "seeds": len(self.builds),
            **scores,
            "scores_of_seeds": {name: [each[name] for each in self.scores] for name in SCORES},
            "update": min(map(Timing.of, self.updates), key=lambda timing: timing.median),
            "work_out_map_s": build,
            "scan_to_map": Timing.of(spent),
            "missed": float(np.mean(missed)),
            "least_error": min(missed),
            "largest_error": max(missed),
            "default": self.mode == "robust" and self.value == USUAL_BEAMS,
        }


def settings(sweeps: Mapping[str, Sequence[float]]) -> list[Setting]:
    """Both modes with each value; the modes take turns, so that time stops neither first."""
    return [
        Setting(varied, value, mode)
        for varied, values in sweeps.items()
        for value in values
        for mode in MODES
    ]
