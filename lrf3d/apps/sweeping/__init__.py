"""Sweeps: many runs over worlds, mappers, settings and seeds, on one machine or on many.

A plan lists all runs with keys that are derived from their contents, and any executor of
`concurrent.futures` makes them. Each result is appended to a file as it comes; it does not depend
on where or when it was computed.
"""

from lrf3d.apps.sweeping.running import sweep
from lrf3d.apps.sweeping.table import SweepTable

__all__ = ["SweepTable", "sweep"]
