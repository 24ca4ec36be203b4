"""How much of the glass of a world does the default mapper find and mark, and does it map images?

A share of the walls of a world is made glass, and seen from random poses. Of the glass that
returned light directly, the length between its outermost returns, the share that is found is
measured, and which share of what is marked is glass. Images are map segments that lie by returns
which came by way of a mirror or a pane, and by no wall: a wall that is there is no image, however
askew it is drawn.
"""

import numpy as np

from benchmarks.report import Row
from benchmarks.score import random_poses
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import Bool, Float, directions, lengths
from lrf3d.laser import LaserRangeFinder, ProportionalNoise, reflection_points
from lrf3d.scoring import visible_walls
from lrf3d.simulation.recorder import simulate
from lrf3d.simulation.run import Run
from lrf3d.world import World

STEP, NEAR, ASKEW = 0.05, 0.1, np.cos(np.radians(5.0))
"""Distance of samples [m]; how far off [m] and how much askew [cosine] they may lie."""

DIRECT = 1e-3
"""Farthest off its wall [m] that the place of a direct return may be."""


def with_glass(world: World, share: float, rng: np.random.Generator) -> tuple[World, Bool]:
    """A world of brick with a share of the length of its walls of glass, and which walls are."""
    size = lengths(world.segments)
    order = rng.permutation(len(size))
    count = int(np.searchsorted(np.cumsum(size[order]), share * size.sum()))
    glass = np.zeros(len(size), np.bool_)
    glass[order[:count]] = True
    materials = ["glass" if one else "brick" for one in glass]
    return World(world.segments, range(len(size)), world.heights, materials=materials), glass


def samples(segments: Float, others: Float, *, cosine: float = ASKEW) -> tuple[Float, Float]:
    """The length of each of segments (m, 4) [m], and the share of it that lies by others (n, 4).

    Others count that are no more askew than the cosine says.
    """
    size, along = lengths(segments), directions(segments)
    shares = np.zeros(len(segments))
    if not len(others):
        return size, shares
    ways, reach = directions(others), lengths(others)
    for row, (own, unit) in enumerate(zip(segments, along, strict=True)):
        count = max(int(size[row] / STEP), 1)
        points = own[:2] + ((np.arange(count) + 0.5) * size[row] / count)[:, None] * unit
        parallel = np.abs(ways @ unit) >= cosine
        offset = points[:, None] - others[None, parallel, :2]
        station = np.einsum("nmk,mk->nm", offset, ways[parallel]).clip(0.0, reach[parallel])
        rest = offset - station[..., None] * ways[parallel]
        shares[row] = (np.hypot(rest[..., 0], rest[..., 1]) < NEAR).any(axis=1).mean()
    return size, shares


def image_points(run: Run) -> Float:
    """Places (n, 2) [m] of the noise-free returns that came by way of a mirror or a pane."""
    found = []
    for index in range(len(run)):
        scan = run.true_scan(index)
        hits = scan.hits & (scan.walls >= 0)
        points = reflection_points(scan.pose, scan.angles[hits], scan.ranges[hits])
        walls = run.world.segments[scan.walls[hits]]
        unit, offset = directions(walls), points - walls[:, :2]
        along = np.einsum("ij,ij->i", offset, unit)
        away = np.abs(unit[:, 0] * offset[:, 1] - unit[:, 1] * offset[:, 0]) > DIRECT
        found.append(points[away | (along < -DIRECT) | (along > lengths(walls) + DIRECT)])
    return np.concatenate(found)


def images(run: Run) -> int:
    """How many map segments are images."""
    _, shares = samples(run.map.segments, run.world.segments, cosine=0.0)
    points, count = image_points(run), 0
    for x1, y1, x2, y2 in run.map.segments[shares < 0.5]:
        share = np.linspace(0.0, 1.0, 21)[:, None]
        places = np.array([x1, y1]) + share * np.array([x2 - x1, y2 - y1])
        apart = np.hypot(*(points[:, None] - places[None]).transpose(2, 0, 1))
        count += len(points) > 0 and bool((apart.min(axis=0) < 0.3).mean() > 0.5)
    return count


def found_glass(world: World, seed: int, lrf: LaserRangeFinder, poses: int, share: float) -> Row:
    """The glass that is seen and marked in a map of a world, and the images in it."""
    lit, glass = with_glass(world, share, np.random.default_rng(1000 + seed))
    places = random_poses(world, poses, np.random.default_rng(seed))
    noise = ProportionalNoise(0.04)
    run = simulate(lit, places, lrf, caster=PlanarCaster(lit), noise=noise, rng=seed, snapshots=1)
    parts, walls = visible_walls(run)
    marked = run.map.segments[run.map.kinds == "glass"]
    size, found = samples(parts[glass[walls]], marked)
    length, right = samples(marked, lit.segments[glass])
    return {
        "seed": seed,
        "seen": size.sum(),
        "found_share": float(size @ found / max(size.sum(), STEP)),
        "marked": length.sum(),
        "right_share": float(length @ right / max(length.sum(), STEP)),
        "images": images(run),
        "segments": len(run.map),
    }
