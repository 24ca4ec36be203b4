"""The folder that a command writes its results to: where it is, who made it, and one writer."""

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path
from typing import Any

import typer

from lrf3d.cli.console import warn
from lrf3d.input import read_text
from lrf3d.output import clear_unfinished, locked, make_folder
from lrf3d.world import world_names

LONGEST_NAME = 100
"""Bytes of a folder's name: file systems take 255, and some names are joined to it."""

LARGEST_SUMMARY = 1 << 26
"""Bytes of a summary.json that is looked into."""

LOCK, SUMMARY = ".lrf3d.lock", "summary.json"
"""Files that say what made the results: while they are made or unfinished, and afterwards."""

RESULTS = ("run.npz", "sweep.parquet", SUMMARY, "map.geojson")
"""Files that are results, whoever made them."""


@dataclass(frozen=True, slots=True)
class ResultsFolder:
    """A folder for results, and what makes them.

    Args:
        path: The folder.
        made_by: The command, and the worlds or logs that it reads: built-in names, and paths
            relative to the folder, so that a project can be moved.
    """

    path: Path
    made_by: dict[str, Any]


def results_folder(
    context: typer.Context, sources: Sequence[str | Path], name: str, out: Path | None
) -> ResultsFolder:
    """The folder for the results of a command, locked until the command ends.

    Args:
        context: The command.
        sources: The worlds, or the log, that the results are of.
        name: What these are called.
        out: The folder that was asked for. Where None, ``out/NAME``, or where that holds results
            of something else the first of ``out/NAME_2``, ``out/NAME_3``, … that does not.

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
    context.with_resource(_held(folder, made_by))
    return ResultsFolder(folder, made_by)


def folder_name(name: str) -> str:
    """A name as one of a folder: of letters, digits, dots, hyphens and underscores.

    Example:
        >>> folder_name("Lab 3/west"), folder_name("../..")
        ('Lab_3_west', 'world')
    """
    plain = re.sub(r"[^\w.+-]+", "_", name.encode(errors="ignore").decode()).strip("._")
    return plain.encode()[:LONGEST_NAME].decode(errors="ignore") or "world"


def _free(folder: Path, made_by: dict[str, Any]) -> Path:
    """The folder, or the first numbered one after it, that holds no results of something else."""
    numbered = (Path(f"{folder}_{number}") for number in count(2))
    place = next(place for place in chain([folder], numbered) if _maker(place) in (None, made_by))
    if place != folder:
        others = _said(_maker(folder), folder)
        warn(f"{folder}: holds results of {others}; the new ones go to {place}")
    return place


@contextmanager
def _held(folder: Path, made_by: dict[str, Any]) -> Iterator[None]:
    """Lock a folder, and warn if it holds results of something else."""
    with locked(folder / LOCK, folder) as lock:
        before = _maker(folder, lock.left)
        if before not in (None, made_by):
            others = _said(before, folder)
            warn(f"{folder}: holds results of {others}; files of the same names are replaced")
        clear_unfinished(folder)
        lock.note(made_by=made_by)
        try:
            yield
        finally:
            # Until a summary says it, the lock file keeps in mind whose unfinished work lies here.
            work = any(entry.name != LOCK for entry in folder.iterdir())
            lock.keep = work and _member(folder / SUMMARY) != made_by


def _maker(folder: Path, left: Mapping[str, Any] | None = None) -> object:
    """What made the results in a folder; an empty dict where that is not known.

    Args:
        folder: The folder.
        left: What its lock file says, where that is read already.
    """
    noted = _member(folder / LOCK) if left is None else left.get("made_by")
    noted = noted or _member(folder / SUMMARY)
    if noted is None and any((folder / name).exists() for name in RESULTS):
        return {}
    return noted


def _member(path: Path) -> object:
    """What made the results, as a JSON file says; None if it does not say."""
    if not path.exists():
        return None
    try:
        return json.loads(read_text(path, largest=LARGEST_SUMMARY)).get("made_by")
    except (ValueError, AttributeError, RecursionError):
        return None


def _said(maker: object, folder: Path) -> str:
    """What made results, as a user gave it."""
    try:
        command, sources = maker["command"], maker["sources"]  # type: ignore[index]
        shown = [
            source if source in world_names() else _relative(folder / source, Path())
            for source in sources
        ]
        return " ".join(["lrf3d", str(command), *shown])
    except (KeyError, TypeError):
        return "something else"


def _relative(path: str | Path, folder: Path) -> str:
    return os.path.relpath(os.path.realpath(path), os.path.realpath(folder))
