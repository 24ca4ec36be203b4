"""Lines, walls and objects: from outlines and drawings to a world, and back for files."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lrf3d.base.errors import WorldError
from lrf3d.base.files import own_name
from lrf3d.geometry.lines import ROUNDING, Float, Int, lengths
from lrf3d.world.materials import Material
from lrf3d.world.model import World
from lrf3d.world.schema import colour_value

# Largest number of pairs of shapes that touch, beyond four of each: seconds of work. A town with
# 100,000 buildings has some 200,000.
MOST_PAIRS = 1_000_000

# Largest gap [m] between walls that touch: no beam can separate them, so they are one object.
TOUCHING = 0.001


class Part(NamedTuple):
    """Walls (n, 4) [m] of one object, with one height [m] or one for each, and its looks."""

    number: int
    segments: Float
    heights: Float
    name: str = ""
    colour: Float | tuple[float, float, float] | None = None
    material: Material | None = None


def world_of_parts(parts: Sequence[Part], name: str, **others: Any) -> World:
    """The world of walls; the first part of an object that has a name, a colour, … gives it."""
    numbers, segments, *_ = zip(*parts, strict=True)
    objects = np.repeat(numbers, [len(own) for own in segments])
    count = int(objects.max()) + 1
    names = [""] * count
    colours = np.full((count, 3), np.nan)
    materials: list[Material | None] = [None] * count
    for part in reversed([part for part in parts if part.number < count]):
        names[part.number] = part.name or names[part.number]
        materials[part.number] = part.material or materials[part.number]
        if part.colour is not None:
            colours[part.number] = part.colour
    return World(
        np.concatenate(segments),
        objects,
        np.concatenate([np.broadcast_to(part.heights, len(part.segments)) for part in parts]),
        name,
        object_names=names if any(names) else (),
        colours=colours,
        materials=materials,
        **others,
    )


def walls(points: Float, closed: bool = False) -> Float:
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


def lines_of(segments: Float) -> list[Float]:
    """Lines (k, 2) that reproduce the segments (n, 4), bit for bit and in their order.

    A ring, of three walls or more, is a line that ends at its first point.
    """
    bits = np.ascontiguousarray(segments).view(np.int64)
    lines = []
    first = 0
    for last in range(len(segments)):
        ring = last - first >= 2 and (bits[last, 2:] == bits[first, :2]).all()
        joined = last + 1 < len(segments) and (bits[last, 2:] == bits[last + 1, :2]).all()
        if ring or not joined:
            lines.append(np.vstack([segments[first : last + 1, :2], segments[last : last + 1, 2:]]))
            first = last + 1
    return lines


def runs_of(world: World) -> Iterator[tuple[int, dict[str, Any], list[Any], Any]]:
    """Runs of consecutive walls of one object: its number and looks, their lines and height.

    The looks are the name, the colour and the material, as far as it has them; lines are lists of
    points; there is one height [m], or one for each wall. Objects without walls come first.
    """
    for number in sorted(set(range(world.object_count)) - set(world.objects.tolist())):
        if own := _looks(world, number):
            yield number, own, [], []
    cuts = np.flatnonzero(np.diff(world.objects)) + 1
    for first, end in pairwise([0, *cuts.tolist(), len(world.objects)]):
        if end > first:
            number = int(world.objects[first])
            heights = world.heights[first:end].tolist()
            height = heights[0] if len(set(heights)) == 1 else heights
            lines = [line.tolist() for line in lines_of(world.segments[first:end])]
            yield number, _looks(world, number), lines, height


def _looks(world: World, number: int) -> dict[str, Any]:
    """The name, the colour and the material of an object, as far as it has them."""
    colour = world.colours[number]
    held = {
        "name": world.object_names[number] if world.object_names else "",
        "colour": colour_value(colour) if np.isfinite(colour).all() else None,
        "material": world.materials[number] if world.materials else None,
    }
    return {key: value for key, value in held.items() if value}


def world_of_walls(segments: Float, heights: Float, path: Path, gap: float = TOUCHING) -> World:
    """The world of segments (n, 4), with heights (n,), of which repeated ones count once."""
    kept = np.flatnonzero(lengths(segments) > ROUNDING)
    kept = kept[without_repeats(segments[kept])]
    segments = segments[kept]
    heights = heights[kept]
    extent = float(np.ptp(segments.reshape(-1, 2), axis=0).max())
    # Drawings may have the size of their paper.
    gap = min(gap, 1e-4 * extent) if gap == TOUCHING else gap
    return World(segments, connected(segments, gap), heights, own_name(path))


def without_repeats(segments: Float) -> Int:
    """The numbers of the segments (n, 4) without repeated ones, in either direction."""
    turned = (segments[:, 0] > segments[:, 2]) | (
        (segments[:, 0] == segments[:, 2]) & (segments[:, 1] > segments[:, 3])
    )
    either = np.where(turned[:, None], segments[:, [2, 3, 0, 1]], segments)
    _, kept = np.unique(either, axis=0, return_index=True)
    return np.sort(kept)


def connected(segments: Float, gap: float = TOUCHING) -> Int:
    """The object (n,) of each of the segments (n, 4); those within the gap [m] are one object."""
    import shapely

    if not len(segments):
        return np.zeros(0, np.int64)
    middle = segments.reshape(-1, 2).mean(axis=0)
    lines = shapely.linestrings(segments.reshape(-1, 2, 2) - middle)
    return groups(*pairs_within(lines, gap, "walls"), len(segments))


def pairs_within(shapes: Any, distance: float, what: str) -> tuple[Int, Int]:
    """Pairs (k,), (k,) of shapes within a distance [m], each both ways, and each with itself.

    Raises:
        WorldError: Far more of what they are lie at one place than in any plan or town.
    """
    import shapely

    tree = shapely.STRtree(shapes)
    count = len(shapes)
    pairs = [np.empty((2, 0), np.int64)]
    known = 0
    for first in range(0, count, step := 1 + MOST_PAIRS // (count + 1)):
        part = shapes[first : first + step]
        found = tree.query(part, predicate="dwithin", distance=distance)
        found[0] += first
        pairs.append(found)
        known += found.shape[1]
        # Found both ways, and that each touches a few is usual.
        if known > 2 * MOST_PAIRS + 8 * count:
            raise WorldError(
                f"more than {MOST_PAIRS:,} pairs of {what} touch; remove repeated ones"
            )
    one, other = np.concatenate(pairs, axis=1)
    return one, other


def groups(one: Int, other: Int, count: int) -> Int:
    """The group (count,) of each of some things, of which pairs (k,), (k,) belong together."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(one)), (one, other)), shape=(count, count))
    _, label = connected_components(links, directed=False)
    return np.asarray(label, dtype=np.int64)


def members_of(label: Int) -> list[Int]:
    """The numbers of the members of each group, by their labels from 0."""
    order = np.argsort(label, kind="stable")
    return np.split(order, np.cumsum(np.bincount(label, minlength=1))[:-1])


def joined_objects(world: World) -> Int:
    """The object (n,) of each wall where objects that touch count as one, by their lowest number.

    Maps are scored and labelled by these: no beam can separate the rooms of a house.
    """
    if not len(world.segments):
        return world.objects
    # Objects and groups of touching walls are the nodes of a graph; each wall is an edge.
    group = connected(world.segments) + world.object_count
    nodes = int(group.max()) + 1
    label = groups(world.objects, group, nodes)
    lowest = np.full(nodes, nodes)
    np.minimum.at(lowest, label[world.objects], world.objects)
    return np.asarray(lowest[label[world.objects]], dtype=np.int64)
