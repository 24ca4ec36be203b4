"""What stands in a run's world, painted and lit once for all pictures of it.

Baking the light takes seconds, so the stage asked for last is kept; it can be pickled, to be handed
to other processes.
"""

from functools import lru_cache
from typing import NamedTuple

from lrf3d.interrupts import Progress, silent
from lrf3d.run import Run
from lrf3d.scene.ground import canvas_of, paint_ground
from lrf3d.scene.light import bake_light, screen, sunlight
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
    """Paint walls, roofs, leaves and the ground, in the sun and where it is hidden."""
    indoor, canvas = structures.indoor, canvas_of(structures)
    walls = cut_small(lay_walls(structures), _STEP_INDOOR if indoor else _STEP, _MOST_PIECES)
    faces = joined(walls, build_roofs(structures), crowns_of(structures))
    box = canvas.corner, canvas.corner + canvas.extent
    light = bake_light(
        faces, *box, indoor=indoor, progress=lambda done, count: progress(done, count + 1)
    )
    lit = light.faces + sunlight(faces.normals, indoor=indoor)
    faces = faces._replace(lit=single(screen(lit)), shaded=single(screen(light.faces)))
    ground = paint_ground(structures, canvas, light.ground)
    progress(1, 1)
    return Stage(structures, faces, ground)
