"""Localisation: an extended Kalman filter that follows the robot over a known map of lines."""

from lrf3d.laser import RangeNoise
from lrf3d.localization.estimate import PoseEstimate
from lrf3d.localization.lines import KnownLines, LocalLines
from lrf3d.localization.localiser import (
    Localiser,
    OdometryNoise,
    Track,
    localise,
    odometry_increments,
)

__all__ = [
    "KnownLines",
    "LocalLines",
    "Localiser",
    "OdometryNoise",
    "PoseEstimate",
    "RangeNoise",
    "Track",
    "localise",
    "odometry_increments",
]
