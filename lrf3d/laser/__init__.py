"""The laser range finder, its scans and its noise (section 2.3 of Teslić et al.)."""

from lrf3d.laser.depth_camera import DepthCamera, DepthImage
from lrf3d.laser.imperfections import AngleNoise, DropOuts, MixedPixels, imperfect
from lrf3d.laser.lidar import Lidar, LidarScan
from lrf3d.laser.noise import (
    Chain,
    ConstantNoise,
    Limits,
    Noise,
    ProportionalNoise,
    Quantised,
    RangeNoise,
    with_ranges,
)
from lrf3d.laser.range_finder import LaserRangeFinder, beam_directions, layer_directions
from lrf3d.laser.ros_scan import Stamp
from lrf3d.laser.scan import LaserScan, doubtful_ranges, doubtful_unit, reflection_points

__all__ = [
    "AngleNoise",
    "Chain",
    "ConstantNoise",
    "DepthCamera",
    "DepthImage",
    "DropOuts",
    "LaserRangeFinder",
    "LaserScan",
    "Lidar",
    "LidarScan",
    "Limits",
    "MixedPixels",
    "Noise",
    "ProportionalNoise",
    "Quantised",
    "RangeNoise",
    "Stamp",
    "beam_directions",
    "doubtful_ranges",
    "doubtful_unit",
    "imperfect",
    "layer_directions",
    "reflection_points",
    "with_ranges",
]
