"""Keeps simulated time next to the wall clock, and measures how well that works."""

from time import monotonic

PATIENCE = 0.25
"""How far [s] ticks may be behind before they count as late; less is caught up."""


class Pace:
    """When the next tick is due.

    A program that was held up for longer, by a debugger or a suspended machine, goes on from there:
    it does not hurry.
    """

    def __init__(self, tick: float) -> None:
        self.tick, self._due, self._lost, self._ticks = tick, monotonic(), 0.0, 0
        self._since = self._due

    def left(self) -> float:
        """Time until the next tick is due [s]."""
        return self._due - monotonic()

    def done(self) -> None:
        """Count a tick."""
        now = monotonic()
        self._due += self.tick
        self._ticks += 1
        if now > self._due + PATIENCE:
            self._lost += now - self._due
            self._due = now

    def rest(self, seconds: float) -> None:
        """Let time stand for a while."""
        self._due = max(self._due, monotonic()) + seconds

    def behind(self) -> float:
        """The share of real time that was reached since the last call, if less than it should be.

        1 is in time.
        """
        now = monotonic()
        elapsed, lost = now - self._since, self._lost
        self._since, self._lost, self._ticks = now, 0.0, 0
        return 1.0 - lost / elapsed if elapsed > 0.0 else 1.0
