"""A plan: a drawing divided into walls, doors, furniture, text and floors.

A drawing, of DXF, SVG or PDF, enters; walls (segments with heights) and doors leave, with what was
left out and why, and become a world, in which walls that touch are one object. A layer whose name
says what it holds, in AIA's groups or words of the larger languages, is taken at its word.
Elsewhere a leaf and its quarter arc are a door that stands open, and rows of small strokes are
text. What has a thickness is two faces.
"""

import warnings
from collections import Counter
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.base.errors import Lrf3dNote, Lrf3dWarning, WorldError
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Float, Int, lengths
from lrf3d.plans.canvas import Drawing, Mark, is_area
from lrf3d.plans.rules.layers import role_of
from lrf3d.plans.rules.sheet import THICKEST_WALL, plans_apart
from lrf3d.plans.rules.symbols import SIDE, Door, Strokes, cleared, find_doors, find_leaves, symbols
from lrf3d.world.model import DEFAULT_HEIGHT, SHEET, World
from lrf3d.world.pieces import TOUCHING, without_repeats, world_of_walls

# Height of furniture [m]: that of tables and of kitchen units.
FURNITURE_HEIGHT = 0.8

# Largest thickness [m] of what is left of a wall beside a doorway that is painted on it.
SLIVER = 0.02

# Mean thickness [m] up to which an area is a wall, and not a floor, whatever its colour; contrast
# below which one that parts a dark wall is a doorway.
THICKEST = 0.6
PALE = 0.25

# The roles of what stands; lines of ``other`` layers are walls, too.
STANDS = ("wall", "window", "other", "furniture")


class Layer(NamedTuple):
    """A layer: its name, the length of its lines [m], and what they are taken for."""

    name: str
    length: float
    roles: str


class Plan(NamedTuple):
    """Walls (n, 4) with heights (n,) [m], doors, what was left out (k, 4), and the layers."""

    segments: Float
    heights: Float
    doors: Sequence[Door] = ()
    rest: Float = np.empty((0, 4))
    layers: Sequence[Layer] = ()
    left_out: str = ""
    """In words: ``12 texts, layers DOORS, TEXT``."""
    said: str = ""
    """What else a reader assumed."""
    rooms: Sequence[tuple[float, Float]] = ()
    """Areas [m²] and places (2,) [m] of rooms, as a route through them is planned."""
    gap: float = TOUCHING
    """Largest gap [m] between walls that touch."""

    def scaled(self, factor: float) -> "Plan":
        """The plan enlarged by a factor; heights stay the same."""
        doors = [Door(door.corners * factor, door.width * factor) for door in self.doors]
        segments = self.segments * factor
        rest = self.rest * factor
        return self._replace(segments=segments, rest=rest, doors=doors, gap=self.gap * factor)

    def world(self, path: Path) -> World:
        """The world of the walls, with a note on what was left out."""
        if not len(self.segments):
            known = ", ".join(layer.name for layer in self.layers[:20] if layer.name)
            held = f"; it holds {self.left_out}" if self.left_out else ""
            remedy = f"; --layers takes layers as walls: {known}" if known else ""
            raise WorldError(f"there is no wall in it{held}{remedy}")
        world = world_of_walls(self.segments, self.heights, path, self.gap)
        doors = f"{counted(len(self.doors), 'door')} standing open" if self.doors else ""
        left = f"left out: {self.left_out}" if self.left_out else ""
        if words := "; ".join(filter(None, [self.said, doors, left])):
            walls = counted(len(world.segments), "wall")
            note = f"{path}: {walls}; {words}; `lrf3d world show` draws it"
            warnings.warn(note, Lrf3dNote, stacklevel=4)
        # On a drawing of the size of its paper all touches, and more are the houses of a town.
        large = np.ptp(world.segments.reshape(-1, 2), axis=0).max() > SHEET
        town = 10
        plans = plans_apart(world.segments) if large else ()
        if 1 < len(plans) < town:
            each = [f"{c - a:.0f} x {d - b:.0f} m at ({a:.1f}, {b:.1f})" for a, b, c, d in plans]
            warnings.warn(
                f"{path}: {len(plans)} plans stand apart ({', '.join(each)}); the route is"
                " planned in one of them: --set robot.start=[x,y,0] chooses which, --layers and"
                " --page choose what is read; `lrf3d world show` draws them",
                Lrf3dWarning,
                stacklevel=4,
            )
        return world


def plan_of(drawing: Drawing, layers: Sequence[str] = (), without: Sequence[str] = ()) -> Plan:
    """Decide what of a drawing stands; of some layers alone, or without some, by patterns."""
    marks = drawing.marks
    roles = _without_floors(marks, _roles(marks, layers, without))
    solids = _solids(marks, roles)
    flat = [(mark.shape, role) for mark, role in zip(marks, roles, strict=True)
            if not (is_area(mark.shape) and role in STANDS)]  # fmt: skip
    # An arrowhead does not cut the line that it is on.
    large = [shape for shape, _ in solids if shape.length > 1.5]
    outline = 1e-4  # Distance [m] up to which a line runs along the outline of an area.
    solid = shapely.union_all(large).buffer(outline)
    shapely.prepare(solid)
    pieces = [
        (shape.difference(solid) if role in STANDS and solid.intersects(shape) else shape, role)
        for shape, role in flat
    ]
    pieces += [(shape.boundary, role) for shape, role in solids]
    segments, line, mark, role = _segments(pieces)
    drawn = np.isin(role, [*STANDS, "door", "dashed"])
    doors, opened = find_doors(segments, line, drawn)
    more, leaves = find_leaves(segments, line, drawn & ~opened)
    doors = doors + more
    opened = opened | leaves
    # Partitions are found on layers of doors, too; they are longer than leaves.
    stands = np.isin(role, STANDS) | ((role == "door") & (lengths(segments) > 2.2))
    stands &= ~opened
    left = drawing.left_out + Counter(
        {each: roles.count(each.split()[0]) for each in ("dashed line", "doorway", "floor")}
    )
    # On a drawing that is as large as its paper symbols have other sizes, and far more neighbours.
    small = not len(segments) or np.ptp(segments.reshape(-1, 2), axis=0).max() < SHEET
    known = np.flatnonzero(stands & (not small))
    strokes = Strokes(segments[known], line[known], mark[known], role[known] == "other")
    for what, found in symbols(strokes, sheet="annotation" in roles):
        stands[known[found]] = False
        left[what] += int(found.sum())
    walls, own, left["doorway line"] = cleared(segments[stands], doors)
    role = role[stands][own]
    layered = [(mark.layer, role) for mark, role in zip(marks, roles, strict=True)]
    hidden = {name for name, role in layered if role == "left out"}
    named = ("annotation", "door")
    hidden |= {name for name, _ in layered} - {name for name, role in layered if role not in named}
    # In a layer of which more stands, groups and blocks may be left out by their names.
    for what in named:
        left[f"{what} mark"] = sum(each == what and name not in hidden for name, each in layered)
    words = [counted(number, noun) for noun, number in sorted(left.items()) if number]
    words += [f"layers {', '.join(name or '(none)' for name in sorted(hidden))}"] if hidden else []
    return Plan(
        walls,
        np.where(role == "furniture", FURNITURE_HEIGHT, DEFAULT_HEIGHT),
        doors,
        segments[~stands],
        _listed(marks, layered),
        ", ".join(words),
        drawing.said,
    )


def _roles(marks: list[Mark], layers: Sequence[str], without: Sequence[str]) -> list[str]:
    """What each mark is, by the name of its layer and of its block, and by what was chosen."""
    names = dict.fromkeys((mark.layer, mark.names) for mark in marks)
    for pattern in (*layers, *without):
        if not any(_fits(name, [pattern]) for name in names):
            known = ", ".join(dict.fromkeys(layer or "(none)" for layer, _ in [*names][:100]))
            raise WorldError(f"no layer is called {pattern}; with lines are {known}")
    kinds = dict[Any, str]()
    for name in names:
        role = role_of(*name[1])
        if layers and role in ("annotation", "door", "other"):
            role = "wall"
        chosen = (not layers or _fits(name, layers)) and not _fits(name, without)
        kinds[name] = role if chosen else "left out"
    roles = [kinds[mark.layer, mark.names] for mark in marks]
    return [
        "dashed" if mark.dashed and role in ("other", "furniture") else role
        for mark, role in zip(marks, roles, strict=True)
    ]


def _fits(name: tuple[str, tuple[str, ...]], patterns: Sequence[str]) -> bool:
    """Whether a layer, or another name of it, fits one of some patterns."""
    each = [word.casefold() for word in (name[0], *name[1])]
    return any(fnmatch(word, pattern.casefold()) for word in each for pattern in patterns)


def _without_floors(marks: list[Mark], roles: list[str]) -> list[str]:
    """The roles, where areas that are floors are said to be that: thick, and pale or drawn on."""
    shapes = [mark.shape for mark in marks]
    tree = shapely.STRtree(shapes)
    roles = list(roles)
    thin = list[int]()
    for number, (mark, role) in enumerate(zip(marks, roles, strict=True)):
        area = mark.shape.area
        edge = mark.shape.length
        stands = role in STANDS and role != "furniture" and is_area(mark.shape)
        if stands and 2.0 * area > THICKEST * edge:
            # What is darker is a solid house.
            pale = mark.contrast < 0.45 and role != "wall"
            if pale or (tree.query(mark.shape, predicate="contains_properly") > number).any():
                roles[number] = "floor"
        elif stands and mark.contrast < PALE and 2.0 * area < THICKEST_WALL * edge:
            thin.append(number)
    for number in thin:
        _open_doorway(marks, roles, number, tree.query(shapes[number], "dwithin", distance=SLIVER))
    return roles


def _open_doorway(marks: list[Mark], roles: list[str], number: int, near: Int) -> None:
    """Note in the roles that an area is a doorway: it is far paler than the wall that it divides.

    Lines that end in it are its leaf; without one, it has floors on both sides.
    """
    shape = marks[number].shape
    dark = [marks[n].shape for n in near if is_area(marks[n].shape) and marks[n].contrast > 0.6]
    wall = shapely.union_all(shapely.intersection(dark, shape.buffer(2.0 * SIDE)))
    # Along its sides a sliver of the wall may be left.
    ends = shape.boundary.intersection(wall.buffer(-SLIVER).buffer(1.5 * SLIVER))
    if ends.length > 0.5 * shape.length or len(shapely.get_parts(shapely.line_merge(ends))) < 2:
        return
    lines = [n for n in near if roles[n] == "other" and not is_area(marks[n].shape)]
    short = [n for n in lines if marks[n].shape.length < 2.0]
    leaf = [n for n in short if shape.distance(marks[n].shape.boundary) < SLIVER]
    if leaf or sum(roles[n] == "floor" for n in near) > 1:
        roles[number] = "doorway"
        for each in leaf:
            roles[each] = "door"


def _solids(marks: list[Mark], roles: list[str]) -> list[tuple[Any, str]]:
    """The areas that stand, joined where they touch, each with its role."""
    solids = list[tuple[Any, str]]()
    areas = [(mark.shape, r) for mark, r in zip(marks, roles, strict=True) if is_area(mark.shape)]
    doorways = shapely.union_all([shape for shape, role in areas if role == "doorway"])
    open_ = doorways.buffer(1.5 * SLIVER, join_style="mitre")
    for name, group in (("wall", ("wall", "window", "other")), ("furniture", ("furniture",))):
        members = [(shape, role) for shape, role in areas if role in group]
        if not members:
            continue
        shapes = np.array([shape for shape, _ in members])
        whole = shapely.union_all(shapes).difference(open_)
        parts = [each for each in shapely.get_parts(whole) if is_area(each)]
        known = shapely.STRtree(shapes[[role != "other" for _, role in members]])
        named = set(known.query(parts, predicate="intersects")[0].tolist())
        solids += [(part, name if n in named else "other") for n, part in enumerate(parts)]
    return solids


def _segments(pieces: list[tuple[Any, str]]) -> tuple[Float, Int, Int, Any]:
    """The segments (n, 4) of geometries, each once, with its line, its piece and its role (n,)."""
    shapes = [shape.boundary if is_area(shape) else shape for shape, _ in pieces]
    lines, piece = shapely.get_parts(shapes, return_index=True)
    points, line = shapely.get_coordinates(lines, return_index=True)
    joined = np.flatnonzero((line[1:] == line[:-1]) & (points[1:] != points[:-1]).any(axis=1))
    role = np.array([role for _, role in pieces] or [""], dtype=object)
    segments = np.hstack([points[joined], points[joined + 1]])
    line = line[joined]
    role = role[piece[line]]
    # What stands may be drawn on a floor's outline.
    same = [np.flatnonzero(role == each) for each in dict.fromkeys(role.tolist())]
    kept = [each[without_repeats(segments[each])] for each in same]
    once = np.sort(np.concatenate([np.empty(0, np.int64), *kept]))
    return segments[once], line[once], piece[line[once]], role[once]


def _listed(marks: list[Mark], layered: list[tuple[str, str]]) -> list[Layer]:
    """The layers, the longest first, with the roles in them."""
    long = Counter[str]()
    held = dict[str, dict[str, None]]()
    for mark, (name, role) in zip(marks, layered, strict=True):
        long[name] += mark.shape.length
        held.setdefault(name, {})[role] = None
    return [Layer(name, length, ", ".join(held[name])) for name, length in long.most_common()]
