"""Reports: what a benchmark measured, as rows of named figures, in tables for eyes and as JSON.

A row is a dict. The ending of a name is the unit of its figure: ``_s`` [s], ``_m`` [m], ``_share``
of 1. Tables on the terminal and JSON are made of the same rows.
"""

import inspect
import math
import os
import platform
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np

from lrf3d.apps.cli.parser import read_value
from lrf3d.base.cores import core_count
from lrf3d.base.text import table

Row = dict[str, Any]

UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
"""Units of time [s]."""

BUSY = 0.5
"""Processes of others, on average, above which figures of all cores are too low to be trusted."""


class Report:
    """What one benchmark that asks a question measured: tables of rows, and notes, a line each."""

    def __init__(self, question: str) -> None:
        self.question = question
        self.tables: dict[str, list[Row]] = {}
        self.notes: list[str] = []
        # Processes of others before the start, on average.
        self.load: float = getattr(os, "getloadavg", lambda: [0.0])()[0]

    def add(self, name: str, **figures: Any) -> None:
        """Add a row to a table; what is NaN or infinite is missing."""
        plain = {key: v.item() if isinstance(v, np.generic) else v for key, v in figures.items()}
        row = {key: None if v in (math.inf, -math.inf) or v != v else v for key, v in plain.items()}
        self.tables.setdefault(name, []).append(row)

    def save(self, work: str, without: float, done: float) -> None:
        """Add what skipping a piece of work saves: the time without it and with it [s]."""
        self.add("skipped work", work=work, skipped_s=without, done_s=done, saves=done / without)

    def as_dict(self) -> Row:
        """The report in JSON's types."""
        machine = {"system": platform.platform(), "cores": core_count(), "load": self.load,
                   "python": platform.python_version(), "numpy": np.__version__}  # fmt: skip
        return {
            "question": self.question, "machine": machine, **self.tables, "notes": self.notes,
        }  # fmt: skip

    def text(self) -> str:
        """The report for people."""
        parts = [self.question]
        parts += [f"{name}\n{rows_text(rows)}" for name, rows in self.tables.items() if rows]
        notes = list(self.notes)
        if self.load > BUSY:
            notes.append(f"Others used this machine (load {self.load:.1f}): times are too long.")
        return "\n\n".join([*parts, *(["\n".join(notes)] if notes else [])])


def rows_text(rows: Sequence[Row]) -> str:
    """Rows as a table; columns without a figure are left out."""
    names = [name for name in rows[0] if any(row.get(name) is not None for row in rows)]
    cells = [[written(name, row.get(name)) for name in names] for row in rows]
    words = {k for k, name in enumerate(names) if isinstance(rows[0].get(name), str)}
    return table([head(name) for name in names], cells, left=words)


def head(name: str) -> str:
    """The heading of a column: its name without the unit."""
    stem, _, unit = name.rpartition("_")
    return (stem if unit in ("s", "m", "share") else name).replace("_", " ")


def written(name: str, value: Any) -> str:
    """A figure with the unit that its name ends with."""
    if value is None:
        return ""
    if isinstance(value, str | bool | int):
        return f"{value:,}" if type(value) is int else str(value)
    unit = name.rpartition("_")[2]
    if unit == "s":
        return duration(value)
    if unit == "m":
        return "exact" if value == 0.0 else f"{value:.2g} m"
    if unit == "share":
        return f"{100.0 * value:.4g} %"
    return f"{value:,.3f}".rstrip("0").rstrip(".")


def duration(seconds: float, digits: int = 3) -> str:
    """A time with some digits, in the unit that suits it."""
    unit, name = next((u for u in UNITS if seconds >= u[0]), UNITS[-1])
    value = seconds / unit
    # Rounded by hand: %g would write 480 with two digits as 4.8e+02.
    value = round(value, digits - 1 - math.floor(math.log10(value))) if value > 0.0 else value
    return f"{value:g} {name}"


Figure = Annotated[Path | None, "Draw the result to this .png."]


def program(
    bench: Callable[..., Report], name: str, example: str, quick: str = ""
) -> Callable[[Sequence[str]], None]:
    """A benchmark as a program that prints its report, with ``--json`` as one JSON value.

    Its parameters are annotated with their help; those given by name alone are options. With
    ``--quick`` it takes the quick arguments, unless others are given.
    """
    parser = ArgumentParser(prog=name, description=bench.__doc__, epilog=f"Example: {example}")
    parser.add_argument("--json", action="store_true", help="Print one JSON value.")
    if quick:
        help_text = f"A form of a few seconds, to see that it works: {quick}."
        parser.add_argument("--quick", action="store_true", help=help_text)
    for each in inspect.signature(bench).parameters.values():
        kind, (text,) = each.annotation.__origin__, each.annotation.__metadata__
        kinds = {int: "SEED" if each.name == "seed" else "N", float: "M", Path: "FILE"}
        value = kinds.get((*get_args(kind), kind)[0], "TEXT")
        read: dict[str, Any] = {"type": partial(read_value, value), "help": text}
        if each.default is not each.empty:
            read["default"] = each.default
        if each.kind is each.KEYWORD_ONLY:
            short = ["-o"] if each.name == "out" else []
            parser.add_argument(*short, f"--{each.name}", **read)
        else:
            parser.add_argument(each.name, nargs="?" if "default" in read else None, **read)

    def run(words: Sequence[str]) -> None:
        from lrf3d.apps.cli.console import print_json

        given = [*quick.split(), *words] if "--quick" in words else words
        options = vars(parser.parse_args(given))
        as_json = options.pop("json")
        options.pop("quick", None)
        report = bench(**options)
        print_json(report.as_dict()) if as_json else print(report.text(), flush=True)

    return run


def numbers(option: str, text: str, *, least: int = 1) -> list[int]:
    """Whole numbers from a text with commas between them."""
    from lrf3d.base.errors import InputError

    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdecimal() and int(part) >= least for part in parts):
        raise InputError(f"{option} {text}: expected whole numbers from {least}, such as 400,10000")
    return [int(part) for part in parts]


def scatter(
    path: Path,
    rows: Sequence[Row],
    x: str,
    y: str,
    by: str,
    labels: tuple[str, str],
    note: str = "",
) -> None:
    """Draw rows as points of time and error on logarithmic axes, a line for each method."""
    from matplotlib.figure import Figure as Sheet

    from lrf3d.base.files import replacing

    figure = Sheet(figsize=(8, 5), layout="constrained")
    axes = figure.subplots()
    least = min((row[y] for row in rows if row[y] and row[y] > 0.0), default=1e-16)
    for name in dict.fromkeys(row[by] for row in rows):
        mine = [row for row in rows if row[by] == name and row[y] is not None]
        # What is exact stands at the lower edge.
        axes.loglog([row[x] for row in mine], [max(row[y], 0.1 * least) for row in mine], "o-",
                    label=name)  # fmt: skip
        for row in mine if note else ():
            axes.annotate(str(row[note]), (row[x], max(row[y], 0.1 * least)), fontsize=7)
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.grid(alpha=0.3)
    figure.legend(loc="outside right upper", frameon=False)
    with replacing(path) as unfinished:
        figure.savefig(unfinished, dpi=120)
