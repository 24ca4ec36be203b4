"""Exporting runs for other programs."""

from pathlib import Path

import numpy as np

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.base.files import as_path, replacing
from lrf3d.geometry.lines import whole_number
from lrf3d.simulation.run import Run

# The formats, with default names of their files; what follows the first dot is the ending.
EXPORTERS = {
    "carmen": "run.log.gz",
    "mcap": "run.mcap",
    "rosbag2": "run_bag",
    "glb": "run.glb",
    "html": "run.html",
}


def export_run(run: Run, to: str, path: str | Path, *, every: int = 1) -> None:
    """Write a run in the format of another program.

    Args:
        run: The run.
        to: Name of the format, of :data:`EXPORTERS`.
        path: The file, or the folder.
        every: Keep every n-th scan, or moment of a page.

    Raises:
        InputError: There is no such format, or the ending of the file does not match it.
        OutputError: The file cannot be written.
        MissingLibraryError: The format needs a library that is not installed.

    Examples:
        >>> import lrf3d
        >>> run = lrf3d.load_scenario("paper_room").run(rng=0)
        >>> lrf3d.export_run(run, "carmen", "run.log.gz")
        >>> len(lrf3d.load_log("run.log.gz").scans)
        3
    """
    expect(run, Run, "run")
    every = whole_number(every, "every")
    if not isinstance(to, str) or to not in EXPORTERS:
        raise InputError(f"--to {shown(to)}: expected one of {', '.join(EXPORTERS)}")
    path = as_path(path)
    _, dot, ending = EXPORTERS[to].partition(".")
    endings = (f".{ending}", f".{ending.removesuffix('.gz')}") if dot else ("",)
    if not path.name.lower().endswith(endings):
        raise InputError(f"--out {path}: expected a name that ends in {endings[0]}")
    if to in ("glb", "html"):
        if to == "glb":
            from lrf3d.studio.gltf import run_glb as written
        else:
            from lrf3d.studio.page.page_file import page_file as written
        with replacing(path) as unfinished:
            unfinished.write_bytes(written(run, every=every))
        return
    if every > 1:
        run = run.part(np.arange(0, len(run), every))
    if to == "carmen":
        from lrf3d.recordings.formats.carmen_writer import write_carmen

        write_carmen(run, path)
    else:
        from lrf3d.recordings.formats.bags.writer import write, write_folder

        (write if to == "mcap" else write_folder)(run, path)
