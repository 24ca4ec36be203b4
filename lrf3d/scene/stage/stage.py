"""What stands in a run's world, painted once for all pictures: walls, roofs, ground and light.

Walls and roofs are faces, as bright as they look at the sky. Painting takes a second, so the stage
asked for last is kept; it can be pickled, to be handed to other processes.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import LEFT, Float, Int, directions, lengths
from lrf3d.run import Run
from lrf3d.scene.look import SUN, WALL_LIGHT
from lrf3d.scene.shapes import GroundPicture, Painted, single
from lrf3d.scene.stage.exposure import Exposure, expose, unexposed
from lrf3d.scene.stage.ground import canvas_of, paint_ground
from lrf3d.scene.stage.structures import Structures

_TOGETHER, _APART, _LEAST = 0.05, 0.004, 1e-7
"""Length [m] over which two walls at one place are one; half the gap between both faces of a free
wall [m], as a ray meets the one that looks at it; and the least area of a triangle [m²]: outlines
that touch themselves have smaller ones."""


class Stage(NamedTuple):
    """What stands in a world: its structures, their faces, the ground, and its light.

    The longest of the walls that are mirrors (m, 5) have their heights [m] as the fifth column.
    """

    structures: Structures
    faces: Painted
    ground: GroundPicture
    exposure: Exposure
    mirrors: Float


@lru_cache(maxsize=1)
def stage_of(run: Run) -> Stage:
    """Paint what can be seen of a run's world, or take what was painted for it before."""
    return paint_stage(Structures.from_run(run), run)


def paint_stage(structures: Structures, run: Run | None = None) -> Stage:
    """Paint walls, roofs and the ground, and when the scans of a run first met them."""
    canvas = canvas_of(structures)
    box = canvas.corner, canvas.corner + canvas.extent
    # What is driven by hand has no scans yet: they light it as they come.
    exposure = unexposed(structures, *box)
    if isinstance(run, Run):
        exposure = expose(run, structures, *box)
    walls, tops = (each[structures.mirrors] for each in (structures.segments, structures.heights))
    most_mirrors = 4  # Most walls that show reflections: each takes the time of a picture.
    longest = np.argsort(-lengths(walls), kind="stable")[:most_mirrors]
    mirrors = np.column_stack([walls, tops])[longest]
    faces, ground = lay_faces(structures, exposure), paint_ground(structures, canvas)
    return Stage(structures, faces, ground, exposure, mirrors)


def _free_walls(structures: Structures) -> tuple[Int, Float]:
    """The free walls (n,), and the parts (n, 4) of them that lie on no higher or earlier wall.

    Plans have a line twice where rooms meet, and two faces in one plane would flicker.
    """
    lines = structures.tree.geometries
    free = np.flatnonzero(~structures.closed & ~structures.glass)
    later, other = structures.tree.query(lines[free], predicate="dwithin", distance=_APART)
    ranks = np.argsort(np.lexsort([np.arange(len(lines)), -structures.heights]))
    hides = ranks[other] < ranks[free[later]]
    later, other = later[hides], other[hides]
    strips = shapely.buffer(lines[other], _APART, cap_style="flat")
    along = shapely.length(shapely.intersection(lines[free[later]], strips)) > _TOGETHER
    hidden = np.full(len(free), shapely.Polygon(), dtype=object)
    shapely.geometrycollections(strips[along], indices=later[along], out=hidden)
    left = shapely.difference(lines[free], shapely.union_all(hidden[:, None], axis=1))
    parts, owner = shapely.get_parts(left, return_index=True)
    there = shapely.length(parts) > _APART
    return free[owner[there]], shapely.get_coordinates(parts[there]).reshape(-1, 4)


def lay_faces(structures: Structures, exposure: Exposure) -> Painted:
    """All walls and flat roofs.

    A wall looks at the cell before it, a roof at that wall of its house which was mapped first.
    """
    # Those of solids are seen from outside, free ones from both sides, and glass has no face.
    solid = np.flatnonzero(structures.closed & ~structures.glass)
    free, parts = _free_walls(structures)
    number = np.concatenate([solid, free, free])
    segments = np.concatenate([structures.segments[solid], parts, parts[:, [2, 3, 0, 1]]])
    along = directions(segments)
    off, (*_, sun_up), (even, sunny, foot) = -along @ LEFT, SUN, WALL_LIGHT
    apart = np.where(structures.closed[number], 0.0, _APART)[:, None]
    level = segments.reshape(-1, 2, 2)[:, [0, 1, 1, 0]] + (apart * off)[:, None]
    high = structures.heights[number, None] * [0.0, 0.0, 1.0, 1.0]
    light = (even + sunny * (off @ SUN[:2]))[:, None] * [foot, foot, 1.0, 1.0]
    steps = exposure.cell * structures.setting.before
    before = np.insert(level + steps * off[:, None], 2, 1.0, axis=2)
    walls = Painted(
        single(np.dstack([level, high])),
        single(light[..., None] * structures.colours[number, None]),
        single(before),
        structures.objects[number],
    )
    corners, owner = triangles(structures.solids)
    level, count = corners[:, [0, 1, 2, 2]], len(corners)
    high = np.broadcast_to(structures.solid_heights[owner, None], (count, 4))
    light = even + sunny * sun_up
    objects = structures.solid_objects[owner]
    roofs = Painted(
        single(np.dstack([level, high])),
        single(np.repeat(light * structures.solid_colours[owner, None], 4, axis=1)),
        np.zeros((count, 4, 3), np.float32),
        objects,
    )
    if count:
        middles = before[..., :2].mean(axis=1)
        order = np.lexsort((exposure.sampled(middles)["mapped"], walls.objects))
        among, first = np.unique(walls.objects[order], return_index=True)
        best = order[first][np.searchsorted(among, objects)]
        roofs.before[..., :2] = middles[best, None]
    columns: zip[Any] = zip(walls, roofs, strict=True)
    return Painted(*map(np.concatenate, columns))


def triangles(polygons: Any) -> tuple[Float, Int]:
    """Cut polygons (p,) into counter-clockwise triangles (t, 3, 2), and which each (t,) is of."""
    if not len(polygons):
        return np.zeros((0, 3, 2)), np.zeros(0, np.int64)
    found, piece = shapely.get_parts(
        shapely.constrained_delaunay_triangles(polygons), return_index=True
    )
    there = shapely.area(found) > _LEAST
    turned = shapely.orient_polygons(found[there])
    return shapely.get_coordinates(turned).reshape(-1, 4, 2)[:, :3], piece[there]
