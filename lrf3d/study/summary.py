"""The summary of a run: what was driven, seen and mapped, in JSON's types."""

from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.mapping import LineMapper
from lrf3d.scoring import buildings_seen, score_run, storage
from lrf3d.simulation import Run


def summarise(run: Run, mapper: LineMapper) -> dict[str, Any]:
    """The figures of a run; the mapper gives the local polylines for the comparison of storage."""
    returned = np.isfinite(run.ranges)
    return {
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
            "returned": int(returned.sum()),
            "returned_share": float(returned.mean()),
        },
        "map": {"segments": len(run.map), "unions": run.map.object_count},
        "score": score_run(run).as_dict(),
        "buildings": buildings_seen(run).as_dict(),
        "storage": storage(
            run, [local_polylines(run, mapper, i) for i in range(len(run))]
        ).as_dict(),
    }


def local_polylines(run: Run, mapper: LineMapper, scan: int) -> list[Float]:
    """Vertices (k, 2) of each polyline that a mapper makes of one scan of a run alone.

    Where two segments follow each other, their vertex lies midway between their ends.
    """
    local = mapper.local_map(run.scan(scan))
    polylines = []
    for union in np.unique(local.objects):
        segments = local.segments[local.objects == union]
        middle = 0.5 * (segments[:-1, 2:] + segments[1:, :2])
        polylines.append(np.concatenate([segments[:1, :2], middle, segments[-1:, 2:]]))
    return polylines
