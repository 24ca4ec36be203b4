"""Output of the commands: progress on a terminal, results as text or as JSON."""

import json
import logging
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from lrf3d.base.errors import Lrf3dNote, Lrf3dWarning, one_line
from lrf3d.base.interrupts import Progress, check
from lrf3d.base.text import table

Rows = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Console:
    """What a command prints: a summary, one JSON value or nothing; notes and progress on stderr."""

    json: bool
    quiet: bool
    verbose: bool
    # What is held until the command ends.
    until_end: ExitStack

    @property
    def shows(self) -> bool:
        """Whether results are printed as text."""
        return not (self.json or self.quiet)

    def print(self, figures: Mapping[str, Any], rows: Rows) -> None:
        """Print figures as JSON, or what most users ask as a table, and with ``-v`` both."""
        if self.shows:
            print_table(rows)
        if self.json or (self.shows and self.verbose):
            print_json(figures)

    def note(self, message: str) -> None:
        """Print on stderr what was chosen by default."""
        if not self.quiet:
            say(message)

    @contextmanager
    def progress(self, title: str) -> Iterator[Progress]:
        """A progress bar if stderr is a terminal; a request to stop raises KeyboardInterrupt."""
        check()
        if self.quiet or not sys.stderr.isatty():
            yield lambda done, total: check()
            return
        with progress_bar(title) as report:
            yield report


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """A progress bar on stderr."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    name = TextColumn("{task.description:<13}")
    columns = (name, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        # At the first use the compiler works for half a minute before the first step.
        task = bar.add_task("getting ready", total=None)

        def report(done: int, total: int) -> None:
            check()
            bar.update(task, description=title, completed=done, total=total)

        yield report


def quiet_libraries() -> None:
    """Silence the warnings of libraries, which the user cannot fix; our own are shown in one line.

    ``python -W default -m lrf3d`` shows all.
    """
    say.cache_clear()
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
        warnings.simplefilter("default", Lrf3dWarning)
        warnings.showwarning = lambda message, kind, *_, **__: (
            say(str(message)) if issubclass(kind, Lrf3dNote) else warn(str(message))
        )
    # Without a handler, Python prints log messages of libraries from warnings on.
    logging.lastResort = logging.NullHandler()


@lru_cache
def say(message: str) -> None:
    """Print a note on stderr, each only once."""
    print(f"lrf3d: {one_line(message)}", file=sys.stderr)


def warn(message: str) -> None:
    """Print a warning on stderr."""
    say(f"warning: {message}")


def print_json(value: Any) -> None:
    """Print one JSON value and nothing else."""
    print_text(json_text(value))


def json_text(value: Any) -> str:
    """A value as standard JSON, without NaN and infinity, its numbers to nine digits."""
    text = json.dumps(value, allow_nan=False)
    rounded = json.loads(text, parse_float=lambda number: float(f"{float(number):.9g}"))
    return json.dumps(rounded, indent=2) + "\n"


def print_table(rows: Rows, width: int = 9) -> None:
    """Print names and values in two columns, the first of a least width."""
    cells = [(name, one_line(value)) for name, value in rows]
    print_text(table((), cells, left=(0, 1), width=width) + "\n")


def print_text(text: str) -> None:
    """Print a text and flush it; an error names the standard output."""
    try:
        print(text, end="", flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, "standard output") from error
