"""``scripts/bench score``: how good are maps and lines on your own world, log, or single scans?

A file, or the name of a world, enters; its ending gives the format. What leaves is a table of
scores, both modes of the mapper side by side.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.results import Result
from benchmarks.score.vertices import VertexEntry, load_scan_sets, score_vertices
from benchmarks.score.world import WorldEntry, score_world
from benchmarks.text import duration
from lrf3d.logs import load_log
from lrf3d.mapping.line_mapper import MODES
from lrf3d.study.log_mapping import MappedLog, map_log
from lrf3d.tables import table
from lrf3d.world.files import find_world, load_world
from lrf3d.world.geojson import read_geojson

LOG_ENDINGS = (".log", ".clf", ".gz")
"""Endings of recorded logs."""

SCAN_ENDING = ".npz"
"""Ending of files of single scans."""

COLUMNS = {
    "length F1": ("length_f1", 1.0, ".3f", min),
    "segment F1": ("segment_f1", 1.0, ".3f", min),
    "ratio": ("segment_ratio", 1.0, ".2f", None),
    "RMS [mm]": ("perpendicular_rms", 1e3, ".1f", max),
    "purity": ("object_purity", 1.0, ".3f", min),
}
"""Scores of a map: their names, what they are shown in, and which of several seeds is the worst."""


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


@dataclass(frozen=True, slots=True)
class LogEntry:
    """The map of a log in one mode."""

    mapped: MappedLog

    def as_dict(self) -> dict[str, object]:
        return self.mapped.summary()


@dataclass(kw_only=True)
class ScoreResult(Result):
    """The scores of one source; of the three lists those are empty that do not apply.

    Args:
        source: What was scored.
        maps: Maps of a world.
        logs: Maps of a log.
        lines: Lines of single scans.
    """

    benchmark = "score"
    source: str
    maps: list[WorldEntry] = field(default_factory=list)
    logs: list[LogEntry] = field(default_factory=list)
    lines: list[VertexEntry] = field(default_factory=list)

    def tables(self) -> Iterable[str]:
        if self.maps:
            head = ("mode", "beams", "seeds", *COLUMNS, "walls", "segments", "update")
            groups = dict.fromkeys((entry.mode, entry.beams) for entry in self.maps)
            yield table(head, [self._map_row(*group) for group in groups])
            yield (
                "Means over the seeds of poses and noise; in brackets the worst. ratio: segments"
                " by visible walls.\nRMS: perpendicular distance from the true walls. purity:"
                " unions against true objects.\nwalls: visible ones, longer than 0.5 m. update:"
                " the median of the seed that was disturbed least."
            )
        if self.logs:
            head = ("mode", "segments", "explained", "violated", "median error", "length", "update")
            yield table(head, [_log_row(entry.mapped) for entry in self.logs])
            yield (
                "The even scans build the map, the odd ones test it. explained: returns within"
                " 0.1 m of a segment.\nviolated: beams that meet the map over 0.2 m before their"
                " return. median error: of the ranges that the\nmap predicts."
            )
        if self.lines:
            head = ("scans", "number", "vertices", "ray RMSE", "explained", "area error")
            yield table(head, [_vertex_row(entry) for entry in self.lines])
            yield (
                "Means over the scans, each with at most this number of vertices. ray RMSE: of the"
                " beams that meet a line.\nexplained: share of the returns whose beams do. area"
                " error: of the symmetric difference, by the true area."
            )

    def _map_row(self, mode: str, beams: int) -> tuple[str, ...]:
        own = [entry for entry in self.maps if (entry.mode, entry.beams) == (mode, beams)]
        cells = []
        for name, unit, style, worst in COLUMNS.values():
            values = [unit * getattr(entry.score, name) for entry in own]
            cell = format(np.mean(values), style)
            cells.append(cell + (f" ({worst(values):{style}})" if worst and len(own) > 1 else ""))
        sizes = [
            f"{np.mean([getattr(entry.score, name) for entry in own]):.0f}"
            for name in ("visible_segments", "map_segments")
        ]
        update = duration(min(entry.update_s for entry in own))
        return mode, f"{beams}", f"{len(own)}", *cells, *sizes, update


def _log_row(mapped: MappedLog) -> tuple[str, ...]:
    score = mapped.score
    return (
        mapped.mode,
        f"{score.segments}",
        f"{score.explained:.3f}",
        f"{score.violation:.3f}",
        f"{1e3 * score.median_range_error:.0f} mm",
        f"{score.length:.0f} m",
        duration(1e-3 * float(np.median(mapped.milliseconds))),
    )


def _vertex_row(entry: VertexEntry) -> tuple[str, ...]:
    return (
        entry.kind,
        f"{entry.scans}",
        f"{entry.vertices}",
        f"{entry.ray_rmse_m:.4f} m",
        f"{entry.explained:.4f}",
        "" if entry.area_error is None else f"{entry.area_error:.4f}",
    )


def bench_score(
    source: str,
    choice: ScoreChoice | None = None,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> ScoreResult:
    """Score the mapper on a world, a log, or single scans.

    Args:
        source: A built-in world, or a file: a world, a log, or an .npz of single scans.
        choice: What is scored; the usual where not given.
        progress: Called with the steps done, and of how many.

    Raises:
        InputError: The file is none of these, or cannot be used.
    """
    choice = ScoreChoice() if choice is None else choice
    result = ScoreResult(source=source)
    ending = Path(source).suffix.lower()
    if ending == SCAN_ENDING:
        sets = load_scan_sets(Path(source))
        result.lines = score_vertices(sets, choice.vertices, progress=progress)
    elif ending in LOG_ENDINGS:
        log = load_log(source)
        result.logs = [
            LogEntry(map_log(log, mode=mode, sigma=choice.sigma, progress=progress))
            for mode in choice.modes
        ]
    else:
        if choice.simplify is not None and find_world(source).suffix.lower() == ".geojson":
            world = read_geojson(find_world(source), simplify=choice.simplify)
        else:
            world = load_world(source)
        result.maps = score_world(
            world, modes=choice.modes, beams=choice.beams, seeds=choice.seeds,
            poses=choice.poses, sigma=choice.sigma, progress=progress,
        )  # fmt: skip
    return result
