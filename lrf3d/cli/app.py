"""The commands of the program ``lrf3d``."""

from typing import Annotated

import typer

from lrf3d.cli.crosscheck import crosscheck
from lrf3d.cli.export import export
from lrf3d.cli.localise import localise
from lrf3d.cli.map import map_
from lrf3d.cli.render import render
from lrf3d.cli.run import run
from lrf3d.cli.slam import slam
from lrf3d.cli.sweep import sweep
from lrf3d.cli.view import view
from lrf3d.cli.world import world

# Rich help would take a third of the time budget of a help page.
app = typer.Typer(
    name="lrf3d",
    epilog="Example: lrf3d run city",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    no_args_is_help=True,
)


def print_version(wanted: bool) -> None:
    """Print the version and exit, if ``--version`` is given."""
    if wanted:
        import lrf3d

        print(f"lrf3d {lrf3d.__version__}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=print_version, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Simulate a robot with a laser range finder, map its world, and film it."""


app.command(epilog="Example: lrf3d run city --sigma 0.04 --out out/city")(run)
app.command(epilog="Example: lrf3d render out/city --view top")(render)
app.command(epilog="Example: lrf3d view city")(view)
app.command(epilog="Example: lrf3d export out/city --to mcap")(export)
app.command(epilog="Example: lrf3d crosscheck city --json")(crosscheck)
app.command("map", epilog="Example: lrf3d map drive.log.gz --out out/drive")(map_)
app.command(epilog="Example: lrf3d slam drive.log.gz --out out/drive")(slam)
app.command(epilog="Example: lrf3d localise city --seeds 100 --json")(localise)
app.command(epilog="Example: lrf3d sweep city --sigma 0.04,0.42 --beams 91,181 --seeds 20")(sweep)
app.add_typer(world, name="world")
