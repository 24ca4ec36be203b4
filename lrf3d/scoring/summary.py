"""The summary of a run: what was driven, seen and mapped, in JSON's types."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.mapped_files import in_parts
from lrf3d.mapping import LineMap
from lrf3d.run import Run
from lrf3d.scoring import buildings_seen, score_run, storage

MOST_JUDGED = 2000
"""Scans that the walls in sight and the storage are judged by, at most: of a longer run as many,
taken at random, show as much of the walls, and the time does not grow with the run."""

MOST_DRAWN = 4000
"""Scans that a picture shows: the first of a longer run."""

LocalMap = Callable[[LaserScan], LineMap]


def summarise(run: Run, local_map: LocalMap | None) -> dict[str, Any]:
    """The figures of a run.

    What speaks of a map of lines is None where the mapper makes none.

    Args:
        run: The run.
        local_map: Makes the map of one scan alone, for the comparison of storage; None where the
            mapper makes no map of lines.
    """
    judged = judged_part(run)
    returned = sum(int(np.isfinite(part).sum()) for part in in_parts(run.ranges))
    summary: dict[str, Any] = {
        "world": {
            "name": run.world.name,
            "objects": run.world.object_count,
            "walls": len(run.world.segments),
        },
        "drive": {
            "scans": len(run),
            "duration_s": run.trajectory.duration,
            "length_m": run.trajectory.length,
        },
        "laser": {
            "beams": run.lrf.beams,
            "range_max_m": run.lrf.range_max,
            "returned": returned,
            "returned_share": returned / run.ranges.size,
        },
        **dict.fromkeys(("map", "score", "buildings", "storage")),
    }
    if len(judged) < len(run):
        summary["judged_scans"] = len(judged)
    if run.maps:
        summary["map"] = {"segments": len(run.map), "objects": run.map.object_count}
        summary["score"] = score_run(judged).as_dict()
        summary["buildings"] = buildings_seen(judged).as_dict()
    if run.maps and local_map is not None:
        polylines = [local_polylines(local_map(scan)) for scan in judged.scans]
        summary["storage"] = storage(judged, polylines).as_dict()
    return summary


def judged_part(run: Run) -> Run:
    """The run, or where it is long some of its scans."""
    if len(run) <= MOST_JUDGED:
        return run
    scans = np.random.default_rng(0).choice(len(run), MOST_JUDGED, replace=False)
    return run.part(np.sort(scans))


def drawn_part(run: Run) -> Run:
    """The run, or where it is long its beginning, with the map of its end."""
    return run if len(run) <= MOST_DRAWN else run.part(np.arange(MOST_DRAWN))


def local_polylines(local: LineMap) -> list[Float]:
    """Vertices (k, 2) of each polyline of the map of one scan.

    Where two segments follow each other, their vertex lies midway between their ends.
    """
    polylines = []
    for union in np.unique(local.objects):
        segments = local.segments[local.objects == union]
        middle = 0.5 * (segments[:-1, 2:] + segments[1:, :2])
        polylines.append(np.concatenate([segments[:1, :2], middle, segments[-1:, 2:]]))
    return polylines
