"""Mapping a recorded log: the even scans build the map, the odd ones test it."""

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from lrf3d.interrupts import check, stoppable
from lrf3d.io import LaserLog
from lrf3d.laser import LaserScan
from lrf3d.laser.free_space import distinct_poses, free_cells
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.progress import Progress, silent
from lrf3d.scoring import LogScore, score_log
from lrf3d.text import counted
from lrf3d.world.free_cells import FreeCells


@dataclass(frozen=True, eq=False)
class MappedLog:
    """A log and the map that was built from its even scans.

    Args:
        log: The log.
        mode: Mode of the mapper.
        sigma: The initial noise [m] of the mapper; its default if None.
        map: The map.
        score: How well it predicts the odd scans.
        milliseconds: (k,) time of the update with each scan.
        mapped: The scans that the map was built from.
    """

    log: LaserLog
    mode: str
    sigma: float | None
    map: LineMap
    score: LogScore
    milliseconds: tuple[float, ...]
    mapped: list[LaserScan]

    def free_cells(self) -> FreeCells:
        """The cells that the mapped scans show to be free."""
        chosen = distinct_poses(np.array([scan.pose for scan in self.mapped]).reshape(-1, 3))
        return free_cells([self.mapped[index] for index in chosen])

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        return {
            "name": self.log.name,
            "mode": self.mode,
            "sigma_m": self.sigma,
            "log": {
                "scans": len(self.log),
                "beams": len(self.log.scans[0].ranges),
                "poses": self.log.source,
                "bad_lines": self.log.bad_count,
                "first_bad_lines": [
                    {bad.kind: bad.number, "reason": bad.reason} for bad in self.log.bad_lines
                ],
            },
            "map": {"segments": len(self.map), "objects": self.map.object_count},
            "score": self.score.as_dict(),
            "milliseconds_a_scan": float(np.mean(self.milliseconds)),
            "median_milliseconds_a_scan": float(np.median(self.milliseconds)),
        }

    def rows(self) -> list[tuple[str, str]]:
        """The figures as a printed table."""
        score = self.score
        beams = counted(len(self.log.scans[0].ranges), "beam")
        kind = self.log.bad_lines[0].kind if self.log.bad_lines else "line"
        bad = counted(self.log.bad_count, f"bad {kind}")
        rows = [("log", f"{counted(len(self.log), 'scan')} of {beams}, {bad}")]
        rows += [("", str(bad)) for bad in self.log.bad_lines]
        rows.append(("poses", self.log.source))
        rows.append(("map", f"{self.map.counts}, {score.length:.0f} m long"))
        if score.returns:
            explained = f"{_share(score.explained)} of {score.returns} returns explained"
            error = f"median range error {_metres(score.median_range_error)}"
            violated = f"{_share(score.violation)} violated"
            rows.append(("odd scans", f"{explained}, {violated}, {error}"))
        mean, median = np.mean(self.milliseconds), np.median(self.milliseconds)
        return [*rows, ("time", f"{mean:.2f} ms a scan, median {median:.2f} ms")]


@stoppable()
def map_log(
    log: LaserLog,
    *,
    mode: str = "robust",
    sigma: float | None = None,
    all_scans: bool = False,
    progress: Progress = silent,
) -> MappedLog:
    """Build a map from the even scans of a log, counted from 0, and test it on the odd ones.

    Args:
        log: The log.
        mode: Mode of the mapper.
        sigma: Noise [m] at the largest range; learnt from the scans if not given.
        all_scans: Build it from all scans instead, and test it on none.
        progress: Called with the number of finished scans, and of all.

    Raises:
        InputError: There is no such mode, or the noise is invalid.
    """
    mapper = LineMapper(mode, sigma=sigma)
    even, odd = (log.scans, []) if all_scans else (log.scans[::2], log.scans[1::2])
    # Compiling at the first scan is not counted.
    mapper.local_map(even[0])
    milliseconds = []
    for done, scan in enumerate(even, 1):
        begin = perf_counter()
        mapper.update(scan)
        milliseconds.append(1e3 * (perf_counter() - begin))
        progress(done, len(even))
        check()
    score = score_log(mapper.map, odd)
    return MappedLog(log, mode, sigma, mapper.map, score, tuple(milliseconds), even)


def draw_mapped_log(mapped: MappedLog, path: Path) -> None:
    """Draw the map of a log over the points that it was built from, to a file.

    Raises:
        OutputError: The file cannot be written.
    """
    from lrf3d.render.figures import draw_map

    draw_map(
        mapped.map,
        path,
        points=np.vstack([scan.points() for scan in mapped.mapped]),
        poses=np.array([scan.pose for scan in mapped.mapped]),
        title=mapped.log.name,
    )


def _metres(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.3f} m"


def _share(value: float) -> str:
    return "–" if np.isnan(value) else f"{100.0 * value:.1f} %"
