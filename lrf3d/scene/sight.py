"""Sight: what of a world can be seen from where its robot goes, and the frame to see it in.

What is drawn costs what is looked at, however large the world is: walls end where nothing is drawn
any more. The frame's origin lies among them, as graphics count in float32, which far from their
origin knows no centimetres.
"""

from dataclasses import dataclass, replace

import numpy as np

from lrf3d.geometry import Float, Int, lengths
from lrf3d.run import Run
from lrf3d.world import World

SIGHT_DISTANCE = 4000.0
"""Distance [m] up to which things are drawn: haze hides what is far beyond a tenth of it."""


@dataclass(frozen=True, eq=False)
class Sight:
    """The part of a world that can be seen.

    Args:
        world: The walls within :data:`SIGHT_DISTANCE` of the path; where those are all, the world
            itself.
        origin: (2,) whole metres near their middle: the origin of the frame to draw in.
    """

    world: World
    origin: Float

    @classmethod
    def of(cls, world: World, path: Float | None = None) -> "Sight":
        """What can be seen of a world from a path (k, 2) and from its cameras; all without one."""
        places = np.zeros((0, 2)) if path is None else path
        if not len(places):
            return cls(world, world.origin)
        stands = [np.reshape([c.position[:2], c.target[:2]], (2, 2)) for c in world.cameras]
        places = np.concatenate([places, *stands])
        low, high = places.min(axis=0), places.max(axis=0)
        world = _near(world, low - SIGHT_DISTANCE, high + SIGHT_DISTANCE)
        if not len(world.segments):
            return cls(world, np.round(0.5 * (low + high)))
        return cls(world, world.origin)

    @classmethod
    def of_run(cls, run: Run) -> "Sight":
        """What can be seen of a run's world."""
        return cls.of(run.world, run.trajectory.poses[:, :2])


def _near(world: World, low: Float, high: Float) -> World:
    """The world within a box, its walls cut where they leave it; itself where none does."""
    ends = world.segments.reshape(-1, 2)
    if ((ends >= low) & (ends <= high)).all() and world.heights.max(initial=0.0) <= SIGHT_DISTANCE:
        return world
    pieces, kept = _cut(world.segments, low, high)
    objects = world.objects[kept]
    count = int(objects.max(initial=-1)) + 1
    return replace(
        world,
        segments=pieces,
        objects=objects,
        heights=np.minimum(world.heights[kept], SIGHT_DISTANCE),
        object_names=world.object_names[:count],
        colours=world.colours[:count],
    )


def _cut(segments: Float, low: Float, high: Float) -> tuple[Float, Int]:
    """What of segments (n, 4) lies in a box, and the number of the segment that each piece is of.

    The way of Liang and Barsky (1984): along a segment the box is left and entered by its four
    sides one after the other.
    """
    start, way = segments[:, :2], segments[:, 2:] - segments[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - start) / way, (high - start) / way
    # A segment that runs along a side of the box is beside it or not, all the way.
    beside = (way == 0.0) & ((start < low) | (start > high))
    level = way == 0.0
    enter = np.where(level, 0.0, np.minimum(first, second)).max(axis=1).clip(min=0.0)
    leave = np.where(level, 1.0, np.maximum(first, second)).min(axis=1).clip(max=1.0)
    kept = np.flatnonzero((enter < leave) & ~beside.any(axis=1))
    enter, leave = enter[kept, None], leave[kept, None]
    start, end, way = start[kept], segments[kept, 2:], way[kept]
    # Ends within the box stay as they are, to the last bit.
    begin = np.where(enter > 0.0, start + enter * way, start)
    finish = np.where(leave < 1.0, start + leave * way, end)
    pieces = np.concatenate([begin, finish], axis=1)
    there = lengths(pieces) > 0.0
    return pieces[there], kept[there]
