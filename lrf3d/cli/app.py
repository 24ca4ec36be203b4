"""The program ``lrf3d``: its commands, and how its errors reach the user."""

import sys

import typer

from lrf3d.cli.crosscheck import crosscheck
from lrf3d.cli.export import export
from lrf3d.cli.localise import localise
from lrf3d.cli.map import map_
from lrf3d.cli.render import render
from lrf3d.cli.run import run
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
app.command("map", epilog="Example: lrf3d map drive.log.gz --out out/drive")(map_)
app.command(epilog="Example: lrf3d localise city --seeds 100 --json")(localise)
app.command(epilog="Example: lrf3d sweep city --sigma 0.04,0.42 --beams 91,181 --seeds 20")(sweep)
app.add_typer(world, name="world")


def main(program: typer.Typer = app, name: str = "lrf3d") -> None:
    """Run a program; a known error ends it with one line and the status 1.

    Args:
        program: The program.
        name: How it is called.
    """
    try:
        program(prog_name=name)
    except Lrf3dError as error:
        print(f"{name}: {error}", file=sys.stderr)
        sys.exit(1)
    except SystemExit as end:
        # Typer turns Ctrl-C into this status, without a word.
        if end.code == INTERRUPTED:
            print(f"{name}: stopped", file=sys.stderr)
        raise
    except BrokenPipeError:
        # Whoever read our output has had enough; that is no error.
        sys.stderr.close()
        sys.exit(0)
