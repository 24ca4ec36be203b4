"""Mapping: from scans to a map of line segments (section 3 of Teslić et al.).

The mapper is compiled, which takes a library that readers of finished maps need not wait for: it
is loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from lrf3d.mapping.line_map import LineMap, load_map, save_map

if TYPE_CHECKING:
    from lrf3d.mapping.mapper import LineMapper
    from lrf3d.mapping.vertices import fit_vertices

_HOME = {"LineMapper": "mapper", "fit_vertices": "vertices"}

__all__ = ["LineMap", "LineMapper", "fit_vertices", "load_map", "save_map"]


def __getattr__(name: str) -> object:
    """Load a public name from its module at its first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'lrf3d.mapping' has no attribute {name!r}")
    value = getattr(import_module(f"lrf3d.mapping.{_HOME[name]}"), name)
    globals()[name] = value
    return value
