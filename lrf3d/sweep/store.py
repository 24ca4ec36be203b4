"""Store: the rows of a sweep in a folder, each run exactly once.

During the sweep, rows are written to part files, each completely or not at all. At the end they
become one table in the order of the plan. Only one process writes, so a run that was made twice is
stored once.
"""

import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError
from lrf3d.output import lock_of, locked, make_folder, replacing
from lrf3d.sweep.cluster import missing_sweep
from lrf3d.sweep.plan import Plan
from lrf3d.sweep.task import Row

try:
    import pyarrow as arrow
    from pyarrow import parquet
except ImportError as error:
    raise missing_sweep() from error

TABLE, PARTS = "sweep.parquet", "parts"
"""Names of the table and of the folder of part files."""

COUNTS = (
    "map_segments", "visible_segments", "matched_segments", "map_objects", "visible_objects",
    "seen_on_all_sides", "whole",
)  # fmt: skip
"""Figures of a run that are whole numbers."""

SCORES = (
    "length_precision", "length_recall", "length_f1", "segment_precision", "segment_recall",
    "segment_f1", "segment_ratio", "perpendicular_rms", "object_purity", "object_ratio",
)  # fmt: skip
"""Other figures of a run; null if a run has none."""


def schema_of(plan: Plan) -> Any:
    """The columns of a plan's table, with their types."""
    fields = [("key", arrow.string()), ("world", arrow.string())]
    for name in plan.cells[0].columns:
        kinds = {type(cell.columns[name]) for cell in plan.cells}
        kind = float if kinds == {int, float} else kinds.pop()
        fields.append((name, _TYPES[kind]))
    fields += [("seed", arrow.int64()), ("noise_seed", arrow.int64())]
    fields += [(name, arrow.int64()) for name in COUNTS]
    return arrow.schema(fields + [(name, arrow.float64()) for name in SCORES])


_TYPES = {float: arrow.float64(), int: arrow.int64(), str: arrow.string(), bool: arrow.bool_()}


class Store:
    """The rows of a sweep in a folder, which is locked during the ``with`` block.

    Args:
        folder: The folder; it is made.
        plan: The plan.
        resume: Continue with the runs in the folder.

    Raises:
        InputError: The folder holds runs and ``resume`` is not set, it holds runs of another plan,
            or another process writes a sweep to it.
        OutputError: It cannot be written to.
    """

    def __init__(self, folder: Path, plan: Plan, *, resume: bool = False) -> None:
        self._folder, self._parts = make_folder(folder), folder / PARTS
        self._schema, self._plan = schema_of(plan), plan
        self._rows: dict[str, Row] = {}
        self._waiting: list[Row] = []
        self._planned = {run.order.key: run for run in plan.runs}
        self._held = ExitStack()
        self._held.enter_context(locked(lock_of(folder / TABLE), folder))
        try:
            found = self._found()
            if found and not resume:
                raise InputError(
                    f"{folder}: holds {len(found)} runs of a sweep; go on with it by --resume, or"
                    " choose another folder with --out"
                )
            foreign = sum(key not in self._planned for key in found)
            if foreign:
                raise InputError(
                    f"{folder}: holds {foreign} runs that this sweep does not ask for; resume it"
                    " with all that it was started with, or choose another folder with --out"
                )
            self._rows = found
            make_folder(self._parts)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        # The results so far are kept when a sweep is stopped.
        try:
            self.flush()
        finally:
            self.close()

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def kept(self) -> int:
        """Number of rows on the disk."""
        return len(self._rows) - len(self._waiting)

    def __contains__(self, key: object) -> bool:
        return key in self._rows

    def add(self, rows: Sequence[Row]) -> None:
        """Add results of workers; a run that is stored already is not added again."""
        for row in rows:
            if row["key"] not in self._rows:
                whole = {**self._plan.described(self._planned[row["key"]]), **row}
                self._rows[row["key"]] = whole
                self._waiting.append(whole)

    def flush(self) -> None:
        """Write the rows since the last call as another part."""
        if not self._waiting:
            return
        # Its name is that of its first run, which no other part has.
        path = self._parts / f"{self._waiting[0]['key']}.parquet"
        self._write(self._waiting, path)
        self._waiting = []

    def finish(self) -> list[Row]:
        """Write all rows as one table in the order of the plan, and return them.

        The parts are removed afterwards.
        """
        self.flush()
        rows = [self._rows[run.order.key] for run in self._plan.runs]
        self._write(rows, self._folder / TABLE)
        shutil.rmtree(self._parts, ignore_errors=True)
        return rows

    def close(self) -> None:
        """Release the lock."""
        self._held.close()

    def _write(self, rows: Sequence[Row], path: Path) -> None:
        with replacing(path) as unfinished:
            parquet.write_table(arrow.Table.from_pylist(list(rows), self._schema), unfinished)

    def _found(self) -> dict[str, Row]:
        """The rows in the folder, by their keys."""
        paths = [self._folder / TABLE, *sorted(self._parts.glob("[!.]*.parquet"))]
        rows: dict[str, Row] = {}
        for path in paths:
            if path.is_file():
                rows.update({row["key"]: row for row in _read(path)})
        return rows


def _read(path: Path) -> list[Row]:
    try:
        table = parquet.read_table(path)
        # The objects of a map have another name in tables of earlier versions.
        names = ["map_objects" if name == "unions" else name for name in table.column_names]
        rows: list[Row] = table.rename_columns(names).to_pylist()
        return rows if all("key" in row for row in rows) else _refuse(path)
    except (arrow.ArrowException, OSError):
        return _refuse(path)


def _refuse(path: Path) -> list[Row]:
    raise InputError(f"{path}: not a table of a sweep or damaged; take it away")
