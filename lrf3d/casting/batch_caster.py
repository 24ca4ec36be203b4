"""BatchCaster: scans one by one and many at a time on all cores, exact whatever their numbers."""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.casting.exact import RationalCaster
from lrf3d.cores import core_count
from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.laser.range_finder import within_limits
from lrf3d.pose import as_pose, as_poses

if TYPE_CHECKING:
    from lrf3d.casting.kernels.echoes import Lit
    from lrf3d.casting.lighting import Lighting

PIECES_A_CORE = 8
"""Pieces of work for each core: with fewer the slowest core decides, with more Python's lock
does."""

LEAST_PIECE = 8
"""Least number of items in a piece."""


class Kernels(NamedTuple):
    """Compiled code that casts the scans of one range finder.

    Attributes:
        scan: Returns the ranges and walls (beams,) of the scan from x, y, theta.
        scans: Fills ranges (k, beams) of the scans from poses (k, 3), and walls unless empty.
    """

    scan: Callable[[float, float, float], tuple[Float, Int]]
    scans: Callable[[Float, Float, Int], None]


class BatchCaster(ABC):
    """Casts scans by compiled code, and by rationals where that would not be exact."""

    _rationals: RationalCaster
    _latest: tuple[LaserRangeFinder | None, Kernels | None] = None, None
    _lights: "Lighting | None" = None

    def cast(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> LaserScan:
        """The true scan from a pose."""
        pose = as_pose(pose)
        if self._lights is not None:
            lit = self._lit(lrf, np.array([pose]))
            echoes = (lit.echo_ranges[0], lit.echo_intensities[0]) if lrf.echoes > 1 else ()
            return LaserScan.unchecked(
                lrf, pose, lit.ranges[0], lit.walls[0], lit.intensities[0], *echoes
            )
        latest, kernels = self._latest
        if latest is not lrf:
            kernels = self._latest_kernels(lrf)
        if kernels is None or self._rationals.needed(*pose):
            return LaserScan.unchecked(lrf, pose, *self._rationals.cast(lrf, pose))
        return LaserScan.unchecked(lrf, pose, *kernels.scan(*pose))

    def cast_batch(self, lrf: LaserRangeFinder, poses: ArrayLike) -> Float:
        """Ranges (k, beams) from poses (k, 3), on all cores."""
        return self._cast_batch(lrf, as_poses(poses), np.empty((0, lrf.beams), np.int64))

    def scan_batch(self, lrf: LaserRangeFinder, poses: ArrayLike) -> tuple[Float, Int]:
        """Ranges and walls (k, beams) from poses (k, 3), on all cores."""
        poses = as_poses(poses)
        walls = np.empty((len(poses), lrf.beams), np.int64)
        return self._cast_batch(lrf, poses, walls), walls

    def chains(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> Int:
        """The walls (beams, k) on the way of each beam of a scan: mirrors, glass, and the last.

        −1 stands after the last; without a range all are −1. k is the longest way.

        Examples:
            >>> import lrf3d
            >>> walls = [[2, -1, 4, 1], [0, 3, 6, 3]]
            >>> world = lrf3d.World(walls, objects=[0, 1], materials=["mirror", "plaster"])
            >>> caster = lrf3d.PlanarCaster(world)
            >>> ahead = lrf3d.LaserRangeFinder(0.0, 0.0, beams=1)
            >>> caster.chains(ahead, (0, 0, 0)).tolist()
            [[0, 1]]
            >>> caster.cast(ahead, (0, 0, 0)).ranges.tolist()
            [6.0]
        """
        chains: Int = self.chain_batch(lrf, [as_pose(pose)])[1][0]
        longest = max(1, int((chains >= 0).sum(axis=1).max(initial=0)))
        found: Int = chains[:, :longest]
        return found

    def chain_batch(self, lrf: LaserRangeFinder, poses: ArrayLike) -> tuple[Float, Int]:
        """Ranges (k, beams) from poses (k, 3), and the walls (k, beams, n) on the ways, then −1."""
        if self._lights is None:
            ranges, walls = self.scan_batch(lrf, poses)
            return ranges, walls[:, :, None]
        lit = self._lit(lrf, np.ascontiguousarray(as_poses(poses)), chains=True)
        return lit.ranges, lit.chains

    def light_batch(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int, Float]:
        """Ranges, walls and intensities (k, beams) from poses (k, 3), on all cores.

        Raises:
            InputError: The world has no materials.
        """
        if self._lights is None:
            raise InputError("world without materials: its scans have no intensities")
        lit = self._lit(lrf, np.ascontiguousarray(as_poses(poses)))
        return lit.ranges, lit.walls, lit.intensities

    def _lit(self, lrf: LaserRangeFinder, poses: Float, *, chains: bool = False) -> "Lit":
        """The light of scans from poses (k, 3), on all cores."""
        lights = self._lights
        assert lights is not None
        latest, kernels = self._latest
        if latest is not lrf:
            kernels = self._latest_kernels(lrf)
        cast = None if kernels is None else kernels.scans
        lit = lights.empty(lrf, len(poses), chains=chains)

        def work(start: int, stop: int) -> None:
            lights.light(lrf, cast, poses, lit, (start, stop))

        share(work, len(poses))
        return lit

    def _latest_kernels(self, lrf: LaserRangeFinder) -> Kernels | None:
        """The code for a range finder, kept until another one is cast; None for rationals."""
        # Mirrors may be nearer than range_min, and what they show beyond it.
        cast = lrf if self._lights is None else lrf.from_zero
        kernels = None if self._rationals.for_all(lrf) else self._kernels(cast)
        # One assignment, because other threads may cast with other range finders.
        self._latest = lrf, kernels
        return kernels

    @abstractmethod
    def _kernels(self, lrf: LaserRangeFinder) -> Kernels:
        """The compiled code for a range finder."""

    def _cast_batch(self, lrf: LaserRangeFinder, poses: Float, walls: Int) -> Float:
        poses = np.ascontiguousarray(as_poses(poses))
        if self._lights is not None:
            lit = self._lit(lrf, poses)
            walls[:] = lit.walls[: len(walls)]
            return lit.ranges
        ranges = np.empty((len(poses), lrf.beams))
        if not self._rationals.for_all(lrf):
            cast = self._kernels(lrf).scans

            def work(start: int, stop: int) -> None:
                cast(poses[start:stop], ranges[start:stop], walls[start:stop])

            share(work, len(poses))
        self._rationals.correct(lrf, poses, ranges, walls)
        return ranges


def limited(lrf: LaserRangeFinder, distances: Float, walls: Int) -> tuple[Float, Int]:
    """Ranges and walls of a whole number of scans (…, beams); without a range the wall is −1."""
    ranges = within_limits(distances, lrf.range_min, lrf.range_max).reshape(-1, lrf.beams)
    return ranges, np.where(np.isfinite(ranges), walls.reshape(-1, lrf.beams), -1)


def share(work: Callable[[int, int], None], count: int) -> None:
    """Call work(start, stop) for pieces of range(count), in one thread for each core."""
    cores = core_count()
    size = max(LEAST_PIECE, -(-count // (PIECES_A_CORE * cores)))
    starts = range(0, count, size)
    if len(starts) < 2 or cores < 2:
        work(0, count)
        return
    # Advancing the iterator holds Python's lock, so each piece goes to exactly one thread.
    rest = iter(starts)

    def work_on() -> None:
        for start in rest:
            work(start, min(start + size, count))

    others = [_pool(cores - 1).submit(work_on) for _ in range(min(cores, len(starts)) - 1)]
    try:
        work_on()
    finally:
        wait(others)
    for other in others:
        other.result()


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads that are kept: starting new ones for each batch would cost a sixth of its time."""
    return ThreadPoolExecutor(threads, thread_name_prefix="lrf3d")


if hasattr(os, "register_at_fork"):  # pragma: no branch - Windows has no fork
    # The threads of its parent do not exist in a forked process.
    os.register_at_fork(after_in_child=_pool.cache_clear)
