"""Where commands write: a folder for the results, which holds one run, or a single file.

What is there already is replaced if it is of the same command, sources and seed, and otherwise only
with --force.
"""

import json
import os
import re
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
        following: str = "",
        kept: str,
    ) -> None:
        """Write summary.json, print the results, and draw, which may fail or be stopped, last.

        Files and drawings are given by their contents; a drawing that fails does not keep the
        others from being drawn. ``following`` is the command that a user may want next, and
        ``kept`` is printed if drawing fails or is stopped: how to continue.
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
            written_row += [("next", following)] if following else []
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
        if file.parent.resolve() / file.name != home / name or not file.is_file():
            continue
        if file.is_symlink():
            continue
        file.unlink()
        console.note(f"{file}: removed, as it was of the run before")
        for parent in file.relative_to(folder).parents[:-1]:
            with suppress(OSError):
                (folder / parent).rmdir()


def _without_endings(made_by: Mapping[str, Any]) -> Any:
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
    # Paths are relative to the folder, so that a project can be moved.
    named = [
        str(source)
        if source in world_names()
        else os.path.relpath(os.path.realpath(source), os.path.realpath(folder))
        for source in sources
    ]
    made_by = {"command": console.command, "sources": named}
    made_by |= {"seed": args.seed} if hasattr(args, "seed") else {}
    if alone:
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

    It is entered among the files of the run, which are replaced when it is written again, and
    removed with it.
    """
    folder = args.run if args.run.is_dir() else args.run.parent
    path: Path = args.out or folder / name
    make_folder(path.parent)
    # The folder of a fleet holds one for each robot.
    homes = [each for each in (folder, folder.parent) if _summary_of(each) is not None]
    home = next(iter(homes), folder).resolve()
    files = _files_of(_summary_of(home) or {})
    known = args.out is None or _name_in(home, path) in files
    if path.is_dir():
        known = args.out is None or any(_name_in(home, each) in files for each in path.iterdir())
    if path.exists() and not (known or args.force):
        raise InputError(
            f"{path}: is there, and not known to be of {args.run}; choose another name, or replace"
            " it with --force"
        )
    yield path
    if summary := _summary_of(home):
        made = [path] if path.is_file() else path.iterdir()
        entered = {_name_in(home, each): _name_in(home, each) for each in made}
        listed = dict(summary.get("files", {}))
        others = {key: file for key, file in entered.items() if file not in listed.values()}
        write_text(home / "summary.json", json_text({**summary, "files": listed | others}))


def _name_in(folder: Path, file: Path) -> str:
    return os.path.relpath(file.parent.resolve() / file.name, folder)


@contextmanager
def new_file(path: Path, force: bool) -> Iterator[Path]:
    """Yield a place for a file, and what is written beside it; it is moved to ``path``.

    What is there and differs is replaced by force alone.
    """
    with unfinished_folder(path) as folder:
        yield folder / path.name
        made = sorted(folder.iterdir())
        for file in made:
            there = path.with_name(file.name)
            if there.exists() and not (force or cmp(file, there, shallow=False)):
                raise InputError(
                    f"{there}: is there and differs; choose another name, or replace it with"
                    " --force"
                )
        with writing(path):
            for file in made:
                os.replace(file, path.with_name(file.name))
