"""Lidars of many robots, compiled: the fans of all poses, one after the other."""

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.layers import read_layers
from lrf3d.casting.kernels.raising import raise_fan
from lrf3d.casting.kernels.tree import Plain
from lrf3d.compiling import compiled
from lrf3d.geometry.lines import Float, Records


@compiled
def cast_fans(
    plain: Plain, sensor: Plain, poses: Float, rays: Records, skies: Plain, ranges: Float,
    hits: NDArray[np.int32],
) -> int:  # fmt: skip
    """Fill ranges (k, azimuths, layers) from poses (k, 3), and the hits of the last pose.

    The sensor is its beams as of `raise_fan`, its eye, its layers and its range_max. Returns the
    number of poses for which the skylines had room.
    """
    beams, eye, layers, range_max = sensor
    for k in range(len(poses)):
        if not raise_fan(plain, beams, poses[k], rays, eye, skies):
            return k
        read_layers(rays, eye[0], layers, range_max, skies, ranges[k], hits)
    return len(poses)
