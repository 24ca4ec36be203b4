"""Guarded: a plug-in of the user's whose mistakes are told in one line, with its name and place.

A plug-in enters, and what behaves just like it leaves; but what it raises is an InputError, with
the user's own error as its cause, so that a program can still ask for it.
"""

import inspect
from collections.abc import Callable
from pathlib import Path
from traceback import extract_tb
from typing import Any

from lrf3d.errors import InputError, Lrf3dError

METHODS = {"update", "command", "report", "state", "restore"}
"""What lrf3d calls of a mapper and of a controller; a noise is called itself."""

COPY_FIRST = (
    "copy what is to be changed, as ranges = scan.ranges.copy(), and return"
    " dataclasses.replace(scan, ranges=ranges)"
)
"""The mend where a plug-in writes to the scan that it is given, which others still need."""


class Guarded:
    """A plug-in; in all but what its calls raise it is the plug-in itself.

    Args:
        made: The plug-in.
        label: How the user named it: ``--mapper module:object``.
    """

    def __init__(self, made: Any, label: str) -> None:
        self._made, self._label = made, label
        if callable(made):
            # Who asks how many arguments a noise takes is to be told those of the user's.
            self.__signature__ = inspect.signature(made)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._made, name)
        if name in METHODS and callable(found):
            return lambda *arguments: called(self._label, found, *arguments)
        return found

    def __call__(self, *arguments: Any) -> Any:
        """Call the plug-in."""
        return called(self._label, self._made, *arguments)

    def __repr__(self) -> str:
        return self._label


def called(label: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """What a function of the user's returns.

    Raises:
        InputError: It fails; the message names the plug-in, the error, and where it arose.
    """
    try:
        return function(*arguments)
    except Lrf3dError:
        raise
    except Exception as error:
        words = " ".join(str(error).split())
        if isinstance(error, ValueError) and words.endswith("read-only"):
            words += f"; {COPY_FIRST}"
        place = extract_tb(error.__traceback__)[-1]
        raise InputError(
            f"{label}: {type(error).__name__}: {words} ({Path(place.filename).name},"
            f" line {place.lineno})"
        ) from error
