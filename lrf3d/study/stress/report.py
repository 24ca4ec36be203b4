"""The report of a stress run, as JSON and as a table."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

from lrf3d.study.stress.tally import Case, Tally


@dataclass(frozen=True, slots=True)
class Report:
    """What a run has shown.

    Args:
        rows: The cases and their tallies.
        asked: Beams that were asked for.
        seed: Seed of the random numbers.
        seconds: Time that it took [s].
        complete: Whether all was tried; else the time was over before.
    """

    rows: Sequence[tuple[Case, Tally]]
    asked: int
    seed: int
    seconds: float
    complete: bool

    @property
    def total(self) -> Tally:
        """All cases together."""
        return reduce(add, (tally for _, tally in self.rows), Tally())

    @property
    def passed(self) -> bool:
        """Whether nothing failed of what was tried."""
        return self.total.failures == 0

    def as_dict(self) -> dict[str, Any]:
        """The report in JSON's types."""
        return {
            "passed": self.passed,
            "complete": self.complete,
            "seed": self.seed,
            "seconds": self.seconds,
            "beams_asked": self.asked,
            **self.total.as_dict(),
            "rows": [
                {"part": case.part, "name": case.name, **tally.as_dict()}
                for case, tally in self.rows
            ],
            "failures": [
                {"row": case.name, **example}
                for case, tally in self.rows
                for example in tally.examples
            ],
        }

    def text(self) -> str:
        """A table for each part, and what it comes to."""
        parts = dict.fromkeys(case.part for case, _ in self.rows)
        return "\n\n".join([*(self._table(part) for part in parts), "\n".join(self._verdict())])

    def _table(self, part: str) -> str:
        rows = [(case.name, tally) for case, tally in self.rows if case.part == part]
        rows.append(("all", reduce(add, (tally for _, tally in rows), Tally())))
        subjects = list(rows[-1][1].claims)
        head = [part, "beams", "by bound", "by rationals"]
        for subject in subjects:
            head += [f"{subject} wrong", "ulp", "m"]
        cells = [head]
        for name, tally in rows:
            line = [name, f"{tally.tried:,}", f"{tally.bounds:,}", f"{tally.rationals:,}"]
            for subject in subjects:
                if claims := tally.claims.get(subject):
                    line += [f"{claims.wrong:,}", f"{claims.ulp:.3g}", f"{claims.metres:.1e}"]
                else:
                    line += ["–"] * 3
            cells.append(line)
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        return "\n".join(
            "  ".join(
                [line[0].ljust(widths[0])]
                + [cell.rjust(width) for cell, width in zip(line[1:], widths[1:], strict=True)]
            )
            for line in cells
        )

    def _verdict(self) -> list[str]:
        total = self.total
        lines = [
            f"{total.tried:,} beams in {self.seconds:.0f} s: {total.bounds:,} certified by error"
            f" bounds, {total.rationals:,} by rationals, {total.outright:,} of these outright"
        ]
        if not self.complete:
            lines.append(f"The time was over before all {self.asked:,} beams were tried.")
        for name, claims in total.claims.items():
            lines.append(
                f"{name}: {claims.wrong:,} wrong decisions, {claims.inexact:,} ranges off by too"
                f" much, largest error {claims.ulp:.3g} ulp, {claims.metres:.1e} m"
            )
        if total.contradictions:
            lines.append(f"Bounds and rationals disagree on {total.contradictions:,} beams.")
        return lines
