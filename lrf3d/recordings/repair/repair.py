"""Repair: one thing that may be wrong with a recording, how it is found and how it is corrected."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

# What is repaired: the scans of a laser, a log, or a recording with the path of its robot.
Repaired = TypeVar("Repaired")


@dataclass(frozen=True)
class Repair(Generic[Repaired]):
    """One thing that may be wrong with a recording.

    ``find`` returns what is wrong, or None, and raises an InputError where that is beyond repair.
    ``apply`` corrects it. ``sentence`` says what was wrong and what was done; it is empty where
    nobody needs to know. ``figures`` are the entries of a summary, for None those of a recording
    that has no such fault.
    """

    name: str
    find: Callable[..., Any]
    apply: Callable[[Repaired, Any], Repaired]
    sentence: Callable[[Any], str] = lambda _: ""
    figures: Callable[[Any], dict[str, Any]] = lambda _: {}


@dataclass(frozen=True, eq=False, slots=True)
class Found:
    """What a repair found, and the recording before it, to take the repair back."""

    repair: Repair[Any]
    finding: Any
    before: Any
