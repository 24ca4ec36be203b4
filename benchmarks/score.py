"""How good are maps and lines on your own world, log, or single scans, and how good is your mapper?

The ending of the source gives its format. A world is seen from random poses, 1 m off all walls, and
its map is compared with the walls that were visible; all mappers see the very same scans. The even
scans of a log build a map and the odd ones test it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from benchmarks.report import Report, numbers
from benchmarks.timing import time_updates
from lrf3d.base.errors import InputError
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import Float
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.mapping.mapper import MODES
from lrf3d.planning.free_space import free_places
from lrf3d.recordings import load_log
from lrf3d.scoring import score_log, score_run
from lrf3d.simulation.recorder import simulate
from lrf3d.world import World, load_world

CLEARANCE = 1.0
"""Least distance of a random pose to any wall [m]."""

LOG_ENDINGS = (".log", ".clf", ".gz")
"""Endings of recorded logs."""


def bench(
    source: Annotated[str, "A world or its file; a CARMEN log; or an .npz of single scans."],
    *,
    mapper: Annotated[str, "robust, paper, or your own as FILE.py:NAME."] = "robust,paper",
    sigma: Annotated[float, "Noise [m] at the farthest range."] = 0.04,
    seeds: Annotated[int, "A world: seeds of poses and noise."] = 6,
    poses: Annotated[int, "A world: random poses in the open."] = 200,
    beams: Annotated[str, "A world: numbers of beams."] = "721,181",
    vertices: Annotated[str, "Single scans: numbers of vertices."] = "10,20,30,50",
) -> Report:
    """Score maps of a world or a log by several mappers, or the lines of single scans."""
    report = Report(__doc__.splitlines()[0])
    makers = {label.strip(): maker_of(label.strip(), sigma) for label in mapper.split(",")}
    ending = Path(source).suffix.lower()
    if ending == ".npz":
        from benchmarks.single_scans import load_scan_sets, score_vertices

        counts = numbers("--vertices", vertices, least=2)
        for row in score_vertices(load_scan_sets(Path(source)), counts):
            report.add("lines", **row)
    elif ending in LOG_ENDINGS:
        score_recorded(report, source, makers)
    else:
        counts = numbers("--beams", beams, least=3)
        score_world(report, load_world(source), makers, counts, seeds, poses, sigma)
    return report


def maker_of(label: str, sigma: float) -> Callable[[], Any]:
    """What makes a mapper for each run: a mode of the LineMapper, or a user's own."""
    if label in MODES:
        return lambda: LineMapper(label, sigma=sigma)
    if ":" not in label:
        raise InputError(f"--mapper {label}: expected {', '.join(MODES)} or FILE.py:NAME")
    from lrf3d.apps.cli.inputs import load_plugin, made

    found = load_plugin("mapper", label)
    return lambda: made(found)


def score_world(
    report: Report,
    world: World,
    makers: dict[str, Callable[[], Any]],
    beams: Sequence[int],
    seeds: int,
    poses: int,
    sigma: float,
) -> None:
    """Score maps of a world: means over the seeds, and the worst of them."""
    caster, noise = PlanarCaster(world), ProportionalNoise(sigma)
    for count in beams:
        lrf = replace(LaserRangeFinder(), beams=count)
        for label, make in makers.items():
            scores, spent = [], []
            for seed in range(seeds):
                places = random_poses(world, poses, np.random.default_rng(seed))
                mapper = make()
                times = time_updates(mapper)
                run = simulate(world, places, lrf, caster=caster, noise=noise, mapper=mapper,
                               rng=seed, snapshots=1)  # fmt: skip
                scores.append(score_run(run))
                spent.append(float(np.mean(times)))
            rms = [score.perpendicular_rms for score in scores if score.perpendicular_rms]
            purity = [score.object_purity for score in scores if score.object_purity is not None]
            report.add(
                "maps",
                mapper=label,
                beams=count,
                seeds=seeds,
                length_f1=float(np.mean([score.length_f1 for score in scores])),
                segment_f1=float(np.mean([score.segment_f1 for score in scores])),
                worst=float(min(score.segment_f1 for score in scores)),
                segment_ratio=float(np.mean([score.segment_ratio for score in scores])),
                rms_m=float(np.mean(rms)) if rms else None,
                purity=float(np.mean(purity)) if purity else None,
                update_s=min(spent),
            )
    report.notes.append(
        "worst: the least segment F1. update: the mean with its map, of the seed disturbed least."
    )


def score_recorded(report: Report, source: str, makers: dict[str, Callable[[], Any]]) -> None:
    """Score maps of a log: its even scans build the map, the odd ones test it."""
    log = load_log(source)
    for label, make in makers.items():
        mapper = make()
        spent = time_updates(mapper)
        for scan in log.scans[::2]:
            latest = mapper.update(scan)
        found = score_log(latest, log.scans[1::2])
        report.add(
            "logs",
            mapper=label,
            segments=found.segments,
            explained=found.explained,
            violation=found.violation,
            median_error_m=found.median_range_error,
            update_s=float(np.mean(spent)),
        )
    report.notes.append(
        "explained: returns within 0.1 m of a segment. violation: beams that meet the map over"
        " 0.2 m before their return."
    )


def random_poses(world: World, count: int, rng: np.random.Generator) -> Float:
    """Poses (count, 3), evenly spread over the free space of a world.

    Raises:
        InputError: There is no such room in the world.
    """
    places = free_places(world, CLEARANCE)
    heading = rng.uniform(-np.pi, np.pi, count)
    return np.column_stack([places[rng.integers(len(places), size=count)], heading])
