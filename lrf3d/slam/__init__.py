"""SLAM: poses and map from scans and odometry alone; `lrf3d.slam_log` runs it over a log."""

from lrf3d.slam.simulated import SlamMapper
from lrf3d.slam.slam import Slam

__all__ = ["Slam", "SlamMapper"]
