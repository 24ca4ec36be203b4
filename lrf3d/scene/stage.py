"""What stands in a run's world, painted and lit once for all pictures of it.

Baking the light takes seconds, so the stage asked for last is kept; it can be pickled, to be handed
to other processes.
"""

from functools import lru_cache
from typing import NamedTuple

from lrf3d.progress import Progress, silent
from lrf3d.run import Run
from lrf3d.scene.ground import paint_ground
from lrf3d.scene.shapes import GroundPicture, Painted
from lrf3d.scene.structures import Structures
from lrf3d.scene.walls import paint_walls

_GROUND_SHARE = 0.25
"""What the ground takes of a bake, against the walls."""


class Stage(NamedTuple):
    """What stands in a world."""

    structures: Structures
    """What its walls make up."""
    walls: Painted
    """(n quads) Walls in their light."""
    roofs: Painted
    """(t triangles) Roofs and leaves in their light."""
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
    whole = 1

    def report(done: int, total: int) -> None:
        nonlocal whole
        whole = total + max(1, round(_GROUND_SHARE * total))
        progress(done, whole)

    walls, roofs, light = paint_walls(structures, progress=report)
    ground = paint_ground(structures, light)
    progress(whole, whole)
    return Stage(structures, walls, roofs, ground)
