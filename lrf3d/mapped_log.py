"""Recorded logs whose poses are known: `map_log`, which ``lrf3d map`` runs.

A log, or the path of one, enters. Its map leaves, with a score by the scans that it was not built
from.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from lrf3d.errors import InputError, Lrf3dWarning
from lrf3d.interrupts import check, stoppable
from lrf3d.io import LaserLog, load_log
from lrf3d.laser import LaserScan, doubtful_ranges
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.progress import Progress, silent
from lrf3d.scoring import LogScore, score_log


@dataclass(frozen=True, eq=False, repr=False)
class MappedLog:
    """A log, the map of some of its scans, and how well that predicts the others.

    Args:
        log: The log.
        map: The map.
        mapped: The scans that it was built from.
        score: How well it predicts the others.
        settings: The mode of the mapper, and the noise that it was given.
        milliseconds: Time of each update [ms].
    """

    log: LaserLog
    map: LineMap
    mapped: list[LaserScan]
    score: LogScore
    settings: dict[str, Any]
    milliseconds: list[float]

    def __repr__(self) -> str:
        return f"MappedLog({self.log.name}, {len(self.mapped)} scans, {self.map.counts})"

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        log = self.log
        bad = [{line.kind: line.number, "reason": line.reason} for line in log.bad_lines]
        return {
            "name": log.name,
            **self.settings,
            "log": {**log.counts, "poses": log.source, "first_bad_lines": bad},
            "map": {"segments": len(self.map), "objects": self.map.object_count},
            "score": self.score.as_dict(),
            "milliseconds_a_scan": float(np.mean(self.milliseconds)),
            "median_milliseconds_a_scan": float(np.median(self.milliseconds)),
        }


@stoppable()
def map_log(
    log: LaserLog | str | Path,
    *,
    mode: str = "robust",
    sigma: float | None = None,
    all_scans: bool = False,
    progress: Progress = silent,
) -> MappedLog:
    """Build a map from the even scans of a log, counted from 0, and test it on the odd ones.

    Args:
        log: The log, or its path; its poses are taken as they are.
        mode: Mode of the mapper.
        sigma: Noise [m] at the largest range; learnt from the scans if not given.
        all_scans: Build it from all scans instead, and test it on none.
        progress: Called with the number of finished scans, and of all.

    Raises:
        InputError: There is no such mode, the noise is invalid, or the scans show no wall.

    Warns:
        Lrf3dWarning: The ranges are hardly in metres.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> len(lrf3d.map_log("drive.log").map) > 3
        True
    """
    log = log if isinstance(log, LaserLog) else load_log(log)
    mapper, milliseconds = LineMapper(mode, sigma=sigma), list[float]()
    even, odd = (log.scans, []) if all_scans else (log.scans[::2], log.scans[1::2])
    # Compiling at the first scan is not counted.
    mapper.local_map(even[0])
    for done, scan in enumerate(even, 1):
        begin = perf_counter()
        mapper.update(scan)
        milliseconds.append(1e3 * (perf_counter() - begin))
        progress(done, len(even))
        check()
    line_map, doubt = mapper.map, doubtful_ranges(log.scans)
    if not len(line_map):
        reason = doubt or "expected walls within the laser's range"
        raise InputError(
            f"{log.name}: {len(even)} scans show no wall, so that there is no map; {reason}"
        )
    if doubt:
        warnings.warn(f"map: {log.name}: {doubt}", Lrf3dWarning, stacklevel=2)
    score, settings = score_log(line_map, odd), {"mode": mode, "sigma_m": sigma}
    return MappedLog(log, line_map, even, score, settings, milliseconds)
