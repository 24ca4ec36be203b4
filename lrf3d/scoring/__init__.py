"""Scoring: the error of a map against the truth, and the numbers that it takes to store.

Everything is computed in a local frame, so that no digits are lost far from the origin.
"""

from lrf3d.scoring.log_score import LogScore, score_log
from lrf3d.scoring.map_score import MapScore, adjusted_rand_index, score_map, score_run
from lrf3d.scoring.matching import match_segments
from lrf3d.scoring.trajectory_score import Relations, TrajectoryScore, score_trajectory
from lrf3d.scoring.visibility import BuildingCount, buildings_seen, visible_walls

__all__ = [
    "BuildingCount",
    "LogScore",
    "MapScore",
    "Relations",
    "TrajectoryScore",
    "adjusted_rand_index",
    "buildings_seen",
    "match_segments",
    "score_log",
    "score_map",
    "score_run",
    "score_trajectory",
    "visible_walls",
]
