"""Vertex choice: the best beams for the vertices of polylines, by dynamic programming, compiled."""

import numpy as np
from numba import njit

from lrf3d.geometry import Bool, Float, Int

UNEXPLAINED = 0.4
"""Range error [m] that a beam is charged with which no polyline explains: theirs is 0.5, and
less gives fewer beams up to lines that explain them badly."""


@njit(cache=True, nogil=True)
def best_vertices(
    angles: Float, ranges: Float, joined: Bool, radii: Float, vertices: int, start: int
) -> tuple[float, Int, Int, Bool]:  # pragma: no cover
    """The best vertices; with a start ≥ 0, one closed polyline that begins and ends at it.

    Edges are charged with r⁴·(1/r − 1/r̂)², which is (r − r̂)² for small errors and adds up by
    running sums. ``cost[i, k, v]`` is the least charge of v vertices, the last at beam i.
    """
    count, offsets = radii.shape
    sums = np.zeros((count + 1, 6))
    for i in range(count):
        cos, sin = np.cos(angles[i]), np.sin(angles[i])
        inverse, weight = 1.0 / ranges[i], ranges[i] ** 4
        terms = (cos * cos, cos * sin, sin * sin, cos * inverse, sin * inverse, inverse * inverse)
        for k in range(6):
            sums[i + 1, k] = sums[i, k] + weight * terms[k]
    cost = np.full((count, offsets, vertices + 1), np.inf)
    origin = np.full((count, offsets, vertices + 1), -1)
    free = np.full((count + 1, vertices + 1), np.inf)
    left = np.full((count + 1, vertices + 1), -2)
    free[0, 0] = 0.0
    alone = UNEXPLAINED**2
    for j in range(count):
        for k in range(offsets):
            off = (radii[j, k] - ranges[j]) ** 2
            if start < 0:
                for v in range(vertices):
                    cost[j, k, v + 1] = free[j, v] + off
            elif j == 0 and k == start:
                cost[j, k, 1] = off
            bx, by = radii[j, k] * np.cos(angles[j]), radii[j, k] * np.sin(angles[j])
            i = j - 1
            while i >= 0 and joined[i] and angles[j] - angles[i] < 0.95 * np.pi:
                for m in range(offsets):
                    ax, ay = radii[i, m] * np.cos(angles[i]), radii[i, m] * np.sin(angles[i])
                    area = ax * by - ay * bx
                    if area <= 0.0:
                        continue
                    nx, ny = (by - ay) / area, (ax - bx) / area
                    charge = (
                        nx * nx * (sums[j + 1, 0] - sums[i + 1, 0])
                        + 2.0 * nx * ny * (sums[j + 1, 1] - sums[i + 1, 1])
                        + ny * ny * (sums[j + 1, 2] - sums[i + 1, 2])
                        - 2.0 * nx * (sums[j + 1, 3] - sums[i + 1, 3])
                        - 2.0 * ny * (sums[j + 1, 4] - sums[i + 1, 4])
                        + sums[j + 1, 5]
                        - sums[i + 1, 5]
                    )
                    charge = max(charge, 0.0)
                    for v in range(1, vertices):
                        if cost[i, m, v] + charge < cost[j, k, v + 1]:
                            cost[j, k, v + 1] = cost[i, m, v] + charge
                            origin[j, k, v + 1] = i * offsets + m
                i -= 1
        for v in range(vertices + 1):
            free[j + 1, v] = free[j, v] + alone
            left[j + 1, v] = -1
            for k in range(offsets):
                if origin[j, k, v] >= 0 and cost[j, k, v] < free[j + 1, v]:
                    free[j + 1, v] = cost[j, k, v]
                    left[j + 1, v] = k
    beams = np.empty(vertices + 1, np.int64)
    place = np.empty(vertices + 1, np.int64)
    starts = np.zeros(vertices + 1, np.bool_)
    found = 0
    v = 0
    if start < 0:
        v = int(np.argmin(free[count]))
        least = free[count, v]
        i, k = count, -1
        while i > 0:
            k = left[i, v]
            if k < 0:
                i -= 1
                continue
            i -= 1
            while True:
                beams[found], place[found] = i, k
                found += 1
                before = origin[i, k, v]
                v -= 1
                if before < 0:
                    starts[found - 1] = True
                    break
                i, k = before // offsets, before % offsets
    else:
        v = int(np.argmin(cost[count - 1, start]))
        least = cost[count - 1, start, v]
        i, k = count - 1, start
        while True:
            beams[found], place[found] = i, k
            found += 1
            before = origin[i, k, v]
            v -= 1
            if before < 0:
                starts[found - 1] = True
                break
            i, k = before // offsets, before % offsets
    order = np.arange(found - 1, -1, -1)
    return least, beams[order], place[order], starts[order]
