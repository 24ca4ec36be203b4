"""Mapping: from scans to a map of line segments (section 3 of Teslić et al.).

The mapper is compiled, which takes a library that readers of finished maps need not wait for: it
is loaded when it is first used.
"""

from typing import TYPE_CHECKING

from lrf3d.lazy import loading
from lrf3d.mapping.line_map import LineMap, load_map, save_map

if TYPE_CHECKING:
    from lrf3d.mapping.mapper import LineMapper
else:
    __getattr__, __dir__ = loading(globals(), {"mapper": "LineMapper"})

__all__ = ["LineMap", "LineMapper", "load_map", "save_map"]
