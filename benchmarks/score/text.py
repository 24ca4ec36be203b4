"""The tables of ``bench score``, as text."""

from collections.abc import Sequence

import numpy as np

from lrf3d.study.bench.score_bench import ScoreBenchmark
from lrf3d.study.bench.text import duration, table
from lrf3d.study.bench.vertex_score import VertexEntry
from lrf3d.study.bench.world_score import WorldEntry
from lrf3d.study.log_mapping import MappedLog

COLUMNS = {
    "length F1": ("length_f1", 1.0, ".3f", min),
    "segment F1": ("segment_f1", 1.0, ".3f", min),
    "ratio": ("segment_ratio", 1.0, ".2f", None),
    "RMS [mm]": ("perpendicular_rms", 1e3, ".1f", max),
    "purity": ("object_purity", 1.0, ".3f", min),
}
"""Scores of a map: their names, what they are shown in, and which of several seeds is the worst."""


def score_text(result: ScoreBenchmark) -> str:
    """The scores as a table, with what each column means."""
    if result.lines:
        return _lines(result.lines)
    if result.logs:
        return _logs(result.logs)
    return _maps(result.maps)


def _maps(entries: Sequence[WorldEntry]) -> str:
    head = ("mode", "beams", "seeds", *COLUMNS, "walls", "segments", "update")
    rows = []
    for mode, beams in dict.fromkeys((entry.mode, entry.beams) for entry in entries):
        own = [entry for entry in entries if (entry.mode, entry.beams) == (mode, beams)]
        cells = []
        for name, unit, style, worst in COLUMNS.values():
            values = [unit * getattr(entry.score, name) for entry in own]
            cell = format(np.mean(values), style)
            cells.append(cell + (f" ({worst(values):{style}})" if worst and len(own) > 1 else ""))
        sizes = [
            f"{np.mean([getattr(entry.score, name) for entry in own]):.0f}"
            for name in ("visible_segments", "map_segments")
        ]
        update = duration(min(entry.update for entry in own))
        rows.append((mode, f"{beams}", f"{len(own)}", *cells, *sizes, update))
    return table(head, rows) + (
        "\n\nMeans over the seeds of poses and noise; in brackets the worst. ratio: segments by"
        " visible walls.\nRMS: perpendicular distance from the true walls. purity: unions against"
        " true objects.\nwalls: visible ones, longer than 0.5 m. update: the median of the seed"
        " that was disturbed least."
    )


def _logs(logs: Sequence[MappedLog]) -> str:
    head = ("mode", "segments", "explained", "violated", "median error", "length", "update")
    rows = [
        (
            mapped.mode,
            f"{mapped.score.segments}",
            f"{mapped.score.explained:.3f}",
            f"{mapped.score.violation:.3f}",
            f"{1e3 * mapped.score.median_range_error:.0f} mm",
            f"{mapped.score.length:.0f} m",
            duration(1e-3 * float(np.median(mapped.milliseconds))),
        )
        for mapped in logs
    ]
    return table(head, rows) + (
        "\n\nThe even scans build the map, the odd ones test it. explained: returns within 0.1 m"
        " of a segment.\nviolated: beams that meet the map over 0.2 m before their return."
        " median error: of the ranges that the\nmap foretells."
    )


def _lines(entries: Sequence[VertexEntry]) -> str:
    head = ("scans", "number", "vertices", "ray RMSE", "explained", "area error")
    rows = [
        (
            entry.kind,
            f"{entry.scans}",
            f"{entry.vertices}",
            f"{entry.error:.4f} m",
            f"{entry.explained:.4f}",
            "" if entry.area is None else f"{entry.area:.4f}",
        )
        for entry in entries
    ]
    return table(head, rows) + (
        "\n\nMeans over the scans, each with at most so many vertices. ray RMSE: of the beams that"
        " meet a line.\nexplained: share of the returns whose beams do. area error: of the"
        " symmetric difference, by the true area."
    )
