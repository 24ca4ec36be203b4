"""Bounds of an SVG file, checked before a library opens it: its size, and what ``use`` repeats."""

from dataclasses import dataclass, field
from pathlib import Path

from lrf3d.errors import WorldError
from lrf3d.world.xml_file import go_through

LARGEST = 1 << 25
"""Bytes of a drawing: a plan of a whole works is smaller."""

MOST_ELEMENTS = 50_000
"""Elements that are drawn, those that ``use`` repeats counted each time."""


@dataclass(slots=True, eq=False)
class _Element:
    line: int
    parts: list["_Element"] = field(default_factory=list)
    uses: str = ""
    drawn: int = 0


def check_svg(path: Path) -> None:
    """See that a file is SVG, draws no more than it may, and refers to nothing outside itself.

    Raises:
        WorldError: It is not so; the message names the line.
    """
    bounds = _Bounds(path)
    go_through(path, bounds.begin, bounds.end, largest=LARGEST)
    bounds.count(bounds.root)


class _Bounds:
    """The tree of elements, with where each points to."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.root = _Element(1)
        self.open = [self.root]
        self.named: dict[str, _Element] = {}

    def begin(self, tag: str, attributes: dict[str, str], line: int) -> None:
        if self.open[-1] is self.root and tag != "svg":
            raise WorldError(
                f"{self.path}:{line}: <{tag[:40]}> where <svg> was expected: not an SVG drawing"
            )
        element = _Element(line)
        if tag == "use":
            href = next((v for k, v in attributes.items() if k.rpartition(" ")[2] == "href"), "")
            if href and not href.startswith("#"):
                raise WorldError(
                    f"{self.path}:{line}: uses {href[:40]!r}, which is outside this file; put it in"
                )
            element.uses = href[1:]
        if "id" in attributes:
            self.named.setdefault(attributes["id"], element)
        self.open[-1].parts.append(element)
        self.open.append(element)

    def end(self, tag: str) -> None:
        self.open.pop()

    def count(self, top: _Element) -> None:
        """Count what each element draws, those it uses included; −1 marks one being counted."""
        waiting = [top]
        while waiting:
            element = waiting[-1]
            inside = list(element.parts)
            if element.uses in self.named:
                inside.append(self.named[element.uses])
            if element.drawn == 0:
                element.drawn = -1
                for part in inside:
                    if part.drawn == -1:
                        raise WorldError(f"{self.path}:{part.line}: an element that uses itself")
                waiting += [part for part in inside if part.drawn == 0]
                continue
            waiting.pop()
            if element.drawn == -1:
                element.drawn = 1 + sum(part.drawn for part in inside)
            if element.drawn > MOST_ELEMENTS:
                raise WorldError(
                    f"{self.path}:{element.line}: draws {element.drawn:,} elements, more than the"
                    f" {MOST_ELEMENTS:,} that are read; simplify the drawing"
                )
