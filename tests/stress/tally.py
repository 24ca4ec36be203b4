"""Cases and tallies: what is tried, and what it has shown so far."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

EXAMPLES = 3
"""Failures that are kept whole, to be repeated by hand."""


@dataclass(frozen=True, slots=True)
class Claims:
    """How one subject, such as a caster, has done.

    Args:
        wrong: Wrong decisions: the wrong wall, a return for a miss, or a miss for a return.
        inexact: Right decisions whose number is off by more than it may be.
        ulp: Largest error of a number in units in the last place.
        metres: Largest error of a number [m].
    """

    wrong: int = 0
    inexact: int = 0
    ulp: float = 0.0
    metres: float = 0.0

    def __add__(self, other: "Claims") -> "Claims":
        return Claims(
            self.wrong + other.wrong,
            self.inexact + other.inexact,
            max(self.ulp, other.ulp),
            max(self.metres, other.metres),
        )

    def as_dict(self) -> dict[str, Any]:
        """The claims in JSON's types."""
        return {
            "wrong": self.wrong,
            "inexact": self.inexact,
            # Only a range claimed where the true one is 0 is off by more units than JSON can say.
            "largest_error_ulp": min(self.ulp, np.finfo(np.float64).max),
            "largest_error_m": self.metres,
        }


@dataclass(frozen=True, slots=True)
class Tally:
    """What was tried, how it was certified, and how the subjects did; tallies add up.

    Args:
        tried: How many beams.
        rationals: Those that rationals decided; error bounds decided the others.
        outright: Those chosen for rationals beforehand, whatever the bounds say.
        contradictions: Those on which bounds and rationals do not agree: the proof is broken.
        claims: How each subject did, by its name.
        examples: Failures with all that is needed to repeat them.
    """

    tried: int = 0
    rationals: int = 0
    outright: int = 0
    contradictions: int = 0
    claims: dict[str, Claims] = field(default_factory=dict)
    examples: tuple[dict[str, Any], ...] = ()

    def __add__(self, other: "Tally") -> "Tally":
        names = dict.fromkeys((*self.claims, *other.claims))
        none = Claims()
        return Tally(
            self.tried + other.tried,
            self.rationals + other.rationals,
            self.outright + other.outright,
            self.contradictions + other.contradictions,
            {name: self.claims.get(name, none) + other.claims.get(name, none) for name in names},
            (self.examples + other.examples)[:EXAMPLES],
        )

    @property
    def bounds(self) -> int:
        """How many error bounds decided."""
        return self.tried - self.rationals

    @property
    def failures(self) -> int:
        """What must be 0: wrong decisions, numbers off by too much, and broken proofs."""
        return self.contradictions + sum(one.wrong + one.inexact for one in self.claims.values())

    def as_dict(self) -> dict[str, Any]:
        """The tally in JSON's types."""
        return {
            "beams": self.tried,
            "certified_by_bound": self.bounds,
            "certified_by_rationals": self.rationals,
            "outright_by_rationals": self.outright,
            "contradictions": self.contradictions,
            **{name: claims.as_dict() for name, claims in self.claims.items()},
        }


@dataclass(frozen=True, slots=True)
class Findings:
    """What was tried of a part that measures in a unit of its own; findings add up.

    Args:
        tried: How many trials.
        failed: Those that raised, or whose error is beyond the bound.
        error: The largest error.
        examples: Failures with all that is needed to repeat them.
        left_out: Why nothing could be tried on this machine; empty where it could.
    """

    tried: int = 0
    failed: int = 0
    error: float = 0.0
    examples: tuple[dict[str, Any], ...] = ()
    left_out: str = ""

    def __add__(self, other: "Findings") -> "Findings":
        return Findings(
            self.tried + other.tried,
            self.failed + other.failed,
            max(self.error, other.error),
            (self.examples + other.examples)[:EXAMPLES],
            self.left_out or other.left_out,
        )

    @property
    def failures(self) -> int:
        """What must be 0."""
        return self.failed

    def as_dict(self) -> dict[str, Any]:
        """The findings in JSON's types."""
        return {
            "cases": self.tried,
            "failed": self.failed,
            # An infinite error stands for an answer that is no number.
            "largest_error": min(self.error, np.finfo(np.float64).max),
            "left_out": self.left_out or None,
        }


@dataclass(frozen=True, slots=True)
class Case:
    """A row of the table.

    Args:
        part: What is under test.
        name: What is hard about it.
        attempt: Tries at least so many, and of beams at least so many by rationals anyway.
        bound: The largest error that is none.
        unit: The unit of errors and bound.
        tries: Trials of a whole run; 0 for a share of all beams.
        each: Trials that a process makes at a time.
        heavy: Whether a short run leaves it out.
    """

    part: str
    name: str
    attempt: Callable[[np.random.Generator, int, int], Any]
    bound: float
    unit: str
    tries: int = 0
    each: int = 5_000
    heavy: bool = False
