"""Batches: runs in lots that take about as long as is worth sending."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from lrf3d.study.sweep.plan import Cell, PlannedRun

SECONDS = 0.5
"""How long a batch should take [s]: a hundred times what sending it costs, and short enough that
little is lost with a worker or at the end."""

MOST = 256
"""Runs of a batch at most."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Runs of one place that are sent together."""

    place: str
    runs: tuple[PlannedRun, ...]


class Batches:
    """Cuts runs into batches, by how long those before them took.

    Args:
        runs: The runs, in order.
        cells: The cells that they belong to.
        workers: How many workers share them.
    """

    def __init__(self, runs: Iterable[PlannedRun], cells: Sequence[Cell], *, workers: int) -> None:
        self._waiting = deque(runs)
        self._cells, self._workers = cells, workers
        self._pace: dict[object, float] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def take(self) -> Batch | None:
        """The next batch; None when there is none."""
        if not self._waiting:
            return None
        place = self._cells[self._waiting[0].cell].place
        # Towards the end batches get smaller, so that all workers end at about one time.
        most = min(MOST, max(1, len(self._waiting) // (2 * self._workers)))
        runs: list[PlannedRun] = []
        seconds = 0.0
        while self._waiting and len(runs) < most and seconds < SECONDS:
            if self._cells[self._waiting[0].cell].place != place:
                break
            runs.append(self._waiting.popleft())
            seconds += self._expected(runs[-1])
        return Batch(place, tuple(runs))

    def learn(self, batch: Batch, seconds: float) -> None:
        """Take in how long a batch took [s].

        Only the last counts: the first in a process also load what was compiled.
        """
        for name in {each for run in batch.runs for each in self._names(run)}:
            self._pace[name] = seconds / len(batch.runs)

    def _expected(self, run: PlannedRun) -> float:
        """How long a run will take [s]; a whole batch where nothing like it has been made."""
        return next((self._pace[n] for n in self._names(run) if n in self._pace), SECONDS)

    def _names(self, run: PlannedRun) -> tuple[object, ...]:
        """What a run is like: its cell, or else its world and mode."""
        cell = self._cells[run.cell]
        return run.cell, (cell.world, cell.columns["mode"])
