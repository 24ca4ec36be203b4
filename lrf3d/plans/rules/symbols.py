"""Symbols of plans, by how they are drawn: doors that stand open, and text."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from lrf3d.geometry.lines import Bool, Float, Int, cross, directions, lengths
from lrf3d.plans.rules.sheet import THICKEST_WALL, is_annotation, is_aside, is_frame
from lrf3d.world.pieces import connected, groups, members_of

# Turn [rad] between two segments above which they are no chords of one arc; least and largest turn
# along the chords of a door's arc.
CORNER = np.radians(32.0)
SWEEP = np.radians([40.0, 150.0])

# Least and largest width [m] of a leaf; how far it may be from hinge and arc, as a share of its
# width, as it has a thickness; and the share that a thick wall may cover.
WIDTHS = (0.4, 1.7)
NEAR = 0.12
COVERED = 0.3

# Most arcs that are looked at.
MOST_DOORS = 5000

# Distance [m] within which a line runs along a doorway or a leaf.
SIDE = 0.05

# Number from which on parallels are a pattern.
MOST_ALIKE = 5


class Door(NamedTuple):
    """A door that stands open: hinge, other side and end of the leaf (3, 2), and its width [m]."""

    corners: Float
    width: float

    @property
    def opening(self) -> Float:
        """Its ends (2, 2), from the hinge on."""
        return self.corners[:2]


def find_doors(segments: Float, line: Int, free: Bool) -> tuple[list[Door], Bool]:
    """The doors among segments (n, 4), and which segments (n,) are their arcs and leaves.

    Consecutive segments of the same line (n,) are joined; those that are not free are no door's.
    """
    opened = np.zeros(len(segments), dtype=bool)
    arcs = [arc for arc in _arcs(segments, line) if free[arc[0]].all()][:MOST_DOORS]
    straight = np.setdiff1d(np.flatnonzero(free), [n for run, *_ in arcs for n in run])
    if not arcs or not len(straight):
        return [], opened
    ends = segments[straight].reshape(-1, 2)
    doors = list[Door]()
    tree = cKDTree(ends)
    around = shapely.STRtree(_lines(segments))
    for run, hinge, radius in arcs:
        tips = np.stack([segments[run[0], :2], segments[run[-1], 2:]])
        # A leaf that is drawn from the middle of a thick wall is seen from its face on.
        near = np.array(tree.query_ball_point(hinge, COVERED * radius), dtype=np.int64)
        off = np.hypot(*(ends[near ^ 1][:, None] - tips).transpose(2, 0, 1))
        aside = cross((ends[near] - hinge)[:, None], (tips - hinge)[None] / radius)
        off = np.maximum(off, np.abs(aside))
        if not (off < NEAR * radius).any():
            continue
        # Where a line closes the opening, too, the leaf has a thickness or comes first.
        leaf = int(np.argmin(off.min(axis=1)))
        far = int(np.argmax(off[leaf]))
        doors.append(Door(np.stack([hinge, tips[far], tips[1 - far]]), radius))
        opened[run] = True
        opened[straight[near[off.min(axis=1) < NEAR * radius] // 2]] = True
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
    doors = list[Door]()
    found = np.zeros(len(segments), dtype=bool)
    long = lengths(segments)
    alone = np.bincount(line, minlength=1)[line] == 1 if len(line) else found
    leaves = np.flatnonzero(free & alone & (long > WIDTHS[0]) & (long < WIDTHS[1]))
    if not len(leaves):
        return doors, found
    walls = segments[free]
    ends = walls.reshape(-1, 2)
    along = directions(walls)
    tree = cKDTree(ends)
    around = shapely.STRtree(_lines(walls))
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
                doors.append(Door(np.stack([hinge, ends[end], tip]), width))
                found[leaf] = True
                break
    return doors, found


def cleared(segments: Float, doors: list[Door]) -> tuple[Float, Int, int]:
    """What is left of segments (n, 4) outside of doorways: pieces (k, 4), and of which they are.

    Then the number of segments that reached into doorways. The line of a tile or of a threshold
    closes no door that stands open between two ends of walls, nor does a wall that goes on behind a
    door: its author did not break it.
    """
    lines = _lines(segments)
    ends = segments.reshape(-1, 2)
    ways = directions(segments)
    ends_near = cKDTree(ends)
    near = partial(shapely.STRtree(lines).query, predicate="dwithin")
    ways = np.stack([ways, -ways], axis=1).reshape(-1, 2)
    boxes = list[Any]()
    tips = np.array([door.corners[1] for door in doors])
    for hinge, other, leaf in (door.corners for door in doors):
        width = float(np.hypot(*(other - hinge)))
        axis = (other - hinge) / width
        posts = list[Float]()
        for place, way in ((hinge, -0.98), (other, 0.98)):
            at = np.array(ends_near.query_ball_point(place, NEAR * width), dtype=np.int64)
            posts.append((ends[at[ways[at] @ axis / way > 1.0]] - hinge) @ axis)
        # Of two leaves, each ends where the other does.
        met = np.hypot(*(tips - other).T) < NEAR * width
        if not (len(posts[0]) and (len(posts[1]) or met.sum() > 1)):
            base, free = shapely.linestrings([[hinge, other], [0.7 * hinge + 0.3 * leaf, leaf]])
            # The hinge is at a face of the wall, or in its middle.
            behind = ends.reshape(-1, 2, 2)[near(base, distance=0.5 * THICKEST_WALL + SIDE)] - hinge
            reach = np.sort(behind @ axis, axis=1)
            passes = (reach[:, 0] < -SIDE) & (reach[:, 1] > width + SIDE)
            # A shower in a corner is drawn alike, but has walls on both sides.
            if not passes.any() or len(near(free, distance=SIDE)):
                continue
        across = (THICKEST_WALL + SIDE) * np.array([-axis[1], axis[0]])
        low = hinge + (posts[0].max(initial=0.0) + 0.01) * axis
        high = hinge + (posts[1].min(initial=width) - 0.01) * axis
        boxes.append(shapely.Polygon([low - across, high - across, high + across, low + across]))
    shut = np.array(boxes, dtype=object)
    box, line = shapely.STRtree(lines).query(shut, predicate="intersects")
    cut = np.unique(line)
    while len(line):
        # All boxes at once would be slow: one after the other for each line.
        own, first = np.unique(line, return_index=True)
        lines[own] = shapely.difference(lines[own], shut[box[first]])
        box = np.delete(box, first)
        line = np.delete(line, first)
    parts, number = shapely.get_parts(lines, return_index=True)
    points, part = shapely.get_coordinates(parts, return_index=True)
    return points.reshape(-1, 4), number[part[::2]], len(cut)


def _lines(segments: Float) -> Any:
    return shapely.linestrings(segments.reshape(-1, 2, 2))


def _rays(middles: Float, ahead: Float) -> Any:
    return _lines(np.hstack([middles - ahead, middles + ahead]))


def _arcs(segments: Float, line: Int) -> list[tuple[Int, Float, float]]:
    """Runs of chords of arcs that a leaf may draw: their numbers, middle (2,) and radius [m]."""
    if len(segments) < 3:
        return []
    along = segments[:, 2:] - segments[:, :2]
    one = along[:-1]
    two = along[1:]
    turn = np.arctan2(cross(one, two), (one * two).sum(axis=1))
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
        terms = np.column_stack([2 * x, 2 * y, np.ones_like(x)])
        (cx, cy, c), *_ = np.linalg.lstsq(terms, x**2 + y**2)
        radius = float(np.sqrt(max(c + cx**2 + cy**2, 0.0)))
        off = np.abs(np.hypot(x - cx, y - cy) - radius).max()
        if len(chords) > 2 and WIDTHS[0] < radius < WIDTHS[1] and off < 0.02 * radius:
            found.append((chords, about + np.array([cx, cy]), radius))
    return found


class Strokes(NamedTuple):
    """Segments (n, 4) [m], the line and the mark (n,) of each, and whether they are free (n,).

    A mark may be cut into lines by what covers it. Only what is free may be a symbol.
    """

    segments: Float
    line: Int
    mark: Int
    free: Bool


def symbols(strokes: Strokes, sheet: bool = False) -> Iterator[tuple[str, Bool]]:
    """What of the strokes is no wall, by what it is called, and which (n,) are that.

    Each kind is looked for among what the others leave. Annotations and frames show that a drawing
    is a sheet, on which what stands beside the plan is no wall.
    """
    segments = strokes.segments
    left = strokes.free.copy()

    def among(find: Callable[[Float], Bool], chosen: Bool) -> Bool:
        found = np.zeros(len(segments), dtype=bool)
        found[chosen] = find(segments[chosen])
        found &= left
        left[found] = False
        return found

    pattern = np.zeros(len(segments), dtype=bool)
    pattern[left] = is_pattern(segments[left])
    noted = is_annotation(segments[left], strokes.line[left], strokes.mark[left], pattern[left])
    yield "annotation line", (noted := among(lambda _: noted, left.copy()))
    drawn = left & (~pattern | (lengths(segments) < 0.5))
    yield "pattern line", among(lambda _: pattern[left], left.copy())
    yield "letter stroke", among(lambda each: is_lettering(each, pattern[drawn]), drawn)
    stands = left | ~strokes.free
    sheet |= bool(noted.any())
    yield "frame line", (framed := among(lambda each: is_frame(each, sheet), stands))
    sheet |= bool(framed.any())
    stands &= ~framed
    named = ~strokes.free[stands]
    yield "outside line", among(lambda each: is_aside(each, sheet, named), stands)


def is_lettering(segments: Float, pattern: Bool) -> Bool:
    """Which segments (n, 4) are letters of a word of three or more; a letter is what touches.

    Columns and chairs in a row are all alike, dashes have no width: both are no letters. Titles
    have large letters, all of one height. Upright strokes may look like those of a pattern (n,).
    """
    found = np.zeros(len(segments), dtype=bool)
    if not len(segments):
        return found
    # A word may be written over a wall, but its letters are not drawn on from there.
    ends = segments.reshape(-1, 2)
    _, node = np.unique(ends @ [1.0, 1.0j], return_inverse=True)
    chain = groups(node[::2], node[1::2], node.max() + 1)[node]
    box = np.full((2, chain.max() + 1, 2), np.inf)
    for corner, sign in zip(box, (1.0, -1.0), strict=True):
        np.minimum.at(corner, chain, sign * ends)
    loose = ((-box.sum(axis=0)).max(axis=1) < 1.5)[chain[::2]]
    found[loose] = _of_words(segments[loose], pattern[loose], float(np.ptp(ends, axis=0).max()))
    return found


def _of_words(segments: Float, pattern: Bool, extent: float) -> Bool:
    part = connected(segments)
    own = members_of(part)
    text = np.zeros(len(own), dtype=bool)
    if not len(segments):
        return text[part]
    plain = np.array([not pattern[each].all() for each in own])
    strokes = np.array([len(each) for each in own])
    boxes = shapely.bounds([shapely.multilinestrings(_lines(segments[each])) for each in own])
    sides = boxes[:, 2:] - boxes[:, :2]
    size = sides.max(axis=1)
    # A drawing of the size of its paper shows nothing larger.
    # Letters, as drawn on a plan of 1:100, are 5 mm high, and those of titles 15 mm.
    for largest, least in ((0.5, 3), (1.5, 5)):
        small = np.flatnonzero(size < min(largest, 0.05 * extent))
        # Gaps between letters of a word are shares of the larger one.
        away = 0.6 * size[small, None] * [-1.0, -1.0, 1.0, 1.0]
        reach = shapely.box(*(boxes[small] + away).T)
        tree = shapely.STRtree(shapely.box(*boxes[small].T))
        one, other = tree.query(reach, predicate="intersects")
        ratio = size[small[one]] / size[small[other]]
        # Points and accents are small.
        alike = (ratio >= 1.0) & ((ratio < 2.5) | (largest < 1.0))
        for word in members_of(groups(one[alike], other[alike], len(small))):
            members = small[word]
            sure = small[word][plain[small[word]]]
            if len(members) < least or len(set(strokes[sure].tolist())) < 2:
                continue
            wide = sides[sure].min(axis=1) > 0.3 * size[sure]
            high = sides[members, 1]
            middle = float(np.median(high))
            level = np.abs(high - middle) < 0.1 * middle
            text[members] |= wide.any() and (least == 3 or level.mean() > 0.6)
    # Units and single letters stand next to words.
    while True:
        rest = np.flatnonzero((size < min(0.5, 0.05 * extent)) & ~text)
        away = 0.8 * size[text, None] * [-1.0, -1.0, 1.0, 1.0]
        words = shapely.STRtree(shapely.box(*(boxes[text] + away).T))
        near, word = words.query(shapely.box(*boxes[rest].T), predicate="intersects")
        near = near[size[rest[near]] < 1.3 * size[text][word]]
        if not len(near):
            break
        text[rest[near]] = True
    return text[part]


def is_pattern(segments: Float) -> Bool:
    """Which segments (n, 4) are of six or more parallels at one distance: tiles or hatching."""
    found = np.zeros(len(segments), dtype=bool)
    if len(segments) < MOST_ALIKE:
        return found
    along = directions(segments)
    long = lengths(segments)
    # Of opposite directions one stands for both.
    along *= np.where(along @ [1.0, 1e-3] < 0.0, -1.0, 1.0)[:, None]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    middles = 0.5 * (segments[:, :2] + segments[:, 2:])
    # Those of hatched walls are short, and shifted against each other.
    more = (0.5 * long + 0.2)[:, None] * along
    tree = shapely.STRtree(_lines(np.hstack([middles - more, middles + more])))
    # Lines of a pattern are no farther apart; where more pairs are than this, they are nearer.
    reach = 1.5
    most_pairs = 5e6
    apart = 1 + len(segments) // 100
    rays = _rays(middles, reach * across)
    while (
        reach > 0.2
        and apart * tree.query(rays[::apart], predicate="intersects").shape[1] > most_pairs
    ):
        reach *= 0.5
        rays = _rays(middles, reach * across)
    one, other = tree.query(rays, predicate="intersects")
    off = ((middles[other] - middles[one]) * across[one]).sum(axis=1)
    turned = np.abs(along[one, 0] * along[other, 1] - along[one, 1] * along[other, 0])
    alike = np.minimum(long[one], long[other]) > 0.5 * np.maximum(long[one], long[other])
    fits = (turned < 0.01) & (np.abs(off) > 0.02) & alike
    one = one[fits]
    other = other[fits]
    off = off[fits]
    # At a distance of up to 0.7 m there is another on both sides, or two in a row.
    keys = np.sort(10.0 * one + off)
    even = np.zeros(len(one), dtype=bool)
    for factor in (-1.0, 2.0):
        wanted = 10.0 * one + factor * off
        slack = 0.03 * np.abs(off) + 1e-3
        at = np.searchsorted(keys, wanted - slack)
        even |= keys[np.minimum(at, len(keys) - 1)] <= wanted + slack if len(keys) else even
    even &= np.abs(off) < 0.7
    pairs = one[even], other[even]
    member = groups(*pairs, len(segments))
    linked = np.isin(np.arange(len(segments)), np.concatenate(pairs))
    # The lines of a window are alike, too, but within a wall.
    place = ((middles - middles.mean(axis=0)) * across).sum(axis=1)
    low, high = np.full((2, len(segments)), [[np.inf], [-np.inf]])
    np.minimum.at(low, member, place)
    np.maximum.at(high, member, place)
    found = linked & ((np.bincount(member) >= MOST_ALIKE)[member]) & (high - low > 0.5)[member]
    # The side of a wall from which tiles are drawn on goes on at both of its corners.
    corners = segments[~found].reshape(-1, 2) @ [1.0, 1.0j]
    found &= ~np.isin(segments.reshape(-1, 2, 2) @ [1.0, 1.0j], corners).all(axis=1)
    return np.asarray(found & (np.bincount(member, found)[member] >= MOST_ALIKE - 1))
