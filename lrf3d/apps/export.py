"""Exporting runs for other programs."""

import io
from pathlib import Path

import numpy as np

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.base.files import as_path, replacing
from lrf3d.base.formats import function, of_kind
from lrf3d.geometry.lines import whole_number
from lrf3d.simulation.run import Run

# Largest page that is shared [bytes]: most mail and chat programs accept attachments of this size.
_LARGEST_PAGE = 3_000_000

# A page keeps at least every n-th moment; with fewer its film is jerky.
_FEWEST = 32

# Width and height of its preview [pixels].
_PREVIEW = (640, 336)


def export_run(run: Run, to: str, path: str | Path, *, every: int = 1) -> None:
    """Write a run in the format of another program.

    Args:
        run: The run.
        to: Name of the format: ``carmen``, ``mcap``, ``rosbag2``, ``glb`` or ``html``;
            of the first lidar's points ``ply``, ``pcd``, ``las``, ``kitti`` or ``npz``.
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
    known = {row.name: row for row in of_kind("export")}
    if not isinstance(to, str) or to not in known:
        raise InputError(f"--to {shown(to)}: expected one of {', '.join(known)}")
    path = as_path(path)
    row = known[to]
    if not path.name.lower().endswith(row.endings):
        raise InputError(f"--out {path}: expected a name that ends in {row.endings[0]}")
    write = function(row.write)
    if "every" not in row.options:
        write(run if every == 1 else run.part(np.arange(0, len(run), every)), path)
        return
    # A scene keeps moments, not scans: what it is made of is the whole run.
    with replacing(path) as unfinished:
        unfinished.write_bytes(write(run, every=every))


def share_run(run: Run, path: str | Path) -> int:
    """Write a run as a single page of up to 3 MB; it keeps every n-th moment, and n is returned.

    The page opens without a server, plays its film in any browser, and has a preview picture.
    """
    from PIL import Image

    from lrf3d.studio.page.page_file import page_file

    path = as_path(path)
    if path.suffix.lower() != ".html":
        raise InputError(f"--out {path}: expected a name that ends in .html")
    # The preview is from the film's end, as its beginning is dark.
    shown = run.frame(float(run.trajectory.times.max()), size=_PREVIEW, view="overview")
    picture = io.BytesIO()
    Image.fromarray(shown).save(picture, "PNG")
    every = 1
    page = page_file(run, preview=picture.getvalue())
    while len(page) > _LARGEST_PAGE and every < _FEWEST:
        every *= 2
        page = page_file(run, every=every, preview=picture.getvalue())
    with replacing(path) as unfinished:
        unfinished.write_bytes(page)
    return every
