"""``bench score``: how good are maps and lines on what a user has: a world, a log, single scans?

A file, or the name of a world, enters; its ending tells what it is. What leaves is a table of
scores, both modes of the mapper side by side.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lrf3d.logs import load_log
from lrf3d.mapping.line_mapper import MODES
from lrf3d.study.bench.scan_set import load_scan_sets
from lrf3d.study.bench.vertex_score import VertexEntry, score_vertices
from lrf3d.study.bench.world_score import Survey, WorldEntry, score_world
from lrf3d.study.log_mapping import MappedLog, map_log
from lrf3d.world.files import find_world, load_world
from lrf3d.world.geojson import read_geojson

LOG_ENDINGS = (".log", ".clf", ".gz")
"""Endings of recorded logs."""

SCAN_ENDING = ".npz"
"""Ending of files of single scans."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class ScoreChoice:
    """What is scored.

    Args:
        modes: Modes of the mapper, for a world and for a log.
        sigma: Noise [m] at the farthest range, for a world and for a log.
        seeds: Seeds of poses and noise, for a world.
        poses: Random poses in a world.
        beams: Beams of a scan in a world.
        simplify: Corners of footprints up to this [m] off a straight façade are left out;
            the reader's own where None.
        vertices: Vertices of a single scan.
    """

    modes: tuple[str, ...] = tuple(reversed(MODES))
    sigma: float = 0.04
    seeds: int = 6
    poses: int = 200
    beams: tuple[int, ...] = (721, 181)
    simplify: float | None = None
    vertices: tuple[int, ...] = (10, 20, 30, 50)


@dataclass(frozen=True, eq=False)
class ScoreBenchmark:
    """The scores of one source; of the three lists those are empty that it is not of.

    Args:
        source: What was scored.
        maps: Maps of a world.
        logs: Maps of a log.
        lines: Lines of single scans.
    """

    source: str
    maps: Sequence[WorldEntry] = ()
    logs: Sequence[MappedLog] = ()
    lines: Sequence[VertexEntry] = ()

    def as_dict(self) -> dict[str, Any]:
        """The scores in JSON's types."""
        return {
            "benchmark": "score",
            "source": self.source,
            "maps": [entry.as_dict() for entry in self.maps],
            "logs": [mapped.summary() for mapped in self.logs],
            "lines": [entry.as_dict() for entry in self.lines],
        }


def bench_score(
    source: str,
    choice: ScoreChoice | None = None,
    *,
    progress: Progress = lambda done, total: None,
) -> ScoreBenchmark:
    """Score the mapper on a world, a log, or single scans.

    Args:
        source: A built-in world, or a file: a world, a log, or an .npz of single scans.
        choice: What is scored; the usual where not given.
        progress: Called with the steps done, and of how many.

    Raises:
        InputError: The file is none of these, or cannot be used.
    """
    choice = ScoreChoice() if choice is None else choice
    path = Path(source)
    if path.suffix.lower() == SCAN_ENDING:
        sets = load_scan_sets(path)
        return ScoreBenchmark(
            source, lines=score_vertices(sets, choice.vertices, progress=progress)
        )
    if path.suffix.lower() in LOG_ENDINGS:
        log = load_log(path)
        logs = [
            map_log(log, mode=mode, sigma=choice.sigma, progress=progress) for mode in choice.modes
        ]
        return ScoreBenchmark(source, logs=logs)
    if choice.simplify is not None and find_world(source).suffix.lower() == ".geojson":
        world = read_geojson(find_world(source), simplify=choice.simplify)
    else:
        world = load_world(source)
    maps = score_world(
        world,
        modes=choice.modes,
        beams=choice.beams,
        seeds=choice.seeds,
        survey=Survey(choice.poses, choice.sigma),
        progress=progress,
    )
    return ScoreBenchmark(source, maps=maps)
