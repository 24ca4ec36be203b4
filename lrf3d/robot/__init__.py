"""The robot: how it moves and where it drives (section 2.1 of Teslić et al.)."""

from lrf3d.robot.attitude import Attitude
from lrf3d.robot.estimated_trajectory import EstimatedTrajectory
from lrf3d.robot.following import follow_route
from lrf3d.robot.kinematics import AckermannDrive, DifferentialDrive, OmniDrive, Unicycle, drive
from lrf3d.robot.odometry import Imu, WheelOdometry
from lrf3d.robot.trajectory import Trajectory

__all__ = [
    "AckermannDrive",
    "Attitude",
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
