"""Motion: predictions of the step between two scans, by wheels, or without any by the last step.

Odometry increments (ahead, to the left [m], turn [rad]) and the same motions by scan matching
enter; predictions with their covariances leave. The systematic errors of the wheels are

    Δθ = (1 + a)·Δθ_wheels + b·Δs,    Δs = (1 + c)·Δs_wheels

with a (a wrong wheel base), b (wheels of unequal size) and c (a wrong circumference) from a linear
regression over all stretches so far. It regresses the wheels on the scans, and is then solved for
the scans: the other way round the noise of a drive straight ahead would show as turns. The
residuals of the turns are the noise of the heading, which is learnt as well.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.matching.key_scans import FORGETTING

# Largest slip of wheels between two scans [m], [rad], and the share of their step that is added to
# it: the window that is searched. A bump turns a robot by half a radian.
WINDOW = np.array([0.4, 0.4, 0.7])
WINDOW_SHARE = 0.3

# Least share of a scan that a match must explain; otherwise the places around it are searched.
DOUBTFUL = 0.65

# Standard deviations of a, b [rad/m] and c before anything was driven.
EXPECTED = np.array([0.05, 0.05, 0.03])

# Standard deviations of an increment's place [m] and turn [rad]: a constant, even of wheels that
# stand still, and for each metre and each radian, as wheels slip on carpets and sills.
NOISE = np.array([[0.005, 0.05, 0.05], [0.003, 0.02, 0.05]])

# Prior of the heading noise as a variance in units of that of good wheels, and its weight in
# stretches. Small robots slip two to four times as much; taken for good ones, their noise looks
# like a turn per metre, which bends a hall by ten degrees.
ROUGH = 9.0
ROUGH_STRETCHES = 20.0


class Prediction(NamedTuple):
    """The expected step (3,) since the last scan.

    It has a covariance (3, 3) of its random errors, and an uncertain one with all errors, which
    weighs it in matching; a window of standard deviations (3,) is searched where a match explains
    less than the doubtful share. A trusted prediction also weighs places that are compared. Where
    scans contradicted it before, another one may be right as well.
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
    return np.asarray((WINDOW + WINDOW_SHARE * np.array([length, length, turn])) / 3.0)


class Excess:
    """Running means of squared prediction errors in units of their variance.

    One is for places and one for headings. Neither falls below its floor: predictions that were
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
        """Update the mean with a prediction and the step (3,) that matching found."""
        error = found - prediction.step
        # The variances of the prediction are already multiplied by the scale.
        x, y, heading = error**2 / prediction.covariance.diagonal() * self.scale
        # A slip counts as at most ten deviations, so that its effect fades.
        now = np.minimum([0.5 * (x + y), heading], 100.0 * self._mean)
        self._mean = np.maximum(FORGETTING * self._mean + (1.0 - FORGETTING) * now, 1.0)


class Coasting:
    """Without odometry: a robot repeats its last step, up to noise.

    Every scan is searched, and places are chosen by what scans show alone: in a corridor the place
    of the last scan explains most of the next one, even where the robot has started to move.
    """

    def __init__(self) -> None:
        self._step = np.zeros(3)
        self._excess = Excess()

    def predict(self) -> Prediction:
        """The step to the next scan."""
        length, turn = size_of(self._step)
        # Standard deviation [m], [rad] of a step from the last one, and the share of the step that
        # is added. With 0.1 m a robot that starts to move in a corridor is taken to stand still.
        coast = 0.03
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
        """Update for a scan that was not matched."""
        # Share of the last step that is predicted after each scan that matches nothing.
        lost_share = 0.5
        self._step = lost_share * self._step


class Wheels:
    """Corrects odometry increments by the errors of the wheels that scan matching has shown."""

    def __init__(self) -> None:
        # The regression of the wheels' errors: those of turns as shares of the true turn and
        # distance, those of distances as a share of the true distance.
        self._information = np.zeros((3, 3))
        self._sums = np.zeros(3)
        # Squares of the turns' errors, and their number.
        self._squares = self._stretches = 0.0
        self.excess = Excess(ROUGH)
        self._errors, self._known = self._fit()

    @property
    def biases(self) -> Float:
        """The errors (3,): a, b [rad/m] and c."""
        a, b, c = self._errors.tolist()
        return -np.array([a / (1.0 + a), b / (1.0 + a), c / (1.0 + c)])

    def _fit(self) -> tuple[Float, Float]:
        """The wheels' errors (3,) as shares of the true motion, and their information (3, 3)."""
        noise = self.excess.heading
        variances = np.array([noise, noise, 1.0])
        known = np.diag(EXPECTED**-2.0) + self._information / variances
        return np.asarray(np.linalg.solve(known, self._sums / variances)), known

    def predict(self, increment: Float) -> Prediction:
        """The step of an increment (3,), corrected by the systematic errors."""
        a, b, c = self.biases.tolist()
        ahead, left, turn = increment * (1.0 + np.array([c, c, a]))
        step = np.array([ahead, left, turn + b * ahead])
        covariance = self._covariance(step)
        # At first a and b are several times less certain than the random errors. A prior without
        # that would turn the first few scans, and with them the whole drive.
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
        excess_ahead, _, excess_turn = (measured - matched).tolist()
        # The larger distance counts, so that wheels that measure twice as much are corrected, too.
        farthest, _, widest = np.maximum(np.abs(matched), np.abs(measured))
        _, spread = NOISE @ [1.0, farthest, widest]
        error = excess_turn / spread
        row = np.array([turn, ahead, 0.0]) / spread
        weight = self._regress(row, error, self.excess.heading)
        self._squares, self._stretches = self._squares + weight * error**2, self._stretches + weight
        # Weight of the prior in the residuals of the regression: with the whole prior, wheels far
        # from it would look noisy.
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
        """Add an error of a stretch and its factors (3,), in deviations of good wheels.

        Returns its weight.
        """
        off = abs(error - float(row @ self._fit()[0])) / np.sqrt(variance)
        # Beyond ten deviations it was driven backwards, with encoders that measure no sign; beyond
        # three it contains a slip, which is no systematic error.
        weight = 0.0 if off > 10.0 else 1.0 / max(1.0, off / 3.0)
        self._information += weight * np.outer(row, row)
        self._sums += weight * error * row
        return weight
