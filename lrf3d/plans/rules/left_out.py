"""Counting what is left out of a picture: dark parts enter with a reason, a balance leaves."""

from collections import Counter

import numpy as np

from lrf3d.base.balance import Balance
from lrf3d.geometry.lines import Bool
from lrf3d.world.grid_walls import grown

# Distance [pixels] within which cells are next to each other, also across a corner.
RIM = 1.5


class LeftOut:
    """The parts of a picture's dark pixels that are left out, by reason, and their pixels."""

    def __init__(self, dark: Bool) -> None:
        self.dark = dark
        self.parts = Counter[str]()
        # Which pixels are in large parts as thick as walls.
        self.thick = np.zeros_like(dark)
        # Area [pixels] of the box around the largest part that is not of the building.
        self.outside = 0
        # The number of pixels that are neither paper nor dark.
        self._pale = 0
        # The number of each pixel's reason, from 1; 0 for none.
        self._reason = np.zeros(dark.shape, dtype=np.uint8)

    def without(self, reason: str, cells: Bool, out: Bool, parts: int) -> Bool:
        """Leave out some parts for a reason; returns the other cells."""
        self.parts[reason] += parts
        taken = cells & out & (self._reason == 0)
        self._reason[taken] = list(self.parts).index(reason) + 1
        return cells & ~out

    def leave_pale(self, pale: Bool, parts: int) -> None:
        """Leave out pixels that are neither paper nor dark, in a number of parts."""
        self.parts["pale part"] += parts
        self._pale = int(pale.sum())

    def balance(self, walls: Bool) -> Balance:
        """The balance of all pixels, of which some are walls."""
        used = self.dark & grown(walls, RIM)
        out = self.dark & ~used
        counts = np.bincount(self._reason[out], minlength=len(self.parts) + 1)
        # Strokes are cut off a little before what they meet.
        cut = out & (self._reason == 0) & grown(used | (self._reason > 0), 2.0 * RIM)
        balance = Balance("pixel", self.dark.size, int(used.sum()))
        balance.leave("paper", int((~self.dark).sum()) - self._pale)
        balance.leave("pale part", self._pale)
        balance.leave("thin stroke", int(cut.sum()))
        for reason, count in zip(self.parts, counts[1:].tolist(), strict=True):
            balance.leave(reason, count)
        return balance
