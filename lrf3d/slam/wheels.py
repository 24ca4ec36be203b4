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
        self._turn_information = np.diag(EXPECTED[:2] ** -2.0)
        self._turn_sum = np.zeros(2)
        self._way_information = EXPECTED[2] ** -2.0
        self._way_sum = 0.0
        # Squared differences between wheels and scans in units of their variance.
        self._excess = np.ones(2)
        # What the wheels measure too much, as shares of the true turn, way, and way.
        self._turn_errors: Float = np.zeros(2)
        self._way_error = 0.0

    @property
    def biases(self) -> Float:
        """The errors (3,): a, b [rad/m] and c."""
        by_turn, by_way = (self._turn_errors / (1.0 + self._turn_errors[0])).tolist()
        return -np.array([by_turn, by_way, self._way_error / (1.0 + self._way_error)])

    def corrected(self, increment: Float) -> Float:
        """An increment (3,) without the systematic errors that are known by now."""
        ahead, left, turn = increment
        a, b, c = self.biases
        way = ahead + c * ahead
        return np.array([way, left + c * left, turn + a * turn + b * way])

    def covariance(self, increment: Float) -> Float:
        """Covariance (3, 3) of an increment's random errors."""
        way, turn = float(np.hypot(increment[0], increment[1])), abs(float(increment[2]))
        place = STILL_POSITION + SLIP * way + SKID * turn
        heading = STILL_HEADING + SWERVE * way + SLIP_TURN * turn
        place, heading = place**2 * self._excess[0], heading**2 * self._excess[1]
        # Wheels may slip anywhere on the path: the rest of it is turned by the slip.
        lever = way / 2.0
        aside = place + heading * way**2 / 3.0
        return np.array(
            [[place, 0.0, 0.0], [0.0, aside, lever * heading], [0.0, lever * heading, heading]]
        )

    def unlearned(self, increment: Float) -> float:
        """Variance [rad²] of an increment's turn by what is not known of a and b yet.

        In the beginning it is several times that of the random errors: a prior without it would
        turn the first few scans, and with them the whole drive, by some milliradians.
        """
        turn, way = float(increment[2]), float(increment[0])
        (by_turn, both), (_, by_way) = self._turn_information.tolist()
        squares = by_way * turn**2 - 2.0 * both * turn * way + by_turn * way**2
        return float(squares / (by_turn * by_way - both**2))

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

        Sums (3,) of raw increments enter, and those that matching found, whose way ahead may not
        have been fixed by the walls in view.
        """
        way, turn = float(matched[0]), float(matched[2])
        row = np.array([turn, way])
        # The larger distance counts, so that wheels that measure twice as much are corrected, too.
        farthest = max(abs(way), abs(float(measured[0])))
        spread = STILL_HEADING + SWERVE * farthest
        spread += SLIP_TURN * max(abs(turn), abs(float(measured[2])))
        error = float(measured[2]) - turn
        weight = _weight(error - float(row @ self._turn_errors), spread)
        self._turn_information += weight * np.outer(row, row)
        self._turn_sum += weight * error * row
        errors = np.linalg.solve(self._turn_information, self._turn_sum)
        self._turn_errors = np.asarray(errors, dtype=np.float64)
        if ahead_known and abs(way) > 0.0:
            spread = STILL_POSITION + SLIP * farthest
            error = float(measured[0]) - way
            weight = _weight(error - self._way_error * way, spread)
            self._way_information += weight * way**2
            self._way_sum += weight * way * error
            self._way_error = self._way_sum / self._way_information


def _weight(residual: float, spread: float) -> float:
    """The weight of a stretch in the regression, by its residual.

    Beyond three deviations it contains a slip, which is no systematic error. Beyond ten it was
    driven backwards, with encoders that measure no sign.
    """
    off = abs(residual) / spread
    return 0.0 if off > 10.0 else 1.0 / (spread * spread * max(1.0, off / 3.0))
