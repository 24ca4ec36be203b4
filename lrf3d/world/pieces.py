"""Polylines and walls: an object's outline as points, and the wall segments between them."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lrf3d.geometry import Float
from lrf3d.world.model import World


@dataclass(frozen=True, slots=True)
class Piece:
    """A polyline through points (k, 2) [m]; a closed one ends at its first point."""

    points: Float
    closed: bool

    @property
    def outline(self) -> Float:
        """The points (k or k + 1, 2), with the first one repeated at the end of a closed piece."""
        return np.vstack([self.points, self.points[:1]]) if self.closed else self.points


@dataclass(frozen=True, slots=True)
class WallRun:
    """Consecutive walls of one object.

    Args:
        number: The object they belong to.
        pieces: The polylines they make.
        heights: (n,) height of each wall [m].
    """

    number: int
    pieces: tuple[Piece, ...]
    heights: Float

    @property
    def height_value(self) -> float | list[float]:
        """The heights for a file: one number if all walls have the same height, else a list."""
        heights = [float(height) for height in self.heights]
        return heights[0] if len(set(heights)) == 1 else heights


def walls(points: Float, closed: bool) -> Float:
    """Segments (n, 4) between the points (k, 2), and back to the first where closed."""
    ends = np.vstack([points, points[:1]]) if closed else points
    return np.hstack([ends[:-1], ends[1:]])


def from_corner(chain: Float) -> Float:
    """A chain (k, 2) as it is, or a ring opened where it is farthest from its middle: a corner.

    Simplifying keeps the ends of a chain, so that a ring would keep a point within a wall.
    """
    if (chain[0] != chain[-1]).any():
        return chain
    ring = chain[:-1]
    start = int(np.argmax(((ring - ring.mean(axis=0)) ** 2).sum(axis=1)))
    return np.vstack([ring[start:], ring[: start + 1]])


def pieces_of(segments: Float) -> tuple[Piece, ...]:
    """The polylines that reproduce the segments (n, 4), bit for bit and in their order."""
    bits = np.ascontiguousarray(segments).view(np.int64)
    pieces = []
    first = 0
    for last in range(len(segments)):
        # A ring ends at its start; two walls there and back are not a ring.
        ring = last - first >= 2 and (bits[last, 2:] == bits[first, :2]).all()
        joined = last + 1 < len(segments) and (bits[last, 2:] == bits[last + 1, :2]).all()
        if ring:
            pieces.append(Piece(segments[first : last + 1, :2], closed=True))
        elif not joined:
            points = np.vstack([segments[first : last + 1, :2], segments[last : last + 1, 2:]])
            pieces.append(Piece(points, closed=False))
        else:
            continue
        first = last + 1
    return tuple(pieces)


def parts_of(world: World) -> Iterator[WallRun]:
    """The walls of a world in their order, in runs of one object each."""
    cuts = np.flatnonzero(np.diff(world.objects)) + 1
    bounds = [0, *cuts.tolist(), len(world.objects)] if len(world.objects) else [0]
    for first, end in pairwise(bounds):
        pieces = pieces_of(world.segments[first:end])
        yield WallRun(int(world.objects[first]), pieces, world.heights[first:end])
