"""Scoring: how near a map comes to the truth, and what it costs to store.

Everything is computed in a local frame, so that worlds far from the origin lose no digits.
"""

from lrf3d.scoring.buildings import BuildingCount, buildings_seen
from lrf3d.scoring.log_score import LogScore, score_log
from lrf3d.scoring.map_score import MapScore, adjusted_rand_index, score_map, score_run
from lrf3d.scoring.matching import match_segments
from lrf3d.scoring.storage import StorageCount, storage
from lrf3d.scoring.trajectory_score import Relations, TrajectoryScore, score_trajectory
from lrf3d.scoring.visibility import visible_parts, visible_walls

__all__ = [
    "BuildingCount",
    "LogScore",
    "MapScore",
    "Relations",
    "StorageCount",
    "TrajectoryScore",
    "adjusted_rand_index",
    "buildings_seen",
    "match_segments",
    "score_log",
    "score_map",
    "score_run",
    "score_trajectory",
    "storage",
    "visible_parts",
    "visible_walls",
]
