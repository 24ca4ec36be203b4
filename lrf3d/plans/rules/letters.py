"""Letters: words that a drawing holds as lines."""

from typing import NamedTuple

import numpy as np
import shapely

from lrf3d.geometry.lines import Bool, Float, Int
from lrf3d.plans.rules.sheet import as_lines
from lrf3d.world.pieces import connected, groups, members_of

# Largest height [m] of letters: on a plan of 1:100, 5 mm.
LETTER = 0.5

# Least number of letters in a word.
LEAST_LETTERS = 3


class _LetterParts(NamedTuple):
    """Parts whose strokes touch, as those of a letter do: their boxes (k, 4) [m] and looks (k,)."""

    boxes: Float
    # (k, 2) [m].
    sides: Float
    # The longer side [m].
    size: Float
    # Number of segments.
    strokes: Int
    # Whether at least one segment is not of a pattern.
    plain: Bool
    # Size [m] of the largest letter, by the extent of the drawing: it may be as small as its paper.
    letter: float

    def around(self, chosen: Int, share: float) -> Float:
        """Boxes (m,) of chosen parts, enlarged on all sides by a share of their size."""
        away = share * self.size[chosen, None] * [-1.0, -1.0, 1.0, 1.0]
        return np.asarray(shapely.box(*(self.boxes[chosen] + away).T))


def is_lettering(segments: Float, pattern: Bool) -> Bool:
    """Which segments (n, 4) are letters of a word of three or more; the strokes of a letter touch.

    Columns and chairs in a row are all alike, and dashes have no width: they are not letters.
    Upright strokes may look like those of a pattern (n,).
    """
    found = np.zeros(len(segments), dtype=bool)
    if not len(segments):
        return found
    # A word may be written across a wall, but no line is joined to its letters end to end.
    ends = segments.reshape(-1, 2)
    _, node = np.unique(ends @ [1.0, 1.0j], return_inverse=True)
    chain = groups(node[::2], node[1::2], node.max() + 1)[node]
    box = np.full((2, chain.max() + 1, 2), np.inf)
    for corner, sign in zip(box, (1.0, -1.0), strict=True):
        np.minimum.at(corner, chain, sign * ends)
    loose = ((-box.sum(axis=0)).max(axis=1) < LETTER)[chain[::2]]
    if loose.any():
        largest = 0.05 * float(np.ptp(ends, axis=0).max())
        found[loose] = _is_in_words(segments[loose], pattern[loose], largest)
    return found


def _is_in_words(segments: Float, pattern: Bool, largest: float) -> Bool:
    """Which segments (n, 4) are of words, with letters of up to a height [m]."""
    part = connected(segments)
    own = members_of(part)
    boxes = shapely.bounds([shapely.multilinestrings(as_lines(segments[each])) for each in own])
    sides = boxes[:, 2:] - boxes[:, :2]
    strokes = np.array([len(each) for each in own])
    plain = np.array([not pattern[each].all() for each in own])
    parts = _LetterParts(boxes, sides, sides.max(axis=1), strokes, plain, largest)
    text = np.zeros(len(own), dtype=bool)
    for row in _rows(parts):
        text[row] |= _is_word(parts, row)
    # Units and single letters stand next to words.
    while len(more := _next_to(parts, text)):
        text[more] = True
    return text[part]


def _rows(parts: _LetterParts) -> list[Int]:
    """Rows of parts as small as letters, close to each other and alike in size."""
    small = np.flatnonzero(parts.size < min(LETTER, parts.letter))
    # Gaps between letters of a word are shares of the larger one.
    tree = shapely.STRtree(parts.around(small, 0.0))
    one, other = tree.query(parts.around(small, 0.6), predicate="intersects")
    ratio = parts.size[small[one]] / parts.size[small[other]]
    # Dots and accents are far smaller than letters.
    alike = ratio >= 1.0
    return [small[row] for row in members_of(groups(one[alike], other[alike], len(small)))]


def _is_word(parts: _LetterParts, row: Int) -> bool:
    """Whether a row of parts is a word."""
    sure = row[parts.plain[row]]
    if len(row) < LEAST_LETTERS or len(set(parts.strokes[sure].tolist())) < 2:
        return False
    return bool((parts.sides[sure].min(axis=1) > 0.3 * parts.size[sure]).any())


def _next_to(parts: _LetterParts, text: Bool) -> Int:
    """The parts that stand next to letters (k,) and are hardly larger."""
    rest = np.flatnonzero((parts.size < min(LETTER, parts.letter)) & ~text)
    letters = np.flatnonzero(text)
    words = shapely.STRtree(parts.around(letters, 0.8))
    near, word = words.query(parts.around(rest, 0.0), predicate="intersects")
    return np.asarray(rest[near[parts.size[rest[near]] < 1.3 * parts.size[letters[word]]]])
