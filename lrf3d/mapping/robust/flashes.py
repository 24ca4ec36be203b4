"""Flashes: where glass faces the laser, and the lines that flashes of one pane lie on.

Near its normal glass flashes: it returns many times the light of any diffuse wall, and the beams
next to the flash pass it, or return next to nothing.
"""

import numpy as np

from lrf3d.geometry import Bool, Float, Int, cross
from lrf3d.mapping.robust.light import BRIGHT, DEVIATION, FREE, RANGE, UX, UY, LitScan
from lrf3d.mapping.robust.surfaces import (
    DEVIATIONS,
    DIM,
    FLASH,
    FLASH_ANGLE,
    MOST_OPAQUE,
    ON_LINE,
    PASSED_BY,
    SHORTEST,
)

BESIDE = np.radians(1.5), np.radians(20.0)
"""[rad] How far off a flash beams show what stands next to it."""

LEAST_SHOWN = 3
"""[beams] A flash is of glass if on one side so many of these pass or are dim, and few of them
return from the line of the flash as from a wall: metal and retro-reflectors do."""

LOOSE, STEADY, FARTHEST = 0.015, 0.005, 0.3
"""[rad, rad, m] How far off a line other flashes may lie by its direction, that of one flash and
that of several, and at most."""

LONGEST_GAP = 8.0
"""[m] Between two flashes of a pane."""

NEAREST_FLASH = 0.05
"""[m] Nearer to one that is known another one shows nothing."""


class Flashes:
    """All flashes of glass so far, and the line of each.

    Attributes:
        line_of: (f,) number of each flash's line.
    """

    def __init__(self) -> None:
        # Of each its place, the direction of its beam, and the deviation of its range.
        self._flashes = np.empty((0, 5))
        self.line_of: Int = np.empty(0, np.int64)

    def add(self, scan: LitScan) -> None:
        """Add the flashes of a scan."""
        rays, bright = scan.rays, scan.rays[:, BRIGHT]
        peak = (bright > FLASH) & (bright > np.roll(bright, 1)) & (bright >= np.roll(bright, -1))
        units = rays[:, [UX, UY]]
        places = scan.place + rays[:, RANGE, None] * units
        # Nearer to a flash that is known another one shows nothing.
        peaks = np.array(
            [row for row in np.flatnonzero(peak).tolist() if self._is_new(places[row])]
        )
        if not len(peaks):
            return
        cos = units[peaks] @ units.T
        beside = (cos < np.cos(BESIDE[0])) & (cos > np.cos(BESIDE[1]))
        way = rays[peaks, RANGE, None] / np.maximum(cos, np.cos(BESIDE[1]))
        tolerance = ON_LINE + DEVIATIONS * rays[peaks, DEVIATION, None]
        on = beside & (rays[:, RANGE] > 0.0) & (np.abs(rays[:, RANGE] - way) * cos < tolerance)
        dim = on & (bright < DIM)
        passed = beside & (rays[:, FREE] > way + tolerance + PASSED_BY)
        glass = np.zeros(len(peaks), np.bool_)
        # One side is enough: at the end of a pane a wall may follow.
        left = cross(units[peaks][:, None], units[None]) > 0.0
        for side in (left, ~left):
            shown = ((dim | passed) & side).sum(axis=1)
            opaque = (on & ~dim & side).sum(axis=1)
            glass |= (shown >= LEAST_SHOWN) & (opaque < MOST_OPAQUE * shown)
        for row in peaks[glass].tolist():
            if self._is_new(places[row]):
                self._add(np.array([*places[row], *units[row], rays[row, DEVIATION]]))

    def _is_new(self, place: Float) -> bool:
        apart = self._flashes[:, :2] - place
        return bool(((apart * apart).sum(axis=1) > NEAREST_FLASH**2).all())

    def _add(self, flash: Float) -> None:
        """Add a flash to the line that it lies on, or begin another one."""
        own = int(self.line_of.max(initial=-1)) + 1
        self._flashes = np.vstack([self._flashes, flash])
        self.line_of = np.append(self.line_of, own)
        for other in np.unique(self.line_of[:-1]).tolist():
            if self._on(other)[-1]:
                own = other
                break
        self.line_of[-1] = own
        # Others that lie on it now, as it is better known, are of the same line.
        taken = self._on(own)
        for other in np.unique(self.line_of[taken]).tolist():
            if taken[self.line_of == other].all():
                self.line_of[self.line_of == other] = own

    def line(self, number: int) -> tuple[Float, Float, Float]:
        """A point (2,) of a line, its direction (2,), and the places (f, 2) of its flashes [m]."""
        own = self._flashes[self.line_of == number]
        point = own[:, :2].mean(axis=0)
        unit = np.array([-own[0, 3], own[0, 2]])
        if np.ptp((own[:, :2] - point) @ unit) > SHORTEST:
            unit = np.linalg.eigh(np.cov((own[:, :2] - point).T))[1][:, 1]
        return point, unit, own[:, :2]

    def _on(self, number: int) -> Bool:
        """Which flashes (f,) lie on a line."""
        point, unit, places = self.line(number)
        offset, own = self._flashes[:, :2] - point, (places - point) @ unit
        along = offset @ unit
        aside = np.abs(cross(unit, offset))
        turn = STEADY if np.ptp(own) > SHORTEST else LOOSE
        allowed = ON_LINE + DEVIATIONS * self._flashes[:, 4]
        allowed = allowed + np.minimum(turn * np.abs(along), FARTHEST)
        near = np.maximum(along - own.max(), own.min() - along) < LONGEST_GAP
        on: Bool = (aside < allowed) & near
        return on & (np.abs(self._flashes[:, 2:4] @ unit) < FLASH_ANGLE)
