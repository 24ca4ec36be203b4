"""What stands in a run's world, painted and lit once for all pictures of it.

Baking the light takes seconds, so the stage asked for last is kept; it can be pickled, to be handed
to other processes.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lrf3d.progress import Progress, silent
from lrf3d.run import Run
from lrf3d.scene.ground import paint_ground
from lrf3d.scene.light import Light, screen
from lrf3d.scene.look import SUN, SUNSHINE
from lrf3d.scene.panels import cut_small, joined
from lrf3d.scene.roofs import build_roofs
from lrf3d.scene.shapes import GroundPicture, Painted, single
from lrf3d.scene.structures import Structures
from lrf3d.scene.trees import crowns_of
from lrf3d.scene.walls import lay_walls

_STEP, _STEP_INDOOR = 3.2, 0.8
"""Sides of the pieces that walls are cut into for their light [m]."""

_MOST_PIECES = 60_000
"""About how many pieces there may be: beyond, light takes seconds."""


class Stage(NamedTuple):
    """What stands in a world."""

    structures: Structures
    """What its walls make up."""
    faces: Painted
    """Walls, roofs and leaves in their light."""
    ground: GroundPicture
    """The ground in its light."""


def stage_of(run: Run, progress: Progress = silent) -> Stage:
    """Paint what can be seen of a run's world, or take what was painted for it before.

    Progress is called with finished steps and their number while the light is baked.
    """
    kept = _in_memory(run)
    if not kept:
        kept.append(paint_stage(Structures.from_run(run), progress))
    return kept[0]


@lru_cache(maxsize=1)
def _in_memory(run: Run) -> list[Stage]:
    """The stage of the run asked for last, once there is one."""
    return []


def paint_stage(structures: Structures, progress: Progress = silent) -> Stage:
    """Paint walls, roofs and ground."""
    faces, light = paint_faces(structures, lambda done, whole: progress(done, whole + 1))
    ground = paint_ground(structures, light)
    progress(1, 1)
    return Stage(structures, faces, ground)


def paint_faces(structures: Structures, progress: Progress = silent) -> tuple[Painted, Light]:
    """Walls, roofs and leaves in their light, in the sun and where it is hidden, and that light."""
    step = _STEP_INDOOR if structures.indoor else _STEP
    walls = cut_small(lay_walls(structures), step, _MOST_PIECES)
    faces = joined(walls, build_roofs(structures), crowns_of(structures))
    light = Light(structures, faces, progress)
    sun = np.maximum(faces.normals @ SUN, 0.0)[..., None] * SUNSHINE * (not structures.indoor)
    places, normals, texture, colours = (single(each) for each in faces[:4])
    lit, shaded = (single(screen(each)) for each in (light.faces + sun, light.faces))
    painted = places, normals, texture, colours, lit, shaded, single(faces.under), faces.objects
    return Painted(*painted), light
