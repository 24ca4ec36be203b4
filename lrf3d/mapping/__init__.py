"""Mapping: from scans to a map of line segments in unions (section 3 of Teslić et al.)."""

from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.line_mapper import LineMapper

__all__ = ["LineMap", "LineMapper"]
