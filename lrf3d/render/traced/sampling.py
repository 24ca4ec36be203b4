"""Edges, compiled: where they are, and what the samples of their pixels see."""

import math

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float
from lrf3d.render.traced.shading import COLOUR, NORMAL, OFFSET, RayScene, as_byte, see

SAMPLE_PLACES = np.array([[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]])
"""Where in a pixel its four samples lie, as graphics cards have it."""

MIDDLE = np.array([[0.5, 0.5]])


@inner
def one_surface(first: int, second: int, faces: Float) -> bool:
    """Whether two things seen go on into each other without an edge."""
    if first == second:
        return True
    if first < 0 or second < 0:
        return False
    a, b = faces[first], faces[second]
    along = a[NORMAL] * b[NORMAL] + a[NORMAL + 1] * b[NORMAL + 1] + a[NORMAL + 2] * b[NORMAL + 2]
    level = abs(a[OFFSET] - math.copysign(1.0, along) * b[OFFSET]) < 1e-3
    same = a[COLOUR] == b[COLOUR] and a[COLOUR + 1] == b[COLOUR + 1]
    return bool(same and level and abs(along) > 0.999999)


@compiled
def find_edges(seen: NDArray[np.int32], faces: Float) -> NDArray[np.int32]:
    """Numbers (n,) of the pixels at which something else begins."""
    height, width = seen.shape
    found = np.empty(height * width, np.int32)
    count = 0
    for row in range(height):
        for column in range(width):
            here = seen[row, column]
            inside = (
                one_surface(here, seen[row, max(column - 1, 0)], faces)
                and one_surface(here, seen[row, min(column + 1, width - 1)], faces)
                and one_surface(here, seen[max(row - 1, 0), column], faces)
                and one_surface(here, seen[min(row + 1, height - 1), column], faces)
            )
            if not inside:
                found[count] = row * width + column
                count += 1
    return found[:count]


@compiled
def aim_samples(
    camera: Float,
    pixels: NDArray[np.int32],
    width: int,
    places: Float,
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
) -> None:
    """Fill the rays (n s, 3) through the samples of pixels (n,)."""
    for k in range(len(pixels)):
        row, column = pixels[k] // width, pixels[k] % width
        for sample in range(len(places)):
            x, y = column + places[sample, 0], row + places[sample, 1]
            ray = k * len(places) + sample
            for axis in range(3):
                origins[ray, axis] = camera[axis]
                directions[ray, axis] = (
                    camera[3 + axis] + x * camera[6 + axis] + y * camera[9 + axis]
                )


@compiled
def shade_samples(
    camera: Float,
    pixels: NDArray[np.int32],
    places: Float,
    hits: NDArray[np.int32],
    scenery: RayScene,
    colours: NDArray[np.uint8],
    near: NDArray[np.float32],
) -> None:
    """Shade every sample of pixels (n,) by itself."""
    width = colours.shape[1]
    for k in range(len(pixels)):
        row, column = pixels[k] // width, pixels[k] % width
        for sample in range(len(places)):
            r, g, b, inverse, _ = see(
                column + places[sample, 0],
                row + places[sample, 1],
                hits[k * len(places) + sample],
                camera,
                scenery,
            )
            colours[row, column, sample, 0] = as_byte(r)
            colours[row, column, sample, 1] = as_byte(g)
            colours[row, column, sample, 2] = as_byte(b)
            near[row, column, sample] = inverse


@compiled
def resolve(
    sampled: NDArray[np.uint8],
    sampled_near: NDArray[np.float32],
    flat: NDArray[np.uint8],
    flat_near: NDArray[np.float32],
) -> None:
    """Fill one sample a pixel (h, w, 1, 3) with the mean of several, with the first's depth."""
    height, width, samples = sampled_near.shape
    for row in range(height):
        for column in range(width):
            flat_near[row, column, 0] = sampled_near[row, column, 0]
            for channel in range(3):
                total = 0
                for sample in range(samples):
                    total += sampled[row, column, sample, channel]
                flat[row, column, 0, channel] = (total + samples // 2) // samples
