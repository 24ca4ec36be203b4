"""A balance of the items of a source: how many were used, and how many left out, by reason.

The total is counted independently, for example by the library that reads the format, so that items
which a reader overlooks are found missing.
"""

import re
import warnings
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from lrf3d.base.errors import Lrf3dNote
from lrf3d.base.text import counted


@dataclass
class Balance:
    """The items of a source, counted; used and left out add up to all unless some are missing.

    Args:
        noun: What is counted, in the singular, such as ``entity``.
        all: How many of these the source holds.
        used: How many were used.
        left_out: How many were left out, by reason. A reason is a noun in the singular, and may
            end in a name: ``external reference: core.dwg``.

    Examples:
        >>> balance = Balance("feature", 5, 2)
        >>> balance.leave("point", 2)
        >>> balance.missing, balance.words()
        (1, '1 overlooked feature, 2 points')
    """

    noun: str
    all: int = 0
    used: int = 0
    left_out: dict[str, int] = field(default_factory=dict)

    def leave(self, reason: str, number: int = 1) -> None:
        """Leave out some items for a reason."""
        if number:
            self.left_out[reason] = self.left_out.get(reason, 0) + number

    @property
    def missing(self) -> int:
        """The number of items neither used nor left out; unless 0, the reader has a defect."""
        return self.all - self.used - sum(self.left_out.values())

    @property
    def overlooked(self) -> Counter[str]:
        """The number of missing items, as a reason."""
        return Counter({f"overlooked {self.noun}": self.missing} if self.missing else {})

    def note(self, path: object, *said: str) -> None:
        """Warn of what was left out of a file, and of what was assumed."""
        words = f"left out: {self.words()}" if self.words() else ""
        if text := "; ".join(filter(None, [*said, words])):
            warnings.warn(f"{path}: {text}", Lrf3dNote, stacklevel=3)

    def words(self, most: int = 12) -> str:
        """What was left out, in words: the most frequent reasons, and the number of other items."""
        return ", ".join(in_words(Counter(self.left_out) + self.overlooked, most))


def in_words(reasons: Counter[str], most: int = 12) -> Iterable[str]:
    """Numbers of things by reason, in words: ``12 texts``, ``2 undefined blocks (A, B)``."""
    names = dict[str, list[str]]()
    numbers = Counter[str]()
    for reason, number in sorted(reasons.items()):
        noun, _, name = reason.partition(": ")
        numbers[noun] += number
        names.setdefault(noun, []).extend(filter(None, [name]))
    ranked = numbers.most_common(most)
    for noun, count in sorted(ranked):
        # A few names are enough.
        held = f" ({', '.join(names[noun][:5])}{', …' if len(names[noun]) > 5 else ''})"
        # What follows a preposition stays in the singular: ``2 shapes of robots``.
        head, *what = re.split(r"(?= of | without )", noun, maxsplit=1)
        yield "".join([counted(count, head), *what, held if names[noun] else ""])
    if rest := numbers.total() - sum(count for _, count in ranked):
        yield f"{rest:,} of other kinds"
