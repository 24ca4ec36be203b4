"""Keeps simulated time next to the wall clock, and reports how well that works."""

from time import monotonic

PATIENCE = 0.25
"""How far [s] ticks may be behind before they count as late; less is caught up."""


class Pace:
    """When the next tick is due.

    A program that was held up for longer, by a debugger or a suspended machine, goes on from there:
    it does not hurry.
    """

    def __init__(self, tick: float) -> None:
        self.tick, self._lost = tick, 0.0
        self._due = self._since = monotonic()

    def next(self, seconds: float | None = None) -> float:
        """Time until the next tick is due [s], one tick after the last, or after some seconds."""
        now = monotonic()
        self._due += self.tick if seconds is None else seconds
        if now > self._due + PATIENCE:
            self._lost += now - self._due
            self._due = now
        return self._due - now

    def share(self) -> float:
        """The share of the wanted speed that was reached since the last call."""
        elapsed, lost = monotonic() - self._since, self._lost
        self._since, self._lost = monotonic(), 0.0
        return 1.0 - lost / elapsed if elapsed > 0.0 else 1.0
