"""``lrf3d edit``: correct the plan of a drawing by hand in the browser."""

from argparse import Namespace
from pathlib import Path

from lrf3d.apps.cli.console import Console
from lrf3d.apps.cli.inputs import options_of
from lrf3d.recordings.reading import is_run
from lrf3d.world.files import find_world


def edit(_: None, args: Namespace, console: Console) -> None:
    """Edit the plan of a drawing, a map or an empty sheet in the browser."""
    from lrf3d.apps.edit.server import edit as serve
    from lrf3d.studio.page.server import bound

    path = source_of(args.file)

    def shown(address: str) -> None:
        text = f"{path} is edited at {address}; Ctrl-C ends it"
        console.print({"address": address, "file": str(path)}, [("edit", text)])

    # Options at their defaults, and --edits, which the page replaces, are left out.
    given = options_of(args).items()
    options = {k: v for k, v in given if (k, v) != ("scale", 1.0) and k != "edits"}
    with bound(args.host, args.port) as door:
        serve(path, options, door, host=args.host, browser=args.browser, started=shown)


def source_of(name: str | None) -> Path:
    """The file that is edited: for a run its map; a world file may be new."""
    path = Path(name or "world.toml")
    if is_run(str(path)):
        folder = path if path.is_dir() else path.parent
        return find_world(folder / "map.geojson")
    return path if path.suffix.lower() == ".toml" and not path.exists() else find_world(path)
