"""How well do the lines of single scans explain them, at an equal number of vertices?

Scans enter; for each number of vertices a scan, what Schaefer et al. (IROS 2018) measure leaves:
the error of the ranges along the beams that meet a line, how many beams do, and how much of the
area around the laser is taken in or left out wrongly.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.mapping import fit_vertices
from lrf3d.study.bench.scan_set import ScanSet
from lrf3d.world import World

GAP = 1.0
"""Two returns farther apart than this [m] are not joined where no closed polygon is around."""

EDGE = 1e-9
"""How much longer, at each end, a line is made as a part of its length: the vertices lie on beams,
which rounding would let pass beside the ends of a polyline."""

FARTHEST = 1000.0
"""How far [m] lines are looked for."""


@dataclass(frozen=True, slots=True)
class VertexEntry:
    """Scans of one kind at one number of vertices; means over the scans.

    Args:
        kind: The kind of scans.
        scans: How many.
        vertices: The most vertices that a scan may have.
        used: How many it had at most.
        error: Root mean square error of the ranges of a scan's beams that meet a line [m].
        explained: Share of a scan's returns whose beams do.
        area: Area that is wrong, by the true area; None where there is no truth.
    """

    kind: str
    scans: int
    vertices: int
    used: int
    error: float
    explained: float
    area: float | None

    def as_dict(self) -> dict[str, Any]:
        """The entry in JSON's types."""
        return {
            "kind": self.kind,
            "scans": self.scans,
            "vertices": self.vertices,
            "most_used": self.used,
            "ray_rmse_m": self.error,
            "explained": self.explained,
            "area_error": self.area,
        }


def score_vertices(
    sets: Sequence[ScanSet],
    vertices: Sequence[int],
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[VertexEntry]:
    """Score the lines of single scans.

    Args:
        sets: The scans.
        vertices: Numbers of vertices a scan.
        progress: Called with the scans done, and of how many.
    """
    entries = []
    done, total = 0, len(vertices) * sum(len(each.scans) for each in sets)
    for each in sets:
        for most in vertices:
            rows = []
            for index, scan in enumerate(each.scans):
                polygon = each.polygons[index] if each.polygons else None
                rows.append(_score_scan(scan, most, polygon))
                done += 1
                progress(done, total)
            used, errors, shares, areas = zip(*rows, strict=True)
            entries.append(
                VertexEntry(
                    each.kind,
                    len(rows),
                    most,
                    max(used),
                    float(np.nanmean(errors)),
                    float(np.mean(shares)),
                    float(np.mean(areas)) if each.polygons else None,
                )
            )
    return entries


def _score_scan(
    scan: LaserScan, most: int, polygon: Float | None
) -> tuple[int, float, float, float]:
    """Vertices used, error of the ranges [m], share of beams that meet a line, and wrong area."""
    polylines = fit_vertices(scan, most, gap=GAP if polygon is None else np.inf)
    if not polylines:
        raise InputError(f"a scan gave no line at {most} vertices; it needs at least 2 returns")
    used = sum(len(line) - _closed(line) for line in polylines)
    missed = scan.ranges[scan.hits] - _foretold(scan, polylines)[scan.hits]
    met = np.isfinite(missed)
    error = float(np.sqrt(np.mean(missed[met] ** 2))) if met.any() else np.nan
    area = np.nan if polygon is None else _wrong_area(polylines[0], polygon)
    return used, error, float(met.mean()), area


def _foretold(scan: LaserScan, polylines: Sequence[Float]) -> Float:
    """Ranges (beams,) at which the beams of a scan meet polylines."""
    segments = np.vstack([np.hstack([line[:-1], line[1:]]) for line in polylines])
    along = EDGE * (segments[:, 2:] - segments[:, :2])
    caster = PlanarCaster(World(segments + np.hstack([-along, along])))
    # Beams may be spread unevenly, so each is cast as the one beam of a laser of its own.
    x, y, theta = scan.pose
    poses = np.column_stack([np.full((len(scan.angles), 2), (x, y)), theta + scan.angles])
    lrf = LaserRangeFinder(0.0, 0.0, 1, range_max=FARTHEST)
    return caster.cast_batch(lrf, poses)[:, 0]


def _closed(line: Float) -> bool:
    return len(line) > 2 and bool(np.allclose(line[0], line[-1]))


def _wrong_area(line: Float, polygon: Float) -> float:
    """Area of the symmetric difference, by the true area."""
    import shapely

    found, true = (shapely.make_valid(shapely.Polygon(points)) for points in (line, polygon))
    return float(shapely.symmetric_difference(found, true).area / true.area)
