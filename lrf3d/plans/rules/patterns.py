"""Patterns: rows of parallels at one distance, as tiles and hatching are drawn."""

from typing import Any

import numpy as np
import shapely

from lrf3d.geometry.lines import LEFT, Bool, Float, Int, cross, directions, lengths
from lrf3d.plans.rules.sheet import as_lines
from lrf3d.world.pieces import groups

# Least number of parallels in a pattern.
LEAST_ALIKE = 5

# Largest distance [m] between two neighbours of a pattern: that of large tiles.
WIDEST = 0.7

# Least distance [m] between two neighbours of a pattern, and least length of its lines: the chords
# of a traced scan are shorter, and there are tens of thousands.
CLOSEST = 0.02

# Distance [m] within which parallels are compared: a little over two neighbours.
REACH = 1.5

# Reach [m] that is not halved: lines through one point stay as many as they are.
LEAST_REACH = 0.2

# Upper bound on the pairs of parallels, as these take seconds to compare. In a drawing with more,
# lines are close to each other, and the reach is halved until fewer pairs are left.
MOST_PAIRS = 5_000_000


def is_pattern(segments: Float) -> Bool:
    """Which segments (n, 4) are of five or more parallels at one distance: tiles or hatching."""
    if len(segments) < LEAST_ALIKE:
        return np.zeros(len(segments), dtype=bool)
    along = directions(segments)
    long = lengths(segments)
    # Turn lines of opposite directions into the same one.
    along *= np.where(along @ [1.0, 1e-3] < 0.0, -1.0, 1.0)[:, None]
    across = along @ LEFT
    middles = 0.5 * (segments[:, :2] + segments[:, 2:])
    one, other, off = _parallels(middles, along, across, long)
    even = _is_even(one, off)
    pairs = one[even], other[even]
    member = groups(*pairs, len(segments))
    linked = np.isin(np.arange(len(segments)), np.concatenate(pairs))
    # A window is drawn as parallels, too, but its lines are within a wall: a pattern is wider.
    place = ((middles - middles.mean(axis=0)) * across).sum(axis=1)
    low, high = np.full((2, len(segments)), [[np.inf], [-np.inf]])
    np.minimum.at(low, member, place)
    np.maximum.at(high, member, place)
    found = linked & ((np.bincount(member) >= LEAST_ALIKE)[member]) & (high - low > 0.5)[member]
    # Keep the side of a wall along which tiles begin: other lines go on from both of its ends.
    corners = segments[~found].reshape(-1, 2) @ [1.0, 1.0j]
    found &= ~np.isin(segments.reshape(-1, 2, 2) @ [1.0, 1.0j], corners).all(axis=1)
    return np.asarray(found & (np.bincount(member, found)[member] >= LEAST_ALIKE - 1))


def _parallels(middles: Float, along: Float, across: Float, long: Float) -> tuple[Int, Int, Float]:
    """Pairs (k,), (k,) of parallels that face each other, and their distances (k,) [m]."""
    # Lengthen the lines: in hatched walls they are short, and shifted against each other.
    tree = shapely.STRtree(_lines_through(middles, (0.5 * long + 0.2)[:, None] * along))
    reach = REACH
    rays = _lines_through(middles, reach * across)
    sample = 1 + len(middles) // 100
    while (
        reach > LEAST_REACH
        and sample * tree.query(rays[::sample], predicate="intersects").shape[1] > MOST_PAIRS
    ):
        reach *= 0.5
        rays = _lines_through(middles, reach * across)
    one, other = tree.query(rays, predicate="intersects")
    off = ((middles[other] - middles[one]) * across[one]).sum(axis=1)
    turned = np.abs(cross(along[one], along[other]))
    alike = np.minimum(long[one], long[other]) > 0.5 * np.maximum(long[one], long[other])
    fits = (turned < 0.01) & (np.abs(off) > CLOSEST) & alike
    return one[fits], other[fits], off[fits]


def _is_even(one: Int, off: Float) -> Bool:
    """Which pairs (k,) have a third line at the same distance, before one or after the other."""
    # One sorted key holds the number of a line and a distance, which is far below this [m].
    apart = 10.0
    keys = np.sort(apart * one + off)
    even = np.zeros(len(one), dtype=bool)
    for factor in (-1.0, 2.0):
        wanted = apart * one + factor * off
        slack = 0.03 * np.abs(off) + 1e-3
        at = np.searchsorted(keys, wanted - slack)
        even |= keys[np.minimum(at, len(keys) - 1)] <= wanted + slack
    return even & (np.abs(off) < WIDEST)


def _lines_through(middles: Float, ahead: Float) -> Any:
    return as_lines(np.hstack([middles - ahead, middles + ahead]))
