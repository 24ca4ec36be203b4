"""What a command draws once its data are written: a picture that fails loses nothing."""

import traceback
from collections.abc import Callable, Mapping
from pathlib import Path

from lrf3d.errors import Lrf3dError

Drawing = tuple[Path, Callable[[Path], object]]
"""The file of a picture or a film, and what draws it to a path."""


def draw_all(drawings: Mapping[str, Drawing], kept: str) -> tuple[dict[str, Path], str]:
    """Draw pictures and films, each whether or not others fail.

    Args:
        drawings: What to draw, by what it shows.
        kept: What a message about a failure ends with: where the data are, and how to draw again.

    Returns:
        The files that were drawn, by what they show, and a line about those that were not; the
        line is empty where all went well.
    """
    drawn: dict[str, Path] = {}
    failed: list[str] = []
    reason = ""
    for name, (path, draw) in drawings.items():
        try:
            draw(path)
        except Exception as error:
            # Whatever it is, nobody's data depend on it.
            failed.append(path.name)
            reason = reason or _reason(error)
        else:
            drawn[name] = path
    return drawn, f"{', '.join(failed)}: not drawn: {reason}; {kept}" if failed else ""


def _reason(error: Exception) -> str:
    """The last line of what went wrong; an error of lrf3d's own has but one."""
    if isinstance(error, Lrf3dError):
        return str(error)
    return "".join(traceback.format_exception_only(error)).strip().splitlines()[-1]
