"""The estimate of a run over its film: its trail and its ellipses, as lines of even width.

A time enters; lines leave that both renderers draw. Lines keep their width in pixels, so that the
estimate is seen on the trail of the truth, from near and from far.
"""

from collections.abc import Iterator

import numpy as np

from lrf3d.geometry import Float, Single
from lrf3d.render.primitives import Draw, Primitive
from lrf3d.scene import look
from lrf3d.scene.beams import LINE_SIZES, line_quads
from lrf3d.scene.estimate import CORNERS, DrawnEstimate, outlines

TRAIL_WIDTH, ELLIPSE_WIDTH = 1.9, 1.6
"""Widths of lines [pixels at 720 lines]."""

_CORNERS_OF_LINE = 6
"""Rows that a line takes."""


class EstimateLayer:
    """Draws the estimate of a run; nothing where it has none.

    Args:
        estimate: The estimate.
    """

    def __init__(self, estimate: DrawnEstimate | None) -> None:
        self._estimate = estimate
        self._primitives: tuple[Primitive, ...] = ()
        if estimate is None:
            return
        places = estimate.places
        trail = _lines(places[:-1], places[1:], 1.0)
        kept = _closed(estimate.outlines(), look.ESTIMATE_FADED)
        self._trail = Primitive("lines", LINE_SIZES, trail, blend=True)
        self._kept = Primitive("lines", LINE_SIZES, kept, blend=True)
        self._now = Primitive("lines", LINE_SIZES, _none(), capacity=8 * CORNERS, blend=True)
        self._primitives = (self._trail, self._kept, self._now)

    @property
    def all(self) -> tuple[Primitive, ...]:
        """All primitives."""
        return self._primitives

    def draws(self, time: float, scale: float, nearer: float) -> Iterator[Draw]:
        """What is drawn at a time.

        Args:
            time: From the start of the run on [s].
            scale: How many times their size at 720 lines lines are.
            nearer: How much nearer to the eye they are than the ground [m].
        """
        estimate = self._estimate
        if estimate is None:
            return
        place = estimate.place(time)
        # The leg that is being driven ends where the robot is estimated to be now.
        done = max(0, int(np.searchsorted(estimate.times, time, side="right")) - 1)
        self._trail.count = _CORNERS_OF_LINE * min(done, len(estimate.times) - 1)
        kept = estimate.kept_before(time)
        self._kept.count = _CORNERS_OF_LINE * CORNERS * kept
        ellipse = _closed(outlines(place[None], estimate.shape(time)[None]), 1.0)
        self._now.update(
            np.concatenate([ellipse, _lines(estimate.places[[done]], place[None], 1.0)])
        )
        yield Draw(self._kept, {"width": ELLIPSE_WIDTH * scale, "nearer": nearer})
        yield Draw(self._trail, {"width": TRAIL_WIDTH * scale, "nearer": nearer})
        yield Draw(self._now, {"width": TRAIL_WIDTH * scale, "nearer": nearer})


def _none() -> Single:
    return np.zeros((0, sum(LINE_SIZES)), np.float32)


def _closed(rings: Float, alpha: float) -> Single:
    """Lines around closed outlines (n, c, 2)."""
    return _lines(rings.reshape(-1, 2), np.roll(rings, -1, axis=1).reshape(-1, 2), alpha)


def _lines(starts: Float, ends: Float, alpha: float) -> Single:
    """Lines (n, 2) to (n, 2) on the ground, in the estimate's colour."""
    colours = np.tile(look.ESTIMATE_COLOUR, (len(starts), 1))
    opacity = np.full((len(starts), 2), alpha)
    return line_quads(starts, ends, colours, opacity, look.TRAIL_HEIGHT)
