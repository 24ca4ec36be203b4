"""What casters share: batches of scans on all cores, and ranges within a range finder's limits."""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from lrf3d.casting.domain import Rationals
from lrf3d.casting.threads import share
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.laser.range_finder import within_limits
from lrf3d.pose import as_poses


class BatchCaster(ABC):
    """Casts many scans at a time by compiled code, and by rationals where that is not exact."""

    _rationals: Rationals

    def cast_batch(self, lrf: LaserRangeFinder, poses: Float) -> Float:
        """Ranges (k, beams) from poses (k, 3), on all cores."""
        return self._cast_batch(lrf, poses, np.empty((0, lrf.beams), np.int64))

    def scan_batch(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int]:
        """Ranges and walls (k, beams) from poses (k, 3), on all cores."""
        walls = np.empty((len(poses), lrf.beams), np.int64)
        return self._cast_batch(lrf, poses, walls), walls

    @abstractmethod
    def _kernel(self, lrf: LaserRangeFinder) -> Callable[[Float, Float, Int], None]:
        """What fills the ranges (k, beams) of poses (k, 3), and the walls unless empty."""

    def _cast_batch(self, lrf: LaserRangeFinder, poses: Float, walls: Int) -> Float:
        poses = np.ascontiguousarray(as_poses(poses))
        ranges = np.empty((len(poses), lrf.beams))
        if not self._rationals.for_all(lrf):
            cast = self._kernel(lrf)

            def work(start: int, stop: int) -> None:
                cast(poses[start:stop], ranges[start:stop], walls[start:stop])

            share(work, len(poses))
        self._rationals.mend(lrf, poses, ranges, walls)
        return ranges


def limited(lrf: LaserRangeFinder, distances: Float, walls: Int) -> tuple[Float, Int]:
    """Ranges and walls of a whole number of scans (…, beams); without a range the wall is −1."""
    ranges = within_limits(distances, lrf.range_min, lrf.range_max).reshape(-1, lrf.beams)
    return ranges, np.where(np.isfinite(ranges), walls.reshape(-1, lrf.beams), -1)
