"""Localisation: an extended Kalman filter that follows the robot over a known map of lines."""

from lrf3d.slam.places.localiser import (
    Localiser,
    OdometryNoise,
    PoseEstimate,
    Track,
    localise,
    odometry_increments,
)
from lrf3d.slam.places.pairing import KnownLines

__all__ = [
    "KnownLines",
    "Localiser",
    "OdometryNoise",
    "PoseEstimate",
    "Track",
    "localise",
    "odometry_increments",
]
