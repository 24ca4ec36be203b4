"""Sensor: casts the true scan from a pose at a time, and adds noise."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.casting.timed import Caster, timed
from lrf3d.errors import InputError, expect
from lrf3d.geometry import Float
from lrf3d.laser import Chain, LaserRangeFinder, LaserScan, Noise
from lrf3d.robot import Trajectory
from lrf3d.world import World

CASTERS: dict[str, Callable[[World], Caster]] = {"embree": EmbreeCaster, "planar": PlanarCaster}
"""Casters by name."""


class Sensor:
    """A laser range finder among walls and dynamic obstacles, with its noise.

    Without the path of the robot all beams of a scan are cast from one pose.
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
        expect(lrf, LaserRangeFinder, "range finder")
        self.lrf, self.caster, self.noise = lrf, caster_of(caster, world), noise
        self._noisy = Chain([noise])
        self.cast = timed(self.caster, lrf, path, obstacles)

    def measure(
        self, pose: Float, time: float, rng: np.random.Generator
    ) -> tuple[LaserScan, LaserScan]:
        """The true and the measured scan from a pose (3,) at a time [s]."""
        true_scan = self.cast(self.lrf, pose, time)
        return true_scan, self.noisy(true_scan, rng)

    def noisy(self, true_scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """The measured scan of a true one."""
        scan = self._noisy(true_scan, rng)
        if not isinstance(scan, LaserScan) or len(scan.ranges) != self.lrf.beams:
            raise InputError(
                f"noise {self.noise!r} returned {_shown(scan)}; expected a LaserScan of"
                f" {self.lrf.beams} beams"
            )
        return scan


def _shown(scan: Any) -> str:
    """A short description of what a noise has returned."""
    if isinstance(scan, LaserScan):
        return f"one of {len(scan.ranges)}"
    return "None" if scan is None else f"a {type(scan).__name__}"


def caster_of(caster: Caster | str, world: World) -> Caster:
    """The caster for a world, by its name or as given."""
    if not isinstance(caster, str):
        return caster
    if caster not in CASTERS:
        raise InputError(f"caster {caster!r}: expected one of {', '.join(CASTERS)}")
    return CASTERS[caster](world)
