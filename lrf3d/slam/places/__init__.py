"""Localisation on a known map: tracking by an extended Kalman filter, search without a guess."""

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
