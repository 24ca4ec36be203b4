"""Scoring: how far a map or a trajectory is from the truth, or from the scans of a log."""

from lrf3d.scoring.log_score import score_log
from lrf3d.scoring.map_score import (
    adjusted_rand_index,
    buildings_seen,
    score_map,
    score_run,
    seen_share,
    visible_walls,
)
from lrf3d.scoring.matching import match_segments
from lrf3d.scoring.trajectory_score import Relations, score_trajectory

__all__ = [
    "Relations",
    "adjusted_rand_index",
    "buildings_seen",
    "match_segments",
    "score_log",
    "score_map",
    "score_run",
    "score_trajectory",
    "seen_share",
    "visible_walls",
]
