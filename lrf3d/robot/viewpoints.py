"""Visibility in the free space: the pieces of wall that are visible from each patch and heading.

The free space is divided into patches, each with one viewpoint. A tour visits some of these, and a
path shows what is visible from the patches that it passes.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions, lengths
from lrf3d.robot.free_space import FreeSpace
from lrf3d.robot.wall_samples import sample_walls, walls_within
from lrf3d.world import World

PATCHES = 300
"""Approximate number of patches of the free space."""

RAYS = 360
"""Number of rays from each viewpoint, one for each degree."""

HEADINGS = 8
"""Number of headings for which the view of a laser with 180° is stored."""

FARTHEST_VIEW = 40.0
"""Largest distance [m] at which a wall counts as seen: farther away, beams of 1° leave gaps."""

SHALLOWEST = np.sin(np.radians(8.0))
"""Sine of the angle below which a beam grazes a wall and shows little of it."""

FULL_WEIGHT = 2.0
"""Length [m] from which a wall counts in full; niches and steps are not worth a detour."""

MOST_RARITY = 3.0
"""Largest weight of walls of small objects: a shed should be on the map as well as a long block,
but a post is not worth a long detour."""

WALL_PIECES = 6000
"""Approximate number of pieces of all walls."""

SHORTEST_PIECE = 0.25
"""Least length [m] of a piece of wall: about the distance of beams of 1° on a wall 15 m away."""

OPEN = 5.0
"""Clearance [m] above which more room makes no better viewpoint."""

LEAST_GAIN = 0.004
"""Least share of the walls that another viewpoint must add."""


@dataclass(frozen=True)
class Views:
    """The pieces of wall that are visible from the patches of a free space.

    Args:
        patch_of: (cells,) the patch of each cell.
        viewpoints: (patches,) the cell in each patch that represents it.
        seen: (patches, headings, pieces) which pieces are visible with a heading.
        weights: (pieces,) the weight of each piece, about its length [m].
    """

    patch_of: Int
    viewpoints: Int
    seen: Bool
    weights: Float

    def along(self, cells: Float, path: Int) -> Bool:
        """Which pieces (pieces,) are seen along a path of neighbouring cells."""
        step = np.diff(cells[path], axis=0)
        turn = np.arctan2(step[:, 1], step[:, 0]) / (2.0 * np.pi) * HEADINGS
        heading = np.round(turn).astype(int) % HEADINGS
        pairs = np.unique(np.column_stack([self.patch_of[path[1:]], heading]), axis=0)
        return np.asarray(self.seen[pairs[:, 0], pairs[:, 1]].any(axis=0))

    def worth(self, seen: Bool) -> float:
        """Total weight of seen pieces (pieces,)."""
        return float(self.weights[seen].sum())

    def best_patches(self) -> Int:
        """Patches from which nearly all walls are visible, each adding the most to those before."""
        around = np.asarray(self.seen.any(axis=1))
        unseen = np.where(around.any(axis=0), self.weights, 0.0)
        least = LEAST_GAIN * unseen.sum()
        chosen: list[int] = []
        while len(chosen) < len(around):
            gains = around @ unseen
            best = int(np.argmax(gains))
            if gains[best] <= least:
                break
            chosen.append(best)
            unseen[around[best]] = 0.0
        return np.array(chosen, dtype=np.int64)


def look_around(space: FreeSpace, world: World, *, range_max: float) -> Views:
    """Find what is visible from each patch of a free space.

    Args:
        space: The free space.
        world: The walls.
        range_max: Farthest that the laser measures [m].
    """
    patch_of, viewpoints = _patches(space)
    reach = min(range_max, FARTHEST_VIEW)
    low, high = space.cells.min(axis=0) - reach, space.cells.max(axis=0) + reach
    segments, near = walls_within(world.segments - np.tile(world.origin, 2), low, high)
    size = max(SHORTEST_PIECE, float(lengths(segments).sum()) / WALL_PIECES)
    _, weights = sample_walls(segments, size)
    pieces = np.ceil(lengths(segments) / size).astype(int)
    rank = np.minimum(lengths(segments) / FULL_WEIGHT, 1.0) * _rarity(segments, world.objects[near])
    seen = np.array([_seen_from(at, segments, pieces, reach) for at in space.cells[viewpoints]])
    return Views(patch_of, viewpoints, seen, weights * np.repeat(rank, pieces))


def _rarity(segments: Float, objects: Int) -> Float:
    """Weights (n,) of walls by the size of their object: 1 for the average, more for smaller."""
    if not len(segments):
        return np.empty(0)
    sizes = np.bincount(objects, lengths(segments))
    typical = float(sizes.sum()) / max(int((sizes > 0.0).sum()), 1)
    return np.clip(0.5 + 0.5 * typical / sizes[objects], None, MOST_RARITY)


def _patches(space: FreeSpace) -> tuple[Int, Int]:
    """The patch of each cell, and in each patch the cell that lies most openly."""
    size = max(np.sqrt(len(space.cells) / PATCHES), 2.0) * space.size
    scaled = (space.cells - space.cells.min(axis=0)) / size
    patch = np.floor(scaled).astype(np.int64)
    patch_of = np.unique(patch, axis=0, return_inverse=True)[1].reshape(-1)
    off_middle = np.abs(scaled - patch - 0.5).max(axis=1)
    # Among cells with as much room the one nearest to the middle of the patch comes first.
    order = np.lexsort((off_middle, -np.round(np.minimum(space.clearances, OPEN)), patch_of))
    viewpoints = order[np.unique(patch_of[order], return_index=True)[1]]
    return patch_of.astype(np.int64), viewpoints.astype(np.int64)


def _seen_from(viewpoint: Float, segments: Float, pieces: Int, reach: float) -> Bool:
    """Which pieces (headings, pieces) are visible from a viewpoint (2,) with each heading."""
    local = segments - np.tile(viewpoint, 2)
    ends = local.reshape(-1, 2, 2)
    near = np.flatnonzero(((ends.max(axis=1) > -reach) & (ends.min(axis=1) < reach)).all(axis=1))
    marks = np.zeros((HEADINGS, int(pieces.sum()) + 1), dtype=np.int32)
    if len(near):
        wall, share, grazing, distance = _first_hits(local[near])
        seen = (distance <= reach) & (grazing >= SHALLOWEST)
        first = (np.cumsum(pieces) - pieces)[near][wall]
        count = pieces[near][wall]
        piece = first + np.minimum((share * count).astype(int), count - 1)
        # All pieces between two neighbouring rays on one wall are visible. Each such run is marked
        # with +1 where it begins and −1 behind its end, and the sums along a row count the runs.
        following = np.roll(np.arange(RAYS), -1)
        joined = seen & seen[following] & (wall == wall[following])
        other = np.where(joined, piece[following], piece)
        for heading in range(HEADINGS):
            ahead = (np.arange(RAYS) - heading * RAYS // HEADINGS + RAYS // 4) % RAYS <= RAYS // 2
            shown = seen & ahead
            np.add.at(marks[heading], np.minimum(piece, other)[shown], 1)
            np.add.at(marks[heading], np.maximum(piece, other)[shown] + 1, -1)
    return np.asarray(np.cumsum(marks, axis=1)[:, :-1] > 0)


def _first_hits(walls: Float) -> tuple[Int, Float, Float, Float]:
    """For each ray from the origin: first wall, share of its length, sine of the angle, range."""
    angles = 2.0 * np.pi * np.arange(RAYS) / RAYS
    ray = np.column_stack([np.cos(angles), np.sin(angles)])
    start, span = walls[:, :2], walls[:, 2:] - walls[:, :2]
    # A ray d meets a wall where start + share · span = range · d.
    cross = ray[:, :1] * span[:, 1] - ray[:, 1:] * span[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (start[:, 0] * span[:, 1] - start[:, 1] * span[:, 0]) / cross
        share = (start[:, 0] * ray[:, 1:] - start[:, 1] * ray[:, :1]) / cross
        hit = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    distance = np.where(hit, distance, np.inf)
    wall = np.argmin(distance, axis=1)
    at = (np.arange(RAYS), wall)
    unit = directions(walls)[wall]
    grazing = np.abs(ray[:, 0] * unit[:, 1] - ray[:, 1] * unit[:, 0])
    return wall, np.where(hit[at], share[at], 0.0), grazing, distance[at]
