"""The commands of the program ``lrf3d``."""

from collections.abc import Callable
from typing import Annotated, Any

import typer

from lrf3d.cli import world
from lrf3d.cli.accuracy import crosscheck, localise
from lrf3d.cli.commands import Command, ungrouped
from lrf3d.cli.export import export
from lrf3d.cli.film import render
from lrf3d.cli.logs import map_, slam
from lrf3d.cli.run import run
from lrf3d.cli.sweep import sweep
from lrf3d.cli.view import view

Commands = list[tuple[str, Callable[..., None]]]

EXAMPLES: Commands = [
    ("run city --sigma 0.04 --out out/city", run),
    ("render out/city --view top", render),
    ("view city", view),
    ("export out/city --to mcap", export),
    ("crosscheck city --json", crosscheck),
    ("map drive.log.gz --out out/drive", map_),
    ("slam drive.log.gz --out out/drive", slam),
    ("localise city --seeds 100 --json", localise),
    ("sweep city --sigma 0.04,0.42 --beams 91,181 --seeds 20", sweep),
]
"""The commands, each with an example that its help shows."""

WORLD_EXAMPLES: Commands = [
    ("show city --out city.png", world.show),
    ("convert plan.dxf plan.toml", world.convert),
    ("generate maze --seed 7 --out maze.toml", world.generate),
]
"""The commands of ``lrf3d world``."""


def print_version(wanted: bool) -> None:
    """Print the version and exit, if ``--version`` is given."""
    if wanted:
        import lrf3d

        print(f"lrf3d {lrf3d.__version__}")
        raise typer.Exit


def _program(
    version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=print_version, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Simulate a robot with a laser range finder, map its world, and film it."""


def _group(commands: Commands, name: str, **more: Any) -> typer.Typer:
    """A program of commands; Rich help would take a third of the time budget of a help page."""
    made = typer.Typer(
        name=name.split()[-1],
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=False,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
        **more,
    )
    for example, command in commands:
        register = made.command(
            example.split()[0], cls=Command, epilog=f"Example: {name} {example}"
        )
        register(ungrouped(command))
    return made


app = _group(EXAMPLES, "lrf3d", epilog="Example: lrf3d run city")
app.callback()(_program)
app.add_typer(
    _group(WORLD_EXAMPLES, "lrf3d world", help="Look at worlds, convert and generate them.")
)
