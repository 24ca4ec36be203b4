"""Visibility: the parts of the walls that a run could map, and the buildings seen on all sides."""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Float, Int, directions, lengths
from lrf3d.laser import beam_directions
from lrf3d.run import Run
from lrf3d.scoring.matching import match_segments
from lrf3d.scoring.report import Report
from lrf3d.world.pieces import joined_objects

DIRECT = 1e-3
"""Farthest off its wall [m] that the place of a direct return may be."""

LEAST_VISIBLE = 0.5
"""Length [m] above which the visible part of a wall counts."""


def visible_walls(run: Run) -> tuple[Float, Int]:
    """The part of each wall between the outermost noise-free returns of a run.

    Returns:
        (v, 4) the parts longer than 0.5 m, and (v,) their walls, in ascending order.
    """
    segments, angles = run.world.segments, run.lrf.angles
    along, size = directions(segments), lengths(segments)
    low, high = np.full(len(segments), np.inf), np.full(len(segments), -np.inf)
    for pose, ranges, hit in zip(run.trajectory.poses, run.truth, run.walls, strict=True):
        returned = (hit >= 0) & np.isfinite(ranges)
        wall = hit[returned]
        # Relative to the end of the wall, so that no digits are lost far from the origin.
        reach = ranges[returned, None] * beam_directions(pose[2], angles[returned])
        offset, unit = pose[:2] - segments[wall, :2] + reach, along[wall]
        # What came by way of a mirror shows an image of the wall, elsewhere.
        station = np.einsum("ij,ij->i", offset, unit)
        direct = np.abs(offset[:, 0] * unit[:, 1] - offset[:, 1] * unit[:, 0]) < DIRECT
        direct &= (station > -DIRECT) & (station < size[wall] + DIRECT)
        wall, station = wall[direct], station[direct]
        np.minimum.at(low, wall, station)
        np.maximum.at(high, wall, station)
    visible = np.flatnonzero(high - low > LEAST_VISIBLE)
    start, unit = segments[visible, :2], along[visible]
    first = start + low[visible, None] * unit
    return np.hstack([first, start + high[visible, None] * unit]), visible


@dataclass(frozen=True, slots=True)
class BuildingCount(Report):
    """Buildings of a run.

    Args:
        buildings: Objects of the world, where those that touch count as one.
        seen_on_all_sides: Those of which every wall has a visible part.
        whole: Those of the latter that are one object of the map with exactly one segment for
            each wall of the building ("each building is represented with four
            line segments", section 4 of Teslić et al.).
    """

    buildings: int
    seen_on_all_sides: int
    whole: int


def buildings_seen(run: Run) -> BuildingCount:
    """Count the buildings of a run that were seen on all sides, and those mapped whole."""
    objects = joined_objects(run.world)
    walls_of = np.bincount(objects)
    parts, walls = visible_walls(run)
    seen = (np.bincount(objects[walls], minlength=len(walls_of)) == walls_of) & (walls_of > 0)
    _, object_of, sizes = np.unique(run.map.objects, return_inverse=True, return_counts=True)
    pairs = match_segments(run.map.segments, parts)
    building, map_object = objects[walls[pairs[:, 1]]], object_of[pairs[:, 0]]
    whole = 0
    for number in np.flatnonzero(seen):
        found = map_object[building == number]
        one = len(found) == walls_of[number] and bool((found == found[0]).all())
        whole += one and sizes[found[0]] == walls_of[number]
    return BuildingCount(
        buildings=int((walls_of > 0).sum()),
        seen_on_all_sides=int(seen.sum()),
        whole=int(whole),
    )
