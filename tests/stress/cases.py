"""Cases and findings: what is tried, what it has shown so far, and a table and JSON of both."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from operator import add
from typing import Any

import numpy as np

from lrf3d.errors import MissingLibraryError
from lrf3d.geometry import Float
from stress.result import Row, Table

EXAMPLES = 3
"""Failures that are kept whole, to be repeated by hand."""

MOST = float(np.finfo(np.float64).max)
"""Represents an infinite error, or NaN, in JSON."""

Measure = Callable[[np.random.Generator], Float]
"""Makes some trials and returns the error of each, (k,)."""


@dataclass(frozen=True, slots=True)
class Findings:
    """The results of a case; findings add up.

    Args:
        tried: Number of trials, or beams.
        failed: Number that raised, or whose error exceeds the bound.
        error: The largest error.
        examples: Failures with all that is needed to repeat them.
        left_out: Why nothing could be tried on this machine; otherwise empty.
        counts: Other counts; that of a caster has the name ``CASTER.NAME``.
        largest: Other measurements, the largest of each.
    """

    tried: int = 0
    failed: int = 0
    error: float = 0.0
    examples: tuple[dict[str, Any], ...] = ()
    left_out: str = ""
    counts: Mapping[str, int] = field(default_factory=dict)
    largest: Mapping[str, float] = field(default_factory=dict)

    def __add__(self, other: "Findings") -> "Findings":
        counts = dict.fromkeys((*self.counts, *other.counts))
        largest = dict.fromkeys((*self.largest, *other.largest))
        return Findings(
            self.tried + other.tried,
            self.failed + other.failed,
            max(self.error, other.error),
            (self.examples + other.examples)[:EXAMPLES],
            self.left_out or other.left_out,
            {name: self.counts.get(name, 0) + other.counts.get(name, 0) for name in counts},
            {name: max(self.largest.get(name, 0.0), other.largest.get(name, 0.0))
             for name in largest},
        )  # fmt: skip

    def as_dict(self) -> Row:
        """The findings in JSON's types; those of a caster are a dict under its name."""
        found: Row = {
            "cases": self.tried,
            "failures": self.failed,
            "largest_error": min(self.error, MOST),
            "left_out": self.left_out or None,
        }
        for name, value in {**self.counts, **self.largest}.items():
            caster, _, figure = name.rpartition(".")
            where = found.setdefault(caster, {}) if caster else found
            where[figure] = min(value, MOST)
        return found


@dataclass(frozen=True, slots=True)
class Case:
    """A row of the table.

    Args:
        part: What is under test.
        name: What is hard about it.
        attempt: Makes at least a number of trials; of beams, a number by rationals in any case.
        bound: The largest error that passes.
        unit: The unit of errors and bound.
        tries: Trials of a whole run; 0 for a share of all beams.
        each: Trials that a process makes at a time.
        heavy: Whether a short run leaves it out.
    """

    part: str
    name: str
    attempt: Callable[[np.random.Generator, int, int], Findings]
    bound: float
    unit: str
    tries: int = 0
    each: int = 5_000
    heavy: bool = False


def check(
    part: str,
    name: str,
    measure: Measure,
    *,
    bound: float,
    unit: str,
    tries: int,
    each: int | None = None,
    heavy: bool = False,
) -> Case:
    """A case that measures errors in a unit of its own, by default all trials at a time."""
    attempt = partial(_attempt, measure, bound)
    return Case(part, name, attempt, bound, unit, tries, tries if each is None else each, heavy)


def _attempt(
    measure: Measure, bound: float, rng: np.random.Generator, tries: int, outright: int
) -> Findings:
    """Make at least a number of trials; an exception is a failure."""
    found = Findings()
    while found.tried < tries:
        # Each round has its own seed, so that a failure can be repeated alone.
        seed = int(rng.integers(2**62))
        try:
            errors = np.atleast_1d(measure(np.random.default_rng(seed)))
        except MissingLibraryError as error:
            return replace(found, left_out=str(error))
        except Exception as error:  # Whatever is raised is what this looks for.
            found += Findings(1, 1, examples=({"seed": seed, "raised": repr(error)},))
            continue
        # NaN is no error within a bound.
        failed = ~(errors <= bound)
        examples = tuple(
            {"seed": seed, "trial": int(k), "error": repr(float(errors[k]))}
            for k in np.flatnonzero(failed)[:EXAMPLES]
        )
        worst = float(np.where(np.isnan(errors), np.inf, errors).max(initial=0.0))
        found += Findings(errors.size, int(failed.sum()), worst, examples)
    return found


def ulps(errors: Float, size: Float | float) -> Float:
    """Errors in units of the last place of numbers of a size."""
    return np.asarray(np.abs(errors) / np.spacing(np.abs(np.asarray(size, dtype=np.float64))))


BEAMS = Table(
    "beams",
    {
        "name": "casting",
        "cases": "beams",
        "certified_by_bound": "by bound",
        "certified_by_rationals": "by rationals",
        "outright_by_rationals": "outright",
        "planar.wrong": "planar wrong",
        "planar.inexact": ("inexact", "{:,}".format),
        "planar.largest_error_ulp": ("ulp", "{:.3g}".format),
        "planar.largest_error_m": ("m", "{:.1e}".format),
        "embree.wrong": "embree wrong",
        "embree.inexact": ("inexact", "{:,}".format),
        "embree.largest_error_ulp": ("ulp", "{:.3g}".format),
        "embree.largest_error_m": ("m", "{:.1e}".format),
    },
)
"""Beams of each kind, and how the casters did."""

CHECKS = Table(
    "checks",
    {
        "part": "part",
        "name": "what was tried",
        "unit": "unit of the error",
        "cases": "cases",
        "failures": ("failed", "{:,}".format),
        "largest_error": ("largest error", "{:.3g}".format),
        "bound": ("bound", "{:g}".format),
        "left_out": ("left out", str),
    },
    left=3,
)
"""What else was tried."""


@dataclass(frozen=True, slots=True)
class Report:
    """What a run has shown.

    Args:
        rows: The cases with their findings.
        asked: Beams that were asked for.
        seed: Seed of the random numbers.
        seconds: Time that it took [s].
        complete: Whether all was tried; else the time was over before.
    """

    rows: Sequence[tuple[Case, Findings]]
    asked: int
    seed: int
    seconds: float
    complete: bool

    @property
    def total(self) -> Findings:
        """All beams together."""
        return reduce(add, (found for case, found in self.rows if not case.tries), Findings())

    @property
    def passed(self) -> bool:
        """Whether nothing failed of what was tried."""
        return not any(found.failed for _, found in self.rows)

    def as_dict(self) -> dict[str, Any]:
        """The report in JSON's types."""
        total = self.total.as_dict()
        total["beams"] = total.pop("cases")
        return {
            **total,
            "passed": self.passed,
            "complete": self.complete,
            "seed": self.seed,
            "seconds": self.seconds,
            "beams_asked": self.asked,
            "rows": list(map(_row, *zip(*self.rows, strict=True))) if self.rows else [],
            "failures": [
                {"row": case.name, **example}
                for case, found in self.rows
                for example in found.examples
            ],
        }

    def text(self) -> str:
        """A table for the casters, one for all else, and what it comes to."""
        beams = [_row(case, found) for case, found in self.rows if not case.tries]
        checks = [_row(case, found) for case, found in self.rows if case.tries]
        total = self.total.as_dict()
        beams += [{"name": "all", **total}] if beams else []
        lines = [f"{self.seconds:.0f} s, seed {self.seed}"]
        if not self.complete:
            lines.append("The time was over before all was tried.")
        if total.get("contradictions"):
            lines.append(f"Bounds and rationals disagree on {total['contradictions']:,} beams.")
        parts = [BEAMS.text(beams), CHECKS.text(checks), "\n".join(lines)]
        return "\n\n".join(part for part in parts if part)


def _row(case: Case, found: Findings) -> Row:
    """A case with its findings, as a row of a table."""
    said = {"part": case.part, "name": case.name, "bound": case.bound, "unit": case.unit}
    return {**said, **found.as_dict()}
