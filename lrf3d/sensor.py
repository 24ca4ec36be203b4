"""Sensor: casts the true scan from a pose at a time, and adds noise."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.casting.timed import Caster, timed
from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan, Noise, ProportionalNoise
from lrf3d.laser.echoes import measured
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory
from lrf3d.world import World

CASTERS: dict[str, Callable[[World], Caster]] = {"embree": EmbreeCaster, "planar": PlanarCaster}
"""Casters by name."""


class Sensor:
    """A laser range finder among walls and dynamic obstacles, with its noise.

    The beams are cast by ``embree``, ``planar``, or an object with ``cast``. Along a path of the
    robot during its scans each beam is cast from its own pose; without one all are from one pose.

    Raises:
        InputError: There is no such caster, or a scan takes longer than the interval to the next.
    """

    def __init__(
        self,
        world: World,
        lrf: LaserRangeFinder,
        *,
        caster: Caster | str,
        noise: Noise,
        obstacles: Sequence[DynamicObstacle] = (),
        path: Trajectory | None = None,
    ) -> None:
        self.lrf, self.caster, self.noise = lrf, caster_of(caster, world), noise
        # A user's caster need not cast scans in batches, and noises may need intensities.
        alone = obstacles or path or world.materials
        self._cast_batch: Any = None if alone else getattr(self.caster, "scan_batch", None)
        self._cast = timed(self.caster, lrf, path, obstacles)

    def measure(
        self, pose: Float, time: float, rng: np.random.Generator
    ) -> tuple[LaserScan, LaserScan]:
        """The true and the measured scan from a pose (3,) at a time [s].

        Raises:
            InputError: The noise does not return a valid scan.
        """
        true_scan = self._cast(self.lrf, pose, time)
        scan = measured(true_scan, self.noise, rng)
        self._check(scan)
        return true_scan, scan

    def measure_batch(
        self, poses: Float, times: Float, rng: np.random.Generator
    ) -> tuple[Float, Float, Int]:
        """Measured and true ranges and walls, (k, beams) each, from poses (k, 3) at times (k,) [s].

        They equal those of `measure`; without dynamic obstacles and motion the beams of all scans
        are cast in one batch.
        """
        if self._cast_batch is not None:
            truth, walls = self._cast_batch(self.lrf, poses)
            if self.noise == ProportionalNoise(0.0):
                return truth, truth, walls
            scans = [
                LaserScan.unchecked(self.lrf, Pose(*pose), *row).at_time(time)
                for pose, time, *row in zip(
                    poses.tolist(), times.tolist(), truth, walls, strict=True
                )
            ]
        else:
            scans = [
                self._cast(self.lrf, pose, time)
                for pose, time in zip(poses, times.tolist(), strict=True)
            ]
            truth = np.array([scan.ranges for scan in scans])
            walls = np.array([scan.walls for scan in scans])
        ranges = np.empty_like(truth)
        for row, true_scan in zip(ranges, scans, strict=True):
            scan = measured(true_scan, self.noise, rng)
            self._check(scan)
            row[:] = scan.ranges
        return ranges, truth, walls

    def _check(self, scan: Any) -> None:
        """Check that a noise has returned a valid scan.

        Raises:
            InputError: It has not.
        """
        if not isinstance(scan, LaserScan) or len(scan.ranges) != self.lrf.beams:
            raise InputError(
                f"noise {self.noise!r} returned {_shown(scan)}; expected a LaserScan of"
                f" {self.lrf.beams} beams"
            )


def _shown(scan: Any) -> str:
    """A short description of what a noise has returned."""
    if isinstance(scan, LaserScan):
        return f"one of {len(scan.ranges)}"
    return "None" if scan is None else f"a {type(scan).__name__}"


def caster_of(caster: Caster | str, world: World) -> Caster:
    """The caster for a world, by its name or as given.

    Raises:
        InputError: There is no such caster.
    """
    if not isinstance(caster, str):
        return caster
    if caster not in CASTERS:
        raise InputError(f"caster {caster!r}: expected one of {', '.join(CASTERS)}")
    return CASTERS[caster](world)
