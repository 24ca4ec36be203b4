"""Going through an XML file element by element, within bounds, with nothing fetched or expanded.

Entities are refused, for a kilobyte of them can stand for gigabytes, or for files of this machine;
documents that only point to a DTD are read, and the DTD is not.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

from lrf3d.errors import WorldError
from lrf3d.input import opened

BYTES_AT_ONCE = 1 << 16
"""Bytes that are parsed at a time."""

DEEPEST_ELEMENT = 100
"""Elements that may stand inside each other: drawings nest by tens."""

Start = Callable[[str, dict[str, str], int], None]
End = Callable[[str], None]


def go_through(path: Path, start: Start, end: End | None = None, *, largest: int) -> None:
    """Call ``start(tag, attributes, line)`` and ``end(tag)`` for each element of a file.

    Args:
        path: The file.
        start: Called where an element begins; tags come without their namespace.
        end: Called where it ends.
        largest: How many bytes the file may have.

    Raises:
        WorldError: The file cannot be read, is no XML or declares entities; the message names
            the line.
    """
    parser = expat.ParserCreate(namespace_separator=" ")
    depth = 0

    def refuse(message: str) -> NoReturn:
        raise WorldError(f"{path}:{parser.CurrentLineNumber}: {message}")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST_ELEMENT:
            refuse(f"elements nested more than {DEEPEST_ELEMENT} deep")
        start(tag.rpartition(" ")[2], attributes, parser.CurrentLineNumber)

    def finish(tag: str) -> None:
        nonlocal depth
        depth -= 1
        if end is not None:
            end(tag.rpartition(" ")[2])

    def entity(*_: Any) -> None:
        refuse("declares an entity, which a world file has no need of; take it out")

    parser.StartElementHandler = begin
    parser.EndElementHandler = finish
    parser.EntityDeclHandler = entity
    with opened(path, what="a world file", largest=largest, error=WorldError) as file:
        try:
            while block := file.read(BYTES_AT_ONCE):
                parser.Parse(block, False)
            parser.Parse(b"", True)
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            raise WorldError(f"{path}:{error.lineno}: not XML: {reason}") from None
        except WorldError:
            raise
        except (ValueError, LookupError) as error:
            # Encodings that expat does not have are looked up in Python, and may be refused there.
            refuse(f"not XML in a known encoding: {error}")
