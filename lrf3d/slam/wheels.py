"""Wheels: odometry as a prediction, with its systematic errors and the size of its random ones.

Odometry increments (ahead, to the left [m], turn [rad]) and the same motions by scan matching
enter; predictions with their covariances leave. The model of the wheels is

    Δθ = (1 + a)·Δθ_wheels + b·Δs,    Δs = (1 + c)·Δs_wheels

with a, b, c from a linear regression over all stretches so far: b is what wheels of unequal size
do, a what a wrong wheel base does, and c what a wrong circumference does. The regression is that of
the wheels on the scans, and is then solved for the scans: a regression on the wheels, whose noise
is the larger, would take the noise of a drive straight ahead for turns that are not there. What the
regression leaves of the turns is the noise of the heading, which is learnt as well.
"""

import numpy as np

from lrf3d.geometry import Float
from lrf3d.slam.prediction import Excess, Prediction, slip_deviations

EXPECTED = np.array([0.05, 0.05, 0.03])
"""Standard deviations of a, b [rad/m] and c before anything was driven."""

STILL_POSITION, STILL_HEADING = 0.005, 0.003
"""Standard deviations [m], [rad] of any increment, even where the wheels stood still."""

SLIP, SLIP_TURN = 0.05, 0.05
"""Standard deviation of an increment's place as a share of its length, and of its turn as a share
of its turn: what wheels on carpets and sills do."""

ROUGH, ROUGH_STRETCHES = 9.0, 20.0
"""Variance of the heading's noise before anything was driven, in units of that of good wheels, and
the stretches that this counts as. Small robots slip two to four times as much as good wheels do;
taken for good ones, their noise looks like a turn per metre, which bends a hall by ten degrees."""

RIDGE = 0.01
"""Share of the expectation that counts where the regression's residuals are computed: without it
wheels far from what is expected would seem to be noisy."""

SWERVE, SKID = 0.02, 0.05
"""Standard deviation of the turn for each metre [rad/m], and of the place for each turn [m/rad]."""


class Wheels:
    """Corrects odometry increments by the errors of the wheels that scan matching has shown."""

    def __init__(self) -> None:
        # The regression of what wheels measure too much, as shares of the true turn and distance
        # (of turns), and distance (of distances).
        self._information, self._sums = np.zeros((3, 3)), np.zeros(3)
        # Squares of the turns' errors, and their number. What the regression leaves of them is the
        # least noise of the heading.
        self._squares = self._stretches = 0.0
        self.excess = Excess(ROUGH)

    @property
    def biases(self) -> Float:
        """The errors (3,): a, b [rad/m] and c."""
        a, b, c = self._fit()[0].tolist()
        return -np.array([a / (1.0 + a), b / (1.0 + a), c / (1.0 + c)])

    def _fit(self) -> tuple[Float, Float]:
        """What wheels measure too much (3,), and the information (3, 3) on that."""
        noise = self.excess.floor[1]
        variances = np.array([noise, noise, 1.0])
        known = np.diag(EXPECTED**-2.0) + self._information / variances
        return np.asarray(np.linalg.solve(known, self._sums / variances)), known

    def predict(self, increment: Float) -> Prediction:
        """The motion of an increment (3,), without the systematic errors that are known by now."""
        a, b, c = self.biases.tolist()
        ahead, left, turn = increment * (1.0 + np.array([c, c, a]))
        step = np.array([ahead, left, turn + b * ahead])
        covariance = self._covariance(step)
        # In the beginning what is not known of a and b is several times the random errors: a prior
        # without it would turn the first few scans, and with them the whole drive.
        row = np.array([increment[2], increment[0], 0.0])
        unlearned = np.diag([0.0, 0.0, row @ np.linalg.solve(self._fit()[1], row)])
        # Encoders that stand still may have failed: then they say nothing.
        moved, window = bool(step.any()), slip_deviations(step)
        return Prediction(step, covariance, covariance + unlearned, window, trusted=moved)

    def _covariance(self, step: Float) -> Float:
        """Covariance (3, 3) of a step's random errors."""
        length, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        place = STILL_POSITION + SLIP * length + SKID * turn
        heading = STILL_HEADING + SWERVE * length + SLIP_TURN * turn
        place, heading = self.excess.scale * np.array([place, heading]) ** 2
        # Wheels may slip anywhere on the path: the rest of it is turned by the slip.
        lever = length / 2.0
        aside = place + heading * length**2 / 3.0
        return np.array(
            [[place, 0.0, 0.0], [0.0, aside, lever * heading], [0.0, lever * heading, heading]]
        )

    def learn(self, measured: Float, matched: Float, ahead_known: bool) -> None:
        """Add a stretch of some scans to the regression of the systematic errors.

        Sums (3,) of raw increments enter, and those that matching found, whose distance ahead may
        not have been fixed by the walls in view.
        """
        ahead, _, turn = matched
        # The larger distance counts, so that wheels that measure twice as much are corrected, too.
        farthest, _, widest = np.maximum(np.abs(matched), np.abs(measured))
        spread = STILL_HEADING + SWERVE * farthest + SLIP_TURN * widest
        error = float(measured[2] - turn) / spread
        weight = self._regress(np.array([turn, ahead, 0.0]) / spread, error, self.excess.floor[1])
        self._squares, self._stretches = self._squares + weight * error**2, self._stretches + weight
        ridge = RIDGE * np.diag(EXPECTED**-2.0)[:2, :2]
        best = np.linalg.solve(self._information[:2, :2] + ridge, self._sums[:2])
        left = self._squares - float(best @ self._sums[:2])
        rough = (ROUGH_STRETCHES * ROUGH + left) / (ROUGH_STRETCHES + self._stretches)
        self.excess.floor[1] = max(rough, 1.0)
        if ahead_known:
            spread = STILL_POSITION + SLIP * farthest
            row = np.array([0.0, 0.0, ahead]) / spread
            self._regress(row, float(measured[0] - ahead) / spread, 1.0)

    def _regress(self, row: Float, error: float, variance: float) -> float:
        """Add what a stretch shows of the errors: a row (3,) of factors, and their sum.

        Both are in units of the deviation of good wheels; the weight is returned.
        """
        off = abs(error - float(row @ self._fit()[0])) / np.sqrt(variance)
        # Beyond ten deviations it was driven backwards, with encoders that measure no sign; beyond
        # three it contains a slip, which is no systematic error.
        weight = 0.0 if off > 10.0 else 1.0 / max(1.0, off / 3.0)
        self._information += weight * np.outer(row, row)
        self._sums += weight * error * row
        return weight
