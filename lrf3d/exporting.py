"""Runs in the formats of other programs: one table of all of them.

A run and a path enter; a file that the other program reads leaves, whole or not at all.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lrf3d.errors import InputError
from lrf3d.output import replacing
from lrf3d.simulation import Run


@dataclass(frozen=True, slots=True)
class Exporter:
    """A format that runs are written in.

    Args:
        ending: How names of its files end.
        about: What it is and who reads it.
        write: Writes a run to a path, with each scan of a number kept.
    """

    ending: str
    about: str
    write: Callable[[Run, Path, int], None]


def _write_glb(run: Run, path: Path, every: int) -> None:
    from lrf3d.gltf import run_glb

    path.write_bytes(run_glb(run, every=every))


EXPORTERS: dict[str, Exporter] = {
    "glb": Exporter(".glb", "an animated 3D scene for Blender and web viewers", _write_glb),
}
"""How a run is written, by the name of the format; a new format is one more entry."""


def export_run(run: Run, to: str, path: str | Path, *, every: int = 1) -> None:
    """Write a run in the format of another program.

    Args:
        run: The run.
        to: Name of the format, of :data:`EXPORTERS`.
        path: The file.
        every: Each scan of this many is kept.

    Raises:
        InputError: There is no such format, or the name of the file does not end as it should.
        OutputError: The file cannot be written.
    """
    if to not in EXPORTERS:
        raise InputError(f"--to {to}: expected one of {', '.join(EXPORTERS)}")
    exporter, path = EXPORTERS[to], Path(path)
    if path.suffix.lower() != exporter.ending:
        raise InputError(f"--out {path}: expected a name that ends in {exporter.ending}")
    with replacing(path) as unfinished:
        exporter.write(run, unfinished, every)
