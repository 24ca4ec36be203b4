"""Claim: something that the paper says or shows, and what lrf3d finds when it is measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from benchmarks.result import Row, Table

WORDS = {
    "robust": "robust mode", "paper": "paper mode", "city": "the city", "room": "the room",
}  # fmt: skip
"""Where a claim may hold, in words."""


class Picture(NamedTuple):
    """A picture of the page, as a data URI, and what is seen on it."""

    data: str
    caption: str


@dataclass(frozen=True)
class Claim:
    """Something that the paper says, and what is found.

    Args:
        name: A short name, for links.
        title: The claim in a few words.
        place: Where the paper says it.
        said: What the paper says.
        found: What was measured, in sentences.
        criterion: When it is said to hold.
        holds: Whether it does, by mode or by place, or under ``lrf3d`` where neither matters;
            None where it could not be measured.
        tables: The figures.
        pictures: What is seen.
        data: The figures in JSON's types.
    """

    name: str
    title: str
    place: str
    said: str
    found: str
    criterion: str
    holds: Mapping[str, bool | None]
    tables: Sequence[tuple[Table, Sequence[Row]]] = ()
    pictures: Sequence[Picture] = ()
    data: dict[str, Any] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """Whether it holds, in words."""
        known = {name: value for name, value in self.holds.items() if value is not None}
        if not known:
            return "not measured"
        if all(known.values()):
            return "holds"
        right = [WORDS.get(name, name) for name, value in known.items() if value]
        return f"holds in {' and '.join(right)}" if right else "does not hold"

    def as_dict(self) -> dict[str, Any]:
        """The claim in JSON's types."""
        return {
            "name": self.name,
            "title": self.title,
            "place": self.place,
            "criterion": self.criterion,
            "holds": dict(self.holds),
            "verdict": self.verdict,
            "found": self.found,
            "pictures": [picture.caption for picture in self.pictures],
            "measured": self.data,
        }


class Extent(NamedTuple):
    """How much is measured.

    Args:
        seeds: Seeds of the noise in the room.
        city_seeds: Seeds in the city, whose runs take longer.
        every: Each scan of the city whose number is a multiple of this is used where noises vary.
        scans: Scans of the drive through the city at most; all where None.
        towns: Walls of the towns in which lines are paired, beside the city.
        robots: Seeds of the robot that finds itself.
        film: Width and height of the frame of the film [pixels].
    """

    seeds: int = 20
    city_seeds: int = 5
    every: int = 8
    scans: int | None = None
    towns: tuple[int, ...] = (1_000, 10_000)
    robots: int = 5
    film: tuple[int, int] = (1600, 900)
