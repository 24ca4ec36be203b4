"""Mapping: from scans to a map of line segments in unions (section 3 of Teslić et al.)."""

from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.line_mapper import LineMapper
from lrf3d.mapping.vertex_fit import fit_vertices

__all__ = ["LineMap", "LineMapper", "fit_vertices"]
