"""What ``lrf3d run`` does with a scenario: runs at all noise levels, figures and pictures."""

import json
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from lrf3d.cli.folder import Drawing
from lrf3d.errors import InputError
from lrf3d.geometry import lengths
from lrf3d.interrupts import noting
from lrf3d.io import record
from lrf3d.progress import Progress
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scoring import visible_walls
from lrf3d.scoring.summary import drawn_part, judged_part, summarise
from lrf3d.simulation import Simulation, collect
from lrf3d.text import counted

KEPT = "all scans kept; go on with --resume"
"""The note on a run that is stopped after its last scan."""


def simulated(
    simulations: Sequence[Callable[[], Simulation]],
    folder: Path,
    *,
    progress: Callable[[str], AbstractContextManager[Progress]],
    resume: bool,
) -> tuple[list[Run], dict[str, Any]]:
    """Make the runs of all noise levels, and their figures in JSON's types.

    The first run is recorded to a run.npz in the folder, where it may be resumed.
    """
    main, begin, taken = simulations[0](), perf_counter(), 0
    with progress("scans") as report:

        def count(done: int, total: int) -> None:
            # Only the scans of this call count, not those before a resumed run.
            nonlocal taken
            taken += 1
            report(done, total)

        runs = [record(main, folder / "run.npz", resume=resume, progress=count)]
        with noting(lambda: KEPT):
            runs += [collect(make(), count) for make in simulations[1:]]
    seconds, run = perf_counter() - begin, runs[0]
    parts, _ = visible_walls(judged_part(run))
    figures = {
        "mode": getattr(main.mapper, "mode", None),
        **summarise(run),
        "walls_seen": float(lengths(parts).sum() / lengths(run.world.segments).sum()),
        "seconds": seconds,
        "milliseconds_a_scan": 1e3 * seconds / taken if taken else None,
        "milliseconds_an_update": main.milliseconds_an_update,
    }
    if callable(getattr(main.mapper, "report", None)):
        figures["report"] = _report(main, run, folder)
    return runs, figures


def _report(main: Simulation, run: Run, folder: Path) -> dict[str, Any]:
    """What a user's mapper reports of its run."""
    mapper: Any = main.mapper
    if not main.updates:
        # The run was finished before, so this mapper has no scans yet.
        for scan in run.scans:
            mapper.update(scan)
    report = mapper.report(run, folder)
    try:
        return dict(json.loads(json.dumps(report, allow_nan=False)))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{mapper!r}: report: {error}; expected a dict of texts and finite numbers"
        ) from None


def rows_of(runs: Sequence[Run], summary: dict[str, Any]) -> list[tuple[str, str]]:
    """What most users ask of the runs, as a table."""
    run, drive, score = runs[0], summary["drive"], summary["score"]
    scans = f"{counted(drive['scans'], 'scan')} of {counted(run.lrf.beams, 'beam')}"
    rows = [("drive", f"{drive['length_m']:.1f} m in {drive['duration_s']:.1f} s, {scans}")]
    if not drive["length_m"]:
        rows = [("scans", f"{scans}, from single poses")]
    rows.append(("seen", f"{100 * summary['walls_seen']:.0f} % of the walls' length"))
    if score is not None:
        found = f"{score['matched_segments']} of {score['visible_segments']} walls found"
        if score["length_recall"] is not None:
            found += f", {100 * score['length_recall']:.1f} % of their length"
        rows.append(("map", f"{run.map.counts}: {found}"))
    for level, other in zip(summary.get("noise_levels", ()), runs, strict=False):
        rows.append((f"σ {level['sigma_m']:g} m", other.map.counts))
    for name, value in summary.get("report", {}).items():
        shown = f"{value:.3g}" if isinstance(value, float) else str(value)
        rows.append((str(name).replace("_", " "), shown))
    time = f"{summary['seconds']:.1f} s"
    if summary["milliseconds_a_scan"] is not None:
        time += f", {summary['milliseconds_a_scan']:.1f} ms a scan"
    if summary["milliseconds_an_update"] is not None:
        by = summary.get("mapper", "mapping")
        time += f", {summary['milliseconds_an_update']:.1f} ms of it {by}"
    return [*rows, ("time", time)]


def pictures_of(
    runs: Sequence[Run], sigmas: Sequence[float], scenario: Scenario
) -> dict[str, tuple[str, Drawing]]:
    """The pictures of runs: their files, and what draws them, by their contents."""
    from lrf3d.render.figures import draw_map, draw_noise_levels, draw_world

    run = drawn_part(runs[0])
    pictures: dict[str, tuple[str, Drawing]] = {}
    if run.maps:
        pictures["map picture"] = "map.png", partial(draw_map, run)
    world = partial(
        draw_world, run.world, scan=run.scan(0), route=scenario.route, poses=scenario.poses
    )
    pictures["world picture"] = "world.png", world
    if len(runs) > 1:
        pictures["noise picture"] = "noise.png", partial(draw_noise_levels, runs, sigmas)
    return pictures
