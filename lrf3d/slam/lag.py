"""Lag: how far the laser's clock is behind that of the odometry, in lines of the log.

A log says which odometry was read last before a scan, but the scan is older than that: at a turn
rate of 1 rad/s a tenth of a second is 0.1 rad. The turns between following scans enter, as scan
matching gives them; those of the odometry equal them at the right lag and at no other.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int
from lrf3d.slam.frames import between
from lrf3d.slam.front_end import FrontEnd
from lrf3d.slam.resolution import Resolution
from lrf3d.slam.scan_matching import match_scan
from lrf3d.slam.surface import evenly_spaced, grid_of

PAIRS = 300
"""Pairs of scans that are matched: those whose turns depend most on the lag."""

LEAST_PAIRS = 20
"""With fewer of them the lag is taken to be 0."""

LEAST_POINTS = 10
"""Points that each of a pair must show."""

LEAST_CHANGE = 0.01
"""A pair counts if a lag of one line changes its turn by more [rad]."""

Surfaces = Callable[[int], Float]
"""What a scan shows, by its number."""

LAGS = np.arange(-50, 101) / 50.0
"""Lags that are compared, in lines."""

SURE = 1.3
"""A lag is believed if without it the cost is higher by this factor. In logs it is by 1.7 and more;
between two lines the noise of both cancels in part, which looks like a lag of 1.1."""

HUBER = 0.01
"""Residuals beyond this [rad] count linearly."""

GUIDED = np.diag([400.0, 400.0, 25.0])
"""Information of the odometry when a pair is matched: 0.05 m, and 0.2 rad."""


class WheelPath:
    """The way of the wheels, smooth between the lines of the log.

    A robot that turns does so ever faster or slower: straight lines between headings that are a
    fifth of a second apart are up to half a degree off, Akima's curves (1970) are not.

    Args:
        poses: (n, 3) odometry poses, line by line.
    """

    def __init__(self, poses: Float) -> None:
        self._whole = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
        self._slopes = akima_slopes(self._whole)

    def __len__(self) -> int:
        return len(self._whole)

    def increments(self, places: NDArray[np.floating[Any]]) -> Float:
        """How the robot moved (k, 3) to each of the places (k,) from the one before."""
        poses = self.at(places)
        return np.vstack([np.zeros(3), between(poses[:-1], poses[1:])])

    def at(self, places: NDArray[np.floating[Any]]) -> Float:
        """Poses (k, 3) at fractional places (k,) between the lines; headings go on over π."""
        inside = np.clip(places, 0.0, len(self._whole) - 1.0)
        if len(self._whole) == 1:
            return np.repeat(self._whole, len(inside), axis=0)
        first = np.minimum(inside.astype(np.int64), len(self._whole) - 2)
        u = (inside - first)[:, None]
        start, step = self._whole[first], self._whole[first + 1] - self._whole[first]
        begin, end = self._slopes[first], self._slopes[first + 1]
        # Hermite's cubic through both lines with their slopes.
        bend = (1.0 - u) * (begin - step) - u * (end - step)
        return np.asarray(start + u * (step + (1.0 - u) * bend))


def akima_slopes(values: Float) -> Float:
    """Slopes (n, c) of Akima's curves (1970) through values (n, c) that are one apart.

    The slope at a value is the mean of those of the steps to both sides, each of which counts by
    how little it differs from its own other neighbour: a step that is off bends the curve nearby.
    """
    if len(values) < 2:
        return np.zeros(values.shape)
    steps = np.diff(values, axis=0)
    # Two more steps at each end go on as the last two change.
    for _ in range(2):
        last = steps[[0, -1]], steps[[min(1, len(steps) - 1), max(len(steps) - 2, 0)]]
        before, after = 2.0 * last[0] - last[1]
        steps = np.vstack([before, steps, after])
    turns = np.abs(np.diff(steps, axis=0))
    by_before, by_after = turns[2:], turns[:-2]
    total = by_before + by_after
    # Where the curve is straight to both sides the weights are rounding.
    bent = total > 1e-9 * total.max(axis=0)
    weights = np.where(bent, by_before / np.where(bent, total, 1.0), 0.5)
    return np.asarray(weights * steps[1:-2] + (1.0 - weights) * steps[2:-1])


def tracked_lag(surface: Surfaces, path: WheelPath, places: Int, resolution: Resolution) -> float:
    """The lag in lines, by following the whole drive with none.

    Two scans of a sparse laser do not show the turn between them. Arguments as of `matched_lag`.
    """
    increments = path.increments(places.astype(np.float64))
    return fitted_lag(followed(surface, increments, resolution)[1][1:], path, places)


def followed(
    surface: Surfaces, increments: Float, resolution: Resolution
) -> tuple[FrontEnd, Float]:
    """A front end that has followed a drive, and the turns that it found.

    Args:
        surface: Gives the surface of a scan by its number.
        increments: (k, 3) how the robot moved to each scan by its wheels.
        resolution: That of the laser.

    Returns:
        The front end, and the turns (k,) [rad]: NaN for scans that matched nothing.
    """
    front = FrontEnd(resolution=resolution)
    turns = np.full(len(increments), np.nan)
    for number, increment in enumerate(increments):
        before = front.pose
        seen = surface(number)
        if front.track(seen, increment).matched:
            turns[number] = between(before, front.pose)[2]
        if front.key_due():
            front.add_key(seen)
    return front, turns


def matched_lag(surface: Surfaces, path: WheelPath, places: Int, resolution: Resolution) -> float:
    """The lag in lines, by matching pairs of following scans.

    Args:
        surface: Gives the surface of a scan by its number.
        path: The way of the wheels.
        places: (k,) for each scan the index of the last odometry line before it.
        resolution: That of the laser.
    """
    if len(places) < LEAST_PAIRS:
        return 0.0
    chosen = telling_pairs(path, places)[:PAIRS]
    at_scans = path.at(places.astype(np.float64))
    ways = np.hypot(*np.diff(at_scans[:, :2], axis=0).T)
    turns = np.full(len(places) - 1, np.nan)
    for number in chosen.tolist():
        before, after = surface(number), surface(number + 1)
        if min(len(before), len(after)) < LEAST_POINTS or ways[number] > 0.5:
            continue
        guess = between(at_scans[number], at_scans[number + 1])
        grid = grid_of(evenly_spaced(before), resolution.along)
        match = match_scan(after, grid, guess, GUIDED, 20, 0.3, resolution.sigma)
        if match.explained > 0.5:
            turns[number] = match.pose[2]
    return fitted_lag(turns, path, places)


def fitted_lag(turns: Float, path: WheelPath, places: Int) -> float:
    """The lag at which the odometry's turns fit those that scans show best; 0 if it is not known.

    Args:
        turns: (k − 1,) turn from each scan to the next [rad]; NaN where it is not known.
        path: The way of the wheels.
        places: (k,) for each scan the index of the last odometry line before it.
    """
    # Of scans without a line between them odometry says nothing, whatever the lag is.
    chosen = np.flatnonzero(np.isfinite(turns) & (np.diff(places) > 0))
    if len(np.intersect1d(chosen, telling_pairs(path, places))) < LEAST_PAIRS:
        return 0.0
    ways = np.hypot(*np.diff(path.at(places.astype(np.float64))[:, :2], axis=0).T)[chosen]
    costs = [
        _cost(turns[chosen], np.diff(path.at(places - lag)[:, 2])[chosen], ways) for lag in LAGS
    ]
    without = costs[int(np.abs(LAGS).argmin())]
    return float(LAGS[int(np.argmin(costs))]) if without > SURE * min(costs) else 0.0


def telling_pairs(path: WheelPath, places: Int) -> Int:
    """The pairs of following scans whose turns depend on the lag, those that do most first."""
    first, last = (np.diff(path.at(places - lag)[:, 2]) for lag in (LAGS[0], LAGS[-1]))
    change = np.abs(last - first) / (LAGS[-1] - LAGS[0])
    order = np.argsort(-change)
    chosen: Int = order[change[order] > LEAST_CHANGE]
    return chosen


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
