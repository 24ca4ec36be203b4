"""Light of scans in worlds with materials, for both casters: ranges become echoes."""

import math
from typing import Any

import numpy as np

from lrf3d.casting.kernels.echoes import FIRST, LAST, MOST_WALLS, STRONGEST, Lit, Receiver
from lrf3d.casting.kernels.light import Optics, light_beams, light_scans
from lrf3d.casting.kernels.scans import laser_of
from lrf3d.casting.kernels.tree import Tree
from lrf3d.geometry import Float, lengths
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World
from lrf3d.world.materials import PLAIN, Material

CHOICES = {"first": FIRST, "last": LAST, "strongest": STRONGEST}
"""What kernels call the choices of `LaserRangeFinder.echo`."""


class Lighting:
    """Lights the scans of one world."""

    def __init__(self, world: World) -> None:
        of_objects = [one or PLAIN for one in world.materials]
        rows = {material: row for row, material in enumerate(dict.fromkeys(of_objects))}
        kinds = np.array([rows[material] for material in of_objects], np.int64)[world.objects]
        table = np.array([(*one.optics, float(one.mirrors)) for one in rows]).reshape(-1, 7)
        along = world.segments[:, 2:] - world.segments[:, :2]
        bright = np.array([_dullness(one) for one in rows])[kinds]
        dull = along * (bright / lengths(world.segments))[:, None]
        self._optics = Optics(world.segments, world.heights, kinds, table, dull)

    def empty(self, lrf: LaserRangeFinder, count: int, *, chains: bool = False) -> Lit:
        """Arrays for the light of ``count`` scans, and for the walls on the path if wanted."""
        beams, slots = lrf.beams, lrf.echoes if lrf.echoes > 1 else 0
        return Lit(
            np.empty((count, beams)),
            np.empty((count, beams), np.int64),
            np.zeros((count, beams)),
            np.full((count, beams, slots), np.inf),
            np.zeros((count, beams, slots)),
            np.full((count, beams, MOST_WALLS) if chains else (count, 0, 0), -1),
        )

    def light(self, lrf: LaserRangeFinder, tree: Tree, poses: Float, lit: Lit, part: slice) -> None:
        """Light the part of the scans from poses (k, 3), whose ranges among the walls are known."""
        rows: Any = tuple(array[part] for array in lit)
        light_scans(tree[:], self._optics[:], _receiver(lrf), laser_of(lrf), poses[part], rows)

    def light_layers(
        self, lrf: LaserRangeFinder, tree: Tree, origin: tuple[float, float, float], beams: Float
    ) -> Lit:
        """The light of layers of beams (layers, beams, 3) in 3D; the tree is over all walls."""
        lit = self.empty(lrf, len(beams), chains=True)
        rays, reach = np.ascontiguousarray(beams.reshape(-1, 3)), float(lrf.range_max)
        flat: Any = tuple(array.reshape(len(rays), *array.shape[2:]) for array in lit)
        light_beams(tree[:], self._optics[:], _receiver(lrf), reach, origin, rays, flat)
        return lit


def _receiver(lrf: LaserRangeFinder) -> tuple[float, float, int, float]:
    """What a range finder makes of the light, for kernels."""
    numbers = float(lrf.threshold), float(lrf.near_field), CHOICES[lrf.echo], float(lrf.range_min)
    return Receiver(*numbers)[:]


def _dullness(material: Material) -> float:
    """How bright a material that only scatters light is at a right angle; NaN for another one."""
    if material.mirrors or material.passes or material.specular:
        return math.nan
    return material.diffuse + material.retro
