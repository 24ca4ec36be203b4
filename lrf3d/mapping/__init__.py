"""Mapping: from scans to a map of line segments (section 3 of Teslić et al.)."""

from lrf3d.mapping.line_map import LineMap, load_map, save_map
from lrf3d.mapping.mapper import LineMapper

__all__ = ["LineMap", "LineMapper", "load_map", "save_map"]
