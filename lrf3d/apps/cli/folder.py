"""Where commands write: a folder for the results, which holds one run, or a single file.

Earlier results of the same command, sources and seed are replaced; others only with --force.
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
from lrf3d.base.lean import load
from lrf3d.world import world_names

# The file of a picture, and the function that draws it.
Drawing = tuple[str, Callable[[Path], object]]

_ENDING = re.compile(r"(?<=[^/.])\.[^/]*$")

# The rows of a sweep; only lrf3d writes files of this name.
_ROWS = "sweep*.jsonl"

# Names of results, by which also those are found that no summary lists yet.
_RESULTS = (
    "run.npz", "run.journal", "map.geojson", "map.png", "world.png", "noise.png", "run.mp4",
    "trajectory.tum", "check.png", "score.png", "runs.csv", "means.csv", "means.tex",
    "summary.json", *(f"robot[0-9]*/{name}" for name in ("run.npz", "map.geojson", "summary.json")),
)  # fmt: skip


def draw_figure(what: str, *parts: Any, **options: Any) -> None:
    """Draw a figure; matplotlib is loaded when results are done, whose memory is free by then."""
    load(f"lrf3d.studio.figures.figures:draw_{what}")(*parts, **options)


@dataclass(frozen=True, slots=True)
class ResultsFolder:
    """A folder for results, with the command and the sources that make them."""

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
        """Write summary.json, print the results, and draw last, which may fail or be stopped.

        Files and drawings are given by what they show; if one drawing fails, the others are still
        drawn. ``following`` is a command that the user may want next, word by word; ``kept`` is
        printed if drawing fails or is stopped, and says how to continue.
        """
        made = {**files, "summary": "summary.json"}
        before = _files_of(_summary_of(self.path))
        written = {*made.values(), *(file for file, _ in drawings.values())}
        _remove(self.path, before - written, self.console)
        # Keep films and exports of this run that the user wrote elsewhere.
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


def _summary_of(folder: Path) -> dict[str, Any]:
    """The summary in a folder; empty if there is none that names its sources."""
    try:
        found: dict[str, Any] = json.loads(read_text(folder / "summary.json"))
        _ = [str(source) for source in found["made_by"]["sources"]]
        return found
    except (OSError, InputError, ValueError, LookupError, TypeError, RecursionError):
        return {}


def _files_of(summary: Mapping[str, Any]) -> set[str]:
    """The names of the files that a summary lists."""
    files = summary.get("files", {})
    return {str(name) for name in files.values()} if isinstance(files, dict) else set()


def _remove(folder: Path, names: Iterable[str], console: Console) -> None:
    """Remove files of the previous run, and their folders once these are empty."""
    home = folder.resolve()
    for name in sorted(names):
        file = folder / name
        # Results are only plain files in the folder and its subfolders, whatever a summary lists.
        plain = file.is_file() and not file.is_symlink()
        there = file.parent.resolve() / file.name
        if there != home / name or home not in there.parents or not plain:
            continue
        file.unlink()
        console.note(f"{file}: removed, as it belonged to the previous run")
        for parent in file.relative_to(folder).parents[:-1]:
            with suppress(OSError):
                (folder / parent).rmdir()


def _without_endings(made_by: Mapping[str, Any]) -> tuple[Any, ...]:
    """What a run was made from, without endings: a drive may be both a log and a bag."""
    sources = [_ENDING.sub("", str(each)) for each in made_by["sources"]]
    return made_by.get("command"), sources, made_by.get("seed")


def _of_others(folder: Path, made_by: Mapping[str, Any]) -> str:
    """What a folder holds that another command or other sources made; empty if nothing."""
    summary = _summary_of(folder)
    there = sorted(path.name for name in _RESULTS for path in folder.glob(name) if path.is_file())
    if not summary:
        return f"{there[0]} of something else" if there else ""
    before = summary["made_by"]
    # A command that failed early leaves nothing but its summary.
    empty = there == ["summary.json"] and "files" not in summary
    if empty or _without_endings(before) == _without_endings(made_by):
        return ""
    seed = f", seed {before['seed']}" if "seed" in before else ""
    return f"results of lrf3d {before.get('command')} {' '.join(map(str, before['sources']))}{seed}"


def _made_by(args: Namespace, sources: Sequence[str | Path], folder: Path) -> dict[str, Any]:
    """The command, the sources and the seed of the results in a folder."""
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
    # A run that is resumed checks itself whether it is the same.
    elif not (getattr(args, "resume", False) and _resumable(folder)) and (
        others := _of_others(folder, made_by)
    ):
        raise InputError(
            f"{folder}: holds {others}; choose another folder with --out, or replace all of it"
            " with --force"
        )
    if alone and "files" not in _summary_of(folder):
        # So that results of a command that is stopped name their sources, too.
        write_text(folder / "summary.json", json_text({"made_by": made_by}))
    return ResultsFolder(folder, made_by, console)


def _leave_nothing_empty(folder: Path) -> None:
    """Remove the folder of a command that failed before it wrote anything."""
    there = [path.name for path in folder.iterdir()]
    if there == ["summary.json"] and not _files_of(_summary_of(folder)):
        (folder / "summary.json").unlink()
        folder.rmdir()


def _resumable(folder: Path) -> bool:
    """Whether a folder holds a run or a sweep that can be continued."""
    return any(next(folder.glob(name), None) for name in ("run.npz", "run.journal", _ROWS))


def _remove_old(folder: Path, console: Console) -> None:
    """Remove all files of the run in a folder, and nothing else."""
    summary = _summary_of(folder)
    patterns = (_ROWS, *_RESULTS) if summary else (_ROWS,)
    there = {str(path.relative_to(folder)) for each in patterns for path in folder.glob(each)}
    _remove(folder, there | _files_of(summary), console)


@contextmanager
def file_of_run(args: Namespace, name: str) -> Iterator[Path]:
    """Yield the path of a file that is made from a run, in the run's folder if none is given.

    The summary of the run lists it, so that it is removed with the run.
    """
    folder = args.run if args.run.is_dir() else args.run.parent
    path: Path = args.out or folder / name
    make_folder(path.parent)
    made_by = _made_by(args, [args.run], path.parent)
    # The folder of a fleet has a subfolder for each robot.
    homes = [each for each in (folder, folder.parent) if _summary_of(each)]
    home = next(iter(homes), folder).resolve()
    if args.out is not None and not set(_entries(path, home)) & _files_of(_summary_of(home)):
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
    """Yield a temporary path for a file and its companions, which are then moved to ``path``."""
    with unfinished_folder(path) as folder:
        try:
            yield folder / path.name
        except Lrf3dError as error:
            # It names the temporary path.
            raise type(error)(str(error).replace(str(folder / path.name), str(path))) from None
        made_by = _made_by(args, sources, path.parent)
        made = {file: path.with_name(file.name) for file in sorted(folder.iterdir())}
        for file, there in made.items():
            _refuse_others(there, made_by, args.force, file)
            _mark(file, made_by)
        with writing(path):
            for file, there in made.items():
                os.replace(file, there)


# The extended attribute of a file that records its sources, on systems that have attributes.
_ATTRIBUTE = "user.lrf3d.made_by"


def _mark(file: Path, made_by: Mapping[str, Any]) -> None:
    """Record with a file what it was made from, and its size, by which later edits are noticed."""
    with suppress(OSError, AttributeError):
        text = json.dumps([_without_endings(made_by), file.stat().st_size])
        os.setxattr(file, _ATTRIBUTE, text.encode())


def _refuse_others(
    path: Path, made_by: Mapping[str, Any], force: bool, same: Path | None = None
) -> None:
    """Refuse to replace, without --force, a file of other sources or one that was edited."""
    if force or not path.exists() or (same is not None and cmp(same, path, shallow=False)):
        return
    before = None
    with suppress(OSError, AttributeError, ValueError):
        before = json.loads(os.getxattr(path, _ATTRIBUTE))
    if before != [list(_without_endings(made_by)), path.stat().st_size]:
        raise InputError(
            f"{path}: exists, and was not made from {' '.join(made_by['sources'])}; choose"
            " another name, or replace it with --force"
        )
