"""The program ``lrf3d``: its commands, and how its errors reach the user."""

import sys

import typer

from lrf3d.cli.bench import bench
from lrf3d.cli.console import quiet_libraries
from lrf3d.cli.crosscheck import crosscheck
from lrf3d.cli.export import export
from lrf3d.cli.localise import localise
from lrf3d.cli.map import map_
from lrf3d.cli.paper import paper
from lrf3d.cli.render import render
from lrf3d.cli.run import run
from lrf3d.cli.stress import stress
from lrf3d.cli.sweep import sweep
from lrf3d.cli.view import view
from lrf3d.cli.world import world
from lrf3d.errors import Lrf3dError

INTERRUPTED = 130
"""The status of a program that Ctrl-C ended: 128 and the number of the signal."""

# Rich help would cost a third of the time that a help page may take.
app = typer.Typer(
    name="lrf3d",
    help="Simulate a robot with a laser range finder, map its world, and film it.",
    epilog="Example: lrf3d run city",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    no_args_is_help=True,
)
app.command(epilog="Example: lrf3d run city --sigma 0.04 --out out/city")(run)
app.command(epilog="Example: lrf3d render out/city --view top")(render)
app.command(epilog="Example: lrf3d view city")(view)
app.command(epilog="Example: lrf3d export out/city --to mcap")(export)
app.command(epilog="Example: lrf3d crosscheck city --json")(crosscheck)
app.command(epilog="Example: lrf3d stress --quick")(stress)
app.add_typer(bench, name="bench")
app.command("map", epilog="Example: lrf3d map drive.log.gz --out out/drive")(map_)
app.command(epilog="Example: lrf3d localise city --seeds 100 --json")(localise)
app.command(epilog="Example: lrf3d sweep city --sigma 0.04,0.42 --beams 91,181 --seeds 20")(sweep)
app.command(epilog="Example: lrf3d paper --out out/paper")(paper)
app.add_typer(world, name="world")


def main() -> None:
    """Run the program; a known error ends it with one line and the status 1."""
    quiet_libraries()
    try:
        app()
    except Lrf3dError as error:
        print(f"lrf3d: {error}", file=sys.stderr)
        sys.exit(1)
    except SystemExit as end:
        # Typer turns Ctrl-C into this status, without a word.
        if end.code == INTERRUPTED:
            print("lrf3d: stopped", file=sys.stderr)
        raise
    except BrokenPipeError:
        # Whoever read our output has had enough; that is no error.
        sys.stderr.close()
        sys.exit(0)
