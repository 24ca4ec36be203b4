"""LogScore: how well a map predicts scans that it was not built from, without a truth."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lrf3d.base.errors import each_of, expect
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import Float, lengths
from lrf3d.laser import LaserScan, beam_directions, reflection_points
from lrf3d.laser.unrolling import unrolled
from lrf3d.mapping import LineMap
from lrf3d.scoring.map_score import Report
from lrf3d.scoring.matching import REACH
from lrf3d.world import World


@dataclass(frozen=True, slots=True)
class LogScore(Report):
    """How well a map of some segments, with a total length [m], predicts scans.

    Args:
        explained: Share of the returns that count within 0.1 m of a map segment.
        violation: Share of them whose beam hits the map over 0.2 m before the return.
        median_range_error: Median |map range − measured range| [m] of those whose beam hits the
            map; NaN if none does.
    """

    explained: float
    violation: float
    median_range_error: float
    segments: int
    length: float
    scans: int
    returns: int


def score_log(line_map: LineMap, scans: Iterable[LaserScan]) -> LogScore:
    """Score a map by test scans; usually the even scans build the map and the odd ones test it.

    The test scans are others than those that the map was built from; they are read once.
    """
    import shapely

    expect(line_map, LineMap, "map")
    solid = line_map.segments[lengths(line_map.segments) > 0.0]
    tree = shapely.STRtree(shapely.linestrings(solid.reshape(-1, 2, 2)))
    caster = PlanarCaster(World(solid))
    explained = [0]
    beyond = [np.empty(0)]
    # Range limits [m] of the returns that count: nearer ones hit the robot, farther ones are
    # sparse.
    nearest_return = 0.1
    farthest_return = 20.0
    for scan in map(unrolled, each_of(scans, LaserScan, "scan")):
        judged = (scan.ranges > nearest_return) & (scan.ranges < farthest_return)
        places = reflection_points(scan.pose, scan.angles[judged], scan.ranges[judged])
        near, _ = tree.query(shapely.points(places), "dwithin", REACH)
        explained.append(len(np.unique(near)))
        beyond.append(scan.ranges[judged] - _map_ranges(caster, scan)[judged])
    errors = np.concatenate(beyond)
    returns = len(errors)
    met = np.isfinite(errors)
    # Distance [m] between map and return above which a beam violates the map.
    violated_beyond = 2.0 * REACH
    return LogScore(
        explained=sum(explained) / returns if returns else np.nan,
        violation=float((errors > violated_beyond).sum()) / returns if returns else np.nan,
        median_range_error=float(np.median(np.abs(errors[met]))) if met.any() else np.nan,
        segments=len(line_map),
        length=float(lengths(line_map.segments).sum()),
        scans=len(explained) - 1,
        returns=returns,
    )


def _map_ranges(caster: PlanarCaster, scan: LaserScan) -> Float:
    """Ranges (beams,) [m] to the map; +inf where it is not hit."""
    ways = beam_directions(scan.pose.theta, scan.angles)
    ranges, _ = caster.cast_rays(np.tile(scan.pose[:2], (len(ways), 1)), ways)
    return np.where(ranges > scan.range_max, np.inf, ranges)
