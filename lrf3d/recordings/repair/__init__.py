"""Repairs: what may be wrong with a recording, how it is found and how it is corrected."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple


@dataclass(frozen=True, slots=True)
class Repair:
    """One thing that may be wrong with a recording.

    ``find`` returns what is wrong, or None, and raises an InputError where that is beyond repair.
    ``apply`` returns what is corrected: the scans of a laser, a log, or a recording with the path
    of its robot. ``sentence`` says what was wrong and what was done; it is empty where nobody needs
    to know. ``figures`` are the entries of a summary, for None those without such a fault.
    """

    name: str
    find: Callable[..., Any]
    apply: Callable[[Any, Any], Any]
    sentence: Callable[[Any], str] = lambda _: ""
    figures: Callable[[Any], dict[str, Any]] = lambda _: {}


class Applied(NamedTuple):
    """A repair that was applied, what it found, and the recording before it: to take it back."""

    repair: Repair
    finding: Any
    before: Any
