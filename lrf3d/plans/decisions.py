"""The kinds of decisions that a user makes about a plan.

Each class has the keys of its table in a file, and changes a :class:`~lrf3d.plans.plan.Plan`. To
add one, write its class and enter it in `DECISIONS`, whose order is that in which they are applied.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from fnmatch import fnmatch
from typing import Annotated, Any, ClassVar, get_args

import numpy as np
import shapely

from lrf3d.base.errors import WorldError, check_names, expect
from lrf3d.geometry.lines import Bool, Float, directions, lengths, number, whole_number
from lrf3d.plans.canvas import PerUnit
from lrf3d.plans.parts import KINDS, TOUCHED, Parts
from lrf3d.plans.plan import Plan
from lrf3d.plans.rules.doors import Door
from lrf3d.plans.rules.sheet import THICKEST_WALL, as_lines
from lrf3d.simulation.tables import ROBOT
from lrf3d.world import schema
from lrf3d.world.model import DEFAULT_HEIGHT
from lrf3d.world.pieces import walls
from lrf3d.world.schema import Converter, at, row, rows, table, text

# Distance [m] from a selected place within which the middle of its stroke lies; smaller than the
# thickness of walls.
NEAR = 0.05

# Distance [m] within which ends of walls coincide: far less than a user can point at.
SAME = 0.002

# Half the width [m] of the strip that is cut along a line; walls are drawn farther apart.
CUT = 0.02

# Sine of the angle to a line below which a wall lies along it: lines are drawn by hand.
PARALLEL = 0.1

# Share of the width of a doorway, to each side of its middle, that a drawn leaf would block.
PASSAGE = 0.4

# Height [m] below which drawn walls are furniture: the route planner divides no rooms by them.
LOW = 0.5 * DEFAULT_HEIGHT

# Distance from the middle of a doorway, in its widths, within which both ends of a leaf lie.
REACH = 1.2


@dataclass(frozen=True)
class Decision:
    """A decision; its fields are its keys in a file, with `_` after names that Python reserves.

    Each is annotated with its converter.
    """

    # The name of its table in a file.
    key: ClassVar[str]
    # The converters of its values, by their names in a file: the notes of its fields.
    keys: ClassVar[Mapping[str, Converter]]
    # Whether a file has at most one.
    single: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        kinds = {name.rstrip("_"): get_args(kind) for name, kind in cls.__annotations__.items()}
        cls.keys = {name: convert for name, (_, convert) in kinds.items()}

    def __post_init__(self) -> None:
        for each in fields(self):
            object.__setattr__(self, each.name, _frozen(getattr(self, each.name)))
        with at(self.key):
            values = self.as_dict()
            needs = [f.name.rstrip("_") for f in fields(self) if f.default is not None]
            table(self.keys, [name for name in needs if name not in values])(values, self.key)

    @classmethod
    def of(cls, found: Any) -> "Decision":
        """The decision that a table of a file holds."""
        expect(found, Mapping, cls.key)
        check_names(cls.key, found, cls.keys)
        return cls(**{each.name: found.get(each.name.rstrip("_")) for each in fields(cls)})

    def as_dict(self) -> dict[str, Any]:
        """Its table for a file, as plain values."""
        held = {each.name.rstrip("_"): getattr(self, each.name) for each in fields(self)}
        return {name: _plain(value) for name, value in held.items() if value is not None}

    def change(self, plan: Plan) -> Plan | None:
        """The plan with the decision applied; None if it matches nothing in the plan."""
        return self._change(plan)

    def _change(self, plan: Plan) -> Plan | None:
        return plan


def _frozen(value: Any) -> Any:
    """A value with tuples instead of lists and arrays, so that decisions can be compared."""
    if isinstance(value, Mapping):
        return {name: _frozen(each) for name, each in value.items()}
    value = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    return tuple(map(_frozen, value)) if isinstance(value, list | tuple) else value


def _plain(value: Any) -> Any:
    """A value for JSON, with lists instead of tuples."""
    if isinstance(value, Mapping):
        return {str(name): _plain(each) for name, each in value.items()}
    return [*map(_plain, value)] if isinstance(value, list | tuple) else value


_POINT = row("x", "y")
_LINE = rows("x", "y", least=2)
_AREA = rows("x", "y", least=3)
# Something that is called in a table, with its texts and its places in units of the drawing.
SELECT = {"layer": text(), "colour": text(), "rule": text(), "near": _POINT, "inside": _AREA}


@dataclass(frozen=True)
class Reading(Decision):
    """How the file is read: the threshold of grey, and the page of a PDF file."""

    threshold: Annotated[float | None, number] = None
    page: Annotated[int | None, whole_number] = None
    key = "reading"
    single = True


@dataclass(frozen=True)
class Scale(Decision):
    """Two places in units of the drawing, and their distance [m]."""

    between: Annotated[Any, _LINE]
    metres: Annotated[float, schema.LENGTH]
    key = "scale"
    single = True

    @property
    def per_unit(self) -> PerUnit:
        """Metres per unit of the drawing."""
        (x1, y1), (x2, y2) = np.asarray(self.between, dtype=np.float64)[:2]
        apart = float(np.hypot(x2 - x1, y2 - y1))
        if not apart > 0.0:
            raise WorldError("scale.between: two places that are one; choose others")
        return PerUnit(self.metres / apart)

    def _change(self, plan: Plan) -> Plan:
        # The reader has used the scale already; here the doubt about the size is dropped.
        return plan._replace(doubts=(), scales={})


@dataclass(frozen=True)
class Class(Decision):
    """What selected strokes are: a key of `KINDS`, such as ``wall`` or ``nothing``.

    A selector has a ``layer`` (a pattern), a ``colour``, a ``rule``, ``near`` (the middle of a
    stroke) or ``inside`` (a polygon), in units of the drawing; if it has several, all must hold.
    Glass and mirrors in a polygon end at its edge, unless ``near`` says which stroke is meant.
    """

    select: Annotated[Any, table(SELECT)]
    as_: Annotated[str, text(*KINDS)]
    key = "class"

    def _change(self, plan: Plan) -> Plan | None:
        by_area = "inside" in self.select and "near" not in self.select
        if self.as_ in ("glass", "mirror") and by_area:
            # Only the part of a wall that is inside gets the material.
            plan = _cut(plan, self.select)
        chosen = selected(plan.parts, self.select, plan.unit)
        if not chosen.any():
            return None
        made = Parts.of(plan.parts.segments, self.as_)
        names = ("kinds", "heights", "materials")
        new = {n: np.where(chosen, getattr(made, n), getattr(plan.parts, n)) for n in names}
        return plan._replace(parts=plan.parts._replace(**new))


def _cut(plan: Plan, select: Mapping[str, Any]) -> Plan:
    """The plan with the walls that a selector may select cut where they cross its area."""
    area = _area(select, plan.unit)
    without_area = {name: held for name, held in select.items() if name != "inside"}
    lines = as_lines(plan.parts.segments)
    # A wall along the edge of the area does not cross it.
    chosen = shapely.crosses(lines, area) & plan.parts.stands
    chosen &= selected(plan.parts, without_area, plan.unit)
    inside_and_out = [op(lines[chosen], area) for op in (shapely.intersection, shapely.difference)]
    return _replaced(plan, chosen, np.concatenate(inside_and_out)) if chosen.any() else plan


def _area(select: Mapping[str, Any], unit: float) -> Any:
    """The area [m] of a selector, for a unit of the drawing [m]."""
    return shapely.Polygon(np.asarray(select["inside"]) * unit).buffer(0.0)


def selected(parts: Parts, select: Mapping[str, Any], unit: float) -> Bool:
    """Which strokes (n,) a selector selects, for a unit of the drawing [m]."""
    chosen = np.ones(len(parts.segments), dtype=bool)
    for column, name in (("layers", "layer"), ("colours", "colour")):
        if name in select:
            chosen &= _fits(getattr(parts, column), select[name])
    if "rule" in select:
        chosen &= _fits(parts.rules, select["rule"]) | _fits(parts.rules, _rule(select["rule"]))
    if "inside" in select:
        chosen &= shapely.contains_xy(_area(select, unit), parts.middles)
    if "near" in select:
        # What was cut is still found where its middle was.
        place = np.asarray(select["near"]) * unit
        away = np.fmin(
            *(np.hypot(*(each - place).T) for each in (parts.middles, parts.uncut_middles))
        )
        away[~chosen] = np.inf
        least = away.min(initial=np.inf)
        chosen &= (away <= least + SAME) & (away <= NEAR)
    return chosen


def _fits(names: Any, pattern: str) -> Bool:
    """Which names (n,) match a pattern."""
    fits = {name: fnmatch(name.casefold(), pattern.casefold()) for name in set(names.tolist())}
    return np.array([fits[name] for name in names.tolist()], dtype=bool)


def _rule(name: str) -> str:
    """The pattern of a rule's name from the plural of what it finds: ``letters``, ``letter *``."""
    return f"{name.removesuffix('s')} *"


@dataclass(frozen=True)
class Move(Decision):
    """Moves the ends of walls at one place [m] to another."""

    end: Annotated[Any, _POINT]
    to: Annotated[Any, _POINT]
    key = "move"

    def _change(self, plan: Plan) -> Plan | None:
        ends = plan.parts.segments.reshape(-1, 2).copy()
        here = np.hypot(*(ends - self.end).T) < SAME
        if not here.any():
            return None
        ends[here] = self.to
        moved = ends.reshape(-1, 4)
        kept = lengths(moved) > SAME
        return plan._replace(parts=plan.parts._replace(segments=moved).at(kept))


@dataclass(frozen=True)
class Remove(Decision):
    """Removes the pieces of walls along the line between two places [m]."""

    between: Annotated[Any, _LINE]
    key = "remove"

    def _change(self, plan: Plan) -> Plan | None:
        changed = _bared(plan, walls(np.asarray(self.between, dtype=np.float64), False))
        return None if changed is plan else changed


def _bared(plan: Plan, pieces: Float) -> Plan:
    """The plan without the walls along some pieces (k, 4); those that cross them stay."""
    for piece in pieces:
        area = shapely.LineString(piece.reshape(2, 2)).buffer(CUT, cap_style="flat")
        lines = shapely.linestrings(plan.parts.segments.reshape(-1, 2, 2))
        across = directions(piece[None])[0, ::-1] * (-1.0, 1.0)
        along = np.abs(directions(plan.parts.segments) @ across) < PARALLEL
        plan = (
            _without(plan, area, plan.parts.stands & along & shapely.intersects(lines, area))
            or plan
        )
    return plan


def _without(plan: Plan, area: Any, chosen: Bool) -> Plan | None:
    """The plan with chosen strokes (n,) cut away inside an area; None if none are chosen."""
    if not chosen.any():
        return None
    lines = as_lines(plan.parts.segments[chosen])
    return _replaced(plan, chosen, shapely.difference(lines, area))


def _replaced(plan: Plan, chosen: Bool, left: Any) -> Plan:
    """The plan with chosen strokes (n,) replaced by what is left of each, once or several times."""
    parts = plan.parts
    pieces, place = shapely.get_parts(left, return_index=True)
    long = shapely.length(pieces) > SAME
    rows = np.flatnonzero(chosen)
    cut = parts.at(rows[place[long] % len(rows)])
    uncut_middles = np.where(np.isnan(cut.uncut_middles), cut.middles, cut.uncut_middles)
    cut = cut._replace(
        segments=shapely.get_coordinates(pieces[long]).reshape(-1, 4), uncut_middles=uncut_middles
    )
    return plan._replace(parts=parts.at(~chosen).joined(cut))


@dataclass(frozen=True)
class DrawnWall(Decision):
    """Walls through points [m], of a height [m] and a material, instead of any that lie there.

    Low ones are furniture, which may stand against a wall.
    """

    points: Annotated[Any, _LINE]
    height: Annotated[float | None, schema.LENGTH] = None
    material: Annotated[str | None, text()] = None
    closed: Annotated[bool | None, schema.OBJECT["closed"]] = None
    key = "wall"

    def _change(self, plan: Plan) -> Plan:
        drawn = walls(np.asarray(self.points, dtype=np.float64), bool(self.closed))
        drawn = drawn[lengths(drawn) > SAME]
        material = self.material or ""
        height = self.height or DEFAULT_HEIGHT
        kind = material if material in KINDS else "wall"
        if height < LOW:
            kind = "furniture"
        else:
            plan = _bared(plan, drawn)
        made = Parts.of(drawn, kind, heights=height, materials=material, rules="drawn")
        return plan._replace(parts=plan.parts.joined(made))


@dataclass(frozen=True)
class Doorway(Decision):
    """An opening of a width [m] in the wall nearest to a place [m], through both of its faces."""

    at: Annotated[Any, _POINT]
    width: Annotated[float, schema.LENGTH]
    key = "doorway"

    def _change(self, plan: Plan) -> Plan | None:
        parts = plan.parts
        place = np.asarray(self.at, dtype=np.float64)
        stands = np.flatnonzero(parts.stands & (parts.kinds != "furniture"))
        lines = shapely.linestrings(parts.segments[stands].reshape(-1, 2, 2))
        away = shapely.distance(lines, shapely.Point(place))
        if away.min(initial=np.inf) > THICKEST_WALL:
            return None
        along = directions(parts.segments[stands])[np.argmin(away)]
        across = np.array([-along[1], along[0]])
        half = 0.5 * self.width * along
        deep = THICKEST_WALL * across
        box, middle = (
            shapely.Polygon([place + share * s * half + t * deep for s, t in _CORNERS])
            for share in (1.0, 2.0 * PASSAGE)
        )
        parallel = np.abs(directions(parts.segments[stands]) @ across) < PARALLEL
        met = np.flatnonzero(parallel & shapely.intersects(lines, box))
        off = (parts.segments[stands[met], :2] - place) @ across
        # Lines that only end at a side of the opening are no faces of the wall.
        faces = _lines_of_wall(off[shapely.intersects(lines[met], middle)])
        chosen = np.zeros(len(parts.segments), dtype=bool)
        chosen[stands[met[np.isin(np.round(off, 3), np.round(faces, 3))]]] = True
        cut = _without(plan, box, chosen)
        if cut is None:
            return None
        cut = _cleared(cut, place, along * self.width)
        depth = min(faces), max(faces)
        ends = [[place + s * half + t * across for t in depth] for s in (-1.0, 1.0)]
        corners = np.array([ends[0][0], ends[1][0], ends[0][0] + self.width * across])
        door = Door(corners, self.width)
        # Jambs close the ends of a wall with two faces.
        owner = parts.objects[stands[met]].max(initial=TOUCHED)
        jambs = np.array(ends).reshape(2, -1) if len(faces) > 1 else np.empty((0, 4))
        closed = cut.parts.joined(Parts.of(jambs, "wall", rules="drawn", objects=owner))
        return cut._replace(parts=closed, doors=[*plan.doors, door])


def _cleared(plan: Plan, place: Float, opening: Float) -> Plan:
    """The plan without a leaf that is drawn in an opening (2,) [m] about a place (2,)."""
    parts = plan.parts
    ends = parts.segments.reshape(-1, 2, 2)
    passage = shapely.LineString([place - PASSAGE * opening, place + PASSAGE * opening])
    near = np.hypot(*(ends - place).transpose(2, 0, 1)).max(axis=1) < REACH * np.hypot(*opening)
    blocks = near & shapely.intersects(
        shapely.linestrings(ends), passage.buffer(THICKEST_WALL, cap_style="flat")
    )
    blocks &= parts.stands & (parts.kinds != "furniture")
    return plan._replace(parts=parts._replace(kinds=np.where(blocks, "door", parts.kinds)))


# The corners of a box, in halves of its sides.
_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def _lines_of_wall(off: Float) -> list[float]:
    """Those of the distances [m] of lines (k,) that are of the nearest wall: faces, and between."""
    faces: list[float] = []
    for each in sorted({round(float(each), 6) for each in off}, key=abs):
        wall = [*faces, each]
        if max(wall) - min(wall) <= THICKEST_WALL:
            faces = wall
    return faces


@dataclass(frozen=True)
class PlacedRobot(Decision):
    """Where the robot starts, the places that it drives to, its radius [m] and its speed [m/s]."""

    start: Annotated[Any, ROBOT["start"]] = None
    route: Annotated[Any, ROBOT["route"]] = None
    radius: Annotated[float | None, ROBOT["radius"]] = None
    speed: Annotated[float | None, ROBOT["speed"]] = None
    key = "robot"
    single = True

    def _change(self, plan: Plan) -> Plan:
        values = {name: self.keys[name](each, name) for name, each in self.as_dict().items()}
        # The user gives only places; the path between them is planned.
        if "route" in values:
            values["goals"] = values.pop("route")
        return _with_robot(plan, values)


@dataclass(frozen=True)
class KeepOut(Decision):
    """An area [m] that routes avoid."""

    points: Annotated[Any, _AREA]
    key = "keep_out"

    def _change(self, plan: Plan) -> Plan:
        areas = plan.tables.get("robot", {}).get("keep_out", ())
        return _with_robot(plan, {"keep_out": (*areas, np.asarray(self.points, np.float64))})


def _with_robot(plan: Plan, values: Mapping[str, Any]) -> Plan:
    robot = {**plan.tables.get("robot", {}), **values}
    return plan._replace(tables={**plan.tables, "robot": robot})


@dataclass(frozen=True)
class Obstacle(Decision):
    """A dynamic obstacle: the keys of ``[[obstacle]]`` in a world file."""

    route: Annotated[Any, schema.OBSTACLE["route"]]
    speed: Annotated[float | None, schema.LENGTH] = None
    radius: Annotated[float | None, schema.LENGTH] = None
    height: Annotated[float | None, schema.LENGTH] = None
    points: Annotated[Any, schema.OBSTACLE["points"]] = None
    key = "obstacle"

    def _change(self, plan: Plan) -> Plan:
        values = {name: self.keys[name](each, name) for name, each in self.as_dict().items()}
        return plan._replace(obstacles=(*plan.obstacles, values))


# All kinds of decisions, in the order in which they are applied.
DECISIONS: list[type[Decision]] = [
    Reading, Scale, Class, Move, Remove, DrawnWall, Doorway, PlacedRobot, KeepOut, Obstacle,
]  # fmt: skip
