"""Lidars of many robots, compiled: the fans of all poses one after the other, and their noise."""

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.layers import read_layers
from lrf3d.casting.kernels.raising import raise_fan
from lrf3d.casting.kernels.tree import Plain
from lrf3d.compiling import compiled
from lrf3d.geometry.lines import Float, Int

# Odd multipliers of the hash of counters (splitmix64, Steele et al. 2014).
STRIDE = np.uint64(0x9E3779B97F4A7C15)
MIX_FIRST = np.uint64(0xBF58476D1CE4E5B9)
MIX_LAST = np.uint64(0x94D049BB133111EB)

# The 64 bits of a hash choose the quantiles of four beams.
BITS = np.uint64(16)
CHOICES = np.uint64(0xFFFF)


@compiled
def cast_fans(
    plain: Plain, sensor: Plain, poses: Float, directions: Float, skies: Plain, ranges: Float,
    hits: NDArray[np.int32],
) -> int:  # fmt: skip
    """Fill ranges (k, azimuths, layers) from poses (k, 3), and the hits of the last pose.

    The sensor is its beams as of `raise_fan`, its eye and its layers. Returns the number of poses
    for which the skylines had room.
    """
    beams, eye, layers = sensor
    for k in range(len(poses)):
        if not raise_fan(plain, beams, poses[k], directions, eye, skies):
            return k
        read_layers(poses[k : k + 1], directions, eye[0], layers, skies, ranges[k], hits)
    return len(poses)


@compiled
def scatter_ranges(
    ranges: Float, numbers: Int, sensor: Plain, key: np.uint64, quantiles: NDArray[np.float32],
    seen: NDArray[np.float32],
) -> None:  # fmt: skip
    """Fill rows of seen (n, layers, columns) from true ranges (k, columns · layers), with noise.

    The sensor is its least and largest range, which stand for too near and no return, and the
    constant and the growing part of the standard deviation of its ranges. The quantiles (65536,)
    are those of the normal distribution; the key and the place of a beam choose one, so that the
    noise of a beam depends on no other.
    """
    near, far, floor, growth = sensor
    _, layers, columns = seen.shape
    beams = columns * layers
    drawn = (layers + 3) // 4
    # The last column may choose up to three quantiles that no beam needs.
    chosen = np.empty(beams + 3, np.float32)
    noisy = np.empty(beams, np.float32)
    # One short loop after the other: what a loop stores is in memory when the next one loads it.
    for k in range(len(numbers)):
        out = seen[numbers[k]]
        counter = np.uint64(numbers[k] * columns * drawn)
        for i in range(columns):
            for first in range(i * layers, (i + 1) * layers, 4):
                counter += np.uint64(1)
                mixed = key + STRIDE * counter
                mixed = (mixed ^ (mixed >> np.uint64(30))) * MIX_FIRST
                mixed = (mixed ^ (mixed >> np.uint64(27))) * MIX_LAST
                mixed ^= mixed >> np.uint64(31)
                for part in range(4):
                    # Those beyond the last layer are replaced by those of the next column.
                    chosen[first + part] = quantiles[mixed & CHOICES]
                    mixed >>= BITS
        # Without branches.
        for j in range(beams):
            found = ranges[k, j]
            spread = np.sqrt(floor * floor + growth * growth * found * found)
            moved = found + spread * chosen[j]
            found = moved if abs(found) < np.inf else found
            noisy[j] = 0.0 if found < near else min(found, far)
        for r in range(layers):
            for i in range(columns):
                out[r, i] = noisy[i * layers + r]
