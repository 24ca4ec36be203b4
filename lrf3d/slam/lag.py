"""Lag: how far the laser's clock is behind that of the odometry, in lines of the log.

A log says which odometry was read last before a scan, but the scan is older than that: at a turn
rate of 1 rad/s a tenth of a second is 0.1 rad. Pairs of following scans enter; scan matching gives
their turns, which those of the odometry equal at the right lag and at no other.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int
from lrf3d.slam.scan_matching import POINT_SIGMA, match_scan
from lrf3d.slam.surface import ALONG, evenly_spaced, grid_of

PAIRS = 300
"""Pairs of scans that are matched: those whose turns depend most on the lag."""

LEAST_PAIRS = 20
"""With fewer of them the lag is taken to be 0."""

LEAST_POINTS = 10
"""Points that each of a pair must show."""

LEAST_CHANGE = 0.01
"""A pair counts if a lag of one line changes its turn by more [rad]."""

LAGS = np.arange(-1.0, 2.001, 0.02)
"""Lags that are compared, in lines."""

HUBER = 0.01
"""Residuals beyond this [rad] count linearly."""

GUIDED = np.diag([400.0, 400.0, 25.0])
"""Information of the odometry when a pair is matched: 0.05 m, and 0.2 rad."""


def wheel_poses_at(poses: Float, places: NDArray[np.floating[Any]]) -> Float:
    """Odometry poses at fractional places (k,) between the lines (n, 3); headings go on over π."""
    places = np.clip(places, 0.0, len(poses) - 1.0)
    line = np.minimum(places.astype(np.int64), max(len(poses) - 2, 0))
    following = np.minimum(line + 1, len(poses) - 1)
    whole = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    share = (places - line)[:, None]
    between_lines: Float = whole[line] + share * (whole[following] - whole[line])
    return between_lines


def estimate_lag(surface: Callable[[int], Float], poses: Float, places: Int) -> float:
    """The lag in lines.

    Args:
        surface: Gives the surface of a scan by its number.
        poses: (n, 3) odometry poses, line by line.
        places: (k,) for each scan the index of the last odometry line before it.
    """
    if len(places) < LEAST_PAIRS or len(poses) < LEAST_PAIRS:
        return 0.0
    turns = np.array([np.diff(wheel_poses_at(poses, places - lag)[:, 2]) for lag in LAGS])
    change = np.abs(turns[-1] - turns[0]) / (LAGS[-1] - LAGS[0])
    chosen = np.argsort(-change)[:PAIRS]
    chosen = chosen[change[chosen] > LEAST_CHANGE]
    if len(chosen) < LEAST_PAIRS:
        return 0.0
    at_scans = wheel_poses_at(poses, places.astype(np.float64))
    ways = np.hypot(*np.diff(at_scans[:, :2], axis=0).T)
    matched = np.full(len(chosen), np.nan)
    for row, number in enumerate(chosen.tolist()):
        before, after = surface(number), surface(number + 1)
        if min(len(before), len(after)) < LEAST_POINTS or ways[number] > 0.5:
            continue
        guess = np.array([ways[number], 0.0, at_scans[number + 1, 2] - at_scans[number, 2]])
        match = match_scan(
            after, grid_of(evenly_spaced(before), ALONG), guess, GUIDED, 20, 0.3, POINT_SIGMA
        )
        if match.explained > 0.5:
            matched[row] = match.pose[2]
    good = np.isfinite(matched)
    if good.sum() < LEAST_PAIRS:
        return 0.0
    rows = turns[:, chosen][:, good]
    costs = [_cost(matched[good], row, ways[chosen][good]) for row in rows]
    return float(LAGS[int(np.argmin(costs))])


def _cost(matched: Float, turned: Float, ways: Float) -> float:
    """The robust sum of squares that is left of the turns once their systematic errors are out."""
    columns = np.column_stack([turned, ways])
    weights = np.ones(len(matched))
    left = matched - turned
    for _ in range(5):
        root = np.sqrt(weights)
        bias = np.linalg.lstsq(columns * root[:, None], (matched - turned) * root, rcond=None)[0]
        left = np.abs(matched - turned - columns @ bias)
        weights = 1.0 / np.maximum(left / HUBER, 1.0)
    return float(np.where(left < HUBER, 0.5 * left**2, HUBER * (left - 0.5 * HUBER)).sum())
