"""Text for people: numbers, counts and tables."""

from collections.abc import Collection, Sequence
from io import StringIO


def counted(number: int, noun: str) -> str:
    """A number with its noun in the singular or the plural: ``1,238 walls``."""
    return f"{number:,} {noun}" + ("" if number == 1 else "s")


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

    Args:
        head: A title for each column; empty for a table without titles.
        rows: The cells of each row.
        left: Indices of the columns that are aligned to the left; the others are aligned to the
            right.
        width: Least width of the first column [characters].
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    # Cells are plain text: square brackets around units are not markup.
    made = Table(box=None, pad_edge=False, header_style=None, show_header=bool(head))
    for number in range(len(head or rows[0])):
        made.add_column(
            Text(head[number] if head else ""),
            justify="left" if number in left else "right",
            no_wrap=True,
            min_width=None if number else width,
        )
    for row in rows:
        made.add_row(*map(Text, row))
    # The console is wide enough never to fold a line, also for readers of a pipe.
    console = Console(file=StringIO(), width=10_000, color_system=None)
    console.print(made)
    assert isinstance(console.file, StringIO)
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines())
