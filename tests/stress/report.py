"""The report of a stress run, as JSON and as a table."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

from lrf3d.tables import table
from stress.tally import Case, Findings, Tally


@dataclass(frozen=True, slots=True)
class Report:
    """What a run has shown.

    Args:
        rows: The cases with the tallies of casters, and the findings of all else.
        asked: Beams that were asked for.
        seed: Seed of the random numbers.
        seconds: Time that it took [s].
        complete: Whether all was tried; else the time was over before.
    """

    rows: Sequence[tuple[Case, Tally | Findings]]
    asked: int
    seed: int
    seconds: float
    complete: bool

    @property
    def total(self) -> Tally:
        """All beams together."""
        return reduce(add, (found for _, found in self.rows if isinstance(found, Tally)), Tally())

    @property
    def passed(self) -> bool:
        """Whether nothing failed of what was tried."""
        return not any(found.failures for _, found in self.rows)

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
                {
                    "part": case.part,
                    "name": case.name,
                    "failures": found.failures,
                    "bound": case.bound,
                    "unit": case.unit,
                    **found.as_dict(),
                }
                for case, found in self.rows
            ],
            "failures": [
                {"row": case.name, **example}
                for case, found in self.rows
                for example in found.examples
            ],
        }

    def text(self) -> str:
        """A table for the casters, one for all else, and what it comes to."""
        beams = [(case.name, found) for case, found in self.rows if isinstance(found, Tally)]
        checks = [(case, found) for case, found in self.rows if isinstance(found, Findings)]
        parts = [self._beams(beams)] if beams else []
        parts += [self._checks(checks)] if checks else []
        return "\n\n".join([*parts, "\n".join(self._verdict())])

    def _checks(self, checks: Sequence[tuple[Case, Findings]]) -> str:
        head = ("part", "what was tried", "cases", "failed", "largest error", "bound", "unit")
        cells = []
        before = ""
        for case, found in checks:
            cells.append(
                [
                    case.part if case.part != before else "",
                    case.name,
                    f"{found.tried:,}",
                    f"{found.failed:,}",
                    "–" if not found.tried else f"{found.error:.3g}",
                    f"{case.bound:g}",
                    case.unit if not found.left_out else f"{case.unit}; left out: no OpenGL",
                ]
            )
            before = case.part
        return table(head, cells, left=(0, 1, 6))

    def _beams(self, beams: Sequence[tuple[str, Tally]]) -> str:
        rows = [*beams, ("all", self.total)]
        subjects = list(rows[-1][1].claims)
        head = ["casting", "beams", "by bound", "by rationals"]
        for subject in subjects:
            head += [f"{subject} wrong", "ulp", "m"]
        cells = []
        for name, tally in rows:
            line = [name, f"{tally.tried:,}", f"{tally.bounds:,}", f"{tally.rationals:,}"]
            for subject in subjects:
                if claims := tally.claims.get(subject):
                    line += [f"{claims.wrong:,}", f"{claims.ulp:.3g}", f"{claims.metres:.1e}"]
                else:
                    line += ["–"] * 3
            cells.append(line)
        return table(head, cells)

    def _verdict(self) -> list[str]:
        total = self.total
        others = [found for _, found in self.rows if isinstance(found, Findings)]
        lines = [f"{self.seconds:.0f} s, seed {self.seed}"]
        if not self.complete:
            lines.append("The time was over before all was tried.")
        if total.tried:
            lines.append(
                f"{total.tried:,} beams: {total.bounds:,} certified by error bounds,"
                f" {total.rationals:,} by rationals, {total.outright:,} of these outright"
            )
        if others:
            tried, failed = sum(one.tried for one in others), sum(one.failed for one in others)
            lines.append(f"{tried:,} other cases: {failed:,} failed")
        for name, claims in total.claims.items():
            lines.append(
                f"{name}: {claims.wrong:,} wrong decisions, {claims.inexact:,} ranges off by too"
                f" much, largest error {claims.ulp:.3g} ulp, {claims.metres:.1e} m"
            )
        if total.contradictions:
            lines.append(f"Bounds and rationals disagree on {total.contradictions:,} beams.")
        return lines
