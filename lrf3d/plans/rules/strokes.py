"""The rules for drawings: each finds strokes that are not walls and takes them out, in turn.

The strokes of a drawing enter; doors leave, and for each rule the strokes that it takes out. To add
a kind of symbol, write a function that returns which strokes draw it, and enter it in `RULES`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry.lines import Bool, Float, Int, lengths
from lrf3d.plans.rules.doors import Door, find_doors
from lrf3d.plans.rules.letters import is_lettering
from lrf3d.plans.rules.patterns import CLOSEST, is_pattern
from lrf3d.plans.rules.sheet import is_annotation, is_aside, is_frame
from lrf3d.world.model import SHEET

# Roles of what stands in the world. ``other`` is the role where names say nothing: such strokes are
# walls, unless a rule takes them out.
STANDS = ("wall", "window", "other", "furniture")

# Roles of strokes that may draw the leaf or the arc of a door.
MAY_OPEN = (*STANDS, "door", "dashed")

# Length [m] from which a line on a layer of doors is a partition: no leaf is that long.
PARTITION = 2.2


@dataclass
class Strokes:
    """The strokes of a drawing, and what the rules have found so far."""

    # (n, 4) [m].
    segments: Float
    # The number (n,) of each stroke's line; consecutive strokes of one line are joined.
    line: Int
    # The index (n,) of each stroke's piece; areas that cover a piece may cut it into several lines.
    piece: Int
    # The role (n,) of each stroke, mostly by the name of its layer.
    role: Any
    # Whether a layer shows that the drawing is a sheet of paper, with more on it than a plan.
    sheet: bool = False
    # The doors that rules have found; their strokes are taken out.
    doors: list[Door] = field(default_factory=list)
    # Which strokes (n,) each rule takes out, by its name.
    found: dict[str, Bool] = field(default_factory=dict)

    # Which strokes (n,) no rule has taken out.
    remaining: Bool = field(init=False)

    def __post_init__(self) -> None:
        self.remaining = np.ones(len(self.segments), dtype=bool)

    def apply(self, rule: "Rule") -> None:
        """Take out what a rule finds among the remaining strokes."""
        self.found[rule.name] = rule.find(self) & self.remaining
        self.remaining = self.remaining & ~self.found[rule.name]

    @property
    def free(self) -> Bool:
        """Which strokes (n,) may be symbols: those left, on layers whose names say nothing.

        A drawing in the size of its paper has none: rules know the sizes of symbols on real plans.
        """
        large = len(self.segments) and np.ptp(self.segments.reshape(-1, 2), axis=0).max() >= SHEET
        return np.asarray(self.remaining & (self.role == "other") & bool(large))

    def among(self, chosen: Bool, find: Callable[[Float], Bool]) -> Bool:
        """Which free strokes (n,) a function finds if it is given the chosen ones (n,) alone."""
        found = np.zeros(len(self.segments), dtype=bool)
        free = self.free
        if free.any():
            found[chosen] = find(self.segments[chosen])
        return found & free

    def shows_sheet(self, *names: str) -> bool:
        """Whether a layer, or strokes that one of the named rules found, show a sheet of paper."""
        return self.sheet or any(self.found[name].any() for name in names)


class Rule(NamedTuple):
    """A rule: it takes strokes out of the walls."""

    # What a stroke that it finds is called, in the singular.
    name: str
    # A sentence: what it recognises, and how.
    what: str
    # Returns which strokes (n,) it takes, of those that are left.
    find: Callable[[Strokes], Bool]
    # Whether the note on what was left out counts its strokes; it lists doors and layers apart.
    counted: bool = True


def _opened(strokes: Strokes) -> Bool:
    drawn = strokes.remaining & np.isin(strokes.role, MAY_OPEN)
    doors, opened = find_doors(strokes.segments, strokes.line, drawn)
    strokes.doors += doors
    return opened


def _of_other_layers(strokes: Strokes) -> Bool:
    # All that does not stand by its role, but for partitions. The role ``other`` is not meant: it
    # stands.
    partition = (strokes.role == "door") & (lengths(strokes.segments) > PARTITION)
    return np.asarray(~(np.isin(strokes.role, STANDS) | partition))


def _annotations(strokes: Strokes) -> Bool:
    free = strokes.free
    drawn = strokes.line[free], strokes.piece[free]
    return strokes.among(free, lambda each: is_annotation(each, *drawn))


def _letters(strokes: Strokes) -> Bool:
    # Upright strokes of letters may be taken for a pattern: look at its short lines, too. Without
    # them the rest of a word is not recognised.
    pattern = strokes.found["pattern line"]
    drawn = strokes.free | (pattern & (lengths(strokes.segments) < 0.5))
    return strokes.among(drawn, lambda each: is_lettering(each, pattern[drawn]))


def _frame(strokes: Strokes) -> Bool:
    known = strokes.shows_sheet("annotation line")
    return strokes.among(strokes.remaining, partial(is_frame, sheet=known))


def _beside(strokes: Strokes) -> Bool:
    left = strokes.remaining & strokes.shows_sheet("annotation line", "frame line")
    return strokes.among(left, lambda each: is_aside(each, strokes.role[left] != "other"))


# Each rule looks among what the rules before it leave.
RULES = [
    Rule(
        "door stroke",
        "A leaf and the quarter arc that its tip sweeps.",
        _opened,
        counted=False,
    ),
    Rule(
        "layer stroke",
        "Marks that are not walls by the name of their layer, their line type or their colour.",
        _of_other_layers,
        counted=False,
    ),
    Rule(
        "annotation line",
        "Dimensions, axes and leaders: lines that end at an arrowhead, a tick, a dot or a bubble.",
        _annotations,
    ),
    Rule(
        "pattern line",
        "Tiles and hatching: five or more parallels at one distance.",
        lambda strokes: strokes.among(
            strokes.free & (lengths(strokes.segments) > CLOSEST), is_pattern
        ),
    ),
    Rule("letter stroke", "Words: rows of small parts that differ from each other.", _letters),
    Rule("frame line", "The box around all on a sheet, and its title block.", _frame),
    Rule("outside line", "Parts next to the plan: a legend, a scale bar, a north arrow.", _beside),
]
