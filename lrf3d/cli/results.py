"""The results of ``lrf3d run``: runs of a scenario at its noise levels, figures and files."""

import json
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from lrf3d.cli.folder import Drawing
from lrf3d.cli.plugins import made
from lrf3d.errors import InputError
from lrf3d.geometry import lengths
from lrf3d.interrupts import noting
from lrf3d.io import record
from lrf3d.mapping import save_map
from lrf3d.progress import Progress
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scoring import visible_walls
from lrf3d.scoring.summary import drawn_part, judged_part, summarise
from lrf3d.simulation import Simulation, collect
from lrf3d.text import counted

KEPT = "all scans kept; go on with --resume"
"""The note on a run that is stopped after its last scan."""


@dataclass(frozen=True)
class Results:
    """The runs of a scenario, one for each noise level [m], of which the first is recorded.

    With the simulation of that first one, the time that the scans of this call took, and their
    number; the robot has driven, or it has scanned from single poses.
    """

    scenario: Scenario
    sigmas: tuple[float, ...]
    runs: tuple[Run, ...]
    main: Simulation
    seconds: float
    taken: int
    driven: bool

    @property
    def run(self) -> Run:
        """The main run."""
        return self.runs[0]


def simulated(
    scenario: Scenario,
    sigmas: tuple[float, ...],
    folder: Path,
    *,
    plugins: Mapping[str, Any],
    progress: Callable[[str], AbstractContextManager[Progress]],
    resume: bool,
    **settings: Any,
) -> Results:
    """Drive, scan and map a scenario at each noise level; settings are those of a simulation.

    The main run is recorded to a run.npz in the folder, where it may be resumed.
    """

    def simulation(sigma: float | None) -> Simulation:
        own = {kind: made(found) for kind, found in plugins.items()}
        return scenario.simulation(sigma=sigma, **settings, **own)

    main = simulation(None if sigmas == scenario.sigmas else sigmas[0])
    begin, taken = perf_counter(), 0
    with progress("scans") as report:

        def count(done: int, total: int) -> None:
            # Only the scans of this call count, not those before a resumed run.
            nonlocal taken
            taken += 1
            report(done, total)

        runs = [record(main, folder / "run.npz", resume=resume, progress=count)]
        with noting(lambda: KEPT):
            runs += [collect(simulation(sigma), count) for sigma in sigmas[1:]]
    seconds = perf_counter() - begin
    driven = "controller" in plugins or scenario.poses is None
    return Results(scenario, sigmas, tuple(runs), main, seconds, taken, driven)


def summary_of(results: Results, settings: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The figures of the runs, in JSON's types."""
    run: Run = results.run
    mapper: Any = results.main.mapper
    parts, _ = visible_walls(judged_part(run))
    summary = {
        "name": results.scenario.name,
        "mode": getattr(mapper, "mode", None),
        **settings,
        "sigma_m": results.sigmas[0],
        "planned": results.scenario.planned,
        **summarise(run),
        "walls_seen": float(lengths(parts).sum() / lengths(run.world.segments).sum()),
        "seconds": results.seconds,
        "milliseconds_a_scan": 1e3 * results.seconds / results.taken if results.taken else None,
        "milliseconds_an_update": results.main.milliseconds_an_update,
    }
    if not results.driven:
        # The robot did not drive between the poses.
        summary["drive"]["length_m"] = 0.0
    if callable(getattr(mapper, "report", None)):
        if not results.main.updates:
            # The run was finished before, so this mapper has no scans yet.
            for scan in run.scans:
                mapper.update(scan)
        report = mapper.report(run, folder)
        try:
            summary["report"] = dict(json.loads(json.dumps(report, allow_nan=False)))
        except (TypeError, ValueError) as error:
            raise InputError(
                f"{mapper!r}: report: {error}; expected a dict of texts and finite numbers"
            ) from None
    if len(results.runs) > 1:
        summary["noise_levels"] = [
            {"sigma_m": sigma, "segments": len(run.map), "objects": run.map.object_count}
            for sigma, run in zip(results.sigmas, results.runs, strict=True)
        ]
    return summary


def rows_of(
    results: Results, summary: dict[str, Any]
) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """The summary as a table, and more of it."""
    run, drive, score = results.run, summary["drive"], summary["score"]
    scans = f"{counted(drive['scans'], 'scan')} of {counted(run.lrf.beams, 'beam')}"
    details: list[tuple[str, str]] = []
    if results.driven:
        rows = [("drive", f"{drive['length_m']:.1f} m in {drive['duration_s']:.1f} s, {scans}")]
    else:
        rows = [("scans", f"{scans}, from single poses")]
    rows.append(("seen", f"{100 * summary['walls_seen']:.0f} % of the walls' length"))
    if score is not None:
        found = f"{score['matched_segments']} of {score['visible_segments']} walls found"
        recall, buildings = score["length_recall"], summary["buildings"]
        if recall is not None:
            found += f", {100 * recall:.1f} % of their length"
        rows.append(("map", f"{run.map.counts}: {found}"))
        f1 = f"length {_share(score['length_f1'])}, segments {_share(score['segment_f1'])}"
        seen = f"{buildings['seen_on_all_sides']} of {buildings['buildings']} seen on all sides"
        details.append(("F1", f1))
        details.append(("objects", f"{seen}, {buildings['whole']} of them whole in the map"))
    if len(results.runs) > 1:
        levels = zip(results.sigmas, results.runs, strict=True)
        rows += [(f"σ {sigma:g} m", run.map.counts) for sigma, run in levels]
    for name, value in summary.get("report", {}).items():
        shown = f"{value:.3g}" if isinstance(value, float) else str(value)
        rows.append((name.replace("_", " "), shown))
    time = f"{summary['seconds']:.1f} s"
    if summary["milliseconds_a_scan"] is not None:
        time += f", {summary['milliseconds_a_scan']:.1f} ms a scan"
    if summary["milliseconds_an_update"] is not None:
        by = summary.get("mapper", "mapping")
        time += f", {summary['milliseconds_an_update']:.1f} ms of it {by}"
    return [*rows, ("time", time)], details


def _share(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"


def files_of(results: Results, folder: Path) -> dict[str, str]:
    """Write the map next to the run; returns the names of both files by their contents."""
    files = {"run": "run.npz"}
    # A user's mapper may make no LineMap.
    if results.run.maps:
        files["map"] = "map.geojson"
        save_map(results.run.map, folder / files["map"], free=results.run.free_cells())
    return files


def pictures_of(results: Results) -> dict[str, tuple[str, Drawing]]:
    """The pictures of a run: their files, and what draws them, by their contents."""
    from lrf3d.render.figures import draw_map, draw_noise_levels, draw_world

    run, scenario = drawn_part(results.run), results.scenario
    pictures: dict[str, tuple[str, Drawing]] = {}
    if run.maps:
        pictures["map picture"] = "map.png", partial(draw_map, run)
    world = partial(
        draw_world, run.world, scan=run.scan(0), route=scenario.route, poses=scenario.poses
    )
    pictures["world picture"] = "world.png", world
    if len(results.runs) > 1:
        levels = partial(draw_noise_levels, results.runs, results.sigmas)
        pictures["noise picture"] = "noise.png", levels
    return pictures
