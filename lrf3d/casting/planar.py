"""PlanarCaster: exact ranges among the walls of a world, in the plane (section 2.3)."""

from functools import partial

import numpy as np

from lrf3d.casting.batch_caster import BatchCaster, Kernels
from lrf3d.casting.exact import RationalCaster
from lrf3d.casting.kernels.scans import cast_scan, cast_scans, laser_of
from lrf3d.casting.kernels.tree import Tree, build_tree
from lrf3d.errors import InputError, shown
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World


class PlanarCaster(BatchCaster):
    """Casts scans at the walls of a world that reach up to the height of the beams.

    For the float64 pose, directions and walls the wall that a beam hits is exact; of walls at the
    same distance it is the first. The range is that distance, to within half a unit in its last
    place.

    Examples:
        >>> import lrf3d
        >>> caster = lrf3d.PlanarCaster(lrf3d.World([[3, -5, 3, 5]]))
        >>> scan = caster.cast(lrf3d.LaserRangeFinder(beams=3), (1, 0, 0))
        >>> scan.ranges.tolist(), scan.walls.tolist()
        ([inf, 2.0, inf], [-1, 0, -1])
    """

    def __init__(self, world: World) -> None:
        if not isinstance(world, World):
            raise InputError(f"caster for {shown(world)}: expected a World")
        self.world = world
        self._levels = np.unique(world.heights)
        self._trees: dict[int, Tree] = {}
        self._rationals = RationalCaster(world)
        if world.materials:
            from lrf3d.casting.lighting import Lighting

            self._lights = Lighting(world, self.tree)

    def tree(self, height: float) -> Tree:
        """The tree over the walls that reach up to a height [m]; built once for each level."""
        level = int(self._levels.searchsorted(height))
        if level not in self._trees:
            tall = np.flatnonzero(self.world.heights >= height).astype(np.int32)
            self._trees[level] = build_tree(self.world.segments[tall], tall)
        return self._trees[level]

    def _kernels(self, lrf: LaserRangeFinder) -> Kernels:
        return planar_kernels(self.tree(lrf.height), lrf)


def planar_kernels(tree: Tree, lrf: LaserRangeFinder) -> Kernels:
    """The compiled code that casts the scans of a range finder at the walls of a tree."""
    fixed = tree[:], laser_of(lrf)
    return Kernels(partial(cast_scan, *fixed), partial(cast_scans, *fixed))
