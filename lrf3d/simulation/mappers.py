"""Mappers: what a simulation asks of one, and a wrapper for those that have only part of it."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from lrf3d.base.errors import InputError, shown
from lrf3d.geometry.lines import Float
from lrf3d.laser import LaserScan
from lrf3d.robot import EstimatedTrajectory

if TYPE_CHECKING:
    from lrf3d.simulation.run import Run


class Mapper(Protocol):
    """Anything that builds a map from scans; `FullMapper` has the parts that are optional."""

    def update(self, scan: Any, /) -> Any:
        """Add a LaserScan; a return value other than None is the map.

        A mapper whose attribute ``several`` is true gets those of several lasers as a tuple.
        """


class FullMapper(Mapper, Protocol):
    """A mapper with all parts that a simulation asks for; only `update` is required."""

    @property
    def map(self) -> Any:
        """The map after all scans so far: a LineMap, or anything else."""

    @property
    def estimate(self) -> EstimatedTrajectory | None:
        """The poses that it estimates, which pictures and films show next to the true ones."""

    @property
    def several(self) -> bool:
        """Whether it takes the scans of a moment as a tuple; else it gets them one by one."""

    @property
    def mode(self) -> str | None:
        """Its name in the summary of a run."""

    def drive(self, increment: Float, /) -> Any:
        """Take the odometry increment (3,) before each scan, if there is odometry."""

    def report(self, run: "Run", folder: Path, /) -> Mapping[str, Any] | None:
        """Texts and finite numbers for the summary of a run in a folder."""


class OptionalParts:
    """A mapper as a simulation asks it: the parts of `FullMapper` that it lacks are None."""

    def __init__(self, mapper: Mapper) -> None:
        self._mapper: Any = mapper
        if not callable(getattr(mapper, "update", None)):
            raise InputError(f"mapper {shown(mapper)}: expected an object with update(scan)")
        self._several = bool(getattr(mapper, "several", False))
        self._returned: Any = None
        self.mode: str | None = getattr(mapper, "mode", None)
        self.drive = self._method("drive")
        self.report = self._method("report")

    def _method(self, name: str) -> Callable[..., Any] | None:
        method = getattr(self._mapper, name, None)
        return method if callable(method) else None

    @property
    def map(self) -> Any:
        """The map after all scans so far; None if the mapper makes none."""
        return getattr(self._mapper, "map", None) if self._returned is None else self._returned

    @property
    def estimate(self) -> EstimatedTrajectory | None:
        """The poses that the mapper estimates, if it does."""
        estimate = getattr(self._mapper, "estimate", None)
        return estimate if isinstance(estimate, EstimatedTrajectory) else None

    def update(self, scans: Sequence[LaserScan]) -> None:
        """Update the mapper by the scans of a moment: one by one, or together if it takes them."""
        for each in [tuple(scans)] if self._several and len(scans) > 1 else scans:
            self._returned = self._mapper.update(each)
