"""Text that is drawn as lines: rows of small strokes that stand close to each other."""

import numpy as np

from lrf3d.geometry import Bool, Float
from lrf3d.world.pieces import connected, groups

LARGEST = 0.5
"""Largest size [m] of a letter, as drawn on a plan of 1:100: letters of 5 mm."""

SPACING = 0.4
"""Largest gap between letters of a word, as a share of the larger one."""


def is_lettering(segments: Float) -> Bool:
    """Which of the segments (n, 4) are letters of a word of three or more.

    Columns and chairs in a row are all alike, dashes have no width: both are no letters.
    """
    import shapely

    if not len(segments):
        return np.zeros(0, dtype=bool)
    letter = connected(segments)
    count = int(letter.max(initial=-1)) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    for ends in (segments[:, :2], segments[:, 2:]):
        np.minimum.at(low, letter, ends)
        np.maximum.at(high, letter, ends)
    size = (high - low).max(axis=1)
    # A drawing of the size of its paper shows nothing larger.
    extent = float((high.max(axis=0) - low.min(axis=0)).max())
    small = np.flatnonzero(size < min(LARGEST, 0.05 * extent))
    boxes = shapely.box(*low[small].T, *high[small].T)
    reach = shapely.box(*(low - SPACING * size[:, None])[small].T,
                        *(high + SPACING * size[:, None])[small].T)  # fmt: skip
    one, other = shapely.STRtree(boxes).query(reach, predicate="intersects")
    alike = (size[small[one]] < 2.5 * size[small[other]]) & (
        size[small[other]] < 2.5 * size[small[one]]
    )
    word = groups(one[alike], other[alike], len(small))
    text = np.zeros(count, dtype=bool)
    strokes = np.bincount(letter, minlength=count)
    order = np.argsort(word, kind="stable")
    for members in np.split(small[order], np.flatnonzero(np.diff(word[order])) + 1):
        wide = (high - low)[members].min(axis=1) > 0.3 * size[members]
        if len(members) > 2 and wide.any() and len(set(strokes[members].tolist())) > 1:
            text[members] = True
    return np.asarray(text[letter])
