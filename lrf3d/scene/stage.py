"""What stands in a run's world, painted once for all pictures of it."""

from functools import lru_cache
from typing import NamedTuple

from lrf3d.run import Run
from lrf3d.scene.ground import Ground, paint_ground
from lrf3d.scene.structures import Structures
from lrf3d.scene.walls import PaintedWalls, paint_walls


class Stage(NamedTuple):
    """What stands in a world.

    Args:
        structures: What its walls make up.
        walls: Walls and roofs in their light.
        ground: The ground in its light.
    """

    structures: Structures
    walls: PaintedWalls
    ground: Ground


@lru_cache(maxsize=1)
def stage_of(run: Run) -> Stage:
    """Paint what can be seen of a run's world; that of the run asked for last is kept."""
    structures = Structures.from_run(run)
    walls = paint_walls(structures)
    return Stage(structures, walls, paint_ground(structures, walls.light))
