"""The folder for the results of a command: its origin, its lock, its summary and pictures."""

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path
from typing import Any

import typer

from lrf3d.cli.console import json_text, print_json, print_table, warn
from lrf3d.errors import DrawingError
from lrf3d.input import read_text
from lrf3d.interrupts import noting
from lrf3d.output import Drawing, clear_unfinished, draw_all, locked, make_folder, write_text
from lrf3d.world import world_names

LONGEST_NAME = 100
"""Largest length of a folder's name [bytes]: file systems allow 255, and suffixes are added."""

LARGEST_SUMMARY = 1 << 26
"""Largest size of a summary.json that is read [bytes]."""

LOCK, SUMMARY = ".lrf3d.lock", "summary.json"
"""Files that record the origin of results: during the command or if it is interrupted, and after
it."""

RESULTS = ("run.npz", "sweep.parquet", SUMMARY, "map.geojson")
"""Files that are results of any command."""


@dataclass(frozen=True, slots=True)
class ResultsFolder:
    """A folder for results, and their origin.

    Args:
        path: The folder.
        made_by: The command, and the worlds or logs that it reads: built-in names, and paths
            relative to the folder, so that a project can be moved.
    """

    path: Path
    made_by: dict[str, Any]

    def finish(
        self,
        summary: Mapping[str, Any],
        files: Mapping[str, Path],
        drawings: Mapping[str, Drawing],
        *,
        rows: list[tuple[str, str]],
        kept: str,
        note: str = "",
        json: bool,
    ) -> None:
        """Write summary.json and print the results of a command, then draw them.

        The data are written before, and all results printed, before anything is drawn, because
        drawing may fail or be stopped.

        Args:
            summary: The figures, in JSON's types.
            files: The files that have been written, by their contents.
            drawings: What is to be drawn, by name.
            rows: The results as a table.
            kept: The end of a message about a failed drawing: where the data are.
            note: What is printed if drawing is stopped, such as how to continue.
            json: Whether one JSON value is printed instead of tables.

        Raises:
            DrawingError: Something could not be drawn.
            OutputError: The summary cannot be written.
        """
        made = {**files, "summary": self.path / SUMMARY}

        def write() -> dict[str, Any]:
            names = {name: path.name for name, path in made.items()}
            figures = {**summary, "made_by": self.made_by, "files": names}
            write_text(made["summary"], json_text(figures))
            return figures

        write()
        width = max(map(len, (*dict(rows), *made, *drawings)))
        if not json:
            print_table(rows, width)
        with noting(lambda: note) if note else nullcontext():
            drawn, failed = draw_all(drawings, kept)
        made |= drawn
        figures = write()
        if json:
            print_json(figures)
        else:
            print_table([(name, str(path)) for name, path in made.items()], width)
        if failed:
            raise DrawingError(failed)


def results_folder(
    context: typer.Context, sources: Sequence[str | Path], name: str, out: Path | None
) -> ResultsFolder:
    """The folder for the results of a command, locked until the command ends.

    Args:
        context: The command.
        sources: The worlds, or the log, that the results are of.
        name: Their name.
        out: The folder. If None, ``out/NAME``, or the first of ``out/NAME_2``, ``out/NAME_3``, …
            if that holds results of something else.

    Raises:
        InputError: Another process writes to it.
        OutputError: It cannot be made or written to.
    """
    folder = Path("out") / folder_name(name) if out is None else out
    names = world_names()
    made_by = {
        "command": context.info_name,
        "sources": [
            source if isinstance(source, str) and source in names else _relative(source, folder)
            for source in sources
        ],
    }
    if out is None:
        folder = _free(folder, made_by)
    make_folder(folder)
    context.with_resource(_owned(folder, made_by))
    return ResultsFolder(folder, made_by)


def folder_name(name: str) -> str:
    """A name for a folder, of letters, digits, dots, hyphens and underscores.

    Example:
        >>> folder_name("Lab 3/west"), folder_name("../..")
        ('Lab_3_west', 'world')
    """
    plain = re.sub(r"[^\w.+-]+", "_", name.encode(errors="ignore").decode()).strip("._")
    return plain.encode()[:LONGEST_NAME].decode(errors="ignore") or "world"


def _free(folder: Path, made_by: dict[str, Any]) -> Path:
    """The folder, or the first numbered one, without results of something else."""
    numbered = (Path(f"{folder}_{number}") for number in count(2))
    free = next(path for path in chain([folder], numbered) if _origin(path) in (None, made_by))
    if free != folder:
        others = _command_of(_origin(folder), folder)
        warn(f"{folder}: holds results of {others}; the new ones go to {free}")
    return free


@contextmanager
def _owned(folder: Path, made_by: dict[str, Any]) -> Iterator[None]:
    """Lock a folder, and warn if it holds results of something else."""
    with locked(folder / LOCK, folder) as lock:
        before = _origin(folder, lock.left)
        if before not in (None, made_by):
            others = _command_of(before, folder)
            warn(f"{folder}: holds results of {others}; files of the same names are replaced")
        clear_unfinished(folder)
        lock.note(made_by=made_by)
        try:
            yield
        finally:
            # Until there is a summary, the lock file records the origin of unfinished results.
            unfinished = folder.exists() and any(e.name != LOCK for e in folder.iterdir())
            lock.keep = unfinished and _recorded_origin(folder / SUMMARY) != made_by


def _origin(folder: Path, left: Mapping[str, Any] | None = None) -> object:
    """The origin of the results in a folder; an empty dict if it is unknown.

    Args:
        folder: The folder.
        left: The note in its lock file, if it has been read.
    """
    noted = _recorded_origin(folder / LOCK) if left is None else left.get("made_by")
    noted = noted or _recorded_origin(folder / SUMMARY)
    if noted is None and any((folder / name).exists() for name in RESULTS):
        return {}
    return noted


def _recorded_origin(path: Path) -> object:
    """The origin of results according to a JSON file; None if it has none."""
    if not path.exists():
        return None
    try:
        return json.loads(read_text(path, largest=LARGEST_SUMMARY)).get("made_by")
    except (ValueError, AttributeError, RecursionError):
        return None


def _command_of(origin: object, folder: Path) -> str:
    """The origin of results as a command line."""
    try:
        command, sources = origin["command"], origin["sources"]  # type: ignore[index]
        shown = [
            source if source in world_names() else _relative(folder / source, Path())
            for source in sources
        ]
        return " ".join(["lrf3d", str(command), *shown])
    except (KeyError, TypeError):
        return "something else"


def _relative(path: str | Path, folder: Path) -> str:
    return os.path.relpath(os.path.realpath(path), os.path.realpath(folder))
