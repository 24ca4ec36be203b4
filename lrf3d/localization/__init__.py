"""Localisation: an extended Kalman filter that follows the robot over a known map of lines."""

from lrf3d.localization.estimate import Correction, PoseEstimate
from lrf3d.localization.localiser import Localiser, localise
from lrf3d.localization.odometry import OdometryNoise, steps_between
from lrf3d.localization.track import Track

__all__ = [
    "Correction",
    "Localiser",
    "OdometryNoise",
    "PoseEstimate",
    "Track",
    "localise",
    "steps_between",
]
