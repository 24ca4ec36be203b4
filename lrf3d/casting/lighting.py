"""Lighting: the light of scans in worlds with materials, for both casters.

Ranges among the walls come in, from either caster; what leaves are the ranges, walls and
intensities of the echoes that the laser reports. Compiled code follows the beams behind mirrors and
glass, and rationals decide what it leaves open.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from lrf3d.casting.exact import RationalCaster
from lrf3d.casting.exact_light import Echo, ExactLight
from lrf3d.casting.kernels.echoes import (
    FIRST,
    LAST,
    MOST_ECHOES,
    MOST_WALLS,
    STRONGEST,
    Lit,
    Receiver,
    report,
)
from lrf3d.casting.kernels.light import light_scans
from lrf3d.casting.kernels.scans import laser_of
from lrf3d.casting.kernels.tree import Tree
from lrf3d.casting.mesh_scene import MeshScene
from lrf3d.geometry import Bool, Float, Int, lengths
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World
from lrf3d.world.materials import PLAIN, Material

CHOICES = {"first": FIRST, "last": LAST, "strongest": STRONGEST}
"""What kernels call the choices of `LaserRangeFinder.echo`."""

_report = getattr(report, "py_func", report)


class _Level(NamedTuple):
    """The walls that reach up to the height of the laser.

    Attributes:
        tree: The tree over them.
        solid: (m,) which of them, in the order of the tree, let nothing pass.
        places: (n,) row of each wall of the world in the tree, or −1.
        tall: (m,) which walls of the world they are.
        exact: The same walls for rationals.
    """

    tree: Tree
    solid: Bool
    places: Int
    tall: Int
    exact: ExactLight


class Lighting:
    """Lights the scans of one world.

    Args:
        world: The world.
        tree: Returns the tree over the walls that reach up to a height [m].
    """

    def __init__(self, world: World, tree: Callable[[float], Tree]) -> None:
        self._world, self._tree = world, tree
        self._rationals = RationalCaster(world)
        self._levels: dict[int, _Level] = {}
        of_objects = [one or PLAIN for one in world.materials]
        of_objects = of_objects or [PLAIN] * world.object_count
        rows = {material: row for row, material in enumerate(dict.fromkeys(of_objects))}
        kinds = np.array([rows[material] for material in of_objects], np.int64)
        self._of_objects: list[Material] = of_objects
        self._kinds = kinds[world.objects]
        self._table = np.array(
            [(*one.optics, float(one.mirrors), float(one.passes)) for one in rows]
        ).reshape(-1, 8)
        along = world.segments[:, 2:] - world.segments[:, :2]
        bright = np.array([_dullness(one) for one in rows])[self._kinds]
        self._dull = along * (bright / lengths(world.segments))[:, None]
        self._heights = np.unique(world.heights)

    def empty(self, lrf: LaserRangeFinder, count: int, *, chains: bool = False) -> Lit:
        """Arrays for the light of ``count`` scans, and for the walls on the way if wanted."""
        beams, slots = lrf.beams, lrf.echoes if lrf.echoes > 1 else 0
        return Lit(
            np.empty((count, beams)),
            np.empty((count, beams), np.int64),
            np.zeros((count, beams)),
            np.full((count, beams, slots), np.inf),
            np.zeros((count, beams, slots)),
            np.full((count, beams, MOST_WALLS) if chains else (count, 0, 0), -1),
            np.zeros((count, beams), np.bool_),
        )

    def light(
        self,
        lrf: LaserRangeFinder,
        cast: Callable[[Float, Float, Int], None] | None,
        poses: Float,
        lit: Lit,
        rows: tuple[int, int],
    ) -> None:
        """Light scans from some of the poses (k, 3).

        Args:
            lrf: The range finder.
            cast: Fills the ranges and walls of scans among the walls, from a range_min of 0; None
                where all scans need rationals.
            poses: The poses.
            lit: What is filled, (k, …) each.
            rows: The first of the poses, and the one after the last.
        """
        poses = np.ascontiguousarray(poses[slice(*rows)])
        lit = _rows(lit, slice(*rows))
        level, receiver = self._level(lrf.height), receiver_of(lrf)
        if cast is None:
            lit.ranges[:], lit.walls[:], lit.undecided[:] = np.inf, -1, True
        else:
            cast(poses, lit.ranges, lit.walls)
            optics = self._world.segments, self._kinds, self._table, self._dull
            light_scans(
                level.tree[:],
                (*optics, level.places, level.solid),
                receiver[:],
                laser_of(lrf),
                poses,
                lit[:],
            )
            lit.undecided[self._rationals.all_needed(poses)] = True
        if lit.undecided.any():
            for row in np.flatnonzero(lit.undecided.any(axis=1)).tolist():
                self._decide(lrf, poses[row], level, receiver, _rows(lit, row))

    def light_solid(
        self, lrf: LaserRangeFinder, scene: MeshScene, origin: Float, beams: Float
    ) -> Lit:
        """The light of beams (n, 3) in 3D from an origin (3,), a whole number of scans of them."""
        from lrf3d.casting.kernels.solid_light import light_solid

        scans = self.empty(lrf, len(beams) // lrf.beams, chains=True)
        arrays: Any = [array.reshape(len(beams), *array.shape[2:]) for array in scans]
        optics = self._world.segments, self._kinds, self._table
        receiver, mesh = receiver_of(lrf)[:], (scene.corners, scene.owners)
        beams, reach = np.ascontiguousarray(beams), float(lrf.range_max)
        light_solid(scene.tree[:], mesh, optics, receiver, reach, origin, beams, tuple(arrays))
        return scans

    def _decide(
        self, lrf: LaserRangeFinder, pose: Float, level: _Level, receiver: Receiver, lit: Lit
    ) -> None:
        """Light by rationals the beams of a scan that are undecided."""
        directions = lrf.directions(pose)
        for beam in np.flatnonzero(lit.undecided).tolist():
            found = level.exact.echoes(
                (float(pose[0]), float(pose[1])),
                (float(directions[beam, 0]), float(directions[beam, 1])),
                range_max=lrf.range_max,
                near_field=lrf.near_field,
            )
            seen = [echo for echo in found if echo.intensity >= lrf.threshold]
            echoes, ways = _columns(seen, lrf.range_min, level.tall)
            _report(echoes, ways, len(seen), receiver, beam, lit)

    def _level(self, height: float) -> _Level:
        number = int(self._heights.searchsorted(height))
        if number not in self._levels:
            tree = self._tree(height)
            places = np.full(len(self._world.segments), -1, np.int64)
            places[tree.rows] = np.arange(len(tree.rows))
            solid = self._table[self._kinds[tree.rows], 7] == 0.0
            tall = np.flatnonzero(self._world.heights >= height)
            objects = self._world.objects[tall].tolist()
            materials: list[Material | None] = [self._of_objects[number] for number in objects]
            exact = ExactLight(self._world.segments[tall], materials)
            self._levels[number] = _Level(tree, solid, places, tall, exact)
        return self._levels[number]


def receiver_of(lrf: LaserRangeFinder) -> Receiver:
    """What a range finder makes of the light, for kernels."""
    range_min, choice = float(lrf.range_min), CHOICES[lrf.echo]
    return Receiver(float(lrf.threshold), float(lrf.near_field), choice, range_min)


def _dullness(material: Material) -> float:
    """How bright a material that only scatters light is at a right angle; NaN for another one."""
    if material.mirrors or material.passes or material.specular:
        return math.nan
    return material.diffuse + material.retro


def _rows(lit: Lit, rows: int | slice) -> Lit:
    """The light of one scan or of some."""
    arrays: Any = [array[rows] for array in lit]
    return Lit(*arrays)


def _columns(echoes: list[Echo], range_min: float, tall: Int) -> tuple[Float, Int]:
    """Echoes as kernels have them: (MOST_ECHOES, 3) numbers and (MOST_ECHOES, MOST_WALLS) walls."""
    rows, ways = np.zeros((MOST_ECHOES, 3)), np.full((MOST_ECHOES, MOST_WALLS), -1, np.int64)
    for row, echo in enumerate(echoes):
        way = float(echo.way)
        if echo.way < range_min:
            # Rounding must not bring it within the limit.
            way = min(way, float(np.nextafter(range_min, 0.0)))
        rows[row] = way, echo.intensity, len(echo.chain)
        ways[row, : len(echo.chain)] = tall[list(echo.chain)]
    return rows, ways
