"""Revision: a map is checked against the beams of all scans, and walls are put right by them.

Enter the walls that uniting left, and the beams; leave walls cut where beams passed through them,
bent where the points bend, without second copies, and grouped into objects.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lrf3d.geometry import directions, lengths
from lrf3d.mapping.bridges import bridge_walls
from lrf3d.mapping.corners import close_corners
from lrf3d.mapping.evidence import PIECE, weigh
from lrf3d.mapping.facets import PASS, cut
from lrf3d.mapping.links import join_objects
from lrf3d.mapping.scan_archive import Beams
from lrf3d.mapping.table import SegmentTable
from lrf3d.mapping.wall_merging import Rule
from lrf3d.mapping.wall_rows import Walls
from lrf3d.mapping.wall_store import WallStore

ROUNDS = 2
"""How often walls are cut and united again: what the first round frees, the second gathers."""

SHORT_WALL = 0.5
"""Walls shorter than this [m] need twice the beams: clutter makes short ones of any few returns."""

REACH = 2.0
"""How far [m] a wall is followed beyond what one scan showed of it, to what single beams met."""


class Noise(NamedTuple):
    """Deviation of a range: the root of floor² + (growth · range)².

    Args:
        floor: Deviation at no distance [m].
        growth: Growth with the range.
    """

    floor: float
    growth: float


def revise(table: SegmentTable, beams: Beams, noise: Noise, rule: Rule, least: int) -> SegmentTable:
    """The walls of a table, put right by the beams that saw them.

    Args:
        table: Walls.
        beams: The beams of all scans.
        noise: Their noise.
        rule: What one wall is.
        least: Walls on which fewer beams than this ended are left out.
    """
    for turn in range(ROUNDS):
        # Scans show parts of walls; what single beams met beyond them counts in the first round.
        reach = 0.0 if turn else REACH
        if turn:
            table = _bridged(_united(table, rule), rule, beams, noise)
        if not len(table):
            return table
        units = directions(table.ends)
        table = replace(table, ends=table.ends + np.hstack([-reach * units, reach * units]))
        pieces = np.maximum(np.ceil(lengths(table.ends) / PIECE).astype(np.int64), 1)
        first = np.concatenate([[0], np.cumsum(pieces)])
        counts, sums = weigh(table.ends, first, beams, rule.distance, *noise, reach)
        ends, moments, labels = cut(table.ends, first, counts, sums)
        ended, passed = labels[:, 1], labels[:, 2]
        needed = np.where(lengths(ends) < SHORT_WALL, 2 * least, least)
        stands = (ended >= needed) & (PASS * passed <= ended)
        table = SegmentTable(ends, moments, ended, np.arange(len(ends))).take(
            np.flatnonzero(stands)
        )
    table = replace(table, unions=join_objects(table.ends, beams, *noise))
    close_corners(table.ends, table.unions)
    return table


def _united(table: SegmentTable, rule: Rule) -> SegmentTable:
    """The walls of a table, united once more."""
    store = WallStore(rule)
    labels = np.column_stack([table.points, np.arange(len(table))])
    store.add(table.ends, table.moments, labels, (0.0, 0.0))
    return store.table(store.version)


def _bridged(table: SegmentTable, rule: Rule, beams: Beams, noise: Noise) -> SegmentTable:
    """The walls of a table, with stretches of one wall made one."""
    walls = Walls(table.ends, table.moments, table.points.copy(), table.unions)
    bridge_walls(walls, rule, beams, *noise)
    kept = SegmentTable(*walls)
    return kept.take(np.flatnonzero(kept.points))
