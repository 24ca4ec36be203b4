"""Rows: the results of runs, one line of JSON each, appended to a file as they come.

A line is a pure function of its run, so a run that was made twice is kept once, and a line that a
crash cut off is left out and made again. Jobs on other machines write files of their own.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from lrf3d.errors import InputError, OutputError

Row = dict[str, Any]

ROWS = "sweep{}.jsonl"
"""Name of a file of rows, with the number of the job that writes it."""


class RowFile:
    """A file to which the rows of runs are appended.

    Args:
        path: The file.

    Raises:
        OutputError: It cannot be written to.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        kept = path.read_bytes() if path.exists() else b""
        try:
            self._file: TextIO = path.open("a", encoding="utf-8")
            # The end of a line that a crash cut off.
            self._file.truncate(kept.rfind(b"\n") + 1)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written: {error.strerror}") from error

    def add(self, rows: Iterable[Row]) -> None:
        """Append rows, which are on the disk afterwards even if this process is killed."""
        try:
            self._file.write("".join(json.dumps(row, allow_nan=False) + "\n" for row in rows))
            self._file.flush()
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written: {error.strerror}") from error

    def __enter__(self) -> "RowFile":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()


def read_rows(folder: Path) -> dict[str, Row]:
    """The rows of all jobs in a folder, by their keys.

    Raises:
        InputError: A file is damaged.
    """
    rows: dict[str, Row] = {}
    for path in sorted(folder.glob(ROWS.format("*"))):
        text = path.read_text(encoding="utf-8", errors="replace")
        for number, line in enumerate(text.split("\n")[:-1], start=1):
            try:
                row = json.loads(line)
                rows[row["key"]] = row
            except (ValueError, TypeError, KeyError, RecursionError):
                raise InputError(
                    f"{path}: line {number} is not a row of a sweep; remove the line"
                ) from None
    return rows
