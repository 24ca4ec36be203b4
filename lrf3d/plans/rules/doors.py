"""Doors that stand open, found by how they are drawn, and the doorways that they leave.

Segments enter; doors leave, with the segments that draw their leaves and arcs. A door is a leaf and
its quarter arc.
"""

from functools import partial
from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from lrf3d.geometry.lines import LEFT, Bool, Float, Int, cross, directions, lengths
from lrf3d.plans.rules.sheet import THICKEST_WALL, as_lines
from lrf3d.world.pieces import members_of

# Largest turn [rad] between two neighbouring chords of an arc: a circle drawn with fewer than a
# dozen chords is a polygon.
CORNER = np.radians(32.0)

# Least and largest turn [rad] along the arc of a door: of doors drawn half open up to those drawn
# wide open.
SWEEP = np.radians([40.0, 150.0])

# Least and largest width [m] of a leaf: of a cupboard, and of a gate.
WIDTHS = (0.4, 1.7)

# Largest width [m] of a double door.
DOUBLE = 2.0

# Least and largest width [m] of most doors.
USUAL = (0.6, 1.2)

# Sine of the angle between the ends of two walls that face each other, and the largest part of
# their distance by which they may be displaced: pictures are turned, and drawn by hand.
ASKEW = 0.15

# Largest distance of a line of a leaf from the hinge and the arc, in widths of the door: a leaf may
# be drawn with its thickness.
NEAR = 0.12

# Largest part of a leaf that a thick wall may cover, in widths of the door.
COVERED = 0.3

# Upper bound on the arcs and on the leaves that are examined.
MOST_DOORS = 5000

# Distance [m] within which a line runs along a doorway or a leaf.
SIDE = 0.05


class Door(NamedTuple):
    """A door that stands open: hinge, other side of the opening, tip of the leaf; its width [m]."""

    # These three points (3, 2) [m].
    corners: Float
    width: float

    @property
    def opening(self) -> Float:
        """The ends (2, 2) of the opening, the hinge first."""
        return self.corners[:2]

    @property
    def slides(self) -> bool:
        """Whether it is drawn without a leaf: the tip of its leaf is its hinge."""
        return bool((self.corners[2] == self.corners[0]).all())


class _Walls(NamedTuple):
    """Segments by their ends: segment i has ends 2 i and 2 i + 1, so `end ^ 1` is the other one."""

    # (2 n, 2) [m].
    ends: Float
    # Unit vectors (2 n, 2) from each end along its segment.
    ways: Float
    # The k-d tree of the ends.
    tree: Any
    # Returns the segments within a distance of a geometry.
    near: Any

    @classmethod
    def of(cls, segments: Float) -> "_Walls":
        ends = segments.reshape(-1, 2)
        along = directions(segments)
        ways = np.stack([along, -along], axis=1).reshape(-1, 2)
        return cls(ends, ways, cKDTree(ends), shapely.STRtree(as_lines(segments)).query)

    def leading(self, place: Float, way: Float, reach: float) -> Float:
        """The ends (k, 2) at a place (2,) from which walls lead in a direction (2,)."""
        near = np.array(self.tree.query_ball_point(place, reach), dtype=np.int64)
        return self.ends[near[self.ways[near] @ way > 0.98]]


def find_doors(segments: Float, line: Int, free: Bool) -> tuple[list[Door], Bool]:
    """Find doors drawn as a leaf and an arc, and which segments (n,) draw them.

    Consecutive segments of the same line (n,) are joined. Only free segments can belong to a door.
    """
    arcs = [arc for arc in _arcs(segments, line) if free[arc[0]].all()][:MOST_DOORS]
    if not arcs:
        return [], np.zeros(len(segments), dtype=bool)
    straight = np.setdiff1d(np.flatnonzero(free), [n for run, *_ in arcs for n in run])
    opened = np.zeros(len(segments), dtype=bool)
    ends = segments[straight].reshape(-1, 2)
    doors = list[Door]()
    tree = cKDTree(ends)
    around = shapely.STRtree(as_lines(segments))
    for run, hinge, radius in arcs:
        tips = np.stack([segments[run[0], :2], segments[run[-1], 2:]])
        # A thick wall may cover the leaf near the hinge: it may begin some way along.
        near = np.array(tree.query_ball_point(hinge, COVERED * radius), dtype=np.int64)
        # A leaf ends at a tip of the arc (near ^ 1: its other end), and is in line with the hinge.
        off = np.hypot(*(ends[near ^ 1][:, None] - tips).transpose(2, 0, 1))
        aside = cross((ends[near] - hinge)[:, None], (tips - hinge)[None] / radius)
        off = np.maximum(off, np.abs(aside))
        meets = off < NEAR * radius
        if not meets.any():
            continue
        # A line may close the opening, too: the leaf is the best fit, and of equal ones the first.
        far = int(np.argmax(off[np.argmin(off.min(axis=1))]))
        doors.append(Door(np.stack([hinge, tips[far], tips[1 - far]]), radius))
        opened[run] = True
        opened[straight[near[meets.any(axis=1)] // 2]] = True
        for tip in tips[meets.any(axis=0)]:
            along = (tip - hinge) / radius
            body = shapely.linestrings([hinge + 0.02 * along, tip + NEAR * radius * along])
            body = body.buffer(NEAR * radius, cap_style="flat")
            opened[around.query(body, predicate="contains")] = True
    return doors, opened & free


def sliding_doors(segments: Float, line: Int, role: Any, doors: list[Door]) -> list[Door]:
    """Doors that layers of doors draw as rectangles in walls that go on through them.

    Segments (n, 4) have roles (n,); consecutive ones of the same line (n,) are joined. A leaf next
    to a wall, or across it, opens none, nor does one at another door, or with a line along it as in
    windows.
    """
    middles = np.array([door.opening.mean(axis=0) for door in doors]).reshape(-1, 2)
    ends = segments[(role != "door") & (lengths(segments) > WIDTHS[0])].reshape(-1, 2, 2)
    found = list[Door]()
    drawn = np.flatnonzero(role == "door")
    places = segments[drawn].reshape(-1, 2, 2).mean(axis=1)
    _, number = np.unique(line[drawn], return_inverse=True)
    for own in members_of(number):
        sides = segments[drawn[own]]
        long = lengths(sides)
        width = float(long.max(initial=0.0))
        thick = float(long.min(initial=np.inf))
        if len(sides) != 4 or not (USUAL[0] < width < DOUBLE and thick < THICKEST_WALL + SIDE):
            continue
        across = np.flatnonzero(long < 0.5 * (width + thick))
        hinge, other = sides[across[[0, -1]]].reshape(2, 2, 2).mean(axis=1)
        axis = (other - hinge) / width
        centre = 0.5 * (hinge + other)
        taken = np.hypot(*(middles - centre).T).min(initial=np.inf) < SIDE + 0.5 * width
        inside = np.abs((places - centre) @ axis) < 0.25 * width
        inside &= np.abs((places - centre) @ (axis @ LEFT)) < 0.4 * thick
        inside &= np.abs(directions(segments[drawn]) @ (axis @ LEFT)) < ASKEW
        if taken or inside.any():
            continue
        along = np.sort((ends - hinge) @ axis, axis=1)
        off = (ends - hinge) @ (axis @ LEFT)
        passes = (along[:, 0] < -SIDE) & (along[:, 1] > width + SIDE)
        near = off[passes & (np.abs(off).max(axis=1) < 0.5 * thick + SIDE)]
        if len(near) and (near.min() < -0.25 * thick < 0.25 * thick < near.max()):
            found.append(Door(np.stack([hinge, other, hinge]), width))
    return found


def _arcs(segments: Float, line: Int) -> list[tuple[Int, Float, float]]:
    """Arcs that a leaf may sweep: the numbers of their chords, their middle (2,) and radius [m]."""
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
        # Fit a circle to the points by least squares.
        terms = np.column_stack([2 * x, 2 * y, np.ones_like(x)])
        (cx, cy, c), *_ = np.linalg.lstsq(terms, x**2 + y**2)
        radius = float(np.sqrt(max(c + cx**2 + cy**2, 0.0)))
        off = np.abs(np.hypot(x - cx, y - cy) - radius).max()
        if len(chords) > 2 and WIDTHS[0] < radius < WIDTHS[1] and off < 0.02 * radius:
            found.append((chords, about + np.array([cx, cy]), radius))
    return found


def gaps_in(walls: Float, pen: float = 0.0) -> Float:
    """The gaps (k, 2, 2) [m] in walls (n, 4) as wide as doors, between two ends of walls.

    Walls end in the middle of the pen [m] that outlines them.
    """
    ends = walls[lengths(walls) < THICKEST_WALL]
    middles = ends.reshape(-1, 2, 2).mean(axis=1)
    thick = lengths(ends)
    pairs = cKDTree(middles).query_pairs(USUAL[1], output_type="ndarray")
    one, other = pairs.T
    apart = middles[other] - middles[one]
    wide = np.hypot(*apart.T)
    fits = (wide > USUAL[0]) & (np.minimum(thick[one], thick[other]) > 0.5 * thick[pairs].max(1))
    fits &= np.abs(cross(directions(ends[one]), directions(ends[other]))) < ASKEW
    fits &= np.abs((apart * directions(ends[one])).sum(axis=1)) < ASKEW * wide
    found = middles[pairs[fits]]
    # Between the ends of one piece of wall there are its sides, between those of two is nothing.
    inner = 0.9 * found + 0.05 * found.sum(axis=1, keepdims=True)
    areas = shapely.buffer(shapely.linestrings(inner), 0.55 * thick[one[fits]], cap_style="flat")
    lines = shapely.linestrings(walls.reshape(-1, 2, 2))
    crossed, _ = shapely.STRtree(lines).query(areas, predicate="intersects")
    found = np.delete(found, np.unique(crossed), axis=0)
    ahead = 0.5 * pen * directions(found.reshape(-1, 4))[:, None]
    return np.asarray(found + ahead * [[-1.0], [1.0]])


def cleared(segments: Float, doors: list[Door]) -> tuple[Float, Int, Int, Any]:
    """Clip segments (n, 4) at doorways, as doors stand open.

    Returns the pieces (k, 4), the index (k,) of each piece's segment, which segments were cut, and
    the area of all doorways. This also cuts lines of tiles and thresholds, and walls that are drawn
    through behind a door.
    """
    walls = _Walls.of(segments)
    lines = as_lines(segments)
    tips = np.array([door.corners[1] for door in doors])
    led = [_doorway(door, tips, walls) for door in doors]
    doorways = np.array([box for box in led if box is not None], dtype=object)
    box, line = shapely.STRtree(lines).query(doorways, predicate="intersects")
    cut = np.unique(line)
    while len(line):
        # Cut each line by one of its boxes at a time: joining all boxes first would be slow.
        own, first = np.unique(line, return_index=True)
        lines[own] = shapely.difference(lines[own], doorways[box[first]])
        box = np.delete(box, first)
        line = np.delete(line, first)
    parts, number = shapely.get_parts(lines, return_index=True)
    points, part = shapely.get_coordinates(parts, return_index=True)
    return points.reshape(-1, 4), number[part[::2]], cut, shapely.union_all(doorways)


def _doorway(door: Door, tips: Float, walls: _Walls) -> Any:
    """The area of a doorway through a wall, or None where a door does not lead through one.

    A doorway is between two ends of walls, or between one end and the place where the other leaf of
    a double door shuts. The tips (k, 2) are where the leaves of all doors shut.
    """
    hinge, other, _ = door.corners
    width = float(np.hypot(*(other - hinge)))
    axis = (other - hinge) / width
    before = (walls.leading(hinge, -axis, NEAR * width) - hinge) @ axis
    after = (walls.leading(other, axis, NEAR * width) - hinge) @ axis
    # The two leaves of a double door shut at one place.
    paired = (np.hypot(*(tips - other).T) < NEAR * width).sum() > 1
    between = len(before) and (len(after) or paired)
    if not between and not _is_in_wall(door, axis, width, walls):
        return None
    across = (THICKEST_WALL + SIDE) * axis @ LEFT
    low = hinge + (before.max(initial=0.0) + 0.01) * axis
    high = hinge + (after.min(initial=width) - 0.01) * axis
    return shapely.Polygon([low - across, high - across, high + across, low + across])


def _is_in_wall(door: Door, axis: Float, width: float, walls: _Walls) -> bool:
    """Whether a wall goes on behind a door, and its leaf stands free.

    A shower in a corner is drawn alike, but has walls on both sides.
    """
    hinge, other, leaf = door.corners
    base, free = shapely.linestrings(
        [[hinge, other], [(1.0 - COVERED) * hinge + COVERED * leaf, leaf]]
    )
    near = partial(walls.near, predicate="dwithin")
    # The hinge is at a face of the wall, or in its middle.
    behind = walls.ends.reshape(-1, 2, 2)[near(base, distance=THICKEST_WALL / 2.0 + SIDE)] - hinge
    reach = np.sort(behind @ axis, axis=1)
    passes = (reach[:, 0] < -SIDE) & (reach[:, 1] > width + SIDE)
    return bool(passes.any()) and (door.slides or not len(near(free, distance=SIDE)))
