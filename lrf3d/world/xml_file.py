"""Reading an XML file element by element, with limits; nothing is fetched or expanded.

Entities are refused, because a kilobyte of them can expand to gigabytes, or to files of this
machine. A reference to a DTD is allowed, but the DTD is not read.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

from lrf3d.errors import WorldError
from lrf3d.files import opened

BYTES_AT_ONCE = 1 << 16
"""Bytes that are parsed at a time."""

DEEPEST_ELEMENT = 100
"""Largest nesting depth of elements: that of drawings is some tens."""

Start = Callable[[str, dict[str, str], int], None]
End = Callable[[str], None]


def go_through(path: Path, start: Start, end: End | None = None, *, largest: int) -> None:
    """Call ``start(tag, attributes, line)`` and ``end(tag)`` for each element of a file.

    Args:
        path: The file.
        start: Called at the start of an element; tags are without their namespace.
        end: Called at its end.
        largest: Largest size of the file [bytes].

    Raises:
        WorldError: The file cannot be read, is not XML or declares entities; the message names the
            line.
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
            # Python decodes encodings that expat lacks, and may refuse them.
            refuse(f"not XML in a known encoding: {error}")
