"""BuildingCount: buildings seen on all sides, and those mapped as one object."""

from dataclasses import dataclass

import numpy as np

from lrf3d.run import Run
from lrf3d.scoring.matching import match_segments
from lrf3d.scoring.report import Report
from lrf3d.scoring.visibility import visible_walls
from lrf3d.world.touching import joined_objects


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
    _, union, union_sizes = np.unique(run.map.objects, return_inverse=True, return_counts=True)
    pairs = match_segments(run.map.segments, parts)
    building, union_hit = objects[walls[pairs[:, 1]]], union[pairs[:, 0]]
    # A building is whole if all its walls are matched, and all matches are of one object.
    matched = np.bincount(building, minlength=len(walls_of))
    lowest = np.full(len(walls_of), len(union_sizes))
    highest = np.full(len(walls_of), -1)
    np.minimum.at(lowest, building, union_hit)
    np.maximum.at(highest, building, union_hit)
    one_union = (matched == walls_of) & (lowest == highest) & (highest >= 0)
    sizes = np.append(union_sizes, 0)[np.where(one_union, highest, len(union_sizes))]
    return BuildingCount(
        buildings=int((walls_of > 0).sum()),
        seen_on_all_sides=int(seen.sum()),
        whole=int((seen & one_union & (sizes == walls_of)).sum()),
    )
