"""Where commands write: a folder for the results, which holds one run, or a single file.

What is there already is replaced if it is of the same command, sources and seed, and otherwise only
with --force.
"""

import json
import os
import re
import shlex
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from filecmp import cmp
from pathlib import Path
from typing import Any

from lrf3d.apps.cli.console import Console, Rows, json_text, print_json, print_table
from lrf3d.base.errors import DrawingError, InputError, Lrf3dError
from lrf3d.base.files import (
    folder_name,
    locked,
    make_folder,
    read_text,
    unfinished_folder,
    write_text,
    writing,
)
from lrf3d.base.interrupts import check, noting
from lrf3d.world import world_names

# The file of a picture, and the function that draws it.
Drawing = tuple[str, Callable[[Path], object]]

_ENDING = re.compile(r"(?<=[^/.])\.[^/]*$")

# The rows of a sweep, which no other program writes.
_ROWS = "sweep*.jsonl"

# Names of results, also of those that a command has not entered in a summary yet.
_RESULTS = (
    "run.npz", "run.journal", "map.geojson", "map.png", "world.png", "noise.png", "run.mp4",
    "trajectory.tum", "check.png", "score.png", "runs.csv", "means.csv", "means.tex",
    "summary.json", *(f"robot[0-9]*/{name}" for name in ("run.npz", "map.geojson", "summary.json")),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class ResultsFolder:
    """A folder for results, with the command and the sources that they are made by."""

    path: Path
    made_by: dict[str, Any]
    console: Console

    def finish(
        self,
        summary: Mapping[str, Any],
        files: Mapping[str, str],
        drawings: Mapping[str, Drawing],
        *,
        rows: Rows,
        following: Sequence[str | Path] = (),
        kept: str,
    ) -> None:
        """Write summary.json, print the results, and draw, which may fail or be stopped, last.

        Files and drawings are given by their contents; a drawing that fails does not keep the
        others from being drawn. ``following`` are the words of the command that a user may want
        next, and ``kept`` is printed if drawing fails or is stopped: how to continue.
        """
        made = {**files, "summary": "summary.json"}
        before = _files_of(_summary_of(self.path) or {})
        written = {*made.values(), *(file for file, _ in drawings.values())}
        _remove(self.path, before - written, self.console)
        # Films and exports of this run that the user has put elsewhere.
        made |= {name: name for name in sorted(before) if ".." in Path(name).parts}
        figures = {**summary, "made_by": self.made_by, "files": made}
        write_text(self.path / "summary.json", json_text(figures))
        if self.console.shows:
            self.console.print(summary, rows)
        failed: list[str] = []
        try:
            with noting(lambda: kept):
                failed = self._draw(drawings, made)
        finally:
            write_text(self.path / "summary.json", json_text(figures))
            if self.console.json:
                print_json(figures)
        if failed:
            raise DrawingError(f"{'; '.join(failed)}; {kept}")
        if self.console.shows:
            here = [name for name in made.values() if ".." not in Path(name).parts]
            written_row = [("files", f"{self.path}: {', '.join(here)}")]
            if following:
                written_row.append(("next", shlex.join(["lrf3d", *map(str, following)])))
            print_table(written_row, max(9, *(len(name) for name, _ in rows)))

    def _draw(self, drawings: Mapping[str, Drawing], made: dict[str, str]) -> list[str]:
        """Draw, and enter the files among those made; the messages of drawings that failed."""
        failed = []
        for name, (file, draw) in drawings.items():
            check()
            try:
                draw(self.path / file)
            except Exception as error:
                why = str(error)
                if not isinstance(error, Lrf3dError | OSError):
                    why = f"{type(error).__name__}: {why} (a bug of lrf3d; please report it)"
                failed.append(f"{self.path / file}: not drawn: {why}")
            else:
                made[name] = file
        return failed


def _summary_of(folder: Path) -> dict[str, Any] | None:
    """The summary in a folder; None if there is none that says what it was made by."""
    try:
        found: dict[str, Any] = json.loads(read_text(folder / "summary.json"))
        _ = [str(source) for source in found["made_by"]["sources"]]
        return found
    except (OSError, InputError, ValueError, LookupError, TypeError, RecursionError):
        return None


def _files_of(summary: Mapping[str, Any]) -> set[str]:
    """The names of the files that a summary lists."""
    files = summary.get("files", {})
    return {str(name) for name in files.values()} if isinstance(files, dict) else set()


def _remove(folder: Path, names: Iterable[str], console: Console) -> None:
    """Remove files of the run before, and their folders as soon as they hold nothing else."""
    home = folder.resolve()
    for name in sorted(names):
        file = folder / name
        # Only plain files of the folder, and of folders in it, are its results.
        plain = file.is_file() and not file.is_symlink()
        if file.parent.resolve() / file.name != home / name or not plain:
            continue
        file.unlink()
        console.note(f"{file}: removed, as it was of the run before")
        for parent in file.relative_to(folder).parents[:-1]:
            with suppress(OSError):
                (folder / parent).rmdir()


def _without_endings(made_by: Mapping[str, Any]) -> tuple[Any, ...]:
    """What a run is made by; the same drive may be a log and a bag, which differ in endings."""
    sources = [_ENDING.sub("", str(each)) for each in made_by["sources"]]
    return made_by.get("command"), sources, made_by.get("seed")


def _of_others(folder: Path, made_by: Mapping[str, Any]) -> str:
    """What a folder holds that is not of this command with these sources; empty if nothing."""
    summary = _summary_of(folder)
    there = sorted(path.name for name in _RESULTS for path in folder.glob(name) if path.is_file())
    if summary is None:
        return f"{there[0]} of something else" if there else ""
    before = summary["made_by"]
    # A command that failed at its beginning has left nothing but its summary.
    empty = there == ["summary.json"] and "files" not in summary
    if empty or _without_endings(before) == _without_endings(made_by):
        return ""
    seed = f", seed {before['seed']}" if "seed" in before else ""
    return f"results of lrf3d {before.get('command')} {' '.join(map(str, before['sources']))}{seed}"


def _made_by(args: Namespace, sources: Sequence[str | Path], folder: Path) -> dict[str, Any]:
    """The command, the sources and the seed of what is written to a folder."""
    # Paths are relative to the folder, so that a project can be moved.
    named = [
        str(source)
        if source in world_names()
        else os.path.relpath(os.path.realpath(source), os.path.realpath(folder))
        for source in sources
    ]
    seed = {"seed": args.seed} if hasattr(args, "seed") else {}
    return {"command": args.command, "sources": named, **seed}


def results_folder(
    args: Namespace,
    console: Console,
    sources: Sequence[str | Path],
    name: str,
    *,
    alone: bool = True,
) -> ResultsFolder:
    """The folder for the results of a command, ``out/NAME`` if none is given.

    Unless other commands may write there meanwhile, it is locked until the command ends.
    """
    if args.force and any(vars(args).get(name) for name in ("resume", "shard", "merge")):
        raise InputError("--force removes the run before; leave out --resume, --shard and --merge")
    folder = make_folder(Path("out") / folder_name(name) if args.out is None else args.out)
    made_by = _made_by(args, sources, folder)
    if alone:
        console.until_end.callback(_leave_nothing_empty, folder)
        console.until_end.enter_context(locked(folder / "results", folder))
    if args.force:
        _remove_old(folder, console)
    # What is resumed says itself whether it is of the same run.
    elif not (getattr(args, "resume", False) and _resumable(folder)) and (
        others := _of_others(folder, made_by)
    ):
        raise InputError(
            f"{folder}: holds {others}; choose another folder with --out, or replace all of it"
            " with --force"
        )
    if alone and "files" not in (_summary_of(folder) or {}):
        # What is written before a command is stopped has its origin, too.
        write_text(folder / "summary.json", json_text({"made_by": made_by}))
    return ResultsFolder(folder, made_by, console)


def _leave_nothing_empty(folder: Path) -> None:
    """Remove the folder of a command that has failed before it wrote anything."""
    if [path.name for path in folder.iterdir()] == ["summary.json"] and not _files_of(
        _summary_of(folder) or {}
    ):
        (folder / "summary.json").unlink()
        folder.rmdir()


def _resumable(folder: Path) -> bool:
    """Whether a folder holds a run or a sweep that can be continued."""
    return any(next(folder.glob(name), None) for name in ("run.npz", "run.journal", _ROWS))


def _remove_old(folder: Path, console: Console) -> None:
    """Remove all of the run that a folder holds, and nothing else."""
    summary = _summary_of(folder)
    patterns = (_ROWS,) if summary is None else (_ROWS, *_RESULTS)
    there = {str(path.relative_to(folder)) for each in patterns for path in folder.glob(each)}
    _remove(folder, there | _files_of(summary or {}), console)


@contextmanager
def file_of_run(args: Namespace, name: str) -> Iterator[Path]:
    """Yield the file to write of a run, in its folder if none is given.

    It is entered among the files of the run, which are removed with it.
    """
    folder = args.run if args.run.is_dir() else args.run.parent
    path: Path = args.out or folder / name
    make_folder(path.parent)
    made_by = _made_by(args, [args.run], path.parent)
    # The folder of a fleet holds one for each robot.
    homes = [each for each in (folder, folder.parent) if _summary_of(each) is not None]
    home = next(iter(homes), folder).resolve()
    if args.out is not None and not set(_entries(path, home)) & _files_of(_summary_of(home) or {}):
        _refuse_others(path, made_by, args.force)
    yield path
    _mark(path, made_by)
    if summary := _summary_of(home):
        listed = dict(summary.get("files", {}))
        added = {name: name for name in _entries(path, home) if name not in listed.values()}
        write_text(home / "summary.json", json_text({**summary, "files": listed | added}))


def _entries(path: Path, folder: Path) -> list[str]:
    """The names of a file, or of the files of a bag, relative to a folder."""
    files = path.iterdir() if path.is_dir() else [path]
    return [os.path.relpath(each.parent.resolve() / each.name, folder) for each in files]


@contextmanager
def new_file(args: Namespace, path: Path, sources: Sequence[str | Path]) -> Iterator[Path]:
    """Yield a place for a file, and what is written beside it; it is moved to ``path``."""
    with unfinished_folder(path) as folder:
        yield folder / path.name
        made_by = _made_by(args, sources, path.parent)
        made = {file: path.with_name(file.name) for file in sorted(folder.iterdir())}
        for file, there in made.items():
            _refuse_others(there, made_by, args.force, file)
            _mark(file, made_by)
        with writing(path):
            for file, there in made.items():
                os.replace(file, there)


# The attribute of a file in which it is written what it was made by, where the system has them.
_ATTRIBUTE = "user.lrf3d.made_by"


def _mark(file: Path, made_by: Mapping[str, Any]) -> None:
    """Note with a file what it was made by, and its size, which an edit would change."""
    with suppress(OSError, AttributeError):
        text = json.dumps([_without_endings(made_by), file.stat().st_size])
        os.setxattr(file, _ATTRIBUTE, text.encode())


def _refuse_others(
    path: Path, made_by: Mapping[str, Any], force: bool, same: Path | None = None
) -> None:
    """Refuse to replace a file of other sources, or that has been edited, without force."""
    if force or not path.exists() or (same is not None and cmp(same, path, shallow=False)):
        return
    before = None
    with suppress(OSError, AttributeError, ValueError):
        before = json.loads(os.getxattr(path, _ATTRIBUTE))
    if before != [list(_without_endings(made_by)), path.stat().st_size]:
        raise InputError(
            f"{path}: is there, and not known to be of {' '.join(made_by['sources'])}; choose"
            " another name, or replace it with --force"
        )
