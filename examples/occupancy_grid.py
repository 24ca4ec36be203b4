"""A mapper of your own: an occupancy grid, scored and timed beside the line segments of lrf3d.

    lrf3d run city --mapper examples/occupancy_grid.py:OccupancyGrid
    python examples/occupancy_grid.py city

A mapper is anything with ``update(scan)``. Where it has ``report(run, folder)``, `lrf3d run` puts
what that returns into the summary, and it may write files into the folder.
"""

import sys
from time import perf_counter

import numpy as np
from PIL import Image
from scipy.spatial import cKDTree

import lrf3d

CELL = 0.1
"""Side of a cell [m]."""

BLOCK = 256
"""The grid is kept in square blocks with this number of cells a side, made as needed."""

FREE, TAKEN = -0.4, 1.2
"""What a beam that passed a cell, or ended in it, adds to the logarithm of its odds."""

MOST = 6.0
"""How sure a cell gets at most, so that it can still change its mind."""

FARTHEST = 30.0
"""How far beams are used [m]: beyond, a degree is wider than five cells."""


class OccupancyGrid:
    """Cells with the odds that something stands in them."""

    def __init__(self):
        self.blocks = {}

    def update(self, scan):
        """Lower the odds of the cells that beams passed, and raise those in which they ended."""
        reach = np.where(np.isfinite(scan.ranges), scan.ranges, scan.range_max)
        reach = np.where(scan.ranges == -np.inf, 0.0, reach)
        hits = scan.hits & (reach < FARTHEST)
        directions = lrf3d.laser.beam_directions(scan.pose.theta, scan.angles)
        origin = np.array(scan.pose[:2])
        # A point every cell along each beam, up to half a cell before its end.
        steps = np.arange(0.0, min(reach.max(), FARTHEST), CELL)
        beam, step = np.nonzero(steps[None, :] < np.minimum(reach, FARTHEST)[:, None] - CELL)
        passed = origin + steps[step, None] * directions[beam]
        ended = origin + reach[hits, None] * directions[hits]
        taken = np.unique(np.floor(ended / CELL).astype(np.int64), axis=0)
        self._add(np.floor(passed / CELL).astype(np.int64), FREE)
        self._add(taken, TAKEN - FREE)

    def _add(self, cells, odds):
        """Add to the odds of cells (n, 2), to each once."""
        blocks, places = np.divmod(cells, BLOCK)
        keys = blocks[:, 0] * 2**20 + blocks[:, 1]
        for key in np.unique(keys):
            mine = keys == key
            grid = self.blocks.setdefault(int(key), np.zeros((BLOCK, BLOCK), np.float32))
            touched = np.zeros((BLOCK, BLOCK), np.bool_)
            touched[places[mine, 0], places[mine, 1]] = True
            grid[touched] = np.clip(grid[touched] + odds, -MOST, MOST)

    def cells(self, taken=True):
        """Middles (n, 2) of the cells that are taken, or free [m]."""
        found = [np.empty((0, 2))]
        for key, grid in self.blocks.items():
            row = (key + 2**19) // 2**20
            block = np.array([row, key - row * 2**20])
            cells = np.argwhere(grid > 0.0 if taken else grid < 0.0)
            found.append((block * BLOCK + cells + 0.5) * CELL)
        return np.concatenate(found)

    def report(self, run, folder):
        """Write the grid as a picture, and score it."""
        taken, free = self.cells(), self.cells(taken=False)
        low = np.floor(np.concatenate([taken, free]).min(axis=0) / CELL)
        shade = np.full((np.ptp(np.concatenate([taken, free]), axis=0) / CELL + 2).astype(int), 205)
        for places, tone in ((free, 254), (taken, 0)):
            x, y = (np.floor(places / CELL) - low).astype(int).T
            shade[x, y] = tone
        Image.fromarray(np.flipud(shade.T).astype(np.uint8)).save(folder / "grid.png")
        return {"cells": len(taken) + len(free), **score(taken, run)}


def score(points, run):
    """How much of a map, as points (n, 2), is right, and how much of what was seen is in it."""
    starts, ends = run.world.segments[:, :2], run.world.segments[:, 2:]
    walls = along(np.hstack([starts, ends]), 0.02)
    seen = np.concatenate([run.true_scan(k).points() for k in range(0, len(run), 5)])
    if not len(points):
        return {"precision": 1.0, "recall": 0.0}
    right = cKDTree(walls).query(points)[0] < 0.15
    found = cKDTree(points).query(seen)[0] < 0.15
    return {"precision": float(right.mean()), "recall": float(found.mean())}


def along(segments, step):
    """Points (n, 2) along segments (m, 4), so far apart [m]."""
    counts = np.ceil(np.hypot(*(segments[:, 2:] - segments[:, :2]).T) / step).astype(int) + 1
    return np.concatenate(
        [
            np.linspace(segment[:2], segment[2:], count)
            for segment, count in zip(segments, counts, strict=True)
        ]
    )


def main(world):
    """Map a world with both mappers, and print what each took and how good it is."""
    scenario = lrf3d.load_scenario(world)
    drive = scenario.poses
    if drive is None:
        drive = lrf3d.follow_route(scenario.route, speed=scenario.speed, dt=scenario.scan_interval)
    noise = lrf3d.ProportionalNoise(scenario.sigmas[0])
    print(f"{'mapper':<16}{'ms a scan':>10}{'numbers':>10}{'precision':>11}{'recall':>8}")
    for mapper in (OccupancyGrid(), lrf3d.LineMapper(sigma=scenario.sigmas[0])):
        run = lrf3d.simulate(scenario.world, drive, scenario.lrf, noise=noise, rng=0)
        # What is compiled at the first scan is no part of what a scan takes.
        mapper.update(run.scan(0))
        begin = perf_counter()
        for scan in run.scans:
            mapper.update(scan)
        spent = 1e3 * (perf_counter() - begin) / len(run)
        if isinstance(mapper, OccupancyGrid):
            points, numbers = mapper.cells(), len(mapper.blocks) * BLOCK**2
        else:
            points, numbers = along(mapper.map.segments, CELL), 4 * len(mapper.map)
        scores = score(points, run)
        shares = f"{scores['precision']:>11.3f}{scores['recall']:>8.3f}"
        print(f"{type(mapper).__name__:<16}{spent:>10.2f}{numbers:>10,}{shares}")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "city")
