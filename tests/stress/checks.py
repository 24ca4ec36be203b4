"""Checks: rows of the table that measure an error in a unit of their own, against a bound.

A check draws trials from random numbers and gives the error of each; what raises fails.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from lrf3d.errors import MissingLibraryError
from lrf3d.geometry import Float
from stress.tally import EXAMPLES, Case, Findings

Measure = Callable[[np.random.Generator], Float]
"""Makes some trials and gives the error of each, (k,)."""


@dataclass(frozen=True, slots=True)
class Check:
    """What is measured, and how far it may be off.

    Args:
        measure: Makes trials.
        bound: The largest error that is none.
    """

    measure: Measure
    bound: float

    def attempt(self, rng: np.random.Generator, tries: int, outright: int) -> Findings:
        """Make at least so many trials; `outright` is for beams."""
        found = Findings()
        while found.tried < tries:
            # Each round has its own seed, so that a failure can be repeated alone.
            seed = int(rng.integers(2**62))
            try:
                errors = np.atleast_1d(self.measure(np.random.default_rng(seed)))
            except MissingLibraryError as error:
                return found + Findings(left_out=str(error))
            except Exception as error:  # Whatever is raised is what this looks for.
                example: dict[str, Any] = {"seed": seed, "raised": repr(error)}
                found += Findings(1, 1, examples=(example,))
                continue
            # NaN is no error within a bound.
            failed = ~(errors <= self.bound)
            examples = tuple(
                {"seed": seed, "trial": int(k), "error": repr(float(errors[k]))}
                for k in np.flatnonzero(failed)[:EXAMPLES]
            )
            worst = float(np.where(np.isnan(errors), np.inf, errors).max(initial=0.0))
            found += Findings(errors.size, int(failed.sum()), worst, examples)
        return found


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
    """A row of the table from what is measured.

    Args:
        part: What is under test.
        name: What is hard about it.
        measure: Makes trials.
        bound: The largest error that is none.
        unit: The unit of both.
        tries: Trials of a whole run.
        each: Trials that a process makes at a time; all where not given.
        heavy: Whether a short run leaves it out.
    """
    return Case(
        part,
        name,
        partial(Check.attempt, Check(measure, bound)),
        bound=bound,
        unit=unit,
        tries=tries,
        each=tries if each is None else each,
        heavy=heavy,
    )


def ulps(errors: Float, size: Float | float) -> Float:
    """Errors in units of the last place of numbers of a size."""
    return np.asarray(np.abs(errors) / np.spacing(np.abs(np.asarray(size, dtype=np.float64))))
