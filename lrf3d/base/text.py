"""Text for people: numbers, counts and tables."""

from collections.abc import Collection, Sequence
from typing import NamedTuple


class Note(NamedTuple):
    """A fact, and what changes it, in words of the command line."""

    fact: str
    remedy: str = ""

    def __str__(self) -> str:
        return "; ".join(filter(None, self))


def counted(number: int, noun: str) -> str:
    """A number with its noun in the singular or the plural: ``1,238 walls``."""
    many = f"{noun[:-1]}ies" if noun.endswith("ty") else f"{noun}s"
    return f"{number:,} {noun if number == 1 else many}"


def rounded(value: float, digits: int) -> str:
    """A number with a fixed number of decimals; −0 becomes 0."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    left: Collection[int] = (0,),
    width: int = 0,
) -> str:
    """A table as text; every table that lrf3d prints is made here.

    Without a head it has no titles. Columns of the given indices are aligned to the left, the
    others to the right; the first has a least width [characters].
    """
    lines = [head, *rows] if head else list(rows)
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    widths[0] = max(widths[0], width)
    return "\n".join(
        "  ".join(
            cell.ljust(widths[number]) if number in left else cell.rjust(widths[number])
            for number, cell in enumerate(line)
        ).rstrip()
        for line in lines
    )
