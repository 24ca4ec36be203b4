"""A plan: the walls and doors of a drawing, with a record of what was left out and why.

A canvas with the marks of a DXF, SVG or PDF drawing enters; `plan_of` takes four steps:

1. Each mark gets a role from the name of its layer, in AIA's groups or words of the larger
   languages; the role is ``other`` where the name says nothing.
2. Areas that are floors or doorways get these roles instead.
3. Marks become segments: lines as they are, areas by their outlines: a solid wall has two faces.
4. `RULES` find doors and take out what does not stand, by its role or by how symbols are drawn.

What is left are walls and furniture; in the world of a plan, those that touch are one object.
"""

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.base.balance import Balance, in_words
from lrf3d.base.errors import Lrf3dNote, Lrf3dWarning, WorldError
from lrf3d.base.text import Note, counted
from lrf3d.geometry.lines import Float, Int
from lrf3d.plans.canvas import HIDDEN, PALEST, Canvas, Mark, is_area, is_thick
from lrf3d.plans.doubts import (
    notes,
    of_doors,
    of_outside,
    of_pictures,
    of_rooms,
    of_walls,
    warn_of_plans_apart,
)
from lrf3d.plans.parts import Parts, parts_of, world_of_parts
from lrf3d.plans.rules.doors import SIDE, Door, cleared, gaps_in
from lrf3d.plans.rules.layers import role_of
from lrf3d.plans.rules.sheet import THICKEST_WALL, box_area
from lrf3d.plans.rules.strokes import RULES, STANDS, Strokes
from lrf3d.plans.scale import size_doubt
from lrf3d.world.model import World
from lrf3d.world.pieces import TOUCHING, connected, without_repeats, world_of_walls
from lrf3d.world.toml_file import WorldFile

# A doorway painted over a wall may leave strips of the wall along its sides, up to this thickness
# [m].
SLIVER = 0.02

# Contrast below which an area that divides a dark wall may be a doorway.
PALE_DOORWAY = 0.25

# Contrast below which a thick area is a floor, unless its layer is one of walls; a darker area is a
# solid house.
FLOOR = 0.45

# Contrast above which an area is a dark wall.
DARK = 0.6

# Outline [m] above which an area cuts the lines that lie on it; that of an arrowhead is shorter.
CUTTING = 1.5

# Distance [m] from the outline of an area within which a line still lies on the area.
OUTLINE = 1e-4

# Reasons for items that are left out because of their role; other items name their layer.
ROLES = {"floor": "floor", "doorway": "doorway", "dashed": "dashed line"}

# Distance [m] within which edges of two rooms are the same wall.
SHARED = 1e-3

# Least share of the length of outlines that adjacent rooms have in common.
COMMON = 0.05


class Piece(NamedTuple):
    """The shape that items draw, a line or joined areas, with its role."""

    shape: Any
    role: str
    items: tuple[Any, ...]
    # The mark from which it comes, or the first of several.
    mark: Mark


class Layer(NamedTuple):
    """A layer: its name, the length of its lines [m], and what they are taken for."""

    name: str
    length: float
    roles: str


class Plan(NamedTuple):
    """The strokes of a drawing and what they were taken for, doors, and what was left out."""

    parts: Parts
    doors: Sequence[Door] = ()
    # Strokes (k, 4) [m] that were left out, by the name of the rule that found them.
    removed: Mapping[str, Float] = {}
    layers: Sequence[Layer] = ()
    # What was left out, in words: ``12 texts, layers DOORS, TEXT``.
    left_out: str = ""
    # What the reader assumed.
    said: tuple[Note, ...] = ()
    # Area [m²] and place (2,) [m] of each room, as the route planner divides the plan.
    rooms: Sequence[tuple[float, Float]] = ()
    # Largest gap [m] between walls that count as touching.
    gap: float = TOUCHING
    # Why it may be wrong, and what may correct it.
    doubts: tuple[Note, ...] = ()
    # Factors of its scale with which it would be as large as a building, by what they are called.
    scales: Mapping[str, float] = {}
    # The grey, from 0 to 255, from which on the pixels of a picture are paper.
    grey: float | None = None
    # The items of the source: used, and left out by reason.
    balance: Balance = Balance("item")
    # Unit of the drawing [m].
    unit: float = 1.0
    # Thickness [m] of the lines that outline walls; 0 where walls are solid, or lines themselves.
    pen: float = 0.0
    # The tables of the robot and the dynamic obstacles from decisions.
    tables: Mapping[str, Any] = {}
    obstacles: tuple[Mapping[str, Any], ...] = ()
    # The world of which this is an edited plan.
    base: World | None = None
    # Decisions that match nothing any more, in words.
    lost: tuple[str, ...] = ()
    # Layers that would be walls if they were chosen, in a drawing without walls.
    wall_layers: Sequence[str] = ()

    @property
    def segments(self) -> Float:
        """The walls (n, 4) [m]: the parts that stand."""
        return self.parts.at(self.parts.stands).segments

    @property
    def heights(self) -> Float:
        """The heights (n,) of the walls [m]."""
        return self.parts.at(self.parts.stands).heights

    @property
    def openings(self) -> Float:
        """The openings (k, 2, 2) [m] of its doors; in a picture they are gaps in walls."""
        if self.doors:
            return np.array([door.opening for door in self.doors])
        return gaps_in(self.segments, self.pen)

    def scaled(self, factor: float) -> "Plan":
        """The plan enlarged by a factor; heights stay the same."""
        return self._replace(
            parts=self.parts._replace(
                segments=self.parts.segments * factor,
                uncut_middles=self.parts.uncut_middles * factor,
            ),
            removed={name: strokes * factor for name, strokes in self.removed.items()},
            doors=[Door(door.corners * factor, door.width * factor) for door in self.doors],
            gap=self.gap * factor,
            pen=self.pen * factor,
            unit=self.unit * factor,
        )

    def world(self, path: Path) -> World:
        """The world of the walls, with a note on what was left out."""
        if not len(self.segments):
            known = ", ".join(filter(None, self.wall_layers[:20]))
            held = f"; it holds {self.left_out}" if self.left_out else ""
            remedy = f"; --layers takes layers as walls: {known}" if known else ""
            raise WorldError(
                f"{path}: there is no wall in it{held}{remedy}; `lrf3d edit {path}` draws walls"
            )
        world = self.walled(path)
        doors = f"{counted(len(self.doors), 'door')} standing open" if self.doors else ""
        left = f"left out: {self.left_out}" if self.left_out else ""
        if words := "; ".join(filter(None, [*map(str, self.doubts + self.said), doors, left])):
            walls = counted(len(world.segments), "wall")
            shown = (
                f"`lrf3d edit {path}` settles it" if self.doubts else "`lrf3d world show` draws it"
            )
            warnings.warn(f"{path}: {walls}; {words}; {shown}", Lrf3dNote, stacklevel=4)
        if self.lost:
            warnings.warn(
                f"{path}: decided by hand, but not found any more: {', '.join(self.lost)};"
                f" `lrf3d edit {path}` shows the drawing",
                Lrf3dWarning,
                stacklevel=4,
            )
        warn_of_plans_apart(world, path)
        return world

    def file(self, path: Path) -> WorldFile:
        """The world of the walls, with the robot and the obstacles that were decided by hand."""
        return WorldFile(self.world(path), self.tables, self.obstacles, path)

    def walled(self, path: Path) -> World:
        """The world of the walls; of one that was edited with what the drawing was."""
        world = world_of_walls(self.segments, self.heights, path, self.gap)
        if self.base is None and not any(self.parts.materials):
            return world
        standing = self.parts.at(self.parts.stands)
        world = World(standing.segments, connected(standing.segments, self.gap), name=world.name)
        return world_of_parts(standing, world, self.base)


def plan_of(canvas: Canvas, layers: Sequence[str] = (), without: Sequence[str] = ()) -> Plan:
    """Find the walls and doors of a drawing, on some layers alone or without some (by patterns)."""
    marks = canvas.seen()
    roles = _with_floors(marks, _roles(marks, layers, without))
    rooms = _rooms(marks, roles)
    roles = ["wall" if rooms and role in ("floor", *STANDS) else role for role in roles]
    pieces = rooms or _pieces(marks, roles)
    around = "no walls are drawn: rooms have walls around them" if rooms else ""
    strokes = Strokes(*_segments(pieces), sheet="annotation" in roles)
    for rule in RULES:
        strokes.apply(rule)
    left = np.flatnonzero(strokes.remaining)
    walls, own, cut, open_ = cleared(strokes.segments[left], strokes.doors)
    jambs, jambed = _jambs(pieces, strokes.piece[left[cut]], open_)
    jamb_roles = np.array([pieces[number].role for number in jambed], dtype=object)
    role = np.concatenate([strokes.role[left[own]], jamb_roles])
    stands = np.concatenate([strokes.piece[left[own]], jambed])
    parts = parts_of(
        strokes, [piece.mark for piece in pieces], np.concatenate([walls, jambs]), stands, role
    )
    layered = [(mark.layer, role) for mark, role in zip(marks, roles, strict=True)]
    counts = {rule.name: int(strokes.found[rule.name].sum()) for rule in RULES if rule.counted}
    counts["doorway line"] = len(cut)
    balance = _balance(canvas, marks, roles, pieces, strokes, left[own])
    outside = strokes.segments[strokes.found["outside line"]]
    large, scales = size_doubt(canvas, strokes)
    beside = of_outside(box_area(outside), box_area(walls))
    # Doors and rooms of another size cannot be judged.
    sized = [] if large else [of_doors(strokes.doors), of_rooms(walls), beside]
    return Plan(
        parts,
        strokes.doors,
        {name: strokes.segments[each] for name, each in strokes.found.items() if each.any()},
        _listed(marks, layered),
        _in_words(canvas.left_out + Counter(counts) + balance.overlooked, layered),
        notes(canvas.said, around, of_walls(strokes.doors)),
        balance=balance,
        doubts=notes(of_pictures(canvas.pictured), *sized) + large,
        scales=scales,
        unit=canvas.unit,
    )


def _balance(
    canvas: Canvas,
    marks: list[Mark],
    roles: list[str],
    pieces: list["Piece"],
    strokes: Strokes,
    kept: Int,
) -> Balance:
    """The balance of a drawing's items, some of whose strokes are kept, given by number.

    For each item the last decision counts: whether it is visible, its layer, rules, and whether it
    stands.
    """

    def items(chosen: Any, fate: str) -> dict[Any, str]:
        drawn = np.unique(strokes.piece[chosen])
        return {item: fate for number in drawn for item in pieces[number].items}

    fates = {item: fate or "hidden part" for item, fate in canvas.fates.items()}
    for mark, role in zip(marks, roles, strict=True):
        # Overwritten below where a stroke of it is used: what is left had only repeated lines.
        fate = ROLES.get(role, f"layer: {mark.layer}")
        fates |= dict.fromkeys(mark.items, "repeated line" if role in STANDS else fate)
    for rule in RULES:
        if rule.counted:
            fates |= items(strokes.found[rule.name], rule.name)
    fates |= items(strokes.remaining, "doorway line") | items(kept, "")
    fates |= items(strokes.found["door stroke"], "")
    left_out = Counter(filter(None, fates.values()))
    return Balance("item", canvas.held, len(fates) - left_out.total(), dict(left_out))


def _jambs(pieces: list["Piece"], cut: Int, open_: Any) -> tuple[Float, Int]:
    """The segments (n, 4) that close areas of pieces where doorways cut them; their pieces (n,)."""
    areas = np.array([n for n in np.unique(cut) if is_area(pieces[n].shape)], dtype=np.int64)
    sides = [open_.boundary.intersection(pieces[number].shape) for number in areas]
    lines, area = shapely.get_parts(sides, return_index=True)
    long = shapely.length(lines) > 2.0 * HIDDEN
    points, line = shapely.get_coordinates(lines[long], return_index=True)
    on = np.flatnonzero(line[1:] == line[:-1])
    return np.hstack([points[on], points[on + 1]]), areas[area[long][line[on]]]


def _in_words(left: Counter[str], layered: list[tuple[str, str]]) -> str:
    """What was left out, in words: the number of each kind of thing, and the names of layers."""
    held = Counter(role for _, role in layered)
    left = left + Counter(
        {what: held[what.split()[0]] for what in ("dashed line", "doorway", "floor")}
    )
    named = ("annotation", "door")
    hidden = {name for name, role in layered if role == "left out"}
    hidden |= {name for name, _ in layered} - {name for name, role in layered if role not in named}
    # On a layer that stands, marks may be left out by the names of their groups or blocks.
    shown = Counter(role for name, role in layered if name not in hidden)
    left += Counter({f"{what} mark": shown[what] for what in named})
    words = [*in_words(left)]
    words += [f"layers {', '.join(name or '(none)' for name in sorted(hidden))}"] if hidden else []
    return ", ".join(words)


def _roles(marks: list[Mark], layers: Sequence[str], without: Sequence[str]) -> list[str]:
    """The role of each mark, by the names of its layer and block, and by the layers chosen."""
    names = dict.fromkeys((mark.layer, mark.names) for mark in marks)
    for pattern in (*layers, *without):
        if not any(_fits(name, [pattern]) for name in names):
            known = ", ".join(dict.fromkeys(layer or "(none)" for layer, _ in [*names][:100]))
            raise WorldError(f"no layer is called {pattern}; with lines are {known}")
    kinds = {name: _role(name, layers, without) for name in names}
    roles = [kinds[mark.layer, mark.names] for mark in marks]
    return [
        "dashed" if mark.dashed and role in ("other", "furniture") else role
        for mark, role in zip(marks, roles, strict=True)
    ]


def _role(name: tuple[str, tuple[str, ...]], layers: Sequence[str], without: Sequence[str]) -> str:
    """The role of a layer, given by its names and by the patterns that were chosen."""
    if _fits(name, without) or (layers and not _fits(name, layers)):
        return "left out"
    role = role_of(*name[1])
    return "wall" if layers and role in ("annotation", "door", "other") else role


def _fits(name: tuple[str, tuple[str, ...]], patterns: Sequence[str]) -> bool:
    """Whether a layer, or another name of it, fits one of some patterns."""
    each = [word.casefold() for word in (name[0], *name[1])]
    return any(fnmatch(word, pattern.casefold()) for word in each for pattern in patterns)


def _with_floors(marks: list[Mark], roles: list[str]) -> list[str]:
    """The roles, with those of areas that are floors (thick, and pale or drawn on) or doorways."""
    shapes = [mark.shape for mark in marks]
    tree = shapely.STRtree(shapes)
    roles = list(roles)
    stands = [
        number
        for number, role in enumerate(roles)
        if role in STANDS and role != "furniture" and is_area(shapes[number])
    ]
    for number in stands:
        shape = shapes[number]
        if is_thick(shape):
            faint = marks[number].contrast < PALEST
            pale = marks[number].contrast < FLOOR and roles[number] != "wall"
            inner = tree.query(shape, predicate="contains_properly")
            # Marks are in the order of painting: later ones inside are drawn on this area. A wall
            # has no outline that is darker than itself.
            edge = marks[min(number + 1, len(marks) - 1)]
            outlined = edge.items == marks[number].items and edge.contrast > marks[number].contrast
            if faint or pale or outlined or (inner > number).any():
                roles[number] = "floor"
    for number in stands:
        shape = shapes[number]
        narrow = 2.0 * shape.area < THICKEST_WALL * shape.length
        if narrow and marks[number].contrast < PALE_DOORWAY:
            _open_doorway(marks, roles, number, tree.query(shape, "dwithin", distance=SLIVER))
    return roles


def _open_doorway(marks: list[Mark], roles: list[str], number: int, near: Int) -> None:
    """Set the role of a pale area to doorway if it divides a dark wall.

    A short line that ends at it is its leaf; an area without a leaf needs a floor on both sides.
    """
    shape = marks[number].shape
    if not _divides(shape, marks, near):
        return
    lines = [n for n in near if roles[n] == "other" and not is_area(marks[n].shape)]
    short = [n for n in lines if marks[n].shape.length < 2.0]
    leaf = [n for n in short if shape.distance(marks[n].shape.boundary) < SLIVER]
    if leaf or sum(roles[n] == "floor" for n in near) > 1:
        roles[number] = "doorway"
        for each in leaf:
            roles[each] = "door"


def _divides(shape: Any, marks: list[Mark], near: Int) -> bool:
    """Whether an area divides a dark wall: dark areas near it meet two or more of its sides."""
    dark = [marks[n].shape for n in near if is_area(marks[n].shape) and marks[n].contrast > DARK]
    wall = shapely.union_all(shapely.intersection(dark, shape.buffer(2.0 * SIDE)))
    # Slivers of the wall along the doorway do not count: shrinking the wall removes them.
    ends = shape.boundary.intersection(wall.buffer(-SLIVER).buffer(1.5 * SLIVER))
    sides = shapely.get_parts(shapely.line_merge(ends))
    return bool(ends.length <= 0.5 * shape.length and len(sides) > 1)


def _pieces(marks: list[Mark], roles: list[str]) -> list[Piece]:
    """The lines outside of standing areas, these areas, and all others."""
    solids = _solids(marks, roles)
    large = [piece.shape for piece in solids if piece.shape.length > CUTTING]
    solid = shapely.union_all(large).buffer(OUTLINE)
    shapely.prepare(solid)
    pieces = list[Piece]()
    for mark, role in zip(marks, roles, strict=True):
        shape = mark.shape
        if role in STANDS and not is_area(shape) and solid.intersects(shape):
            shape = shape.difference(solid)
        if role not in STANDS or not is_area(shape):
            pieces.append(Piece(shape, role, mark.items, mark))
    return pieces + solids


def _rooms(marks: list[Mark], roles: list[str]) -> list[Piece]:
    """The walls around rooms in a drawing without walls, whose rooms are adjacent areas.

    A pale area on the wall between two rooms is an open door.
    """
    floors = [mark for mark, role in zip(marks, roles, strict=True) if role == "floor"]
    others = [mark for mark, role in zip(marks, roles, strict=True) if role in STANDS]
    if len(floors) < 2 or any(mark.contrast > FLOOR or not is_area(mark.shape) for mark in others):
        return []
    shapes = np.array([mark.shape for mark in floors])
    outline = shapely.union_all(shapely.boundary(shapes), grid_size=SHARED)
    # Adjacent rooms have walls in common.
    if outline.length > (1.0 - COMMON) * shapely.length(shapes).sum():
        return []
    doors = [mark for mark in others if mark.shape.intersects(outline)]
    doorways = shapely.union_all([mark.shape for mark in doors])
    walls = outline.difference(doorways.buffer(2.0 * SHARED, join_style="mitre"))
    items = tuple(item for mark in floors + doors for item in mark.items)
    return [Piece(shapely.line_merge(walls), "wall", items, floors[0])]


def _solids(marks: list[Mark], roles: list[str]) -> list[Piece]:
    """The areas that stand, joined where they touch, each with its role."""
    areas = [
        Piece(mark.shape, role, mark.items, mark)
        for mark, role in zip(marks, roles, strict=True)
        if is_area(mark.shape)
    ]
    doorways = shapely.union_all([each.shape for each in areas if each.role == "doorway"])
    open_ = doorways.buffer(1.5 * SLIVER, join_style="mitre")
    walls = [each for each in areas if each.role in ("wall", "window", "other")]
    furniture = [each for each in areas if each.role == "furniture"]
    stands = (mark.shape for mark, role in zip(marks, roles, strict=True) if role in STANDS)
    walled = not all(map(is_thick, stands))
    return _joined(walls, "wall", open_, walled) + _joined(furniture, "furniture", open_, True)


def _joined(areas: list[Piece], name: str, open_: Any, walled: bool) -> list[Piece]:
    """Areas joined where they touch, without the open doorways, each part with its role.

    In a drawing without walls, areas of different colours are rooms with walls in between.
    The role is the given name if the layer of one of its areas gives a role, and else ``other``.
    """
    if not areas:
        return []
    shapes = np.array([each.shape for each in areas])
    colours = np.array(["" if walled else each.mark.colour for each in areas])
    whole = [shapely.union_all(shapes[colours == each]) for each in np.unique(colours)]
    parts = [each for each in shapely.get_parts(shapely.difference(whole, open_)) if is_area(each)]
    joined: list[list[Piece]] = [[] for _ in parts]
    met = shapely.STRtree(shapes).query(parts, predicate="intersects")
    for part, area in sorted(met.T.tolist()):
        joined[part].append(areas[area])
    return [
        Piece(
            part,
            name if any(each.role != "other" for each in held) else "other",
            tuple(item for each in held for item in each.items),
            (held or areas)[0].mark,
        )
        for part, held in zip(parts, joined, strict=True)
    ]


def _segments(pieces: list[Piece]) -> tuple[Float, Int, Int, Any]:
    """The segments (n, 4) of geometries, each once, with its line, its piece and its role (n,)."""
    shapes = [each.shape.boundary if is_area(each.shape) else each.shape for each in pieces]
    lines, piece = shapely.get_parts(shapes, return_index=True)
    points, line = shapely.get_coordinates(lines, return_index=True)
    joined = np.flatnonzero((line[1:] == line[:-1]) & (points[1:] != points[:-1]).any(axis=1))
    role = np.array([each.role for each in pieces] or [""], dtype=object)
    segments = np.hstack([points[joined], points[joined + 1]])
    line = line[joined]
    role = role[piece[line]]
    # A wall may be drawn on the outline of a floor, so repeats are dropped within one role only.
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
