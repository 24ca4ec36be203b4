"""Tables for the terminal."""

from collections.abc import Collection, Sequence
from io import StringIO


def table(
    head: Sequence[str], rows: Sequence[Sequence[str]], *, left: Collection[int] = (0,)
) -> str:
    """Rows under a head, as text.

    Args:
        head: A word for each column.
        rows: The cells of each row.
        left: Numbers of the columns that are aligned to the left; the others are numbers, which
            are aligned to the right.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    # Cells are plain text: square brackets around units are no markup.
    made = Table(box=None, pad_edge=False, header_style=None)
    for number, word in enumerate(head):
        justify = "left" if number in left else "right"
        made.add_column(Text(word), justify=justify, no_wrap=True)  # type: ignore[arg-type]
    for row in rows:
        made.add_row(*map(Text, row))
    # A console of any width never folds a line: who reads a pipe wants whole rows.
    console = Console(file=StringIO(), width=10_000, color_system=None)
    console.print(made)
    assert isinstance(console.file, StringIO)
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines())
