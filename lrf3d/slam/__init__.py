"""SLAM: poses and map from scans and odometry alone; `lrf3d.slam_log` runs it over a log."""

from lrf3d.slam.log import LogSolution, run_of, solve_log
from lrf3d.slam.simulated import SlamMapper, WheelErrors
from lrf3d.slam.slam import Slam

__all__ = ["LogSolution", "Slam", "SlamMapper", "WheelErrors", "run_of", "solve_log"]
