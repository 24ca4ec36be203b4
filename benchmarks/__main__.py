"""``scripts/bench``: run time against error, of everything or of one part."""

import sys
from importlib import import_module
from typing import Annotated, Any

import typer

from benchmarks.report import command
from lrf3d.cli import main

PARTS = {
    "ranges": "scripts/bench ranges --walls 400,10000 --figure ranges.png",
    "maps": "scripts/bench maps --seeds 1 --figure maps.png",
    "drive": "scripts/bench drive --figure drive.png",
    "slam": "scripts/bench slam --figure slam.png",
    "frames": "scripts/bench frames --figure frames.png",
    "light": "scripts/bench light --seeds 3",
    "robots": "scripts/bench robots --robots 1024",
    "score": "scripts/bench score footprints.geojson --beams 181 --seeds 2",
}
"""The parts, with an example of each."""

ALONE = [part for part in PARTS if part != "score"]
"""Those that need no file."""


def program(parts: dict[str, str]) -> typer.Typer:
    """A program with a command for each part, which measures everything if none is named."""
    app = typer.Typer(
        help="Measure run time against error; all parts that need no file if none is named.",
        epilog="Example: scripts/bench ranges --json",
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=False,
        invoke_without_command=True,
    )
    app.callback()(everything)
    for part, example in parts.items():
        bench = command(import_module(f"benchmarks.{part}").bench)
        app.command(part, epilog=f"Example: {example}")(bench)
    return app


def single(part: str, name: str) -> typer.Typer:
    """A program of one part."""
    app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, add_completion=False)
    bench = command(import_module(f"benchmarks.{part}").bench)
    app.command(epilog=f"Example: {name} --json")(bench)
    return app


def everything(
    context: typer.Context,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON value.")] = False,
) -> None:
    """Measure run time against error; all parts that need no file if none is named."""
    if context.invoked_subcommand is not None:
        return
    from lrf3d.cli.console import print_json, say

    found: dict[str, Any] = {}
    for part in ALONE:
        say(f"bench {part}")
        report = import_module(f"benchmarks.{part}").bench()
        found[part] = report.as_dict()
        if not json:
            print(report.text(), end="\n\n", flush=True)
    if json:
        print_json(found)


if __name__ == "__main__":
    # Only the part that is measured is imported.
    chosen = [word for word in sys.argv[1:] if word in PARTS][:1]
    main(program({part: PARTS[part] for part in chosen or PARTS}), "scripts/bench")
