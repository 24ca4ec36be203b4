"""Records: rows of named columns, for tables that kernels share."""

import numpy as np

from lrf3d.compiling import record

MOMENTS = record(
    weight=float,  # [1/m²] sum of the inverse variances of the points
    x=float, y=float,  # [m] their mean
    xx=float, xy=float, yy=float,  # their weighted scatter about it
)  # fmt: skip
"""The moments of the points of a segment."""

WALL = record(
    points=int,  # number of its points; 0 where the row is free
    evidence=float,  # [hits] hits and weighed violations that it had when it was refit
    fresh=float,  # [beams] that hit it, or went through its hits, since then
    last_scan=int,  # the last scan that added to these
    version=np.int32,  # how often it was refit, from 1; see CLUSTER
    shown=bool,  # whether the beams showed enough of it: the map is these
)  # fmt: skip
"""What is known of a wall beside its place and its moments."""

WALL_COUNTERS = record(
    taken=int,  # rows that were ever taken
    free=int,  # how many of these were given back
    turn=int,  # the wall whose turn it is to be refit
)  # fmt: skip

NEWS = record(
    changed=int, unowned=int,  # see NewEvidence
    scan=int,  # the number of the scan
)  # fmt: skip

PIECE_COUNTS = record(
    hits=float, violations=float,  # [beams] that hit it, and that went through it
    nearer=float,  # [beams] that would be hits had they not hit another wall more nearly
    scans=float,  # scans that hit it
    passes_between=float,  # [beams] that went through between these
    passes_before=float,  # [beams] that went through before the first, a sum over the hits
    spell=float,  # [scans] from the first to the last
)  # fmt: skip
"""What the beams did at a piece of a wall."""

PIECE_SUMS = record(
    weight=float,  # [1/m²]
    along=float, aside=float,  # their place along the wall and beside it
    along_along=float, along_aside=float, aside_aside=float,
)  # fmt: skip
"""Weighted sums over the hits of a piece of a wall."""
