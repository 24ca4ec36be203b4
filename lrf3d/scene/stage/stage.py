"""What stands in a run's world, painted once for all pictures of it.

That takes a second, so the stage asked for last is kept; it can be pickled, to be handed to other
processes.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Float, lengths
from lrf3d.run import Run
from lrf3d.scene.beams import turning_walls
from lrf3d.scene.shapes import GroundPicture, Painted
from lrf3d.scene.stage.exposure import Exposure, expose, unexposed
from lrf3d.scene.stage.ground import canvas_of, paint_ground
from lrf3d.scene.stage.structures import Structures
from lrf3d.scene.stage.walls import lay_faces
from lrf3d.world import World

_MOST_MIRRORS = 4
"""Most walls that show reflections: each takes the time of a picture."""


class Stage(NamedTuple):
    """What stands in a world."""

    structures: Structures
    """What its walls make up."""
    faces: Painted
    """Walls and roofs."""
    ground: GroundPicture
    exposure: Exposure
    """When the laser first lit it."""
    mirrors: Float
    """(m, 5) the longest walls that are mirrors, and their heights [m]."""


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
    mirrors = np.zeros((0, 5)) if run is None else _mirrors(run.world, structures.origin)
    faces, ground = lay_faces(structures, exposure), paint_ground(structures, canvas)
    return Stage(structures, faces, ground, exposure, mirrors)


def _mirrors(world: World, origin: Float) -> Float:
    chosen = np.flatnonzero(turning_walls(world))
    chosen = chosen[np.argsort(-lengths(world.segments[chosen]), kind="stable")[:_MOST_MIRRORS]]
    walls = world.segments[chosen] - np.tile(origin, 2)
    return np.column_stack([walls, world.heights[chosen]])
