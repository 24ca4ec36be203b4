"""The robot: how it moves and where it drives (section 2.1 of Teslić et al.)."""

from lrf3d.robot.drives import AckermannDrive, DifferentialDrive, OmniDrive
from lrf3d.robot.estimated_trajectory import EstimatedTrajectory
from lrf3d.robot.following import follow_route
from lrf3d.robot.odometry import Imu, WheelOdometry
from lrf3d.robot.trajectory import Trajectory
from lrf3d.robot.unicycle import Unicycle, drive

__all__ = [
    "AckermannDrive",
    "DifferentialDrive",
    "EstimatedTrajectory",
    "Imu",
    "OmniDrive",
    "Trajectory",
    "Unicycle",
    "WheelOdometry",
    "drive",
    "follow_route",
]
