"""What an experiment gives: runs at its noises, their figures, and the files of both."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from lrf3d.logs import save_run
from lrf3d.simulation import Run
from lrf3d.study.experiment import Experiment, Progress, noise_levels, trajectory_of
from lrf3d.study.summary import summarise

Bar = Callable[[str], AbstractContextManager[Progress]]


@dataclass(frozen=True)
class Results:
    """The runs of an experiment, one for each noise, and the summary.

    Args:
        experiment: What was run.
        sigmas: The noises [m]; the first is that of the main run.
        runs: A run for each noise.
        summary: The figures, in JSON's types.
    """

    experiment: Experiment
    sigmas: tuple[float, ...]
    runs: tuple[Run, ...]
    summary: dict[str, Any]

    @classmethod
    def of(
        cls,
        experiment: Experiment,
        sigmas: tuple[float, ...],
        *,
        bar: Bar,
        collision: Callable[[str], None] | None = None,
    ) -> "Results":
        """Drive, scan and map a scenario at each of the noises, and sum it up."""
        trajectory = trajectory_of(experiment.scenario, ignore_collisions=collision)
        begin = perf_counter()
        with bar("scans") as progress:
            runs = noise_levels(experiment, trajectory, sigmas, progress)
        seconds = perf_counter() - begin
        summary = {
            "name": experiment.scenario.name,
            "seed": experiment.seed,
            "caster": experiment.caster,
            "mode": experiment.mapper().mode,
            "sigma_m": sigmas[0],
            **summarise(runs[0], experiment.mapper()),
            "milliseconds_a_scan": 1e3 * seconds / sum(len(run) for run in runs),
        }
        if len(sigmas) > 1:
            summary["noise_levels"] = [
                {"sigma_m": sigma, "segments": len(run.map), "unions": run.map.object_count}
                for sigma, run in zip(sigmas, runs, strict=True)
            ]
        return cls(experiment, sigmas, tuple(runs), summary)

    @property
    def run(self) -> Run:
        """The main run."""
        return self.runs[0]

    def rows(self) -> list[tuple[str, str]]:
        """The summary in a few lines for people."""
        drive, score = self.summary["drive"], self.summary["score"]
        buildings, stored = self.summary["buildings"], self.summary["storage"]
        rows = [
            (
                "drive",
                f"{drive['length_m']:.1f} m in {drive['duration_s']:.1f} s, {drive['scans']} scans"
                f" of {self.run.lrf.beams} beams",
            ),
            (
                "map",
                f"{len(self.run.map)} segments in {self.run.map.object_count} unions, length F1"
                f" {_share(score['length_f1'])}, segment F1 {_share(score['segment_f1'])}",
            ),
            (
                "objects",
                f"{buildings['seen_on_all_sides']} of {buildings['buildings']} seen on all sides,"
                f" {buildings['whole']} of them whole in the map",
            ),
            (
                "storage",
                f"{stored['union_numbers']} numbers as unions of segments,"
                f" {stored['polyline_numbers']} as polylines,"
                f" {stored['grid_cells']} as a grid of 0.1 m",
            ),
        ]
        for level in self.summary.get("noise_levels", []):
            text = f"{level['segments']} segments in {level['unions']} unions"
            rows.append((f"σ {level['sigma_m']:g} m", text))
        return rows


def _share(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"


def draw_results(results: Results, folder: Path) -> dict[str, Path]:
    """Write the run, its map and its pictures to a folder; the film is made apart.

    Returns:
        The files by what they hold.

    Raises:
        OutputError: A file cannot be written.
    """
    from lrf3d.render.figures import draw_map, draw_noise_levels, draw_world

    run, scenario = results.run, results.experiment.scenario
    files = {
        "run": folder / "run.npz",
        "map": folder / "map.geojson",
        "map picture": folder / "map.png",
        "world picture": folder / "world.png",
    }
    save_run(run, files["run"])
    run.map.save(files["map"])
    draw_map(run, files["map picture"])
    draw_world(
        run.world,
        files["world picture"],
        scan=run.scan(0),
        route=scenario.route,
        poses=scenario.poses,
    )
    if len(results.runs) > 1:
        files["noise picture"] = folder / "noise.png"
        draw_noise_levels(results.runs, results.sigmas, files["noise picture"])
    return files
