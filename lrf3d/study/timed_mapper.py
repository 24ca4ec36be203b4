"""A mapper with a watch: how long its updates take."""

from time import perf_counter
from typing import Any

from lrf3d.laser import LaserScan
from lrf3d.steps import Mapper


class Timed:
    """A mapper that is timed; in all else it is the mapper itself.

    Args:
        mapper: The mapper.
    """

    def __init__(self, mapper: Mapper) -> None:
        self._mapper = mapper
        self._seconds, self.updates = 0.0, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._mapper, name)

    def __repr__(self) -> str:
        return repr(self._mapper)

    def update(self, scan: LaserScan) -> Any:
        """Let the mapper take in a scan."""
        begin = perf_counter()
        found = self._mapper.update(scan)
        # What is compiled or loaded at the first scan is no part of what a scan takes.
        if self.updates:
            self._seconds += perf_counter() - begin
        self.updates += 1
        return found

    @property
    def milliseconds(self) -> float | None:
        """Mean time of an update after the first [ms]; None where there was no other."""
        return 1e3 * self._seconds / (self.updates - 1) if self.updates > 1 else None
