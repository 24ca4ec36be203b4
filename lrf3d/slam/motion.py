"""Motion: predictions of the step between two scans, by the wheels or by the last step.

Odometry increments (ahead, to the left [m], turn [rad]) and the same motions by scan matching
enter; predictions with covariances leave. The systematic errors of the wheels are

    Δθ = (1 + a)·Δθ_wheels + b·Δs,    Δs = (1 + c)·Δs_wheels

with a (a wrong wheel base), b (wheels of unequal size) and c (a wrong circumference) from a linear
regression over all stretches so far. It regresses the wheels on the scans and is then inverted: the
other way round, the noise of a drive straight ahead would look like turns. The residuals of the
turns give the noise of the heading.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.matching.key_scans import FORGETTING
from lrf3d.matching.surface import DEVIATIONS

# Largest slip of wheels between two scans [m], [m], [rad]: the window that is searched. A bump
# turns a robot by half a radian.
WINDOW = np.array([0.4, 0.4, 0.7])

# Share of the step that is added to the largest slip.
WINDOW_SHARE = 0.3

# Inlier ratio of a match below which the places around it are searched.
DOUBTFUL = 0.65

# Prior standard deviations of a, b [rad/m] and c.
EXPECTED = np.array([0.05, 0.05, 0.03])

# Standard deviations of an increment's position [m] and of its turn [rad], in two rows: a constant,
# even of wheels that stand still, and shares of each metre and each radian, as wheels slip on
# carpets and sills.
NOISE = np.array([[0.005, 0.05, 0.05], [0.003, 0.02, 0.05]])

# Standard deviations from which an error is no noise at all, but a slip or a failed encoder.
OUTLIER = 10.0

# Prior of the heading's variance in units of that of good wheels. Small robots slip two to four
# times as much; taken for good ones, their noise looks like a turn per metre, which bends a hall by
# ten degrees.
ROUGH = 9.0

# Weight of that prior in stretches.
ROUGH_STRETCHES = 20.0


class Prediction(NamedTuple):
    """The expected step (3,) since the last scan.

    ``covariance`` (3, 3) is that of random errors; ``uncertain`` (3, 3) is that of all errors, by
    which matching weighs the step. Where a match explains less than the share ``doubtful``, a
    ``window`` of standard deviations (3,) is searched, and a ``trusted`` prediction is a prior of
    the places in it. After a scan that contradicted it, ``other`` may be right as well.
    """

    step: Float
    covariance: Float
    uncertain: Float
    window: Float
    doubtful: float = DOUBTFUL
    trusted: bool = True
    other: "Prediction | None" = None


def size_of(step: Float) -> tuple[float, float]:
    """The length [m] and the absolute turn [rad] of a step (3,)."""
    ahead, left, turn = step.tolist()
    return float(np.hypot(ahead, left)), abs(turn)


def slip_window(step: Float) -> Float:
    """Standard deviations (3,) of the wheels' slip in a step (3,)."""
    length, turn = size_of(step)
    return np.asarray((WINDOW + WINDOW_SHARE * np.array([length, length, turn])) / DEVIATIONS)


class Excess:
    """Running means of squared prediction errors in units of their variance.

    One is for positions and one for headings. Neither falls below its floor: predictions that were
    right for a while may still be wrong.
    """

    def __init__(self, heading: float = 1.0) -> None:
        self.heading = heading
        self._mean = np.ones(2)

    @property
    def scale(self) -> Float:
        """Factors (3,) on the variances of x, y and the heading."""
        place, heading = np.maximum(self._mean, [1.0, self.heading])
        return np.array([place, place, heading])

    def update(self, prediction: Prediction, found: Float) -> None:
        """Update the means with a prediction and the step (3,) that matching found."""
        error = found - prediction.step
        # The variances of the prediction are already multiplied by the scale.
        x, y, heading = error**2 / prediction.covariance.diagonal() * self.scale
        # The error of a slip is bounded, so that its effect fades.
        now = np.minimum([0.5 * (x + y), heading], OUTLIER**2 * self._mean)
        self._mean = np.maximum(FORGETTING * self._mean + (1.0 - FORGETTING) * now, 1.0)


class Coasting:
    """Predicts, without odometry, that the robot repeats its last step up to noise.

    A window is searched for every scan, and places are weighed by scans alone: in a corridor the
    place of the last scan explains most of the next one, even if the robot has started to move.
    """

    def __init__(self) -> None:
        self._step = np.zeros(3)
        self._excess = Excess()

    def predict(self) -> Prediction:
        """Predict the step to the next scan."""
        length, turn = size_of(self._step)
        # Standard deviation of a step from the last one [m], [rad]. With 0.1 m a robot that starts
        # to move in a corridor is taken to stand still.
        coast = 0.03
        # Share of the step that is added to it.
        coast_share = 0.2
        deviations = coast + coast_share * np.array([length, length, turn])
        variances = deviations**2 * self._excess.scale
        window = np.maximum(slip_window(self._step), np.sqrt(variances))
        largest_window = [0.5, 0.5, 0.6]  # Standard deviations [m], [rad].
        spread = np.diag(variances)
        window = np.minimum(window, largest_window)
        return Prediction(self._step, spread, spread, window, np.inf, trusted=False)

    def found(self, prediction: Prediction, step: Float) -> None:
        """Update with the step (3,) to a scan that was matched."""
        self._excess.update(prediction, step)
        self._step = step

    def lost(self) -> None:
        """Update for a scan that was not matched: half the last step is predicted again."""
        self._step = 0.5 * self._step


class Wheels:
    """Corrects odometry increments by the errors of the wheels, estimated from scan matching."""

    def __init__(self) -> None:
        # Normal equations of the wheels' errors: turns err by shares of the true turn and distance,
        # distances by a share of the true distance.
        self._information = np.zeros((3, 3))
        self._sums = np.zeros(3)
        # Sum of the squared errors of turns, and the weight of the stretches.
        self._squares = self._stretches = 0.0
        self.excess = Excess(ROUGH)
        self._errors, self._known = self._fit()

    @property
    def biases(self) -> Float:
        """The errors (3,): a, b [rad/m] and c."""
        a, b, c = self._errors.tolist()
        return -np.array([a / (1.0 + a), b / (1.0 + a), c / (1.0 + c)])

    def _fit(self) -> tuple[Float, Float]:
        """Fit the wheels' errors (3,), as shares of the true motion; with information (3, 3)."""
        noise = self.excess.heading
        variances = np.array([noise, noise, 1.0])
        known = np.diag(EXPECTED**-2.0) + self._information / variances
        return np.asarray(np.linalg.solve(known, self._sums / variances)), known

    def predict(self, increment: Float) -> Prediction:
        """Predict the step of an increment (3,), corrected by the systematic errors."""
        a, b, c = self.biases.tolist()
        ahead, left, turn = increment * (1.0 + np.array([c, c, a]))
        step = np.array([ahead, left, turn + b * ahead])
        covariance = self._covariance(step)
        # At first a and b are far less certain than the random errors. A prior without them would
        # turn the first few scans, and with them the whole drive.
        measured_ahead, _, measured_turn = increment
        row = np.array([measured_turn, measured_ahead, 0.0])
        unlearned = np.diag([0.0, 0.0, row @ np.linalg.solve(self._known, row)])
        # Encoders that stand still may have failed, and carry no information.
        moved = bool(step.any())
        window = slip_window(step)
        return Prediction(step, covariance, covariance + unlearned, window, trusted=moved)

    def _covariance(self, step: Float) -> Float:
        """Covariance (3, 3) of a step's random errors."""
        length, turn = size_of(step)
        place, heading = NOISE @ [1.0, length, turn]
        place, _, heading = self.excess.scale * np.array([place, place, heading]) ** 2
        # Wheels may slip anywhere on the path, and the slip turns the rest of it.
        lever = length / 2.0
        aside = place + heading * length**2 / 3
        return np.array(
            [[place, 0.0, 0.0], [0.0, aside, lever * heading], [0.0, lever * heading, heading]]
        )

    def learn(self, measured: Float, matched: Float, ahead_known: bool) -> None:
        """Add a stretch to the regression of the systematic errors.

        Its motion (3,) as the wheels measured it and as it was matched enters; the distance ahead
        counts only if it is known.
        """
        ahead, _, turn = matched
        excess_ahead, _, excess_turn = (measured - matched).tolist()
        # The larger distance counts, so that wheels that measure twice as much are corrected.
        farthest, _, widest = np.maximum(np.abs(matched), np.abs(measured))
        _, spread = NOISE @ [1.0, farthest, widest]
        error = excess_turn / spread
        row = np.array([turn, ahead, 0.0]) / spread
        weight = self._regress(row, error, self.excess.heading)
        self._squares += weight * error**2
        self._stretches += weight
        # Weight of the prior in the residuals: with the full prior, wheels far from it look noisy.
        ridge_weight = 0.01
        ridge = ridge_weight * np.diag(EXPECTED**-2.0)[:2, :2]
        best = np.linalg.solve(self._information[:2, :2] + ridge, self._sums[:2])
        left = self._squares - float(best @ self._sums[:2])
        rough = (ROUGH_STRETCHES * ROUGH + left) / (ROUGH_STRETCHES + self._stretches)
        self.excess.heading = max(rough, 1.0)
        if ahead_known:
            spread, _ = NOISE @ [1.0, farthest, 0.0]
            self._regress(np.array([0.0, 0.0, ahead]) / spread, excess_ahead / spread, 1.0)
        self._errors, self._known = self._fit()

    def _regress(self, row: Float, error: float, variance: float) -> float:
        """Add an error of a stretch and its factors (3,), in standard deviations of good wheels.

        Returns its weight.
        """
        off = abs(error - float(row @ self._fit()[0])) / np.sqrt(variance)
        # An outlier was driven backwards, with encoders that measure no sign. Smaller errors beyond
        # the noise contain a slip, which is not systematic.
        weight = 0.0 if off > OUTLIER else 1.0 / max(1.0, off / DEVIATIONS)
        self._information += weight * np.outer(row, row)
        self._sums += weight * error * row
        return weight
