"""Wheels: the systematic errors of odometry, and the covariance of its random ones.

Odometry increments (ahead, to the left [m], turn [rad]) and the same motions by scan matching
enter; corrected increments and their covariances leave. The model of the wheels is

    Δθ = (1 + a)·Δθ_wheels + b·Δs,    Δs = (1 + c)·Δs_wheels

with a, b, c from a linear regression over all stretches so far: b is what wheels of unequal size
do, a what a wrong wheel base does, and c what a wrong circumference does. The regression is that of
the wheels on the scans, and is then solved for the scans: a regression on the wheels, whose noise
is the larger, would take the noise of a drive straight ahead for turns that are not there.
"""

import numpy as np

from lrf3d.geometry import Float

EXPECTED = np.array([0.05, 0.05, 0.03])
"""Standard deviations of a, b [rad/m] and c before anything was driven."""

STILL_POSITION, STILL_HEADING = 0.005, 0.003
"""Standard deviations [m], [rad] of any increment, even where the wheels stood still."""

SLIP, SLIP_TURN = 0.05, 0.05
"""Standard deviation of an increment's place as a share of its length, and of its turn as a share
of its turn: what wheels on carpets and sills do."""

SWERVE, SKID = 0.02, 0.05
"""Standard deviation of the turn for each metre [rad/m], and of the place for each turn [m/rad]."""

FORGETTING = 0.98
"""Weight of the past in the running mean of how far wheels and scans differ, at each scan."""


class Wheels:
    """Corrects odometry increments by the errors of the wheels that scan matching has shown."""

    def __init__(self) -> None:
        # The regression of what wheels measure too much, as shares of the true turn and distance
        # (of turns), and distance (of distances).
        self._information = np.diag(EXPECTED**-2.0)
        self._sums = np.zeros(3)
        # Squared differences between wheels and scans in units of their variance.
        self._excess = np.ones(2)

    @property
    def biases(self) -> Float:
        """The errors (3,): a, b [rad/m] and c."""
        a, b, c = np.linalg.solve(self._information, self._sums).tolist()
        return -np.array([a / (1.0 + a), b / (1.0 + a), c / (1.0 + c)])

    def corrected(self, increment: Float) -> Float:
        """An increment (3,) without the systematic errors that are known by now."""
        a, b, c = self.biases.tolist()
        ahead, left, turn = increment * (1.0 + np.array([c, c, a]))
        return np.array([ahead, left, turn + b * ahead])

    def covariance(self, increment: Float) -> Float:
        """Covariance (3, 3) of an increment's random errors."""
        length, turn = float(np.hypot(increment[0], increment[1])), abs(float(increment[2]))
        place = STILL_POSITION + SLIP * length + SKID * turn
        heading = STILL_HEADING + SWERVE * length + SLIP_TURN * turn
        place, heading = place**2 * self._excess[0], heading**2 * self._excess[1]
        # Wheels may slip anywhere on the path: the rest of it is turned by the slip.
        lever = length / 2.0
        aside = place + heading * length**2 / 3.0
        return np.array(
            [[place, 0.0, 0.0], [0.0, aside, lever * heading], [0.0, lever * heading, heading]]
        )

    def unlearned(self, increment: Float) -> float:
        """Variance [rad²] of an increment's turn by what is not known of a and b yet.

        In the beginning it is several times that of the random errors: a prior without it would
        turn the first few scans, and with them the whole drive, by some milliradians.
        """
        row = np.array([increment[2], increment[0], 0.0])
        return float(row @ np.linalg.solve(self._information, row))

    def compare(self, measured: Float, matched: Float, covariance: Float) -> None:
        """Update the size of random errors by a corrected increment and the one of matching.

        The running mean never falls below what is expected: wheels that were right for a while
        may still slip.
        """
        error = matched - measured
        square = error**2 / covariance.diagonal() * np.repeat(self._excess, [2, 1])
        now = np.array([0.5 * (square[0] + square[1]), square[2]])
        # A slip counts as at most ten deviations, so that its effect fades.
        now = np.minimum(now, 100.0 * self._excess)
        self._excess = np.maximum(FORGETTING * self._excess + (1.0 - FORGETTING) * now, 1.0)

    def learn(self, measured: Float, matched: Float, ahead_known: bool) -> None:
        """Add a stretch of some scans to the regression of the systematic errors.

        Sums (3,) of raw increments enter, and those that matching found, whose distance ahead may
        not have been fixed by the walls in view.
        """
        ahead, _, turn = matched
        # The larger distance counts, so that wheels that measure twice as much are corrected, too.
        farthest, _, widest = np.maximum(np.abs(matched), np.abs(measured))
        spread = STILL_HEADING + SWERVE * farthest + SLIP_TURN * widest
        self._regress(np.array([turn, ahead, 0.0]), measured[2] - turn, spread)
        if ahead_known:
            spread = STILL_POSITION + SLIP * farthest
            self._regress(np.array([0.0, 0.0, ahead]), measured[0] - ahead, spread)

    def _regress(self, row: Float, error: float, spread: float) -> None:
        """Add what a stretch shows of the errors: a row (3,) of factors, and their sum."""
        expected = float(row @ np.linalg.solve(self._information, self._sums))
        off = abs(error - expected) / spread
        # Beyond ten deviations it was driven backwards, with encoders that measure no sign; beyond
        # three it contains a slip, which is no systematic error.
        if off <= 10.0:
            weight = 1.0 / (spread**2 * max(1.0, off / 3.0))
            self._information += weight * np.outer(row, row)
            self._sums += weight * error * row
