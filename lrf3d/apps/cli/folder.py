"""The folder for the results of a command: its lock, its summary and its pictures."""

import json
import os
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lrf3d.apps.cli.console import Console, Rows, json_text, print_json, print_table
from lrf3d.base.errors import DrawingError, InputError, Lrf3dError
from lrf3d.base.files import folder_name, locked, make_folder, read_text, write_text
from lrf3d.base.interrupts import check, noting
from lrf3d.world import world_names

# The file of a picture, and the function that draws it.
Drawing = tuple[str, Callable[[Path], object]]

_ENDING = re.compile(r"(?<=[^/.])\.[^/]*$")


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
        self._clear({*made.values(), *(file for file, _ in drawings.values())})
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
            written = [("files", f"{self.path}: {', '.join(made.values())}")]
            written += [("next", following)] if following else []
            print_table(written, max(9, *(len(name) for name, _ in rows)))

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

    def _clear(self, written: Collection[str]) -> None:
        """Remove what this command wrote here before, of another source or drive, and not now."""
        before = _summary_of(self.path)
        files = before.get("files", {})
        if not isinstance(files, dict) or before["made_by"].get("command") != self.console.command:
            return
        for name in sorted(set(map(str, files.values())) - set(written)):
            file = self.path / name
            parts = Path(name).parts
            # Only plain files of the folder, and of one for each robot, are its results.
            if not 1 <= len(parts) <= 2 or {"..", os.sep} & set(parts) or file.parent.is_symlink():
                continue
            if file.is_file() and not file.is_symlink():
                file.unlink()
                self.console.note(f"{file}: removed, as it was of the run before")
            if len(parts) == 2:
                # It stays as long as it holds anything.
                with suppress(OSError):
                    file.parent.rmdir()


def _summary_of(folder: Path) -> dict[str, Any]:
    """The summary in a folder, or what stands for one that cannot be read."""
    try:
        found: dict[str, Any] = json.loads(read_text(folder / "summary.json"))
        _ = [str(source) for source in found["made_by"]["sources"]]
        return found
    except (OSError, InputError, ValueError, LookupError, TypeError, RecursionError):
        return {"made_by": {"sources": ["something else"]}}


def _without_endings(names: Sequence[str]) -> list[str]:
    return [_ENDING.sub("", each) for each in names]


def results_folder(
    console: Console,
    sources: Sequence[str | Path],
    name: str,
    out: Path | None,
    *,
    alone: bool = True,
) -> ResultsFolder:
    """The folder for the results of a command, ``out/NAME`` if none is given.

    Unless other commands may write there meanwhile, it is locked until the command ends.
    """
    folder = make_folder(Path("out") / folder_name(name) if out is None else out)
    # Paths are relative to the folder, so that a project can be moved.
    named = [
        str(source)
        if source in world_names()
        else os.path.relpath(os.path.realpath(source), os.path.realpath(folder))
        for source in sources
    ]
    made_by = {"command": console.command, "sources": named}
    summary = folder / "summary.json"
    if alone:
        console.until_end.enter_context(locked(folder / "results", folder))
        if not summary.exists():
            # What is written before a command is stopped has its origin, too.
            write_text(summary, json_text({"made_by": made_by}))
    if out is None and summary.exists():
        others = [str(source) for source in _summary_of(folder)["made_by"]["sources"]]
        # The same drive may be a log and a bag, whose names differ in their endings.
        if _without_endings(others) != _without_endings(named):
            raise InputError(
                f"{folder}: holds results of {' '.join(others)}; choose another folder with --out"
            )
    return ResultsFolder(folder, made_by, console)
