"""How well do the lines of single scans explain them, at an equal number of vertices?

Scans enter; for each number of vertices a scan, what Schaefer et al. (IROS 2018) measure leaves:
the error of the ranges along the beams that meet a line, how many beams do, and how much of the
area around the laser is taken in or left out wrongly.

A file of scans is an .npz as made from those of Schaefer et al., one prefix for each kind of
scans: ``KIND_pose`` (s, 3), ``KIND_n`` (s,) beams of each scan, ``KIND_azimuth`` [rad] and
``KIND_range`` [m] of all beams in a row, ``KIND_rlim`` (s, 2) the valid ranges; and where the
truth is known, the corners of a polygon around each scan: ``KIND_poly_n``, ``KIND_poly_xy``.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.report import Row
from benchmarks.vertex_fit import fit_vertices
from lrf3d.base.errors import InputError
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import as_pose
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.world import World

GAP = 1.0
"""Two returns farther apart than this [m] are not joined where no closed polygon is around."""

EDGE = 1e-9
"""How much longer, at each end, a line is made as a part of its length: the vertices lie on beams,
which rounding would let pass beside the ends of a polyline."""

FARTHEST = 1000.0
"""How far [m] lines are looked for."""


class ScanSet(NamedTuple):
    """Scans of one kind, and the true polygon (k, 2) around each, if it is known."""

    kind: str
    scans: list[LaserScan]
    polygons: list[Float] | None


def load_scan_sets(path: Path) -> list[ScanSet]:
    """Read all kinds of scans of a file.

    Raises:
        InputError: The file cannot be read, or does not hold such scans.
    """
    try:
        with np.load(path) as file:
            columns = {name: file[name] for name in file.files}
        kinds = [name.removesuffix("_azimuth") for name in columns if name.endswith("_azimuth")]
        sets = [_scan_set(kind, columns) for kind in kinds]
    except (OSError, KeyError, ValueError, EOFError) as error:
        raise InputError(f"{path}: cannot be read as single scans ({error})") from None
    if not sets:
        raise InputError(f"{path}: holds no scans; expected arrays such as real_azimuth")
    return sets


def _scan_set(kind: str, columns: dict[str, Any]) -> ScanSet:
    starts = np.cumsum(columns[f"{kind}_n"])[:-1]
    azimuths = np.split(columns[f"{kind}_azimuth"], starts)
    ranges = np.split(columns[f"{kind}_range"].astype(np.float64), starts)
    scans = []
    for pose, (low, high), angles, measured in zip(
        columns[f"{kind}_pose"], columns[f"{kind}_rlim"], azimuths, ranges, strict=True
    ):
        valid = np.where((measured <= low) | (measured >= high), np.inf, measured)
        scans.append(LaserScan(as_pose(pose), angles, valid, range_max=float(high)))
    if f"{kind}_poly_n" not in columns:
        return ScanSet(kind, scans, None)
    corners = np.cumsum(columns[f"{kind}_poly_n"])[:-1]
    return ScanSet(kind, scans, np.split(columns[f"{kind}_poly_xy"], corners))


def score_vertices(sets: Sequence[ScanSet], vertices: Sequence[int]) -> Iterator[Row]:
    """Score the lines of single scans of each kind, at each number of vertices; means over scans.

    The error of the ranges is that of the beams that meet a line; ``explained`` is the share of the
    returns whose beams do; the area that is wrong is given by the true one, where that is known.
    """
    for kind, scans, polygons in sets:
        around: Sequence[Float | None] = polygons or [None] * len(scans)
        for most in vertices:
            scores = [_score_scan(s, most, p) for s, p in zip(scans, around, strict=True)]
            used, errors, shares, areas = zip(*scores, strict=True)
            yield {
                "kind": kind,
                "scans": len(scores),
                "vertices": most,
                "most_used": max(used),
                "ray_rmse_m": float(np.nanmean(errors)),
                "explained": float(np.mean(shares)),
                "area_error": None if polygons is None else float(np.mean(areas)),
            }


def _score_scan(
    scan: LaserScan, most: int, polygon: Float | None
) -> tuple[int, float, float, float]:
    """Vertices used, error of the ranges [m], share of beams that meet a line, and wrong area."""
    polylines = fit_vertices(scan, most, gap=GAP if polygon is None else np.inf)
    if not polylines:
        raise InputError(f"a scan gave no line at {most} vertices; it needs at least 2 returns")
    used = sum(len(line) - _closed(line) for line in polylines)
    missed = scan.ranges[scan.hits] - _predicted(scan, polylines)[scan.hits]
    met = np.isfinite(missed)
    error = float(np.sqrt(np.mean(missed[met] ** 2))) if met.any() else np.nan
    area = np.nan if polygon is None else _wrong_area(polylines[0], polygon)
    return used, error, float(met.mean()), area


def _predicted(scan: LaserScan, polylines: Sequence[Float]) -> Float:
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
