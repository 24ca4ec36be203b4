"""Output of the commands: progress on a terminal, results as text or as JSON."""

import json
import logging
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any, TextIO

from lrf3d.errors import Lrf3dWarning, one_line
from lrf3d.interrupts import check
from lrf3d.progress import Progress

BETWEEN_LINES = 30.0
"""Time between two lines of progress where there is no terminal [s]."""


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """A progress bar on stderr; a line now and then if stderr is not a terminal.

    A signal that has asked to stop raises KeyboardInterrupt at the next report.
    """
    check()
    if not sys.stderr.isatty():
        yield progress_lines(title)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.progress import (
        Progress as Bar,
    )

    columns = (
        TextColumn("{task.description:<13}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        # At the first use the compiler works for half a minute before the first step.
        task = bar.add_task("getting ready", total=None, rate="")

        def report(done: int, total: int) -> None:
            check()
            speed = bar.tasks[task].speed
            rate = f"{speed:.0f}/s" if speed else ""
            bar.update(task, description=title, completed=done, total=total, rate=rate)

        yield report


def progress_lines(title: str, clock: Callable[[], float] = monotonic) -> Progress:
    """Progress as lines on stderr, so seldom that a short command prints none.

    Args:
        title: What is counted.
        clock: Gives the time [s].
    """
    began = last = clock()
    # The first step may compile for half a minute, so it is not one to go by.
    first = 0

    def report(done: int, total: int) -> None:
        nonlocal began, first, last
        check()
        now = clock()
        if not first:
            began, first, last = now, done, now
        if now - last < BETWEEN_LINES or not first < done < total:
            return
        last = now
        left = (now - began) * (total - done) / (done - first) / 60.0
        say(f"{title}: {done:,} of {total:,}, about {max(left, 1.0):.0f} min left")

    return report


def quiet_libraries() -> None:
    """Silence the warnings of libraries, which the user cannot fix; our own are shown in one line.

    ``python -W default -m lrf3d`` shows all.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
        warnings.simplefilter("default", Lrf3dWarning)
        usual = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if issubclass(category, Lrf3dWarning):
                warn(str(message))
            else:
                usual(message, category, filename, lineno, file, line)

        warnings.showwarning = show
    # Without a handler, Python prints log messages of libraries from warnings on.
    logging.lastResort = logging.NullHandler()


def say(message: str) -> None:
    """Print on stderr what was chosen by default, or how far the work is."""
    print(f"lrf3d: {one_line(message)}", file=sys.stderr)


def warn(message: str) -> None:
    """Print a warning on stderr."""
    print(f"lrf3d: warning: {one_line(message)}", file=sys.stderr)


def print_json(value: Any) -> None:
    """Print one JSON value and nothing else."""
    print_text(json_text(value))


def json_text(value: Any) -> str:
    """A value as standard JSON, without NaN and infinity, its numbers to nine digits."""
    return json.dumps(_rounded(value), indent=2, allow_nan=False) + "\n"


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.9g}")
    if isinstance(value, dict):
        return {name: _rounded(each) for name, each in value.items()}
    return [_rounded(each) for each in value] if isinstance(value, list | tuple) else value


def print_table(rows: list[tuple[str, str]], width: int = 0) -> None:
    """Print names and values in two columns, the first with a least width [characters]."""
    # Imported here, because the help of a command needs no rich.
    from lrf3d.text import table

    cells = [(name, one_line(value)) for name, value in rows]
    print_text(table((), cells, left=(0, 1), width=width) + "\n")


def print_text(text: str) -> None:
    """Print a text and flush it.

    Raises:
        OSError: It cannot be written; the error names the standard output.
    """
    try:
        print(text, end="", flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, "standard output") from error
