"""Lookouts: places from which most of the walls are seen, and what is seen on the way."""

from dataclasses import dataclass

import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Bool, Float, Int, lengths
from lrf3d.laser import LaserRangeFinder
from lrf3d.planning.free_space import FreeSpace
from lrf3d.world import World

PATCHES = 350
"""Approximate number of patches of the free space, each with one candidate."""

BEAMS, HEADINGS = 720, 8
"""Number of beams all around, and of headings for which the view of a laser with 180° is stored."""

FARTHEST_VIEW = 40.0
"""Largest distance [m] at which a wall counts as seen: farther away, beams of 1° leave gaps."""

WALL_PIECES, SHORTEST_PIECE = 8000, 0.4
"""Approximate number of pieces of all walls, and their least length [m]."""

LONGEST_WALL = 1e7
"""Length [m] of a wall beyond which its pieces are not told apart."""

FULL_WEIGHT = 2.0
"""Length [m] from which a wall counts in full; niches and steps are not worth a detour."""

OPEN = 5.0
"""Distance to walls [m] above which more room makes no better lookout."""

COMFORT, TIGHT = 0.55, 0.8
"""Distance to walls [m] that a place should have, and the factor of what is seen from others."""

LEAST_GAIN, MOST_LOOKOUTS = 0.001, 60
"""Least share of the walls that another lookout must add, and the largest number of lookouts."""


@dataclass(frozen=True)
class Views:
    """The pieces of wall seen (headings, patches, pieces) from patches of a free space.

    Each place (places,) lies in a patch; the weight of a piece (pieces,) is about its length [m].
    """

    patch_of: Int
    seen: Bool
    weights: Float

    def along(self, places: Float, path: Int) -> Bool:
        """Which pieces (pieces,) are seen along a path of neighbouring places."""
        step = np.diff(places[path], axis=0)
        turn = np.arctan2(step[:, 1], step[:, 0]) / (2.0 * np.pi) * HEADINGS
        heading = np.round(turn).astype(int) % HEADINGS
        pairs = np.unique(heading * self.seen.shape[1] + self.patch_of[path[1:]])
        return np.asarray(self.seen.reshape(-1, len(self.weights))[pairs].any(axis=0))


def find_lookouts(space: FreeSpace, world: World, range_max: float) -> tuple[Views, Int]:
    """What is seen from the free space, and the places (k,) from which nearly all of it is seen.

    The first place shows the most, and each adds the most to those before.
    """
    patch_of, candidates = _patches(space)
    seen, weights = _look(space.places[candidates] + world.origin, world, range_max)
    around = np.asarray(seen.any(axis=0))
    unseen = np.where(around.any(axis=0), weights, 0.0)
    least = LEAST_GAIN * unseen.sum()
    chosen: list[int] = []
    appeal = np.where(space.gaps[candidates] < COMFORT, TIGHT, 1.0)
    gains = around @ unseen
    while gains.max(initial=0.0) > least and len(chosen) < MOST_LOOKOUTS:
        chosen.append(int(np.argmax(appeal * gains)))
        unseen[around[chosen[-1]]] = 0.0
        gains = around @ unseen
    return Views(patch_of, seen, weights), candidates[np.array(chosen, dtype=np.int64)]


def _patches(space: FreeSpace) -> tuple[Int, Int]:
    """The patch of each place, and in each patch the place that lies most openly."""
    size = max(np.sqrt(len(space.places) / PATCHES), 2.0) * space.spacing
    scaled = (space.places - space.places.min(axis=0)) / size
    patch = np.floor(scaled).astype(np.int64)
    patch_of = np.unique(patch, axis=0, return_inverse=True)[1].reshape(-1)
    off_middle = np.abs(scaled - patch - 0.5).max(axis=1)
    # Among places with as much room the one nearest to the middle of the patch comes first.
    order = np.lexsort((off_middle, -np.round(np.minimum(space.gaps, OPEN)), patch_of))
    candidates = order[np.unique(patch_of[order], return_index=True)[1]]
    return patch_of.astype(np.int64), candidates.astype(np.int64)


def _look(positions: Float, world: World, range_max: float) -> tuple[Bool, Float]:
    """Which pieces are seen (headings, positions, pieces), and their weights (pieces,)."""
    reach = min(range_max, FARTHEST_VIEW)
    lrf = LaserRangeFinder(
        -np.pi, np.pi - 2.0 * np.pi / BEAMS, beams=BEAMS, range_max=reach, height=0.0
    )
    # Mirrors and glass are left out: what they show is not seen where it stands.
    caster = PlanarCaster(World(world.segments, heights=world.heights))
    poses = np.column_stack([positions, np.zeros(len(positions))])
    ranges, walls = caster.scan_batch(lrf, poses)
    position, beam = np.nonzero(walls >= 0)
    wall = walls[position, beam]
    long = lengths(world.segments)
    # Of a wall as long as a country only what is seen counts.
    visible = np.minimum(long[np.unique(wall)], 4.0 * reach).sum()
    size = max(SHORTEST_PIECE, float(visible) / WALL_PIECES)
    points = positions[position] + ranges[position, beam, None] * lrf.directions((0, 0, 0))[beam]
    station = lengths(np.hstack([world.segments[wall, :2], points]))
    # The pieces of all walls are numbered one after the other.
    count = np.ceil(np.minimum(long, LONGEST_WALL) / size).astype(np.int64)
    first = np.cumsum(count) - count
    number = first[wall] + np.minimum(station / size, count[wall] - 1).astype(np.int64)
    numbers, piece = np.unique(number, return_inverse=True)
    wall = np.asarray(np.searchsorted(first, numbers, side="right")) - 1
    long, station = long[wall], size * (numbers - first[wall])
    weights = np.minimum(size, long - station) * np.minimum(long / FULL_WEIGHT, 1.0)
    seen = np.zeros((HEADINGS, len(positions), len(numbers)), dtype=np.bool_)
    for heading in range(HEADINGS):
        turn = (beam - BEAMS // 2 - heading * BEAMS // HEADINGS + BEAMS // 4) % BEAMS
        ahead = turn <= BEAMS // 2
        seen[heading, position[ahead], piece[ahead]] = True
    return seen, weights
