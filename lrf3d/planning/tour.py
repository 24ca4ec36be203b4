"""Tours: drives past lookouts from which most of the walls are seen."""

from itertools import pairwise

import numpy as np
from scipy.sparse.csgraph import dijkstra

from lrf3d.base.errors import InputError
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import ROUNDING, Bool, Float, Int, lengths
from lrf3d.laser import LaserRangeFinder
from lrf3d.planning.free_space import COMFORT, FreeSpace
from lrf3d.planning.rooms import true_rooms
from lrf3d.world import World

# Number of beams all around by which views are computed.
BEAMS = 360

# Number of headings for which the view of a laser with 180° is stored.
HEADINGS = 8

# Factor on the value of a lookout close to walls.
TIGHT = 0.3

# Value of entering a room: as much as seeing some metres of wall [m].
ROOM_VALUE = 4.0

# Most metres of a tour: some minutes of driving.
LONGEST = 800.0

# Fewest metres of a tour: where a few steps show all walls, the robot still drives.
SHORTEST = 20.0

# Metres of wall that another metre of the drive must show.
LEAST_WORTH = 0.02


def find_tour(space: FreeSpace, world: World, range_max: float) -> list[Int]:
    """The paths of a tour through places of a free space, which shows much in few metres.

    It grows lookout by lookout, always by the one that shows the most additional wall for each
    additional metre, inserted where the detour is shortest.
    """
    patches, patch_of = _patches(space)
    seen, weights = _look(space.places[patches] + world.origin, world, range_max)
    if space.side == "inside":
        room = np.where(space.ground.wide, space.ground.rooms, 0)[space.allowed][patches]
        true = true_rooms(space.ground, space.allowed)
        entered = np.broadcast_to(room[:, None] == true, (HEADINGS, len(room), len(true)))
        seen = np.concatenate([seen, entered], axis=2)
        weights = np.append(weights, np.full(len(true), ROOM_VALUE))
    around = np.asarray(seen.any(axis=0))
    appeal = np.where(space.gaps >= space.radius + COMFORT, 1.0, TIGHT)
    lookouts = patches[_cover(around, weights, appeal[patches])]
    kept = int(space.start is not None)
    if space.start is not None:
        lookouts = np.append(space.number[space.start], lookouts)
    views = around[patch_of[lookouts]]
    order = [0]
    # Paths are computed only from lookouts that the tour passes.
    paths = dict[int, list[Int]]()
    metres = np.zeros((len(lookouts),) * 2)
    best = 0
    while True:
        paths[best] = paths_from(space, lookouts[best], lookouts)
        # The return path is as long.
        metres[best] = metres[:, best] = [_length(space, path) for path in paths[best]]
        if len(order) > 1:
            order = _two_opt(order, metres[np.ix_(order, order)], kept)
        steps = metres[order[:-1], order[1:]]
        away = metres[order]
        shown = _shown(space, _legs(space, paths, order), seen, patch_of)
        detours = np.vstack([away[:1], away[:-1] + away[1:] - steps[:, None], away[-1:]])[kept:]
        detour = detours.min(axis=0)
        worth = views @ np.where(shown, 0.0, weights) / np.maximum(detour, 1.0)
        worth[order] = 0.0
        worth[steps.sum() + detour > LONGEST] = 0.0
        best = int(np.argmax(worth))
        if worth[best] < LEAST_WORTH:
            break
        order.insert(kept + int(np.argmin(detours[:, best])), best)
    # What is seen depends on the direction of the drive.
    tours = [_legs(space, paths, each) for each in ([order] if kept else [order, order[::-1]])]
    legs = max(tours, key=lambda legs: float(weights @ _shown(space, legs, seen, patch_of)))
    return _lengthened(space, legs, int(legs[-1][-1] if legs else lookouts[0]), appeal)


def _lengthened(space: FreeSpace, legs: list[Int], end: int, appeal: Float) -> list[Int]:
    """Lengthen a short tour from its end to the ends of the free space, by their appeal (k,)."""
    while sum(_length(space, leg) for leg in legs) < SHORTEST:
        goal = int(np.argmax(np.hypot(*(space.places - space.places[end]).T) * appeal))
        if goal == end:
            raise InputError("no room to drive between the walls; give a route or poses")
        legs += paths_from(space, end, np.array([goal]))
        end = goal
    return legs


def _legs(space: FreeSpace, paths: dict[int, list[Int]], order: list[int]) -> list[Int]:
    """The paths of a tour; at its ends the robot turns around to see what was behind it."""
    legs = [paths[one][other] for one, other in pairwise(order)]
    turn = int(1.0 / space.ground.size) + 2
    begin = [] if space.start is not None else [leg[turn - 1 :: -1] for leg in legs[:1]]
    return [*begin, *legs, *(leg[: -turn - 1 : -1] for leg in legs[-1:])]


def _shown(space: FreeSpace, legs: list[Int], seen: Bool, patch_of: Int) -> Bool:
    """Which pieces (pieces,) are seen ahead on a drive."""
    path = np.concatenate([np.zeros(0, dtype=np.int64), *legs])
    steps = np.diff(space.places[path], axis=0)
    turn = np.arctan2(steps[:, 1], steps[:, 0]) / (2.0 * np.pi) * HEADINGS
    heading = np.round(turn).astype(int) % HEADINGS
    pairs = np.unique(np.stack([heading, patch_of[path[1:]]])[:, steps.any(axis=1)], axis=1)
    return np.asarray(seen[tuple(pairs)].any(axis=0))


def _patches(space: FreeSpace) -> tuple[Int, Int]:
    """The most open place in each of some 600 patches, and the patch nearest to each place."""
    size = max(np.sqrt(len(space.places) / 600), 2.0) * space.ground.size
    patch = np.floor(space.places / size)
    off_middle = np.abs(space.places / size - patch - 0.5).max(axis=1)
    # Among places with as much room the one nearest to the middle of the patch comes first, and
    # more than 5 m of room make no better lookout.
    order = np.lexsort((off_middle, -np.round(np.minimum(space.gaps, 5.0))))
    best = order[np.unique(patch[order, ::-1], axis=0, return_index=True)[1]]
    source = dijkstra(space.graph, indices=best, min_only=True, return_predecessors=True)[2]
    number = np.zeros(len(space.places), dtype=np.int64)
    number[best] = np.arange(len(best))
    return best, number[source]


def _cover(seen: Bool, weights: Float, appeal: Float) -> list[int]:
    """The positions that show nearly all, each of them the most that those before do not show.

    What is seen (k, pieces) is weighed by the appeal (k,) of the position.
    """
    # Numbers are summed ten times as fast as truth values.
    shows = seen.astype(np.float32)
    unseen = weights.astype(np.float32)
    least = 0.0005 * float(unseen[seen.any(axis=0)].sum())
    chosen = list[int]()
    # With a short range_max no wall may be visible.
    while ((gains := appeal * (shows @ unseen)).max() > least and len(chosen) < 60) or not chosen:
        chosen.append(int(np.argmax(gains)))
        unseen[seen[chosen[-1]]] = 0.0
    return chosen


def paths_from(space: FreeSpace, start: int, ends: Int) -> list[Int]:
    """The places of the cheapest paths from a start to each end, which are places."""
    before = dijkstra(space.graph, indices=[int(start)], return_predecessors=True)[1][0]
    paths = []
    for end in ends.tolist():
        path = [end]
        while before[path[-1]] >= 0:
            path.append(int(before[path[-1]]))
        paths.append(np.array(path[::-1]))
    return paths


def _length(space: FreeSpace, path: Int) -> float:
    """Length [m] of a path."""
    return float(np.hypot(*np.diff(space.places[path], axis=0).T).sum())


def _look(positions: Float, world: World, range_max: float) -> tuple[Bool, Float]:
    """Which pieces are seen (headings, k, pieces) from positions (k, 2), and their weights [m]."""
    reach = min(range_max, 40.0)  # Farther away [m] beams of 1° leave gaps.
    last = np.pi - 2.0 * np.pi / BEAMS
    lrf = LaserRangeFinder(-np.pi, last, beams=BEAMS, range_max=reach, height=0.0)
    # Mirrors and glass are left out: what they show stands elsewhere.
    caster = PlanarCaster(World(world.segments, heights=world.heights))
    poses = np.column_stack([positions, np.zeros(len(positions))])
    ranges, walls = caster.scan_batch(lrf, poses)
    position, beam = np.nonzero(walls >= 0)
    wall = walls[position, beam]
    long = lengths(world.segments)
    # Of a very long wall only the visible part counts. There are some 8,000 pieces.
    visible = np.minimum(long[np.unique(wall)], 4.0 * reach).sum()
    size = max(0.4, float(visible) / 8000)
    points = positions[position] + ranges[position, beam, None] * lrf.directions((0, 0, 0))[beam]
    station = np.minimum(lengths(np.hstack([world.segments[wall, :2], points])), 0.999 * long[wall])
    numbers, piece = np.unique(wall << 32 | (station / size).astype(np.int64), return_inverse=True)
    wall = numbers >> 32
    station = size * (numbers & 0xFFFFFFFF)
    # Niches and steps are not worth a detour.
    weights = np.minimum(size, long[wall] - station) * np.minimum(long[wall] / 2.0, 1.0)
    seen = np.zeros((HEADINGS, len(positions), len(numbers)), dtype=np.bool_)
    for heading in range(HEADINGS):
        turn = (beam - BEAMS // 2 - heading * BEAMS // HEADINGS + BEAMS // 4) % BEAMS
        seen[heading, position[turn <= BEAMS // 2], piece[turn <= BEAMS // 2]] = True
    return seen, weights


def _two_opt(order: list[int], metres: Float, kept: int) -> list[int]:
    """Reverse pieces of an open tour, after the kept places, as long as that is shorter."""
    # The first and the last place are dummies without distance.
    metres = np.pad(metres, 1)
    tour = np.arange(len(order) + 2)
    while True:
        away = metres[np.ix_(tour, tour)]
        steps = np.diagonal(away, 1)
        gain = np.triu(steps[:-1, None] + steps[1:] - away[:-2, 1:-1] - away[1:-1, 2:], 1)
        first, last = np.unravel_index(np.argmax(gain[kept:]), gain[kept:].shape)
        # Rounding alone must not reverse a piece back and forth forever.
        if gain[kept + first, last] <= ROUNDING:
            return [order[at - 1] for at in tour[1:-1]]
        piece = slice(kept + first + 1, last + 2)
        tour[piece] = tour[piece][::-1]
