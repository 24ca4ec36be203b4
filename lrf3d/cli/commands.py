"""Typer's commands with groups of options: as dataclasses in code, under titles in help pages."""

import inspect
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

from typer.core import TyperCommand

LISTS = ("--sigma", "--beams")
"""Options that several numbers may follow, as in ``--sigma 0.1 0.2``."""


class Command(TyperCommand):
    """A command whose help shows options by their groups, in plain text, which is fast."""

    def parse_args(self, context: Any, args: list[str]) -> list[str]:
        """Parse the words of a command line; ``--sigma 0.1 0.2`` is ``--sigma 0.1,0.2``."""
        joined: list[str] = []
        for word in args:
            if joined[-2:-1] and joined[-2] in LISTS and _is_number(word):
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


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def ungrouped(command: Callable[..., None]) -> Callable[..., None]:
    """A command as Typer takes it: a parameter that is a dataclass becomes one for each field."""
    parameters = inspect.signature(command).parameters.values()
    groups: dict[str, Any] = {
        each.name: each.annotation for each in parameters if is_dataclass(each.annotation)
    }
    single = [each for each in parameters if each.name not in groups]
    for group in groups.values():
        single += inspect.signature(group).parameters.values()

    def called(**given: Any) -> None:
        made = {
            name: group(**{each.name: given.pop(each.name) for each in fields(group)})
            for name, group in groups.items()
        }
        command(**given, **made)

    called.__name__, called.__doc__ = command.__name__, command.__doc__
    keyword = inspect.Parameter.KEYWORD_ONLY
    called.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [each.replace(kind=keyword) for each in single]
    )
    called.__annotations__ = {each.name: each.annotation for each in single}
    return called
