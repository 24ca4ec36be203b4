"""The numbers that a map takes as unions, as polylines and as an occupancy grid.

Section 4 of Teslić et al. compares them; union is the paper's word for an object of the map.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float, Int
from lrf3d.mapping import LineMap
from lrf3d.scoring.matching import sample_counts, sample_offsets
from lrf3d.simulation.run import Run

GRID_CELL = 0.1
"""Size of a cell of the occupancy grid [m]."""

COVERED = 0.9
"""A polyline is redundant if this share of its length lies along others."""

TOLERANCE = 0.1
"""How far apart two views of one wall may lie [m], in addition to the noise."""

ALONGSIDE = np.deg2rad(30.0)
"""Largest angle between two views of one wall [rad]: short noisy segments vary in direction."""


class Storage(NamedTuple):
    """The numbers that it takes to store the map of a run.

    Unions take four for each segment and a label, polylines two for each vertex; the grid has cells
    of 0.1 m over all reflection points and poses.
    """

    union_numbers: int
    polyline_numbers: int
    grid_cells: int


def storage(run: Run, local_maps: Sequence[LineMap]) -> Storage:
    """Count the numbers of the map of a run, from the local map of each of its scans.

    A polyline is a chain of consecutive segments of one scan; views from different
    sides are not joined (reference [5] of Teslić et al.). A polyline is kept unless nine tenths
    of its length lie along those kept already; those that it makes redundant likewise are removed.
    """
    polylines = [local_polylines(local) for local in local_maps]
    held = held_polylines(polylines, TOLERANCE + _noise(run))
    return Storage(5 * len(run.map), 2 * sum(map(len, held)), _grid_cells(run))


def local_polylines(local: LineMap) -> list[Float]:
    """Vertices (k, 2) of each polyline of the map of one scan.

    The vertex of two consecutive segments lies midway between their ends.
    """
    polylines = []
    for number in np.unique(local.objects):
        segments = local.segments[local.objects == number]
        middle = 0.5 * (segments[:-1, 2:] + segments[1:, :2])
        polylines.append(np.concatenate([segments[:1, :2], middle, segments[-1:, 2:]]))
    return polylines


def held_polylines(polylines: Sequence[Sequence[Float]], tolerance: float) -> list[Float]:
    """The polylines, arrays (k, 2), that a mapper holds after all scans; tolerance in metres."""
    held: list[Float] = []
    for scan in polylines:
        views = [np.asarray(view, dtype=np.float64) for view in scan if len(view) > 1]
        fresh = _uncovered(views, held, tolerance)
        held = _uncovered(held, fresh, tolerance) + fresh
    return held


def _uncovered(polylines: list[Float], others: list[Float], tolerance: float) -> list[Float]:
    """The polylines of which less than nine tenths lie along the others."""
    if not polylines or not others:
        return polylines
    segments, owner = _segments(polylines)
    walls, _ = _segments(others)
    along = np.isfinite(sample_offsets(segments, walls, reach=tolerance, angle=ALONGSIDE))
    sample_owner = np.repeat(owner, sample_counts(segments))
    samples = np.bincount(sample_owner, minlength=len(polylines))
    covered = np.bincount(sample_owner, weights=along, minlength=len(polylines))
    keep = covered < COVERED * np.maximum(samples, 1)
    return [polyline for polyline, kept in zip(polylines, keep, strict=True) if kept]


def _segments(polylines: list[Float]) -> tuple[Float, Int]:
    """All lines (n, 4) of polylines, and which polyline (n,) each belongs to."""
    lines = [np.hstack([polyline[:-1], polyline[1:]]) for polyline in polylines]
    owner = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    return np.vstack(lines), owner


def _noise(run: Run) -> float:
    """Root mean square noise of the ranges of a run [m]."""
    returned = np.isfinite(run.truth) & np.isfinite(run.ranges)
    noise = run.ranges[returned] - run.truth[returned]
    return float(np.sqrt(np.mean(noise**2))) if len(noise) else 0.0


def _grid_cells(run: Run) -> int:
    """Cells of a grid over the box around all reflection points and poses."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for points in (run.trajectory.poses[:, :2], *(scan.points() for scan in run.scans)):
        low = np.minimum(low, points.min(axis=0, initial=np.inf))
        high = np.maximum(high, points.max(axis=0, initial=-np.inf))
    # The tolerance keeps rounding errors far from the origin from adding a row of cells.
    columns, rows = np.maximum(np.ceil((high - low) / GRID_CELL - 1e-6), 1.0)
    return int(columns) * int(rows)
