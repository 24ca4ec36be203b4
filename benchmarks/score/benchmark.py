"""``scripts/bench score``: how good are maps and lines on your own world, log, or single scans?

A file, or the name of a world, enters; its ending gives the format. What leaves is a table of
scores, both modes of the mapper side by side.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.result import Result, Row, Table, duration
from benchmarks.score.vertices import load_scan_sets, score_vertices
from benchmarks.score.world import score_world
from lrf3d.io import load_log
from lrf3d.progress import Progress, silent
from lrf3d.recorded import map_log
from lrf3d.world.files import find_world, load_world
from lrf3d.world.geojson import read_geojson

MODES = ("robust", "paper")
"""Modes of the mapper, the default first."""

LOG_ENDINGS = (".log", ".clf", ".gz")
"""Endings of recorded logs."""

SCAN_ENDING = ".npz"
"""Ending of files of single scans."""


def _mean(style: str, worst: Callable[[Any], float] | None = None, unit: float = 1.0) -> Any:
    """What writes the mean over the seeds and, in brackets, the worst of several."""

    def write(values: Sequence[float]) -> str:
        some = unit * np.array(values, dtype=np.float64)
        beside = f" ({worst(some):{style}})" if worst and len(some) > 1 else ""
        return f"{some.mean():{style}}{beside}"

    return write


MAPS = Table(
    "means",
    {
        "mode": "mode",
        "beams": "beams",
        "seeds": "seeds",
        "length_f1": ("length F1", _mean(".3f", min)),
        "segment_f1": ("segment F1", _mean(".3f", min)),
        "segment_ratio": ("ratio", _mean(".2f")),
        "perpendicular_rms": ("RMS [mm]", _mean(".1f", max, 1e3)),
        "object_purity": ("purity", _mean(".3f", min)),
        "visible_segments": ("walls", _mean(".0f")),
        "map_segments": ("segments", _mean(".0f")),
        "update_s": ("update", lambda times: duration(min(times))),
    },
    "Means over the seeds of poses and noise; in brackets the worst. ratio: segments by visible"
    " walls.\nRMS: perpendicular distance from the true walls. purity: unions against true"
    " objects.\nwalls: visible ones, longer than 0.5 m. update: the median of the seed that was"
    " disturbed least.",
)
"""Maps of a world: a row for each mode, number of beams and seed, printed together."""

LOGS = Table(
    "logs",
    {
        "mode": "mode",
        "score.segments": "segments",
        "score.explained": ("explained", "{:.3f}".format),
        "score.violation": ("violated", "{:.3f}".format),
        "score.median_range_error": ("median error", lambda error: f"{1e3 * error:.0f} mm"),
        "score.length": ("length", "{:.0f} m".format),
        "median_milliseconds_a_scan": ("update", lambda spent: duration(1e-3 * spent)),
    },
    "The even scans build the map, the odd ones test it. explained: returns within 0.1 m of a"
    " segment.\nviolated: beams that meet the map over 0.2 m before their return. median error: of"
    " the ranges that the\nmap predicts.",
)
"""Maps of a log."""

LINES = Table(
    "lines",
    {
        "kind": "scans",
        "scans": "number",
        "vertices": "vertices",
        "ray_rmse_m": ("ray RMSE", "{:.4f} m".format),
        "explained": ("explained", "{:.4f}".format),
        "area_error": ("area error", "{:.4f}".format),
    },
    "Means over the scans, each with at most this number of vertices. ray RMSE: of the beams that"
    " meet a line.\nexplained: share of the returns whose beams do. area error: of the symmetric"
    " difference, by the true area.",
)
"""Lines of single scans."""


def bench_score(
    source: str,
    *,
    modes: Sequence[str] = MODES,
    sigma: float = 0.04,
    seeds: int = 6,
    poses: int = 200,
    beams: Sequence[int] = (721, 181),
    simplify: float | None = None,
    vertices: Sequence[int] = (10, 20, 30, 50),
    progress: Progress = silent,
) -> Result:
    """Score the mapper on a world, a log, or single scans.

    Args:
        source: A built-in world, or a file: a world, a log, or an .npz of single scans.
        modes: Modes of the mapper, for a world and for a log.
        sigma: Noise [m] at the farthest range, for a world and for a log.
        seeds: Seeds of poses and noise, for a world.
        poses: Random poses in a world.
        beams: Beams of a scan in a world.
        simplify: Corners of footprints up to this [m] off a straight façade are left out;
            the reader's own where None.
        vertices: Vertices of a single scan.
        progress: Called with the steps done, and of how many.

    Raises:
        InputError: The file is none of these, or cannot be used.
    """
    question = "How good are maps and lines on a world, a log, or single scans?"
    result = Result("score", question, {"source": source, "maps": [], "logs": [], "lines": []})
    ending = Path(source).suffix.lower()
    if ending == SCAN_ENDING:
        sets = load_scan_sets(Path(source))
        result.tables[LINES] = score_vertices(sets, vertices, progress=progress)
    elif ending in LOG_ENDINGS:
        log = load_log(source)
        for mode in modes:
            mapped = map_log(log, mode=mode, sigma=sigma, progress=progress)
            result.add(LOGS, **mapped.summary())
    else:
        if simplify is not None and find_world(source).suffix.lower() == ".geojson":
            world = read_geojson(find_world(source), simplify=simplify)
        else:
            world = load_world(source)
        rows = score_world(
            world, modes=modes, beams=beams, seeds=seeds, poses=poses, sigma=sigma,
            progress=progress,
        )  # fmt: skip
        result.facts["maps"] = rows
        result.tables[MAPS] = over_seeds(rows)
    return result


def over_seeds(rows: Sequence[Row]) -> list[Row]:
    """A row for each mode and number of beams, with the figures of all seeds side by side."""
    groups: dict[tuple[str, int], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["mode"], row["beams"]), []).append(row)
    return [
        {name: [row[name] for row in mine] for name in mine[0]}
        | {"mode": mode, "beams": beams, "seeds": len(mine)}
        for (mode, beams), mine in groups.items()
    ]
