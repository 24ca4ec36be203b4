"""Predictions of the motion between two scans, by wheels, or without any by the motion before.

A prediction is where a scan is looked for, and what speaks for finding the robot there.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Float

SLIP, SLIP_SHARE, SLIP_TURN, SLIP_TURN_SHARE = 0.4, 0.3, 0.7, 0.3
"""How far [m], [rad] wheels may slip between two scans, and as a share of their step: the window
that is searched. A bump turns a robot by half a radian."""

DOUBTFUL = 0.65
"""Share of a scan that a match must explain; otherwise the places around it are searched."""

COAST, COAST_TURN, COAST_SHARE = 0.03, 0.03, 0.2
"""Standard deviations [m], [rad] of a motion from the one before, and the share of the motion that
is added. With .1 m a robot that starts to move in a corridor is taken to stand still."""

COAST_WINDOW = np.array([0.5, 0.5, 0.6])
"""Largest standard deviations [m], [rad] of the window that is searched without wheels."""

ALWAYS = 2.0
"""More than any match explains: every scan is searched."""

FORGETTING = 0.98
"""Weight of the past in the running mean of the prediction errors, at each scan."""

LOST_SHARE = 0.5
"""Share of the last motion that is predicted after each scan that matches nothing."""


class Prediction(NamedTuple):
    """The motion (3,) that is expected since the last scan.

    It has a covariance (3, 3) of its random errors, and one with all errors, which weighs it in
    matching; a window has the standard deviations (3,) of what may go wrong besides. The window is
    searched where a match explains less than a share. Where the prediction is trusted it counts,
    too, when places are compared.
    """

    step: Float
    covariance: Float
    uncertain: Float
    window: Float
    doubtful: float = DOUBTFUL
    trusted: bool = True


def slip_deviations(step: Float) -> Float:
    """Standard deviations (3,) of the wheels' slip in a step (3,)."""
    aside = SLIP + SLIP_SHARE * float(np.hypot(step[0], step[1]))
    turn = SLIP_TURN + SLIP_TURN_SHARE * abs(float(step[2]))
    return np.array([aside, aside, turn]) / 3.0


class Excess:
    """How large squared errors of predictions are in units of their variance: a running mean.

    The scale (2,) is that of places and of headings. It never falls below a floor (2,): predictions
    that were right for a while may still be wrong.
    """

    def __init__(self, heading: float = 1.0) -> None:
        self.floor = np.array([1.0, heading])
        self._mean = np.ones(2)

    @property
    def scale(self) -> Float:
        """Factors (2,) on the variances of places and of headings."""
        return np.asarray(np.maximum(self._mean, self.floor))

    def update(self, prediction: Prediction, found: Float) -> None:
        """Update the mean with a prediction and the motion (3,) that matching found."""
        error = found - prediction.step
        square = error**2 / prediction.covariance.diagonal() * self.scale[[0, 0, 1]]
        now = np.array([0.5 * (square[0] + square[1]), square[2]])
        # A slip counts as at most ten deviations, so that its effect fades.
        now = np.minimum(now, 100.0 * self._mean)
        self._mean = np.maximum(FORGETTING * self._mean + (1.0 - FORGETTING) * now, 1.0)


class Coasting:
    """Without odometry: a robot keeps its motion between the last two scans, up to noise.

    Every scan is searched, and places are chosen by what scans show alone: in a corridor a robot
    that has begun to move explains most of what it sees where it stood.
    """

    def __init__(self) -> None:
        self._step = np.zeros(3)
        self._excess = Excess()

    def predict(self) -> Prediction:
        """The motion up to the next scan."""
        length, turn = float(np.hypot(self._step[0], self._step[1])), abs(float(self._step[2]))
        place, heading = COAST + COAST_SHARE * length, COAST_TURN + COAST_SHARE * turn
        variances = np.array([place, place, heading]) ** 2 * self._excess.scale[[0, 0, 1]]
        window = np.maximum(slip_deviations(self._step), np.sqrt(variances))
        spread = np.diag(variances)
        window = np.minimum(window, COAST_WINDOW)
        return Prediction(self._step, spread, spread, window, ALWAYS, trusted=False)

    def found(self, prediction: Prediction, step: Float) -> None:
        """Update with the motion (3,) to a scan that was matched."""
        self._excess.update(prediction, step)
        self._step = step

    def lost(self) -> None:
        """Update for a scan that was not matched."""
        self._step = LOST_SHARE * self._step
