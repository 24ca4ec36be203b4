"""What a sheet adds to a plan: dimensions, axes, leaders, frames and legends, as they are drawn.

An annotation is a line that ends at a marker: an arrowhead, a slanted tick, a dot or a bubble.
Extension lines, which lead from a wall to a dimension, end a little beyond it.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from lrf3d.geometry.lines import Bool, Float, Int, directions, lengths
from lrf3d.world.pieces import connected, groups, members_of, pairs_within

# Largest size [m] of a tick, an arrowhead or a dot, and largest radius of a bubble: those on a plan
# of 1:100 are 3 mm and 5 mm, and on one of 1:200 twice as large.
LARGEST = 0.6
BUBBLE = 0.8

# Length [m] by which a dimension, or an extension line, may go on beyond their crossing.
OVERSHOOT = 0.4

# Least area [m²] of a plan in a frame, as in a hall there may be tables.
LEAST_PLAN = 20.0

# Gaps [m] between walls of one plan: as wide as a door, and as a wall with two faces.
ASIDE = 1.0
THICKEST_WALL = 0.3

# Width [m] of the rim of a sheet in which the lines of a frame are.
MARGIN = 0.6


class _Markers(NamedTuple):
    """Places (k, 2) [m], sizes (k,) [m], directions (k, 2), and kinds (k,) of markers.

    The direction of an arrowhead is that in which it points, a dot has none. The segments (m,) are
    of the markers (m,) with the owner's number.
    """

    place: Float
    size: Float
    along: Float
    kind: Int
    segment: Int
    owner: Int


ARROW, TICK, DOT, RING = range(4)

# Place, size, direction, kind and segments of a marker.
_Found = tuple[Float, float, Float, int, Int]


def is_annotation(segments: Float, line: Int, mark: Int, pattern: Bool) -> Bool:
    """Which segments (n, 4) are of annotations; those of the same line (n,) are joined.

    Lines of the same mark (n,) were one; strokes of a pattern (n,) may look like ticks.
    """
    found = np.zeros(len(segments), dtype=bool)
    line = _parted(segments, line)
    markers = _markers(segments, line)
    hosts = np.flatnonzero(_is_alone(line) & (lengths(segments) > 0.25))
    if not len(hosts) or not len(markers.place):
        return found
    host, marker, end, station = _met(segments[hosts], markers)
    # An end is next to one marker; a chain of dimensions has others on its way.
    at_end = end < 2
    kinds = np.zeros((len(hosts), 2), dtype=np.int64)
    clear = np.zeros(len(hosts), dtype=bool)
    hatched = np.bincount(markers.owner, pattern[markers.segment]) > 0
    clear[host[at_end & ~hatched[marker]]] = True
    np.bitwise_or.at(kinds, (host[at_end], end[at_end]), 1 << markers.kind[marker[at_end]])
    ends = segments.reshape(-1, 2)
    near = cKDTree(ends).query_ball_point(segments[hosts].reshape(-1, 2), 2e-3, return_length=True)
    loose = np.reshape(near, (-1, 2)) == 1
    pointed = (kinds & (1 << ARROW | 1 << RING)) > 0
    leads = (pointed & ((kinds > 0) | loose)[:, ::-1]).any(axis=1)
    broken = _is_broken(segments[hosts], (kinds > 0), loose)
    chosen = ((kinds > 0).all(axis=1) | leads | broken) & clear
    found[hosts[chosen]] = True
    found |= np.isin(mark, mark[hosts[chosen]])
    used = np.unique(marker[chosen[host]])
    found[markers.segment[np.isin(markers.owner, used)]] = True
    rings = used[markers.kind[used] == RING]
    bubbles = shapely.buffer(shapely.points(markers.place[rings]), markers.size[rings])
    lines = shapely.linestrings(segments.reshape(-1, 2, 2))
    found[shapely.STRtree(lines).query(bubbles, predicate="contains")[1]] = True
    dimension = chosen[host] & (markers.kind[marker] != RING)
    found[_extensions(segments, hosts, host[dimension], station[dimension], found)] = True
    return found


def _parted(segments: Float, line: Int) -> Int:
    """The lines (n,), from 0; a dimension drawn as one path with its arrowhead is split there."""
    long = lengths(segments)
    along = directions(segments)
    back = (along[1:] * along[:-1]).sum(axis=1) < np.cos(np.radians(130.0))
    uneven = np.minimum(long[1:], long[:-1]) < 0.5 * np.maximum(long[1:], long[:-1])
    return np.cumsum(np.append(0, (line[1:] != line[:-1]) | (back & uneven)))[: len(line)]


def _is_alone(line: Int) -> Bool:
    """Which segments are lines for themselves."""
    return np.asarray(np.bincount(line, minlength=1)[line] == 1) if len(line) else line > 0


def _markers(segments: Float, line: Int) -> _Markers:
    """What may be a marker: by itself, it may also be a letter or a chair."""
    long = lengths(segments)
    found = list[_Found]()
    small = np.bincount(line, long) < 7.0 * BUBBLE
    for own in members_of(line) if len(line) else []:
        if small[line[own[0]]]:
            found += _marker(segments[own], long[own], own)
    short = np.flatnonzero(_is_alone(line) & (long < LARGEST))
    if len(short):
        for pair in cKDTree(segments[short].reshape(-1, 2)).query_pairs(2e-3):
            barbs = short[np.array(pair) // 2]
            found += _heads(segments[barbs], barbs)
    place, size, along, kind, parts = zip(*found, strict=True) if found else [()] * 5
    owner = np.repeat(np.arange(len(found)), np.array([len(each) for each in parts], dtype=int))
    return _Markers(
        np.reshape(place, (-1, 2)),
        np.array(size, dtype=float),
        np.reshape(along, (-1, 2)),
        np.array(kind, dtype=np.int64),
        np.concatenate([np.empty(0, np.int64), *parts]),
        owner,
    )


def _marker(chords: Float, long: Float, own: Int) -> list[_Found]:
    """The marker that the chords (k, 4) of a line are, if they are one."""
    count = len(chords)
    longest = int(np.argmax(long))
    if count < 3 and long[longest] > LARGEST:
        return []
    if count == 2:
        return _heads(chords, own)
    closed = (chords[0, :2] == chords[-1, 2:]).all()
    middle = chords.reshape(-1, 2).mean(axis=0)
    along = directions(chords)[longest]
    if count == 1 or (count == 4 and closed and long.min() < 0.35 * long.max() < 0.35 * LARGEST):
        return [(middle, float(long[longest]), along, TICK, own)] if long[longest] > 0.05 else []
    if count == 3 and closed and long[longest] < LARGEST:
        return _heads(np.delete(chords, np.argmin(long), axis=0), own)
    radii = np.hypot(*(chords[:, :2] - middle).T)
    if count < 6 or not closed or np.ptp(radii) > 0.1 * radii.mean() or radii.mean() > BUBBLE:
        return []
    kind = DOT if radii.mean() < 0.12 else RING
    return [(middle, float(radii.mean()), np.zeros(2), kind, own)]


def _heads(barbs: Float, own: Int) -> list[_Found]:
    """The arrowhead of two barbs (2, 4) that meet, if they are one."""
    a, b = barbs.reshape(2, 2, 2)
    apart = np.hypot(*(a[:, None] - b[None]).transpose(2, 0, 1))
    i, j = np.unravel_index(np.argmin(apart), (2, 2))
    back = np.stack([a[1 - i] - a[i], b[1 - j] - b[j]])
    sizes = np.hypot(*back.T)
    back /= np.maximum(sizes[:, None], 1e-9)
    angle = np.degrees(np.arccos(np.clip(back[0] @ back[1], -1.0, 1.0)))
    even = 0.03 < sizes.min() > sizes.max() / 1.2 and apart[i, j] < 3e-3
    if not even or not 6.0 < angle < 80.0:
        return []
    along = -back.sum(axis=0) / np.hypot(*back.sum(axis=0))
    return [(a[i], float(sizes.max()), along, ARROW, own)]


def _met(hosts: Float, markers: _Markers) -> tuple[Int, Int, Int, Float]:
    """Pairs of hosts (k,) and of markers (k,) on them, by the end (0 or 1, else 2) and place."""
    body = shapely.linestrings(hosts.reshape(-1, 2, 2))
    reach = np.where(markers.kind == RING, 1.15, 1.0) * markers.size
    marker, host = shapely.STRtree(body).query(
        shapely.points(markers.place), predicate="dwithin", distance=reach + 0.01
    )
    along = directions(hosts)[host]
    long = lengths(hosts)[host]
    place, size, kind = (each[marker] for each in (markers.place, markers.size, markers.kind))
    off = place - hosts[host, :2]
    station = (off * along).sum(axis=1)
    aside = np.abs(off[:, 0] * along[:, 1] - off[:, 1] * along[:, 0])
    cosine = (markers.along[marker] * along).sum(axis=1)
    close = np.choose(kind, [size, 0.5 * size, size, 1.15 * size]) + 0.02
    close = np.maximum(close, np.where(kind == TICK, OVERSHOOT, 0.0))
    first = np.abs(station) < close
    last = np.abs(station - long) < close
    # An arrow points along its line, a tick is slanted.
    slanted = (np.abs(cosine) > np.cos(np.radians(68))) & (np.abs(cosine) < np.cos(np.radians(22)))
    fits = aside < np.where(kind == RING, 0.3, 0.2) * size + 2e-3
    fits &= np.select([kind == ARROW, kind == TICK], [np.abs(cosine) > 0.985, slanted], True)
    fits &= (long > 1.2 * size) & ((kind != RING) | first | last)
    # The tip of an arrow is at the end to which it points, or else comes from outside.
    away = (kind == ARROW) & (cosine > 0.0)
    out = np.where(first & ~(away & last), 0, np.where(last, 1, 2))
    return host[fits], marker[fits], out[fits], place[fits]


def _is_broken(hosts: Float, marked: Bool, loose: Bool) -> Bool:
    """Which hosts are a half of a dimension that is broken for its number."""
    half = (marked & loose[:, ::-1]).any(axis=1) & ~marked.all(axis=1)
    found = np.zeros(len(hosts), dtype=bool)
    along = directions(hosts)
    number = np.flatnonzero(half)[:5000]
    if len(number) < 2:
        return found
    free = np.where(marked[number, 0, None], hosts[number, 2:], hosts[number, :2])
    for one, two in cKDTree(free).query_pairs(2.0):
        gap = free[two] - free[one]
        wide = np.hypot(*gap) + 1e-9
        straight = np.abs(along[number[[one, two]]] @ gap) > 0.999 * wide
        if straight.all():
            found[number[[one, two]]] = True
    return found


def _extensions(segments: Float, hosts: Int, host: Int, place: Float, found: Bool) -> Int:
    """The lines that end a little beyond the places (k, 2) of markers, across their hosts (k,)."""
    lines = np.flatnonzero(~found)
    if not len(place) or not len(lines):
        return lines[:0]
    body = shapely.linestrings(segments[lines].reshape(-1, 2, 2))
    which, other = shapely.STRtree(body).query(
        shapely.points(place), predicate="dwithin", distance=0.06
    )
    across = (directions(segments[lines[other]]) * directions(segments[hosts[host[which]]])).sum(
        axis=1
    )
    ends = segments[lines[other]].reshape(-1, 2, 2)
    away = np.hypot(*(ends - place[which][:, None]).transpose(2, 0, 1))
    tip = ends[np.arange(len(away)), np.argmin(away, axis=1)]
    joined = cKDTree(segments.reshape(-1, 2)).query_ball_point(tip, 2e-3, return_length=True)
    kept = (np.abs(across) < 0.05) & (away.min(axis=1) < OVERSHOOT) & (np.asarray(joined) == 1)
    return np.unique(lines[other[kept]])


def is_frame(segments: Float, sheet: bool) -> Bool:
    """Which segments (n, 4) are the frame of a sheet and its title block.

    A frame is the box around all, or all but words, has a plan within that does not touch it, and
    is that of a sheet for another reason: by its proportions, or by a title block at its sides.
    """
    framed = np.zeros(len(segments), dtype=bool)
    while not framed.all():
        left = np.flatnonzero(~framed)
        ends = segments[left].reshape(-1, 2, 2)
        long = lengths(segments[left])
        near = 2e-3 * np.ptp(ends, axis=(0, 1)).max()
        runs = _runs_across(ends, long, near)
        for chosen in (long > 0.0, runs):
            box = ends[chosen].reshape(-1, 2) if chosen.any() else np.zeros((1, 2))
            low = box.min(axis=0)
            high = box.max(axis=0)
            sides = high - low
            reach = np.concatenate([ends - low, high - ends], axis=2)
            off = reach.max(axis=1)
            drawn = long @ (np.abs(off) < near)
            if sides.min() > 0.0 and (drawn > 0.98 * sides[[1, 0, 1, 0]]).all():
                break
        else:
            return framed
        rim = (off < MARGIN).any(axis=1)
        inner = left[~rim]
        part, _, near, hulls = _parts(segments[inner], THICKEST_WALL)
        if not len(hulls):
            return framed
        part = near[part]
        area = shapely.area(hulls)
        # A plan may come near to the frame, a title block is drawn from it.
        lines = shapely.linestrings(ends)
        edge = shapely.union_all(lines[rim & runs])
        block = np.zeros(len(hulls), dtype=bool)
        block[part[shapely.dwithin(lines[~rim], edge, 0.02)]] = True
        beside = (reach[~rim] < 1.01 * MARGIN).any()
        # Proportions of sheets of paper.
        known = np.array([2**0.5, 17 / 11, 11 / 8.5, 4 / 3, 3 / 2])
        paper = np.abs(known - sides.max() / sides.min()).min() < 0.02
        plan, titles = (float(area[each].max(initial=0.0)) for each in (~block, block))
        held = plan > max(LEAST_PLAN, 0.12 * sides.prod(), 1.5 * titles)
        if not (held and (paper or beside or sheet)):
            return framed
        framed[left[rim]] = framed[inner[block[part]]] = True
    return framed


def _runs_across(ends: Float, long: Float, near: float) -> Bool:
    """Which lines (n, 2, 2), of lengths (n,), are on upright or level runs across most of all."""
    found = np.zeros(len(ends), dtype=bool)
    extent = np.ptp(ends, axis=(0, 1))
    for axis in (0, 1):
        on = np.flatnonzero(np.ptp(ends[:, :, axis], axis=1) < 0.01 * long)
        _, run = np.unique(np.round(ends[on, 0, axis] / near), return_inverse=True)
        found[on] |= np.bincount(run, long[on], 1)[run] > 0.7 * extent[1 - axis]
    return found


def _parts(segments: Float, gap: float) -> tuple[Int, Any, Int, Any]:
    """The part (n,) that touches, of each segment (n, 4), and the hulls of the parts.

    Then the group of each part, in which hulls are within a gap [m], and the hulls of the groups.
    """
    part = connected(segments)
    owned = [segments[each].reshape(-1, 2) for each in members_of(part)] if len(segments) else []
    hulls = shapely.convex_hull(np.array([shapely.multipoints(own) for own in owned], dtype=object))
    near = groups(*pairs_within(hulls, gap, "parts"), len(hulls)) if len(hulls) else part
    close = [shapely.union_all(hulls[each]) for each in members_of(near)] if len(hulls) else []
    return part, hulls, near, shapely.convex_hull(np.array(close, dtype=object))


def plans_apart(segments: Float) -> Float:
    """Boxes (k, 4) [m] around the plans of rooms that walls (n, 4) draw apart from each other."""
    *_, hulls = _parts(segments, ASIDE)
    area = shapely.area(hulls)
    boxes = shapely.envelope(hulls[area > max(LEAST_PLAN, 0.25 * area.max(initial=0.0))])
    one, other = shapely.STRtree(boxes).query(boxes, predicate="intersects")
    label = groups(one, other, len(boxes))
    return np.array([shapely.total_bounds(boxes[label == each]) for each in np.unique(label)])


def is_aside(segments: Float, sheet: bool, named: Bool) -> Bool:
    """Which segments (n, 4) are of parts beside the plan: a legend, a scale bar, a north arrow.

    Where nothing else shows that a drawing is a sheet, such a part encloses nothing.
    """
    part, hulls, _, whole = _parts(segments, ASIDE)
    area = shapely.area(whole)
    if not len(hulls) or area.max() < max(LEAST_PLAN, 0.5 * area.sum()):
        return part < 0
    # Walls that are called so are of the plan.
    known = hulls[np.unique(part[named])]
    plan = shapely.convex_hull(shapely.union_all([whole[int(np.argmax(area))], *known]))
    apart = shapely.disjoint(hulls, plan)
    if sheet:
        # Another building may stand there, but none is as narrow as a title bar.
        narrow = 8.0 * shapely.area(hulls) < shapely.length(hulls) ** 2 / 4.0
        return np.asarray(apart & (narrow | (shapely.area(hulls) < 0.3 * plan.area)))[part]
    _, node, met = np.unique(
        segments.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
    )
    owner = np.repeat(part, 2)
    times = met[node.reshape(-1)]
    # Lines end, and meet: the side of a wall does not.
    loose, star = (np.bincount(owner, each) > 0 for each in (times == 1, times > 2))
    long = lengths(segments)
    few = np.array([len(each) > 2 and np.median(long[each]) < MARGIN for each in members_of(part)])
    return np.asarray(apart & loose & star & few)[part]
