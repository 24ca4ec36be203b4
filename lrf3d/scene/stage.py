"""What stands in a run's world, painted and lit once for all pictures of it.

Baking the light takes seconds, so the stage asked for last is kept; it can be pickled, to be handed
to other processes.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Float, lengths
from lrf3d.interrupts import Progress, silent
from lrf3d.run import Run
from lrf3d.scene.beams import turning_walls
from lrf3d.scene.exposure import Exposure, before, expose, unexposed
from lrf3d.scene.ground import canvas_of, paint_ground
from lrf3d.scene.light import bake_light, screen
from lrf3d.scene.panels import cut_small, joined
from lrf3d.scene.roofs import build_roofs
from lrf3d.scene.shapes import GroundPicture, Painted, single
from lrf3d.scene.structures import Structures
from lrf3d.scene.trees import crowns_of
from lrf3d.scene.walls import lay_walls
from lrf3d.world import World

_STEP, _STEP_INDOOR = 3.2, 0.8
"""Sides of the pieces that walls are cut into for their light [m]."""

_MOST_PIECES = 60_000
"""About how many pieces there may be: beyond, light takes seconds."""


_MOST_MIRRORS = 4
"""Most walls that show reflections: each takes the time of a picture."""


class Stage(NamedTuple):
    """What stands in a world."""

    structures: Structures
    """What its walls make up."""
    faces: Painted
    """Walls, roofs and leaves in their light."""
    ground: GroundPicture
    """The ground in its light."""
    exposure: Exposure
    """When the laser first lit it."""
    mirrors: Float
    """(m, 5) the longest walls that are mirrors, and their heights [m]."""


def stage_of(run: Run, progress: Progress = silent) -> Stage:
    """Paint what can be seen of a run's world, or take what was painted for it before.

    Progress is called with finished steps and their number while the light is baked.
    """
    kept = _in_memory(run)
    if not kept:
        kept.append(paint_stage(Structures.from_run(run), progress, run))
    return kept[0]


@lru_cache(maxsize=1)
def _in_memory(run: Run) -> list[Stage]:
    """The stage of the run asked for last, once there is one."""
    return []


def paint_stage(
    structures: Structures, progress: Progress = silent, run: Run | None = None
) -> Stage:
    """Paint walls, roofs, leaves and the ground, and when the scans of a run first met them."""
    indoor, canvas = structures.indoor, canvas_of(structures)
    walls = cut_small(lay_walls(structures), _STEP_INDOOR if indoor else _STEP, _MOST_PIECES)
    faces = joined(walls, build_roofs(structures), crowns_of(structures))
    box = canvas.corner, canvas.corner + canvas.extent
    light = bake_light(
        faces, *box, indoor=indoor, progress=lambda done, count: progress(done, count + 1)
    )
    ground = paint_ground(structures, canvas, light.ground)
    # What is driven by hand has no scans yet: they light it as they come.
    exposure = unexposed(structures, *box)
    if isinstance(run, Run):
        exposure = expose(run, structures, *box)
    looked_at = before(faces, exposure, structures)
    faces = faces._replace(
        light=single(screen(light.faces).mean(axis=2, keepdims=True)), before=looked_at
    )
    progress(1, 1)
    mirrors = np.zeros((0, 5)) if run is None else _mirrors(run.world, structures.origin)
    return Stage(structures, faces, ground, exposure, mirrors)


def _mirrors(world: World, origin: Float) -> Float:
    chosen = np.flatnonzero(turning_walls(world))
    chosen = chosen[np.argsort(-lengths(world.segments[chosen]), kind="stable")[:_MOST_MIRRORS]]
    walls = world.segments[chosen] - np.tile(origin, 2)
    return np.column_stack([walls, world.heights[chosen]])
