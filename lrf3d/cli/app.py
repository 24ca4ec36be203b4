"""The commands of the program ``lrf3d``, from functions and dataclasses with docstrings.

The section ``Options:`` of a docstring has a line of help for each parameter. A parameter without a
default is an argument. One whose type is a dataclass is a group of options, with a title.
"""

import inspect
import re
from collections.abc import Callable
from copy import copy
from dataclasses import fields, is_dataclass
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from lrf3d.cli import world
from lrf3d.cli.accuracy import crosscheck, localise
from lrf3d.cli.logs import map_, slam
from lrf3d.cli.run import run
from lrf3d.cli.runs import export, render, view
from lrf3d.cli.sweep import sweep

EXAMPLES: dict[str, Callable[..., None]] = {
    "run city --sigma 0.04 --out out/city": run,
    "render out/city --view top": render,
    "view city": view,
    "export out/city --to mcap": export,
    "crosscheck city --json": crosscheck,
    "map drive.log.gz --out out/drive": map_,
    "slam drive.log.gz --out out/drive": slam,
    "localise city --seeds 100 --json": localise,
    "sweep city --sigma 0.04,0.42 --beams 91,181 --seeds 20": sweep,
    "world show city --out city.png": world.show,
    "world convert plan.dxf plan.toml": world.convert,
    "world generate maze --seed 7 --out maze.toml": world.generate,
}
"""The commands, each with an example that its help shows."""

LISTS = ("--sigma", "--beams")
"""Options that several numbers may follow, as in ``--sigma 0.1 0.2``."""

NUMBER = r"[-+]?\.?[0-9][0-9.eE+-]*"
"""A word that is a number, or meant to be one, but not ``--``, after which the arguments stand."""


class Command(TyperCommand):
    """A command whose help shows options by their groups, in plain text, which is fast."""

    def parse_args(self, context: Any, args: list[str]) -> list[str]:
        """Parse the words of a command line; ``--sigma 0.1 0.2`` is ``--sigma 0.1,0.2``."""
        joined: list[str] = []
        for word in args:
            if joined[-2:-1] and joined[-2] in LISTS and re.fullmatch(NUMBER, word):
                joined[-1] += f",{word}"
            else:
                joined.append(word)
        return list(super().parse_args(context, joined))

    def format_options(self, context: Any, formatter: Any) -> None:
        """Write the help of all arguments and options."""
        groups: dict[str, list[Any]] = {}
        for each in self.get_params(context):
            record = each.get_help_record(context)
            if record is not None:
                kind = f"{each.param_type_name.capitalize()}s"
                title = getattr(each, "rich_help_panel", None) or kind
                groups.setdefault(title, []).append(record)
        for title, records in groups.items():
            with formatter.section(title):
                formatter.write_dl(records)


def _ungrouped(command: Callable[..., None]) -> Callable[..., None]:
    """A command as Typer takes it: with a parameter for each field of its groups."""
    parameters = inspect.signature(command).parameters.values()
    groups: dict[str, Any] = {
        each.name: each.annotation for each in parameters if is_dataclass(each.annotation)
    }
    text, helps = _described(command)
    single = [_described_parameter(e, helps) for e in parameters if e.name not in groups]
    for group in groups.values():
        _, helps = _described(group)
        own = inspect.signature(group).parameters.values()
        single += [_described_parameter(each, helps, group.title) for each in own]

    def called(**given: Any) -> None:
        made = {
            name: group(**{each.name: given.pop(each.name) for each in fields(group)})
            for name, group in groups.items()
        }
        command(**given, **made)

    called.__name__, called.__doc__ = command.__name__, text
    called.__signature__ = inspect.Signature(single)  # type: ignore[attr-defined]
    called.__annotations__ = {each.name: each.annotation for each in single}
    return called


def _described(item: Any) -> tuple[str, dict[str, str]]:
    """The text of a docstring, and the help of its options by their names."""
    text, _, listed = inspect.cleandoc(item.__doc__ or "").partition("\n\nOptions:\n")
    found = re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", listed, re.MULTILINE)
    return text, {name: " ".join(words.split()) for name, words in found}


def _described_parameter(
    parameter: inspect.Parameter, helps: dict[str, str], title: str | None = None
) -> inspect.Parameter:
    """A parameter with its help and the title of its group, to be given by name."""
    kind, required = parameter.annotation, parameter.default is parameter.empty
    info = None
    if hasattr(kind, "__metadata__"):
        kind, [info] = kind.__origin__, kind.__metadata__
    if kind is not typer.Context:
        if info is None:
            # A switch that is off has no name that turns it off.
            switch = [f"--{parameter.name.replace('_', '-')}"] if parameter.default is False else []
            info = typer.Argument() if required else typer.Option(*switch)
        info = copy(info)
        info.help = info.help or helps[parameter.name]
        info.rich_help_panel = title or info.rich_help_panel
        kind = Annotated[kind, info]
    return parameter.replace(annotation=kind, kind=inspect.Parameter.KEYWORD_ONLY)


def _version(wanted: bool) -> None:
    """Print the version and exit, if ``--version`` is given."""
    if wanted:
        import lrf3d

        print(f"lrf3d {lrf3d.__version__}")
        raise typer.Exit


Version = Annotated[
    bool,
    typer.Option("--version", is_eager=True, callback=_version, help="Print the version and exit."),
]


def _program(version: Version = False) -> None:
    """Simulate a robot with a laser range finder, map its world, and film it."""


def _group(**more: Any) -> typer.Typer:
    """A program of commands; Rich help would take a third of the time budget of a help page."""
    return typer.Typer(
        rich_markup_mode=None, pretty_exceptions_enable=False, add_completion=False,
        no_args_is_help=True, context_settings={"help_option_names": ["-h", "--help"]}, **more,
    )  # fmt: skip


def _made() -> typer.Typer:
    """The program, and its group of commands for worlds."""
    program = _group(callback=_program, epilog="Example: lrf3d run city")
    worlds = _group(help="Look at worlds, convert and generate them.")
    program.add_typer(worlds, name="world")
    for example, command in EXAMPLES.items():
        group, name = program, example.split()[0]
        if name == "world":
            group, name = worlds, example.split()[1]
        register = group.command(name, cls=Command, epilog=f"Example: lrf3d {example}")
        register(_ungrouped(command))
    return program


app = _made()
