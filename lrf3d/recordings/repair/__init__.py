"""Repairs: what may be wrong with a recording, how it is found and how it is corrected."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple


@dataclass(frozen=True, slots=True)
class Repair:
    """One thing that may be wrong with a recording.

    ``find`` examines what is repaired: the scans of a laser as they are read, then a log, and in
    most repairs a `Recording`. It returns its finding, or None if nothing is wrong, and raises an
    InputError where the fault is beyond repair. ``apply`` takes the same and the finding, and
    returns it corrected; a repair of a `Recording` is undone if scans then agree clearly worse.
    ``sentence`` says what was wrong and what was done; it is empty where users need not know.
    ``figures`` returns the entries of a summary; for a finding of None, those of a recording
    without the fault.
    """

    name: str
    find: Callable[..., Any]
    apply: Callable[[Any, Any], Any]
    sentence: Callable[[Any], str] = lambda _: ""
    figures: Callable[[Any], dict[str, Any]] = lambda _: {}


class Applied(NamedTuple):
    """A repair that was applied, and what it found."""

    repair: Repair
    finding: Any
