"""Lag: scans are stamped late against the odometry, or early; their turns show by how much."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from lrf3d.geometry.lines import Float
from lrf3d.recordings.repair import Repair
from lrf3d.recordings.repair.pairs import ENOUGH_TURNS, SHOWN_TURN
from lrf3d.recordings.repair.recording import COST_RATIO, LATE, Recording
from lrf3d.recordings.repair.wheel_path import WheelPath

# Bounds of the lag [odometry lines].
LAGS = np.array([-1.0, 2.0])

# Bound of the lag in both directions [s], where wider than `LAGS`. A lag of this much may be
# more. A real log whose scans were shifted to be 0.84 s late is corrected by 0.83 s.
LATEST = 1.0


class Lag(NamedTuple):
    """How late scans (k,) are [odometry lines], and how late the first and the last one are [s]."""

    lags: Float
    late: tuple[float, float]


def find(recording: Recording) -> Lag | None:
    """The lag at which the odometry fits the turns of the scans."""
    if not recording.log.placed:
        return None
    path = recording.path
    lags = fitted_lag(recording.turns, path, recording.stamped_at, recording.purpose.sure)
    first, last = (path.interval * lags[[0, -1]]).tolist()
    most = max(abs(first), abs(last))
    # Where a line is worth more than that, stamps are in no unit of time.
    if not lags.any() or not recording.purpose.least_lag <= most <= 2.0 * LATEST:
        return None
    return Lag(lags, (first, last))


def fitted_lag(turns: Float, path: WheelPath, places: Float, sure: float = COST_RATIO) -> Float:
    """The lags (k,) [lines] at which odometry fits the turns (k − 1,) of scans; 0 if not known.

    They are the same for all scans, or change evenly where two clocks drift apart.
    """
    # Two scans without an odometry line between them show nothing about the lag.
    known = np.isfinite(turns) & (np.diff(places) > 0)
    distances = np.hypot(*np.diff(path.at(places)[:, :2], axis=0).T)[known]
    progress = np.linspace(-0.5, 0.5, len(places))

    def lags(lag: float = 0.0, drift: float = 0.0) -> Float:
        return np.clip(lag + drift * progress, least, most)

    def left(values: Float) -> Float:
        by_turn, by_distance, *late = values.tolist()
        turned = np.diff(path.at(places - lags(*late))[:, 2])[known]
        return np.asarray(turns[known] - (1.0 + by_turn) * turned - by_distance * distances)

    def fit(*start: float) -> Any:
        # Residuals beyond the least turn count linearly.
        return least_squares(left, np.array(start), loss="huber", f_scale=SHOWN_TURN)

    def at(lag: float) -> Float:
        return left(np.array([0.0, 0.0, lag]))

    bound = LATEST / (path.interval or np.inf)
    least = min(LAGS[0], -bound)
    most = max(LAGS[1], bound)
    # If hardly any turn depends on the lag, the lag is not known.
    moved = np.abs(at(most) - at(least))
    if (moved > SHOWN_TURN * np.ptp(LAGS)).sum() < ENOUGH_TURNS:
        return lags()
    # Fit first a lag, then a lag with a drift, together with the systematic errors of the wheels. A
    # turn may take no longer than the widest lag, so that the cost has several minima: the fit
    # starts from the best of some lags.
    tried = np.arange(least, most, 0.5)
    first = tried[np.argmin([np.abs(at(lag)).sum() for lag in tried])]
    best = fit(0.0, 0.0)
    for start in ((0.0, 0.0, first), (0.0, 0.0, first, 0.0)):
        found = fit(*start)
        best = found if best.cost > sure * found.cost else best
    return lags(*best.x[2:])


def fitted_again(recording: Recording, turns: Float | None = None) -> Recording:
    """The recording with its lag fitted again, to given turns (k − 1,) [rad] or its own."""
    found = {name: each for name, each in recording.found.items() if name != LAG.name}
    return replace(recording, found=found, lags=np.zeros(1), seen_turns=turns).repaired(LAG)


def sentence(lag: Lag) -> str:
    """How late scans are at the beginning and at the end; empty if too little to blur a map."""
    first, last = lag.late
    if max(abs(first), abs(last)) < LATE:
        return ""
    when = f"{first:.2f} s late"
    if abs(last - first) >= LATE:
        when = f"late, by {first:.2f} s at the beginning and {last:.2f} s at the end"
    elif first < 0.0:
        when = f"{-first:.2f} s early"
    rest = " by as much, but it may be more" * (max(abs(first), abs(last)) >= LATEST)
    return f"by their turns, scans are stamped {when}: corrected{rest}"


LAG = Repair(
    "lag",
    find,
    lambda recording, lag: replace(recording, lags=lag.lags),
    sentence,
    lambda lag: {"late": list(lag.late) if lag else [0.0, 0.0]},
)
