"""The robot: how it moves and where it drives (section 2.1 of Teslić et al.)."""

from lrf3d.robot.trajectory import Trajectory

__all__ = ["Trajectory"]
