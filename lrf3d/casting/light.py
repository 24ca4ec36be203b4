"""Light of scans in worlds with materials, for both casters: ranges become echoes."""

import math
from typing import Any

import numpy as np

from lrf3d.casting.crowd import records
from lrf3d.casting.kernels.beams import RAY
from lrf3d.casting.kernels.echoes import (
    FIRST,
    LAST,
    MOST_WALLS,
    STRONGEST,
    SURFACE,
    Lit,
    Receiver,
    reflect,
)
from lrf3d.casting.kernels.light import NEAR, WallMaterials, light_rays
from lrf3d.casting.kernels.movers import CORNER, LEG, MOVER
from lrf3d.casting.kernels.tree import Plain, Tree
from lrf3d.casting.skyline import Rows
from lrf3d.geometry.lines import Float, Records, directions, lengths
from lrf3d.laser import LaserRangeFinder, Lidar
from lrf3d.laser.range_finder import turn
from lrf3d.world import World
from lrf3d.world.materials import BUILT_IN, PLAIN, Material

# What kernels call the choices of `LaserRangeFinder.echo`.
CHOICES = {"first": FIRST, "last": LAST, "strongest": STRONGEST}

# No obstacles, as kernels take them.
NOBODY = tuple(np.empty(0, kind) for kind in (MOVER, CORNER, LEG))

# What obstacles are made of.
OBSTACLES = BUILT_IN["dark cloth"]


class Lighting:
    """Lights the scans of one world."""

    def __init__(self, world: World) -> None:
        of_objects = [one or PLAIN for one in world.materials or [None] * world.object_count]
        rows = {material: row for row, material in enumerate(dict.fromkeys(of_objects))}
        kinds = np.array([rows[material] for material in of_objects], np.int64)[world.objects]
        surfaces = [(*one.optics, float(one.mirrors)) for one in (*rows, PLAIN, OBSTACLES)]
        along = world.segments[:, 2:] - world.segments[:, :2]
        bright = np.array([_dullness(one) for one in rows])[kinds]
        dull = along * (bright / lengths(world.segments))[:, None]
        self._optics = WallMaterials(
            world.segments, world.heights, kinds, np.array(surfaces, SURFACE), dull
        )

    def empty(self, lrf: LaserRangeFinder, *count: int, chains: bool = False) -> Lit:
        """Arrays for the light of scans or layers, and for the walls on the paths of beams."""
        shape = (*count, lrf.beams)
        slots = lrf.echoes if lrf.echoes > 1 else 0
        return Lit(
            np.empty(shape),
            np.empty(shape, np.int64),
            np.zeros(shape),
            np.full((*shape, slots), np.inf),
            np.zeros((*shape, slots)),
            np.full((*shape, MOST_WALLS if chains else 0), -1),
        )

    def light(
        self, lrf: LaserRangeFinder, tree: Tree, rays: Records, lit: Lit,
        obstacles: Plain = NOBODY, own: int = -1,
    ) -> None:  # fmt: skip
        """Light level rays (…, beams), whose ranges among walls and obstacles are known."""
        self._light(lrf, tree, rays, np.empty((0, 2)), lit, (obstacles, own))

    def reflected(self, lidar: Lidar, poses: Float, ranges: Float, walls: Rows) -> Float:
        """Intensities (layers, columns) of a lidar's beams from poses (columns, 3) or (1, 3).

        They are those of a range finder, by material, angle of incidence and range. Tops are of the
        material of their walls, the floor is of plaster; of obstacles, whose sides are not known
        here, the one that is hit faces the laser.
        """
        beams = lidar.directions((0.0, 0.0, 0.0))
        cos: Any = np.cos(poses[:, 2])
        sin: Any = np.sin(poses[:, 2])
        dx, dy = turn(beams[..., 0], beams[..., 1], cos, sin)
        rise = np.abs(beams[..., 2])
        optics = self._optics
        # The last row is that of beams that hit no wall, whose index is −1.
        along = np.vstack([directions(optics.segments), np.zeros(2)])[walls]
        tops = np.append(optics.heights, 0.0)[walls]
        kinds = np.append(optics.kinds, -1)[walls]
        z = lidar.mount[2] + np.where(np.isfinite(ranges), ranges, 0.0) * beams[..., 2]
        flat = np.abs(z - tops) < NEAR
        across = np.where(walls < 0, 1.0, np.abs(dx * along[..., 1] - dy * along[..., 0]))
        cosines = np.where(flat, rise, across)
        kinds[flat & (walls < 0)] = -2
        found = np.zeros(ranges.shape)
        reflect(cosines.ravel(), kinds.ravel(), optics.surfaces, ranges.ravel(), found.ravel())
        return found

    def light_layers(
        self, lrf: LaserRangeFinder, tree: Tree, origin: tuple[float, float, float], beams: Float
    ) -> Lit:
        """The light of layers of beams (layers, beams, 3) in 3D; the tree is over all walls."""
        lit = self.empty(lrf, len(beams), chains=True)
        x, y, z = origin
        rays = records(RAY, x, y, beams[..., 0], beams[..., 1], 0.0)
        rise = np.column_stack([np.full(rays.size, z), beams[..., 2].ravel()])
        self._light(lrf, tree, rays, rise, lit, (NOBODY, -1))
        return lit

    def _light(
        self, lrf: LaserRangeFinder, tree: Tree, rays: Records, inclined: Float, lit: Lit,
        among: tuple[Plain, int],
    ) -> None:  # fmt: skip
        flat: Any = tuple(each.reshape(rays.size, *each.shape[rays.ndim :]) for each in lit)
        movers, own = among
        limits = own, float(lrf.height), float(lrf.range_max)
        plain = (tree[:], self._optics[:], movers), limits
        if rays.size:
            light_rays(plain, _receiver(lrf), rays.ravel(), inclined, flat)


def _receiver(lrf: LaserRangeFinder) -> tuple[float, float, int, float]:
    """What a range finder makes of the light, for kernels."""
    return Receiver(
        float(lrf.threshold), float(lrf.near_field), CHOICES[lrf.echo], float(lrf.range_min)
    )[:]


def _dullness(material: Material) -> float:
    """How bright a material that only scatters light is at a right angle; NaN for another one."""
    if material.mirrors or material.passes or material.specular:
        return math.nan
    return material.diffuse + material.retro
