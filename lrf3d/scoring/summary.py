"""The summary of a run: its drive, its scans and its map, in JSON's types."""

from typing import Any

import numpy as np

from lrf3d.run import Run
from lrf3d.scoring import buildings_seen, score_run

MOST_JUDGED = 2000
"""Largest number of scans from which visible walls are computed: a random sample of a
long run shows as much of the walls, and the time does not grow with the run."""

MOST_DRAWN = 4000
"""Largest number of scans in a picture: the first ones of a longer run."""


def summarise(run: Run) -> dict[str, Any]:
    """The figures of a run; those of the map are None if the mapper makes no LineMap."""
    judged = judged_part(run)
    # A row at a time, for a run may be larger than the memory.
    returned = sum(int(np.isfinite(ranges).sum()) for ranges in run.ranges)
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
            "beams": run.ranges.shape[1],
            "range_max_m": run.lrf.range_max,
            "returned": returned,
            "returned_share": returned / run.ranges.size,
        },
        **dict.fromkeys(("map", "score", "buildings")),
    }
    if len(judged) < len(run):
        summary["judged_scans"] = len(judged)
    if run.maps:
        summary["map"] = {"segments": len(run.map), "objects": run.map.object_count}
        summary["score"] = score_run(judged).as_dict()
        summary["buildings"] = buildings_seen(judged).as_dict()
    return summary


def judged_part(run: Run) -> Run:
    """The run, or a sample of the scans of a long one."""
    if len(run) <= MOST_JUDGED:
        return run
    scans = np.random.default_rng(0).choice(len(run), MOST_JUDGED, replace=False)
    return run.part(np.sort(scans))


def drawn_part(run: Run) -> Run:
    """The run, or the beginning of a long one, with the final map."""
    return run if len(run) <= MOST_DRAWN else run.part(np.arange(MOST_DRAWN))
