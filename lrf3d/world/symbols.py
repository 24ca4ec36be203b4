"""Symbols of plans, by how they are drawn: doors that stand open, and text."""

from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from lrf3d.geometry import Bool, Float, Int, directions, lengths
from lrf3d.world.pieces import connected, groups

CORNER = np.radians(32.0)
"""Turn [rad] between two segments above which they are no chords of one arc."""

SWEEP = np.radians([40.0, 130.0])
"""Least and largest turn [rad] along the chords of a door's arc."""

WIDTHS = 0.4, 1.7
"""Least and largest width [m] of a leaf."""

MOST_DOORS = 5000
"""Most arcs that are looked at."""

NEAR = 0.12
"""How far a leaf may be from hinge and arc, as a share of its width: it has a thickness."""


LETTER, TITLE = 0.5, 1.5
"""Largest size [m] of a letter, as drawn on a plan of 1:100: letters of 5 mm; and of a title's."""

SPACING = 0.4
"""Largest gap between letters of a word, as a share of the larger one."""


PAPER = 2**0.5, 17 / 11, 11 / 8.5, 4 / 3, 3 / 2
"""Proportions of sheets of paper."""

LEAST_ROOM = 1.5
"""Least area [m²] of a room: of a closet, or a place for a lavatory."""

MARGIN = 0.6
"""Width [m] of the rim of a sheet in which the lines of a frame are."""

LEAST_PLAN = 20.0
"""Least area [m²] of a plan in a frame: in a hall there may be tables."""

PITCH, MOST_ALIKE = 0.7, 5
"""Largest distance [m] of the lines of a pattern, and number from which on parallels are one."""


class Door(NamedTuple):
    """A door that stands open: its hinge (2,) and its opening (2, 2) [m]."""

    opening: Float
    width: float


def find_doors(segments: Float, line: Int, free: Bool) -> tuple[list[Door], Bool]:
    """The doors among segments (n, 4), and which segments (n,) are their arcs and leaves.

    Consecutive segments of the same line (n,) are joined; those that are not free are no door's.
    """
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


def find_leaves(segments: Float, line: Int, free: Bool) -> tuple[list[Door], Bool]:
    """Doors that are drawn as a leaf without an arc, and which segments (n,) are such leaves.

    A leaf is a line for itself, from the corner of a wall with two faces into a room; as long as
    the gap from there to the corner where the face of the wall goes on.
    """
    doors, found, long = list[Door](), np.zeros(len(segments), dtype=bool), lengths(segments)
    alone = np.bincount(line, minlength=1)[line] == 1 if len(line) else found
    leaves = np.flatnonzero(free & alone & (long > WIDTHS[0]) & (long < WIDTHS[1]))
    walls = np.flatnonzero(free)
    if not len(leaves):
        return doors, found
    ends = segments[walls].reshape(-1, 2)
    tree, along = cKDTree(ends), directions(segments[walls])
    around = shapely.STRtree(shapely.linestrings(segments[walls].reshape(-1, 2, 2)))
    for leaf in leaves[:MOST_DOORS]:
        near = [tree.query_ball_point(end, 0.02) for end in segments[leaf].reshape(2, 2)]
        # The hinge is at a corner of two others, the tip stands free.
        at = int(len(near[1]) > 2)
        if len(near[at]) < 3 or len(near[1 - at]) > 1:
            continue
        hinge, tip = segments[leaf].reshape(2, 2)[[at, 1 - at]]
        for end in tree.query_ball_point(hinge, 1.08 * long[leaf]):
            gap = ends[end] - hinge
            width = float(np.hypot(*gap))
            turn = np.arccos(np.clip(gap @ (tip - hinge) / (width * long[leaf] + 1e-9), -1.0, 1.0))
            if width < 0.92 * long[leaf] or not SWEEP[0] / 2 < turn < SWEEP[1]:
                continue
            # The face goes on at both sides, and nothing stands between.
            away = ends[end ^ 1] - ends[end]
            on = abs(gap[0] * away[1] - gap[1] * away[0]) < 0.02 * width and gap @ away > 0.0
            back = max(abs(along[each // 2] @ gap) for each in near[at]) > 0.99 * width
            between = shapely.linestrings([hinge + 0.05 * gap, hinge + 0.95 * gap])
            if on and back and not len(around.query(between, predicate="intersects")):
                doors.append(Door(np.stack([hinge, ends[end]]), width))
                found[leaf] = True
                break
    return doors, found


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


class Parts:
    """Parts of a drawing, each of lines that touch, with the boxes around them."""

    def __init__(self, segments: Float) -> None:
        self.segments = segments
        self.number = connected(segments)
        count = int(self.number.max(initial=-1)) + 1
        self.low, self.high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        for ends in (segments[:, :2], segments[:, 2:]):
            np.minimum.at(self.low, self.number, ends)
            np.maximum.at(self.high, self.number, ends)
        self.sides = self.high - self.low
        self.strokes = np.bincount(self.number, minlength=count)


def is_lettering(parts: Parts) -> Bool:
    """Which parts are letters of a word of three or more.

    Columns and chairs in a row are all alike, dashes have no width: both are no letters. Titles
    have large letters, all of one height.
    """
    text = np.zeros(len(parts.low), dtype=bool)
    size = parts.sides.max(axis=1)
    # A drawing of the size of its paper shows nothing larger.
    extent = float(np.ptp([*parts.low, *parts.high], axis=0).max()) if len(size) else 0.0
    for largest, least in ((LETTER, 3), (TITLE, 5)):
        small = np.flatnonzero((size < min(largest, 0.05 * extent)) & ~text)
        away = SPACING * size[small, None]
        boxes = shapely.box(*parts.low[small].T, *parts.high[small].T)
        reach = shapely.box(*(parts.low[small] - away).T, *(parts.high[small] + away).T)
        one, other = shapely.STRtree(boxes).query(reach, predicate="intersects")
        ratio = size[small[one]] / size[small[other]]
        alike = (ratio < 2.5) & (ratio > 0.4)
        word = groups(one[alike], other[alike], len(small))
        order = np.argsort(word, kind="stable")
        for members in np.split(small[order], np.flatnonzero(np.diff(word[order])) + 1):
            wide = parts.sides[members].min(axis=1) > 0.3 * size[members]
            high = parts.sides[members, 1]
            level = np.abs(high / np.median(high) - 1.0) < 0.1 if len(members) else high > 0.0
            if (
                len(members) >= least
                and wide.any()
                and len(set(parts.strokes[members].tolist())) > 1
                and (largest == LETTER or level.mean() > 0.6)
            ):
                text[members] = True
    return text


def is_frame(segments: Float) -> Bool:
    """Which segments (n, 4) are the frame of a sheet and its title block.

    A frame is the box around all, of the proportions of paper or with a title block at its sides,
    and has a plan within that does not touch it.
    """
    framed = np.zeros(len(segments), dtype=bool)
    while not framed.all():
        left = np.flatnonzero(~framed)
        ends = segments[left].reshape(-1, 2, 2)
        low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
        sides = high - low
        off = np.concatenate([ends - low, high - ends], axis=2).max(axis=1)
        rim = (off < MARGIN).any(axis=1)
        for side, long in enumerate(sides[[1, 0, 1, 0]]):
            on = left[off[:, side] < 1e-3 * sides.max()]
            if not lengths(segments[on]).sum() > 0.98 * long > 0.0:
                return framed
        inner = left[~rim]
        part = connected(segments[inner])
        reach = np.concatenate([ends - low, high - ends], axis=2)[~rim].min(axis=(1, 2))
        block = np.isin(part, part[reach < 1.01 * MARGIN])
        paper = np.abs(np.array(PAPER) - sides.max() / sides.min()).min() < 0.02
        plan, titles = (_largest(segments[inner[each]]) for each in (~block, block))
        held = plan.area > max(LEAST_PLAN, 0.15 * sides.prod(), 2.0 * titles.area)
        if not (held and (paper or block.any())):
            return framed
        if np.abs(np.reshape(plan.bounds, (2, 2)) - [low, high]).min() < MARGIN:
            return framed
        framed[left[rim]] = framed[inner[block]] = True
    return framed


def _largest(segments: Float) -> Any:
    """The largest area that is enclosed by segments (n, 4), or nearly so, with a rim of 0.6 m."""
    lines = shapely.linestrings(segments.reshape(-1, 2, 2))
    whole = shapely.get_parts(shapely.union_all(shapely.buffer(lines, MARGIN, quad_segs=1)))
    areas = shapely.polygons(shapely.get_exterior_ring(whole))
    return areas[np.argmax(shapely.area(areas))] if len(areas) else shapely.Polygon()


def is_pattern(segments: Float) -> Bool:
    """Which segments (n, 4) are of six or more parallels at one distance: tiles or hatching."""
    found = np.zeros(len(segments), dtype=bool)
    if len(segments) < MOST_ALIKE:
        return found
    along = directions(segments)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    middles = 0.5 * (segments[:, :2] + segments[:, 2:])
    rays = np.stack([middles + 1e-4 * across, middles + PITCH * across], axis=1)
    one, other = shapely.STRtree(shapely.linestrings(segments.reshape(-1, 2, 2))).query(
        shapely.linestrings(rays), predicate="intersects"
    )
    off = np.abs(((middles[other] - middles[one]) * across[one]).sum(axis=1))
    turned = np.abs(along[one, 0] * along[other, 1] - along[one, 1] * along[other, 0])
    one, other, off = (each[(turned < 0.01) & (one != other)] for each in (one, other, off))
    order = np.lexsort((off, one))
    one, first = np.unique(one[order], return_index=True)
    following, pitch = np.full(len(segments), -1), np.full(len(segments), np.nan)
    following[one], pitch[one] = other[order][first], off[order][first]
    even = np.abs(pitch[following[one]] - pitch[one]) < 0.05 * pitch[one] + 1e-3
    one, other = one[even], following[one[even]]
    pairs = np.concatenate([one, other]), np.concatenate([other, following[other]])
    member = groups(*pairs, len(segments))
    found = (np.bincount(member) >= MOST_ALIKE)[member]
    # The side of a wall from which tiles are drawn on goes on at both of its corners.
    corners = segments[~found].reshape(-1, 2) @ [1.0, 1.0j]
    found &= ~np.isin(segments.reshape(-1, 2, 2) @ [1.0, 1.0j], corners).all(axis=1)
    return np.asarray(found & (np.bincount(member, found)[member] >= MOST_ALIKE - 1))


def is_aside(parts: Parts) -> Bool:
    """Which parts lie beside the plan and enclose nothing, such as a north arrow."""
    count = len(parts.low)
    if not count:
        return np.zeros(0, dtype=bool)
    order = np.argsort(parts.number, kind="stable")
    lines = np.split(parts.segments[order], np.cumsum(parts.strokes)[:-1])
    hulls = [shapely.multipoints(own.reshape(-1, 2)).convex_hull for own in lines]
    area = shapely.area(hulls)
    if area.max() < max(LEAST_PLAN, 0.5 * area.sum()):
        return np.zeros(count, dtype=bool)
    plan = hulls[int(np.argmax(area))]
    ends = parts.segments.reshape(-1, 2)
    _, node, met = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    owner, times = np.repeat(parts.number, 2), met[node.reshape(-1)]
    # Lines end, and meet: the side of a wall does not.
    loose, star = (np.bincount(owner, each, count) > 0 for each in (times == 1, times > 2))
    few = np.array([len(own) > 2 and np.median(lengths(own)) < MARGIN for own in lines])
    return np.asarray(shapely.disjoint(hulls, plan) & loose & star & few)
