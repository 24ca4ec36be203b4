"""Symbols of plans, by how they are drawn: doors that stand open, and text."""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, lengths
from lrf3d.world.pieces import connected, groups

CORNER = np.radians(32.0)
"""Turn [rad] between two segments above which they are no chords of one arc."""

SWEEP = np.radians([40.0, 100.0])
"""Least and largest turn [rad] along the chords of a door's arc."""

WIDTHS = 0.4, 1.7
"""Least and largest width [m] of a leaf."""

MOST_DOORS = 5000
"""Most arcs that are looked at."""

NEAR = 0.12
"""How far a leaf may be from hinge and arc, as a share of its width: it has a thickness."""


LETTER = 0.5
"""Largest size [m] of a letter, as drawn on a plan of 1:100: letters of 5 mm."""

SPACING = 0.4
"""Largest gap between letters of a word, as a share of the larger one."""


class Door(NamedTuple):
    """A door that stands open: its hinge (2,) and its opening (2, 2) [m]."""

    opening: Float
    width: float


def find_doors(segments: Float, line: Int, free: Bool) -> tuple[list[Door], Bool]:
    """The doors among segments (n, 4), and which segments (n,) are their arcs and leaves.

    Consecutive segments of the same line (n,) are joined; those that are not free are no door's.
    """
    import shapely
    from scipy.spatial import cKDTree

    part = np.zeros(len(segments), dtype=bool)
    arcs = [arc for arc in _arcs(segments, line) if free[arc[0]].all()][:MOST_DOORS]
    if not arcs:
        return [], part
    for run, *_ in arcs:
        part[run] = True
    straight = np.flatnonzero(free & ~part)
    ends = segments[straight].reshape(-1, 2)
    tree = cKDTree(ends) if len(ends) else None
    around = shapely.STRtree(shapely.linestrings(segments.reshape(-1, 2, 2)))
    doors, opened = list[Door](), np.zeros_like(part)
    for run, hinge, radius in arcs:
        tips = np.stack([segments[run[0], :2], segments[run[-1], 2:]])
        near = tree.query_ball_point(hinge, NEAR * radius) if tree else []
        others = ends[np.array(near, dtype=np.int64) ^ 1]
        off = np.hypot(*(others[:, None] - tips).transpose(2, 0, 1))
        if not (off < NEAR * radius).any():
            continue
        # Where a line closes the opening, too, the leaf has a thickness or comes first.
        leaf = int(np.argmin(off.min(axis=1)))
        doors.append(Door(np.stack([hinge, tips[int(np.argmax(off[leaf]))]]), radius))
        opened[run] = True
        opened[straight[np.array(near)[off.min(axis=1) < NEAR * radius] // 2]] = True
        for tip in tips[(off < NEAR * radius).any(axis=0)]:
            along = (tip - hinge) / radius
            body = shapely.linestrings([hinge + 0.02 * along, tip + NEAR * radius * along])
            body = body.buffer(NEAR * radius, cap_style="flat")
            opened[around.query(body, predicate="contains")] = True
    return doors, opened & free


def _arcs(segments: Float, line: Int) -> list[tuple[Int, Float, float]]:
    """Runs of chords of arcs that a leaf may draw: their numbers, middle (2,) and radius [m]."""
    if len(segments) < 3:
        return []
    along = segments[:, 2:] - segments[:, :2]
    one, two = along[:-1], along[1:]
    cross = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    turn = np.arctan2(cross, (one * two).sum(axis=1))
    joined = (line[1:] == line[:-1]) & (segments[:-1, 2:] == segments[1:, :2]).all(axis=1)
    bent = joined & (np.abs(turn) < CORNER) & (np.abs(turn) > 1e-4)
    # An arc bends to one side.
    bent[1:] &= ~(bent[:-1] & (turn[1:] * turn[:-1] < 0.0))
    run = np.concatenate([[0], np.cumsum(~bent)])
    swept = np.abs(np.bincount(run[1:], np.where(bent, turn, 0.0), run[-1] + 1))
    long = np.bincount(run, lengths(segments))
    wanted = (swept > SWEEP[0]) & (swept < SWEEP[1])
    wanted &= (long > WIDTHS[0] * SWEEP[0]) & (long < WIDTHS[1] * 2.0)
    found = []
    for number in np.flatnonzero(wanted):
        chords = np.arange(*np.searchsorted(run, [number, number + 1]))
        points = np.vstack([segments[chords, :2], segments[chords[-1:], 2:]])
        about = points[0]
        x, y = (points - about).T
        (cx, cy, c), *_ = np.linalg.lstsq(
            np.column_stack([2 * x, 2 * y, np.ones_like(x)]), x**2 + y**2
        )
        radius = float(np.sqrt(max(c + cx**2 + cy**2, 0.0)))
        off = np.abs(np.hypot(x - cx, y - cy) - radius).max()
        if len(chords) > 2 and WIDTHS[0] < radius < WIDTHS[1] and off < 0.02 * radius:
            found.append((chords, about + np.array([cx, cy]), radius))
    return found


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
    small = np.flatnonzero(size < min(LETTER, 0.05 * extent))
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
