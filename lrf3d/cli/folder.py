"""The folder for the results of a command: its lock, its summary and its pictures."""

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from lrf3d.cli.console import Report, Rows, json_text, print_json, print_table
from lrf3d.errors import DrawingError, InputError, Lrf3dError
from lrf3d.files import locked, make_folder, read_text, write_text
from lrf3d.interrupts import check, noting
from lrf3d.world import world_names

LONGEST_NAME = 100
"""Largest length of a folder's name [bytes]: file systems allow 255, and suffixes are added."""

LARGEST_SUMMARY = 1 << 26
"""Largest size of a summary.json that is read [bytes]."""

Drawing = Callable[[Path], object]
"""Draws a picture or a film to a path."""


@dataclass(frozen=True, slots=True)
class ResultsFolder:
    """A folder for results.

    Args:
        path: The folder.
        made_by: The command and its sources: built-in worlds, and paths relative to the folder,
            so that a project can be moved.
        report: Prints the results.
    """

    path: Path
    made_by: dict[str, Any]
    report: Report

    def finish(
        self,
        summary: Mapping[str, Any],
        files: Mapping[str, str],
        drawings: Mapping[str, tuple[str, Drawing]],
        *,
        rows: Rows,
        details: Rows = (),
        following: str = "",
        kept: str = "",
    ) -> None:
        """Write summary.json, print the results, and draw, which may fail or be stopped, last.

        Args:
            summary: The figures, in JSON's types.
            files: Names of the files that have been written, by their contents.
            drawings: Names of the files that are drawn, and what draws them, by their contents.
            rows: The results as a table.
            details: More of them, for ``-v``.
            following: The command that a user may want next.
            kept: What is printed if drawing fails or is stopped: how to continue.

        Raises:
            DrawingError: Something could not be drawn.
            OutputError: The summary cannot be written.
        """
        made = {**files, "summary": "summary.json"}

        def write() -> dict[str, Any]:
            figures = {**summary, "made_by": self.made_by, "files": made}
            write_text(self.path / "summary.json", json_text(figures))
            return figures

        write()
        if not self.report.json:
            self.report.print(summary, rows, details)
        try:
            with noting(lambda: kept):
                for name, (file, draw) in drawings.items():
                    check()
                    _draw(self.path / file, draw, kept)
                    made[name] = file
        finally:
            figures = write()
            if self.report.json:
                print_json(figures)
        if not (self.report.json or self.report.quiet):
            written = [("files", f"{self.path}: {', '.join(made.values())}")]
            print_table([*written, ("next", following)] if following else written)


def _draw(path: Path, draw: Drawing, kept: str) -> None:
    """Draw to a path; an error becomes one line, as the data are written already."""
    try:
        draw(path)
    except Exception as error:
        name = "" if isinstance(error, Lrf3dError) else f"{type(error).__name__}: "
        raise DrawingError(f"{path}: not drawn: {name}{error}; {kept}") from error


def results_folder(
    context: typer.Context,
    report: Report,
    sources: Sequence[str | Path],
    name: str,
    out: Path | None,
    *,
    alone: bool = True,
) -> ResultsFolder:
    """The folder for the results of a command, locked until the command ends.

    Args:
        context: The command.
        report: Prints the results.
        sources: The worlds, or the log, that the results are of.
        name: Their name.
        out: The folder; ``out/NAME`` if not given.
        alone: Whether no other command may write there meanwhile.

    Raises:
        InputError: Another process writes to it, or no folder is given and ``out/NAME`` holds
            results of other sources.
        OutputError: It cannot be made or written to.
    """
    folder = Path("out") / folder_name(name) if out is None else out
    built_in = world_names()
    named = [
        source if isinstance(source, str) and source in built_in else _relative(source, folder)
        for source in sources
    ]
    made_by = {"command": context.info_name, "sources": named}
    make_folder(folder)
    if alone:
        context.with_resource(locked(folder / "results", folder))
    summary = folder / "summary.json"
    if alone and not summary.exists():
        # What is written before a command is stopped has its origin, too.
        write_text(summary, json_text({"made_by": made_by}))
    elif (
        out is None
        and summary.exists()
        and _without_ending(others := _sources_of(summary)) != _without_ending(named)
    ):
        what = " ".join(others) or "something else"
        raise InputError(f"{folder}: holds results of {what}; choose another folder with --out")
    return ResultsFolder(folder, made_by, report)


def folder_name(name: str) -> str:
    """A name for a folder, of letters, digits, dots, hyphens and underscores.

    Example:
        >>> folder_name("Lab 3/west"), folder_name("../..")
        ('Lab_3_west', 'world')
    """
    plain = re.sub(r"[^\w.+-]+", "_", name.encode(errors="ignore").decode()).strip("._")
    return plain.encode()[:LONGEST_NAME].decode(errors="ignore") or "world"


def _sources_of(summary: Path) -> list[str]:
    """The sources of the results that a summary is of; none if it does not name them."""
    try:
        found = json.loads(read_text(summary, largest=LARGEST_SUMMARY))["made_by"]["sources"]
        return [str(source) for source in found]
    except (ValueError, LookupError, TypeError, RecursionError):
        return []


def _without_ending(sources: Sequence[str]) -> list[str]:
    """Sources without the endings of their names: the same drive may be a log and a bag."""
    return [re.sub(r"(?<=[^/.])\.[^/]*$", "", source) for source in sources]


def _relative(path: str | Path, folder: Path) -> str:
    return os.path.relpath(os.path.realpath(path), os.path.realpath(folder))
