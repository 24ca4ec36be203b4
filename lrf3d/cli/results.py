"""The results of ``lrf3d run``: runs of a scenario at its noise levels, figures and files."""

import json
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from lrf3d.cli.plugins import Plugin
from lrf3d.errors import InputError
from lrf3d.interrupts import noting
from lrf3d.io import record
from lrf3d.mapping import save_map
from lrf3d.output import Drawing
from lrf3d.progress import Progress
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scoring import walls_seen
from lrf3d.scoring.summary import drawn_part, summarise
from lrf3d.simulation import Simulation, collect
from lrf3d.text import counted

Bar = Callable[[str], AbstractContextManager[Progress]]

KEPT = "all scans kept; go on with --resume"
"""The note on a run that is stopped after its last scan."""


@dataclass(frozen=True)
class Results:
    """The runs of a scenario, one for each noise, and the summary.

    Args:
        scenario: The scenario.
        sigmas: The noise levels [m]; the first is that of the main run.
        runs: A run for each noise level.
        summary: The figures, in JSON's types.
        single_poses: Whether the scans are from single poses, without a drive.
    """

    scenario: Scenario
    sigmas: tuple[float, ...]
    runs: tuple[Run, ...]
    summary: dict[str, Any]
    single_poses: bool

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        sigmas: tuple[float, ...],
        folder: Path,
        *,
        plugins: Mapping[str, Plugin],
        bar: Bar,
        resume: bool,
        seed: int,
        caster: str,
        scans: int | None,
        on_collision: Callable[[str], None] | None,
        **settings: Any,
    ) -> "Results":
        """Drive, scan and map a scenario at each noise level, and summarise it.

        The main run is recorded to a run.npz in the folder, where it may be resumed.
        """
        if "controller" not in plugins:
            # All noise levels have the same drive, which is computed and checked once.
            settings["drive"] = scenario.trajectory(scans=scans, on_collision=on_collision)

        def simulation(sigma: float | None) -> Simulation:
            made = {kind: plugin.make() for kind, plugin in plugins.items()}
            arguments = {"scans": scans, "on_collision": on_collision, **settings, **made}
            return scenario.simulation(rng=seed, sigma=sigma, caster=caster, **arguments)

        main = simulation(None if sigmas == scenario.sigmas else sigmas[0])
        mapper: Any = main.mapper
        begin, taken = perf_counter(), 0
        with bar("scans") as progress:

            def count(done: int, total: int) -> None:
                # Only the scans of this call count, not those before a resumed run.
                nonlocal taken
                taken += 1
                progress(done, total)

            runs = [record(main, folder / "run.npz", resume=resume, progress=count)]
            with noting(lambda: KEPT):
                runs += [collect(simulation(sigma), count) for sigma in sigmas[1:]]
        seconds = perf_counter() - begin
        named = {kind: plugins[kind].name for kind in ("mapper", "controller") if kind in plugins}
        summary = {
            "name": scenario.name,
            "seed": seed,
            "caster": caster,
            "mode": None if "mapper" in plugins else mapper.mode,
            **named,
            "sigma_m": sigmas[0],
            "planned": scenario.planned,
            "walls_seen": walls_seen(runs[0]),
            **summarise(runs[0], getattr(mapper, "local_map", None)),
            "milliseconds_a_scan": 1e3 * seconds / taken if taken else None,
            "milliseconds_an_update": main.milliseconds_an_update,
        }
        single_poses = "controller" not in plugins and scenario.poses is not None
        if single_poses:
            # The robot did not drive between the poses.
            summary["drive"]["length_m"] = 0.0
        if callable(getattr(mapper, "report", None)):
            if not main.updates:
                # The run was finished before, so this mapper has no scans yet.
                for scan in runs[0].scans:
                    mapper.update(scan)
            summary["report"] = _checked(mapper, mapper.report(runs[0], folder))
        if len(sigmas) > 1:
            summary["noise_levels"] = [
                {"sigma_m": sigma, "segments": len(run.map), "objects": run.map.object_count}
                for sigma, run in zip(sigmas, runs, strict=True)
            ]
        return cls(scenario, sigmas, tuple(runs), summary, single_poses)

    @property
    def run(self) -> Run:
        """The main run."""
        return self.runs[0]

    def rows(self) -> list[tuple[str, str]]:
        """The summary as a table."""
        drive, score = self.summary["drive"], self.summary["score"]
        buildings, stored = self.summary["buildings"], self.summary["storage"]
        scans = f"{counted(drive['scans'], 'scan')} of {counted(self.run.lrf.beams, 'beam')}"
        rows = [("drive", f"{drive['length_m']:.1f} m in {drive['duration_s']:.1f} s, {scans}")]
        if self.single_poses:
            rows = [("scans", f"{scans}, from single poses")]
        rows.append(("seen", f"{_share(self.summary['walls_seen'])} of the length of all walls"))
        if score is not None:
            text = f"{self.run.map.counts}, length F1"
            text += f" {_share(score['length_f1'])}, segment F1 {_share(score['segment_f1'])}"
            rows.append(("map", text))
            text = f"{buildings['seen_on_all_sides']} of {buildings['buildings']} seen on all sides"
            rows.append(("objects", f"{text}, {buildings['whole']} of them whole in the map"))
        if stored is not None:
            text = f"{counted(stored['union_numbers'], 'number')} as objects of segments"
            text += f", {stored['polyline_numbers']:,} as polylines"
            rows.append(("storage", f"{text}, {stored['grid_cells']:,} as a grid of 0.1 m"))
        update = self.summary["milliseconds_an_update"]
        if "mapper" in self.summary and update is not None:
            rows.append(("mapper", f"{self.summary['mapper']}, {update:.2f} ms an update"))
        rows += [(str(name), str(value)) for name, value in self.summary.get("report", {}).items()]
        if len(self.runs) > 1:
            levels = zip(self.sigmas, self.runs, strict=True)
            rows += [(f"σ {sigma:g} m", run.map.counts) for sigma, run in levels]
        return rows


def _checked(mapper: Any, report: Any) -> dict[str, Any]:
    """The report of a mapper in JSON's types.

    Raises:
        InputError: JSON cannot represent it.
    """
    try:
        return dict(json.loads(json.dumps(dict(report), allow_nan=False)))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{mapper!r}: report returned {str(report)[:60]!r}; expected a dict of texts and finite"
            f" numbers ({error})"
        ) from None


def _share(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"


def write_results(results: Results, folder: Path) -> dict[str, Path]:
    """Write the map of the run to the folder of the run.

    Returns:
        The files by their contents.

    Raises:
        OutputError: A file cannot be written.
    """
    files = {"run": folder / "run.npz"}
    # A user's mapper may make no LineMap.
    if results.run.maps:
        files["map"] = folder / "map.geojson"
        save_map(results.run.map, files["map"], free=results.run.free_cells())
    return files


def pictures_of(results: Results, folder: Path) -> dict[str, Drawing]:
    """The pictures of a run by name."""
    from lrf3d.render.figures import draw_map, draw_noise_levels, draw_world

    run, scenario = drawn_part(results.run), results.scenario
    pictures: dict[str, Drawing] = {}
    if run.maps:
        pictures["map picture"] = folder / "map.png", partial(draw_map, run)
    world = partial(
        draw_world, run.world, scan=run.scan(0), route=scenario.route, poses=scenario.poses
    )
    pictures["world picture"] = folder / "world.png", world
    if len(results.runs) > 1:
        levels = partial(draw_noise_levels, results.runs, results.sigmas)
        pictures["noise picture"] = folder / "noise.png", levels
    return pictures
