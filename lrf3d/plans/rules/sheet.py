"""What a sheet adds to a plan: dimensions, axes, leaders, frames and legends, as they are drawn.

An annotation is a line that ends at a marker: an arrowhead, a slanted tick, a dot or a bubble.
Extension lines, which lead from a wall to a dimension, end a little beyond it.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from lrf3d.geometry.lines import ROUNDING, Bool, Float, Int, cross, directions, lengths
from lrf3d.world.pieces import connected, groups, members_of, pairs_within

# Largest size [m] of a tick, an arrowhead or a dot: on a plan of 1:100 they are 3 mm, and on one of
# 1:200 twice as large.
LARGEST = 0.6

# Largest radius [m] of a bubble around the name of an axis: 4 mm on a plan of 1:200.
BUBBLE = 0.8

# Length [m] by which a dimension, or an extension line, may go on beyond their crossing.
OVERSHOOT = 0.4

# Distance [m] within which ends of strokes meet: rounding moves ends that are drawn at one place.
MEETING = 2e-3

# Cosine of the angle, of 10°, within which an arrowhead points along its line.
ALONG = 0.985

# Least area [m²] of a plan in a frame: a smaller part may be a table in a hall.
LEAST_PLAN = 20.0

# Gap [m] up to which parts belong to one plan: the width of a door.
ASIDE = 1.0

# Largest thickness [m] of a wall that is drawn as two faces.
THICKEST_WALL = 0.3

# Width [m] of the rim of a sheet that holds the lines of its frame.
MARGIN = 0.6

# Proportions of sheets of paper, of ISO 216 and of North America.
PAPER = np.array([2**0.5, 17 / 11, 11 / 8.5, 4 / 3, 3 / 2])


class _Markers(NamedTuple):
    """Markers: what lines of annotations end at."""

    # (k, 2) [m].
    place: Float
    # (k,) [m].
    size: Float
    # Unit vectors (k, 2): where an arrowhead points; dots have none.
    along: Float
    kind: Int
    # Numbers (m,) of the segments that draw markers.
    segment: Int
    # The marker (m,) of each of these segments.
    owner: Int


ARROW, TICK, DOT, RING = range(4)

# Place, size, direction, kind and segments of a marker.
_Found = tuple[Float, float, Float, int, Int]


def is_annotation(segments: Float, line: Int, mark: Int) -> Bool:
    """Which segments (n, 4) are of annotations; those of the same line (n,) are joined.

    Lines of the same mark (n,) were one line before areas covered parts of it. A host is an
    isolated line that carries markers.
    """
    shortest = 0.25  # Length [m] of the shortest host: shorter lines are strokes of letters.
    found = np.zeros(len(segments), dtype=bool)
    _, line = np.unique(line, return_inverse=True)
    markers = _markers(segments, line)
    hosts = np.flatnonzero(is_alone(line) & (lengths(segments) > shortest))
    if not len(hosts) or not len(markers.place):
        return found
    host, marker, end, station = _met(segments[hosts], markers)
    # The kinds of markers at both ends of each host, a bit for each kind. Markers between the ends,
    # as in a chain of dimensions, do not count.
    at_end = end < 2
    kinds = np.zeros((len(hosts), 2), dtype=np.int64)
    np.bitwise_or.at(kinds, (host[at_end], end[at_end]), 1 << markers.kind[marker[at_end]])
    tree = cKDTree(segments.reshape(-1, 2))
    loose = _ends_at(tree, segments[hosts].reshape(-1, 2)).reshape(-1, 2) == 1
    # A leader has an arrowhead or a bubble at one end, and at the other another marker or nothing.
    pointed = (kinds & (1 << ARROW | 1 << RING)) > 0
    leads = (pointed & ((kinds > 0) | loose)[:, ::-1]).any(axis=1)
    chosen = (kinds > 0).all(axis=1) | leads
    found |= np.isin(mark, mark[hosts[chosen]])
    used = np.unique(marker[chosen[host]])
    found[markers.segment[np.isin(markers.owner, used)]] = True
    # The name of an axis stands in its bubble.
    rings = used[markers.kind[used] == RING]
    bubbles = shapely.buffer(shapely.points(markers.place[rings]), markers.size[rings])
    lines = shapely.STRtree(as_lines(segments))
    found[lines.query(bubbles, predicate="contains")[1]] = True
    dimension = chosen[host] & (markers.kind[marker] != RING)
    along = directions(segments[hosts[host[dimension]]])
    found[_extensions(segments, tree, along, station[dimension], found)] = True
    return found


def as_lines(segments: Float) -> Any:
    """The segments (n, 4) as geometries (n,)."""
    return shapely.linestrings(segments.reshape(-1, 2, 2))


def box_area(segments: Float) -> float:
    """The area [m²] of the box around segments (n, 4)."""
    return float(shapely.multipoints(segments.reshape(-1, 2)).envelope.area)


def is_alone(line: Int) -> Bool:
    """Which segments are isolated: no other is of the same line (n,)."""
    return np.asarray(np.bincount(line, minlength=1)[line] == 1) if len(line) else line > 0


def _ends_at(tree: Any, places: Float) -> Int:
    """The number of ends (k,) that meet at places (k, 2)."""
    return np.asarray(tree.query_ball_point(places, MEETING, return_length=True))


def _markers(segments: Float, line: Int) -> _Markers:
    """Find what may be a marker: only a host shows that it is not a letter or a chair."""
    long = lengths(segments)
    found = list[_Found]()
    small = np.bincount(line, long) < 7.0 * BUBBLE
    for own in members_of(line) if len(line) else []:
        if small[line[own[0]]]:
            found += _marker(segments[own], long[own], own)
    short = np.flatnonzero(is_alone(line) & (long < LARGEST))
    if len(short):
        for pair in cKDTree(segments[short].reshape(-1, 2)).query_pairs(MEETING):
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
    """The marker that the chords (k, 4) of a line draw, if they draw one."""
    count = len(chords)
    if count < 3:
        known = _heads if count == 2 else _tick
        return known(chords, own) if long.max() <= LARGEST else []
    if (chords[0, :2] != chords[-1, 2:]).any():
        return []
    if count == 3:
        return (
            _heads(np.delete(chords, np.argmin(long), axis=0), own) if long.max() < LARGEST else []
        )
    if count == 4:
        slim = long.min() < 0.35 * long.max() < 0.35 * LARGEST
        return _tick(chords, own) if slim else []
    return _round(chords, own)


def _tick(chords: Float, own: Int) -> list[_Found]:
    """The tick of a line (1, 4), or of a slim ring (4, 4)."""
    shortest = 0.05  # [m]
    long = lengths(chords)
    longest = int(np.argmax(long))
    if long[longest] <= shortest:
        return []
    middle = chords.reshape(-1, 2).mean(axis=0)
    return [(middle, float(long[longest]), directions(chords)[longest], TICK, own)]


def _round(chords: Float, own: Int) -> list[_Found]:
    """The dot or the bubble that a ring of chords (k, 4) is, if it is round."""
    dot = 0.12  # Radius [m] below which it is a dot.
    middle = chords.reshape(-1, 2).mean(axis=0)
    radii = np.hypot(*(chords[:, :2] - middle).T)
    radius = float(radii.mean())
    if len(chords) < 6 or np.ptp(radii) > 0.1 * radius or radius > BUBBLE:
        return []
    return [(middle, radius, np.zeros(2), DOT if radius < dot else RING, own)]


def _heads(barbs: Float, own: Int) -> list[_Found]:
    """The arrowhead that two barbs (2, 4) draw, if they meet at a tip."""
    a, b = barbs.reshape(2, 2, 2)
    apart = np.hypot(*(a[:, None] - b[None]).transpose(2, 0, 1))
    i, j = np.unravel_index(np.argmin(apart), (2, 2))
    back = np.stack([a[1 - i] - a[i], b[1 - j] - b[j]])
    sizes = np.hypot(*back.T)
    back /= np.maximum(sizes[:, None], ROUNDING)
    angle = np.degrees(np.arccos(np.clip(back[0] @ back[1], -1.0, 1.0)))
    shortest = 0.03  # [m]
    even = shortest < sizes.min() > sizes.max() / 1.2 and apart[i, j] < 1.5 * MEETING
    if not even or not 6.0 < angle < 80.0:
        return []
    along = -back.sum(axis=0) / np.hypot(*back.sum(axis=0))
    return [(a[i], float(sizes.max()), along, ARROW, own)]


def _met(hosts: Float, markers: _Markers) -> tuple[Int, Int, Int, Float]:
    """Hosts (k,) and the markers (k,) on them; the end (0 or 1; 2: between them), and the place."""
    reach = np.where(markers.kind == RING, 1.15, 1.0) * markers.size
    marker, host = shapely.STRtree(as_lines(hosts)).query(
        shapely.points(markers.place), predicate="dwithin", distance=reach + 0.01
    )
    along = directions(hosts)[host]
    long = lengths(hosts)[host]
    place, size, kind = (each[marker] for each in (markers.place, markers.size, markers.kind))
    off = place - hosts[host, :2]
    station = (off * along).sum(axis=1)
    aside = np.abs(cross(off, along))
    cosine = (markers.along[marker] * along).sum(axis=1)
    close = np.choose(kind, [size, 0.5 * size, size, 1.15 * size]) + 0.02
    close = np.maximum(close, np.where(kind == TICK, OVERSHOOT, 0.0))
    first = np.abs(station) < close
    last = np.abs(station - long) < close
    # An arrow points along its line, a tick is slanted.
    slanted = (np.abs(cosine) > np.cos(np.radians(68))) & (np.abs(cosine) < np.cos(np.radians(22)))
    fits = aside < np.where(kind == RING, 0.3, 0.2) * size + MEETING
    fits &= np.select([kind == ARROW, kind == TICK], [np.abs(cosine) > ALONG, slanted], True)
    fits &= (long > 1.2 * size) & ((kind != RING) | first | last)
    # On a short host a marker may be close to both ends: an arrow is at the one it points to.
    away = (kind == ARROW) & (cosine > 0.0)
    out = np.where(first & ~(away & last), 0, np.where(last, 1, 2))
    return host[fits], marker[fits], out[fits], place[fits]


def _extensions(segments: Float, tree: Any, along: Float, places: Float, found: Bool) -> Int:
    """The extension lines among what is not found: they end a little beyond markers.

    The places (k, 2) are those of the markers, the directions (k, 2) those of their hosts, which
    extension lines cross at right angles; nothing meets their ends in a tree of all ends.
    """
    reach = 0.06  # Distance [m] from a marker within which an extension line runs.
    lines = np.flatnonzero(~found)
    which, other = shapely.STRtree(as_lines(segments[lines])).query(
        shapely.points(places), predicate="dwithin", distance=reach
    )
    across = (directions(segments[lines[other]]) * along[which]).sum(axis=1)
    ends = segments[lines[other]].reshape(-1, 2, 2)
    away = np.hypot(*(ends - places[which][:, None]).transpose(2, 0, 1))
    tip = ends[np.arange(len(away)), np.argmin(away, axis=1)]
    kept = (np.abs(across) < 0.05) & (away.min(axis=1) < OVERSHOOT) & (_ends_at(tree, tip) == 1)
    return np.unique(lines[other[kept]])


def is_frame(segments: Float, sheet: bool) -> Bool:
    """Which segments (n, 4) are the frame of a sheet and its title block.

    A frame is the box around all, or all but words, with a plan in it that does not touch it. One
    more sign must show a sheet: its proportions, a title block at its sides, or `sheet`.
    """
    found = np.zeros(len(segments), dtype=bool)
    if not len(segments):
        return found
    ends = segments.reshape(-1, 2, 2)
    long = lengths(segments)
    near = 2e-3 * np.ptp(ends, axis=(0, 1)).max()
    runs = _runs_across(ends, long, near)
    for chosen in (long > 0.0, runs):
        if chosen.any():
            low = ends[chosen].min(axis=(0, 1))
            high = ends[chosen].max(axis=(0, 1))
            sides = high - low
            reach = np.concatenate([ends - low, high - ends], axis=2)
            drawn = long @ (np.abs(reach.max(axis=1)) < near)
            if sides.min() > 0.0 and (drawn > 0.98 * sides[[1, 0, 1, 0]]).all():
                return _is_of_box(segments, reach, sides, runs, sheet)
    return found


def _is_of_box(segments: Float, reach: Float, sides: Float, runs: Bool, sheet: bool) -> Bool:
    """Which segments (n, 4) are of a box of sides (2,) [m] and its title block, if it is a frame.

    The distances [m] of their ends from the sides of the box are reach (n, 2, 4); those that run
    across the sheet (n,) may be lines of the frame.
    """
    rim: Bool = (reach.max(axis=1) < MARGIN).any(axis=1)
    inner = ~rim
    part, _, near, hulls = _parts(segments[inner], THICKEST_WALL)
    found = np.zeros(len(segments), dtype=bool)
    if not len(hulls):
        return found
    # The lines of a title block touch the frame; a plan only comes near it.
    lines = as_lines(segments)
    edge = shapely.union_all(lines[rim & runs])
    block = np.zeros(len(hulls), dtype=bool)
    block[near[part][shapely.dwithin(lines[inner], edge, 0.02)]] = True
    area = shapely.area(hulls)
    plan, titles = (float(area[each].max(initial=0.0)) for each in (~block, block))
    paper = np.abs(PAPER - sides.max() / sides.min()).min() < 0.02
    beside = (reach[inner] < 1.01 * MARGIN).any()
    held = plan > max(LEAST_PLAN, 0.12 * sides.prod(), 1.5 * titles)
    if not (held and (paper or beside or sheet)):
        return found
    found[inner] = block[near[part]]
    return rim | found


def _runs_across(ends: Float, long: Float, near: float) -> Bool:
    """Which lines (n, 2, 2) are on upright or level runs across most of the drawing.

    Lines within a distance [m] are one run; each has its length (n,) [m].
    """
    found = np.zeros(len(ends), dtype=bool)
    extent = np.ptp(ends, axis=(0, 1))
    for axis in (0, 1):
        on = np.flatnonzero(np.ptp(ends[:, :, axis], axis=1) < 0.01 * long)
        _, run = np.unique(np.round(ends[on, 0, axis] / near), return_inverse=True)
        found[on] |= np.bincount(run, long[on], 1)[run] > 0.7 * extent[1 - axis]
    return found


def _parts(segments: Float, gap: float) -> tuple[Int, Any, Int, Any]:
    """The part (n,) of each segment (n, 4), whose segments touch, and the hulls (k,) of the parts.

    Then the group (k,) of each part, whose hulls are within a gap [m], and the hulls of the groups.
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


def is_aside(segments: Float, named: Bool) -> Bool:
    """Which segments (n, 4) are of parts next to the plan on a sheet, such as legends.

    Segments that their layer names (n,) as walls are of the plan.
    """
    part, hulls, _, whole = _parts(segments, ASIDE)
    area = shapely.area(whole)
    if not len(hulls) or area.max() < max(LEAST_PLAN, 0.5 * area.sum()):
        return part < 0
    known = hulls[np.unique(part[named])]
    plan = shapely.convex_hull(shapely.union_all([whole[int(np.argmax(area))], *known]))
    # Another building may stand there, but none is as narrow as a title bar.
    aside = shapely.disjoint(hulls, plan) & (
        are_bars(hulls) | (shapely.area(hulls) < 0.3 * plan.area)
    )
    return np.asarray(aside[part])


def are_bars(hulls: Any) -> Any:
    """Which hulls (n,) are at least eight times as long as wide."""
    return 8.0 * shapely.area(hulls) < (0.5 * shapely.length(hulls)) ** 2
