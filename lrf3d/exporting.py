"""Exporting runs for other programs: a table of all formats."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lrf3d.errors import InputError
from lrf3d.files import replacing
from lrf3d.run import Run


@dataclass(frozen=True, slots=True)
class Exporter:
    """A format that runs are written in.

    Args:
        name: Default name of a file; the part after its first dot is the ending of all files.
        about: What it is and which programs read it.
        write: Writes every n-th scan of a run to a path, completely or not at all.
    """

    name: str
    about: str
    write: Callable[[Run, Path, int], None]

    @property
    def endings(self) -> tuple[str, ...]:
        """Valid endings of its files; empty for a folder."""
        _, dot, ending = self.name.partition(".")
        return (f".{ending}", f".{ending.removesuffix('.gz')}") if dot else ("",)


def _write_carmen(run: Run, path: Path, every: int) -> None:
    from lrf3d.io.carmen_writer import write_carmen

    write_carmen(_thinned(run, every), path)


def _write_mcap(run: Run, path: Path, every: int) -> None:
    from lrf3d.io.bag_writer import write

    write(_thinned(run, every), path)


def _write_bag_folder(run: Run, path: Path, every: int) -> None:
    from lrf3d.io.bag_writer import write_folder

    write_folder(_thinned(run, every), path)


def _write_glb(run: Run, path: Path, every: int) -> None:
    from lrf3d.gltf import run_glb

    with replacing(path) as unfinished:
        unfinished.write_bytes(run_glb(run, every=every))


def _thinned(run: Run, every: int) -> Run:
    """The run with every n-th of its scans, and the last of its maps."""
    return run if every == 1 else run.part(np.arange(0, len(run), every))


EXPORTERS: dict[str, Exporter] = {
    "carmen": Exporter("run.log.gz", "a CARMEN log", _write_carmen),
    "mcap": Exporter("run.mcap", "a ROS 2 bag as one file, for Foxglove", _write_mcap),
    "rosbag2": Exporter("run_bag", "a ROS 2 bag, for ros2 bag play", _write_bag_folder),
    "glb": Exporter("run.glb", "an animated 3D scene for Blender and web viewers", _write_glb),
}
"""The formats by their names; a new format is one more entry."""


def export_run(run: Run, to: str, path: str | Path, *, every: int = 1) -> None:
    """Write a run in the format of another program.

    Args:
        run: The run.
        to: Name of the format, of :data:`EXPORTERS`.
        path: The file, or the folder.
        every: Keep every n-th scan.

    Raises:
        InputError: There is no such format, or the ending of the file does not match it.
        OutputError: The file cannot be written.
        MissingLibraryError: The format needs a library that is not installed.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "run.log.gz")
        >>> len(lrf3d.load_log("run.log.gz").scans)
        2
    """
    if to not in EXPORTERS:
        raise InputError(f"--to {to}: expected one of {', '.join(EXPORTERS)}")
    exporter, path = EXPORTERS[to], Path(path)
    if not path.name.lower().endswith(exporter.endings):
        raise InputError(f"--out {path}: expected a name that ends in {exporter.endings[0]}")
    exporter.write(run, path, every)
