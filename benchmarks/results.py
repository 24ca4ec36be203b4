"""Parts of the whole benchmark: what each measured, in one form for pages and comparisons.

A part is a thing that lrf3d does; a way is one manner to do it, with its time and its error.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lrf3d.study.bench.ablation import Saving
from lrf3d.study.timing import Timing

Draw = Callable[[Path], None]
"""Draws a picture into a file."""


@dataclass(frozen=True, slots=True)
class Way:
    """One way to do a thing.

    Args:
        thing: What is done, such as a scan among so many walls.
        family: Its kind.
        setting: What tells it from others of its kind; may be empty.
        timing: Its time [s].
        error: Its error, in the unit of the part.
        error_range: Least and largest error where several runs were made with random numbers;
            twice the error where there is nothing random.
        chosen: Whether lrf3d does so by default.
    """

    thing: str
    family: str
    setting: str
    timing: Timing
    error: float
    error_range: tuple[float, float]
    chosen: bool = False

    @property
    def title(self) -> str:
        """Its name."""
        return f"{self.family}, {self.setting}" if self.setting else self.family

    def as_dict(self) -> dict[str, Any]:
        """The way in JSON's types."""
        return {
            "thing": self.thing,
            "family": self.family,
            "setting": self.setting,
            "time": self.timing.as_dict(),
            "error": self.error,
            "least_error": self.error_range[0],
            "largest_error": self.error_range[1],
            "default": self.chosen,
        }

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> "Way":
        """The way that `as_dict` wrote."""
        time = table["time"]
        return cls(
            table["thing"],
            table["family"],
            table["setting"],
            Timing(time["median_s"], time["low_s"], time["high_s"], time["calls"]),
            table["error"],
            (table["least_error"], table["largest_error"]),
            table["default"],
        )


@dataclass(frozen=True, slots=True)
class Part:
    """What one part measured.

    Args:
        key: Its name in JSON.
        title: Its name in words.
        question: What it asks, and how the answer is measured.
        time: What is timed.
        error: What the error is, with its unit.
        ways: All ways; empty where the part was left out.
        savings: What each piece of skipped work saves.
        skipped: What was left out, and why.
        draw: Draws the part's own figure, where it has one beside its ways.
        details: The part's own report, in JSON's types.
        yardstick: Time of a fixed piece of work just before and after it [s].
        took: How long it took [s].
    """

    key: str
    title: str
    question: str
    time: str
    error: str
    ways: tuple[Way, ...] = ()
    savings: tuple[Saving, ...] = ()
    skipped: tuple[str, ...] = ()
    draw: Draw | None = None
    details: dict[str, Any] = field(default_factory=dict)
    yardstick: Timing | None = None
    took: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """The part in JSON's types."""
        return {
            "part": self.key,
            "title": self.title,
            "time": self.time,
            "error": self.error,
            "ways": [way.as_dict() for way in self.ways],
            "savings": [saving.as_dict() for saving in self.savings],
            "skipped": list(self.skipped),
            "yardstick": None if self.yardstick is None else self.yardstick.as_dict(),
            "took_s": self.took,
            "details": self.details,
        }
