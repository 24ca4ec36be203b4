"""The laser range finder, its scans and its noise (section 2.3 of Teslić et al.)."""

from lrf3d.laser.noise import Noise, ProportionalNoise
from lrf3d.laser.range_finder import LaserRangeFinder, beam_directions, layer_directions
from lrf3d.laser.scan import LaserScan, reflection_points

__all__ = [
    "LaserRangeFinder",
    "LaserScan",
    "Noise",
    "ProportionalNoise",
    "beam_directions",
    "layer_directions",
    "reflection_points",
]
