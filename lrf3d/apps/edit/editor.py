"""The state of an editor: a source, the decisions about it, and the plan that follows from both.

A path and the decisions of a page enter; after each change the plan leaves as a message. The
decisions are saved before the page is answered.
"""

import io
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lrf3d.apps.edit.message import packed, plan_message
from lrf3d.apps.edit.sources import (
    USUAL_SIZE,
    Sheet,
    checked_scale,
    sheet_of,
    suggestions,
)
from lrf3d.base.errors import InputError, WorldError
from lrf3d.base.files import write_text
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import Float, Int, directions
from lrf3d.planning.free_space import THINNEST, FreeSpace, Ground, find_free_space
from lrf3d.planning.planner import find_route, fitting_radius
from lrf3d.planning.rooms import USUAL_RADII, bare_rooms, entered_rooms, measured
from lrf3d.plans.decisions import KeepOut, Obstacle, PlacedRobot, Scale
from lrf3d.plans.edits import PlanEdits, digest_of, read_edits
from lrf3d.plans.parts import Parts
from lrf3d.plans.plan import Plan
from lrf3d.plans.reading import drawn_plan
from lrf3d.simulation.scenario import Scenario, scenario_of
from lrf3d.world import World
from lrf3d.world.files import edits_path, is_picture, is_plan
from lrf3d.world.toml_file import WorldFile, toml_table, world_text

# Distance [m] from a goal within which a robot that stops is at it.
SHORT = 0.15


class Editor:
    """A drawing, the decisions about it, and the plan that follows.

    Args:
        path: A drawing, a world, or a new ``.toml``, which is an empty sheet.
        options: The options of its reader.
        read_only: Whether another editor has the file open.
    """

    def __init__(
        self, path: Path, options: Mapping[str, Any] | None = None, *, read_only: bool = False
    ) -> None:
        self.path = path
        self.read_only = read_only
        self.journal = edits_path(path)
        self._options = dict(options or {})
        self.edits = read_edits(self.journal) if self.journal.is_file() else PlanEdits()
        # A plan that was drawn on an empty sheet names no source.
        drawn = self.journal.is_file() and not self.edits.source
        self.empty = path.suffix.lower() == ".toml" and (drawn or not path.exists())
        if self.edits.source not in ("", path.name):
            raise WorldError(f"{self.journal}: is of another drawing, {self.edits.source}")
        self._sources = dict[str, Plan]()
        self.read()

    def read(self) -> None:
        """Read the source, or read it again after it has changed."""
        self._sources.clear()
        self.seen = self.stamp()
        self.digest = "" if self.empty else digest_of(self.path)
        page = {**self._options, **self.edits.options()}.get("page", 1)
        self.sheet: Sheet | None = None if self.empty else sheet_of(self.path, page)
        self._follow(self.edits)

    def stamp(self) -> float:
        """Time at which the source was written; 0 if there is none."""
        return self.path.stat().st_mtime if not self.empty and self.path.exists() else 0.0

    def _source(self, edits: PlanEdits) -> Plan:
        """The plan before decisions, read by those that set how it is read."""
        if self.empty:
            return Plan(Parts.of(np.empty((0, 4)), "wall"))
        options = {**self._options, **edits.options()}
        if is_picture(self.path) and self.sheet is not None and "scale" not in options:
            options.setdefault("resolution", USUAL_SIZE / max(self.sheet.size))
        key = repr(options)
        if key not in self._sources:
            self._sources.clear()
            self._sources[key] = drawn_plan(self.path, **options)
        return self._sources[key]

    def _follow(self, edits: PlanEdits) -> None:
        self.plan = edits.applied(self._source(edits), self.journal.name)
        self.edits = edits
        for name in ("scenario", "caster", "_plain_caster"):
            self.__dict__.pop(name, None)

    def decide(self, values: Mapping[str, Any]) -> None:
        """Replace the decisions by those of a page, and save them.

        Raises:
            InputError: They are invalid, or another editor has the file open.
        """
        if self.read_only:
            raise InputError(f"another editor has {self.path.name} open; this one only reads")
        source = "" if self.empty else self.path.name
        edits = PlanEdits.from_dict({**values, "source": source, "digest": self.digest})
        self._follow(edits)
        edits.write(self.journal)

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario that `lrf3d run` makes from the plan."""
        plan = self.plan
        world = plan.walled(self.path) if len(plan.segments) else World(np.empty((0, 4)))
        return scenario_of(WorldFile(world, plan.tables, plan.obstacles, self.path))

    @cached_property
    def caster(self) -> PlanarCaster:
        """The caster of the exact beams."""
        return PlanarCaster(self.scenario.world)

    @cached_property
    def _plain_caster(self) -> PlanarCaster:
        world = self.scenario.world
        return PlanarCaster(World(world.segments, heights=world.heights))

    def message(self) -> bytes:
        """The message with the plan for the page."""
        scale = self.edits.one(Scale)
        scaled = bool(scale) or "resolution" in self._options or not is_picture(self.path)
        # Gaps between walls are doors in pictures, which show no leaves; a world is in metres.
        known = is_picture(self.path) or bool(self.plan.doors)
        doors = self.plan.openings if known and is_plan(self.path) else np.empty((0, 2, 2))
        source = self._source(self.edits)
        header = {
            "name": self.path.name,
            "edits": self.edits.as_dict(),
            "readOnly": self.read_only,
            "scaled": scaled,
            "empty": self.empty,
            "picture": is_picture(self.path),
            "rosMap": self.path.suffix.lower() in (".yaml", ".yml"),
            "sheet": self.sheet and [*self.sheet.size],
            "suggestions": [] if scale else suggestions(doors, self.plan.unit, scaled),
            "check": checked_scale(self.plan, doors),
            "gaps": doors.tolist() if is_picture(self.path) else [],
            "said": "; ".join(note.fact for note in self.plan.doubts + source.said),
            "grey": source.grey,
            "scales": self.plan.scales,
            "leftOut": self.plan.left_out,
            "lost": self.plan.lost,
            "radius": self.scenario.radius,
            "old": self.old_world(),
        }
        return plan_message(self.plan, header)

    def scan(self, pose: Any) -> bytes:
        """The exact beams from a pose: where each first hits a wall, and where it ends.

        Rows (beams, 4) [m] of these two points, which differ behind mirrors and glass. A beam
        without return ends at range_max.
        """
        lrf = self.scenario.lrf
        scan = self.caster.cast(lrf, pose)
        far = np.where(np.isfinite(scan.ranges), scan.ranges, lrf.range_max)[:, None]
        ways = lrf.directions(pose)
        first = far
        beyond = ways
        if self.caster.lighting is not None:
            # In the world without materials, beams end at the first mirror or pane.
            ranges, walls = self._plain_caster.scan_batch(lrf, [pose])
            first = np.minimum(ranges.T, far)
            beyond = self._behind(walls[0], scan.walls, ways)
        met = np.array(pose[:2], dtype=np.float64) + first * ways
        rows = np.hstack([met, met + (far - first) * beyond]).astype(np.float32)
        return packed({"kind": "scan", "hits": int(np.isfinite(scan.ranges).sum())}, beams=rows)

    def _behind(self, first: Int, last: Int, ways: Float) -> Float:
        """Directions (n, 2) of beams behind the first walls (n,) they hit: mirrors reflect them."""
        world = self.scenario.world
        mirrors = np.array([made is not None and made.mirrors for made in world.materials])
        turned = ways.copy()
        one = np.flatnonzero((first >= 0) & (first != last) & mirrors[world.objects[first]])
        along = directions(world.segments[first[one]])
        turned[one] = 2.0 * (ways[one] * along).sum(axis=1)[:, None] * along - ways[one]
        return turned

    def rooms(self) -> bytes:
        """The message with the rooms and the goals, and why the robot does not reach some.

        Raises:
            InputError: There is no room for the robot around its start.
        """
        scenario = self.scenario
        goals = () if scenario.goals is None else scenario.goals
        start = None if scenario.start is None else np.array(scenario.start[:2])
        ground = Ground(scenario.world, start, scenario.keep_out)
        if start is None:
            # A route through goals begins at the first of them.
            start = next((each for each in goals[:1] if not _gap(ground, each) < THINNEST), None)
        radius = self._radius or fitting_radius(ground, None, start)
        bare, rooms, numbers = bare_rooms(scenario.world)
        space = find_free_space(ground, radius, start=start)
        shut = {
            "inside": "no door leads in, or it is shut or blocked",
            "outside": "a wall is missing around the robot, or it starts outside",
        }[space.side]
        why = {**dict.fromkeys(numbers.tolist(), shut), **_too_narrow(space, start, bare, rooms)}
        why |= dict.fromkeys(entered_rooms(space, bare, rooms).tolist(), "")
        label = np.zeros(rooms.max() + 1, np.uint8)
        found = []
        for number in numbers.tolist():
            area, place = measured(bare, rooms == number)
            label[number] = 2 if why[number] else 1
            found.append({"at": place.tolist(), "area": area, "why": why[number]})
        corner = bare.places[0, 0] - 0.5 * bare.size + bare.world.origin
        values = {
            "kind": "rooms",
            "corner": corner.tolist(),
            "size": bare.size,
            "shape": rooms.shape,
            "rooms": found,
            "goals": [_doubt_of_goal(space, each) for each in goals],
            "radius": radius,
        }
        return packed(values, cells=label[rooms])

    @property
    def _radius(self) -> float | None:
        """The radius of the robot [m], if it is given."""
        radius: float | None = self.plan.tables.get("robot", {}).get("radius")
        return radius

    def route(self) -> bytes:
        """The message with the route that the planner finds, and its notes."""
        scenario = self.scenario
        found = find_route(
            scenario.world,
            radius=self._radius,
            speed=self.plan.tables.get("robot", {}).get("speed"),
            start=scenario.start,
            goals=scenario.goals,
            keep_out=scenario.keep_out,
        )
        values = {
            "kind": "route",
            "route": found.waypoints.tolist(),
            # The page shows the rooms and goals that are missed.
            "notes": [note.fact for note in found.notes if note not in found.missed],
            "radius": found.radius,
        }
        return packed(values)

    def world_path(self) -> Path:
        """The file of the world that is written."""
        path = self.path.with_suffix(".toml")
        if path == self.path and not self.empty:
            path = self.path.with_name(f"{self.path.stem}_edited.toml")
        return path

    def old_world(self) -> str:
        """What to say of the world file if it is older than the decisions, or not written yet."""
        path = self.world_path()
        if self.empty and len(self.plan.segments) and not path.is_file():
            return f"{path.name} is not written yet: Ctrl+S"
        written, decided = (
            each.stat().st_mtime_ns if each.is_file() else 0 for each in (path, self.journal)
        )
        return f"{path.name} is older than this: Ctrl+S" if 0 < written < decided else ""

    def save_world(self) -> Path:
        """Write a world file: the walls, the robot, and the dynamic obstacles."""
        path = self.world_path()
        world = self.scenario.world
        if not len(world.segments):
            raise InputError("there is no wall yet; draw one")
        if self.empty:
            # Doorways end at fractions of a millimetre.
            world = replace(world, segments=np.round(world.segments, 4))
        values = {} if (robot := self.edits.one(PlacedRobot)) is None else robot.as_dict()
        if "route" in values:
            values["goals"] = values.pop("route")
        if areas := [each.as_dict()["points"] for each in self.edits.all(KeepOut)]:
            values["keep_out"] = areas
        blocks = [
            world_text(world),
            *([toml_table("[robot]", values)] if values else []),
            *(toml_table("[[obstacle]]", e.as_dict()) for e in self.edits.all(Obstacle)),
        ]
        write_text(path, "\n".join(blocks))
        return path

    def save_map(self) -> Path:
        """Write the ROS map again, with erased and drawn walls changed in its own cells."""
        from lrf3d.world.ros_map import rewrite_map

        path = self.path.with_name(f"{self.path.stem}_edited{self.path.suffix}")
        rewrite_map(self.path, self._source(self.edits).segments, self.plan.segments, path)
        return path

    def picture(self) -> bytes | None:
        """The picture of the source as PNG, or None."""
        if self.sheet is None:
            return None
        file = io.BytesIO()
        Image.fromarray(self.sheet.picture).save(file, "PNG", compress_level=1)
        return file.getvalue()


def _too_narrow(space: FreeSpace, start: Float | None, bare: Ground, rooms: Int) -> dict[int, str]:
    """Why the robot does not reach rooms that a narrower one, or one without furniture, reaches."""

    def entered(ground: Ground, radius: float) -> list[int]:
        with suppress(InputError):
            found = find_free_space(ground, radius, start=start)
            return [*map(int, entered_rooms(found, bare, rooms))]
        return []

    cause = dict.fromkeys(entered(bare, space.radius), "furniture is in the way of")
    why = {room: f"{words} the robot" for room, words in cause.items()}
    # Of those that would fit, the widest comes last.
    for radius in sorted(each for each in USUAL_RADII if each < space.radius):
        for room in entered(space.ground, radius):
            narrow = f"{cause.get(room, 'a door is too narrow for')} the robot of"
            why[room] = (
                f"{narrow} {2.0 * space.radius:.2f} m; one of {2.0 * radius:.2f} m would fit"
            )
    return why


def _gap(ground: Ground, place: Float) -> float:
    """Distance [m] of a place (2,) [m] to walls and to areas that are kept out of."""
    return float(ground.clearance(place[None] - ground.world.origin)[0])


def _doubt_of_goal(space: FreeSpace, goal: Float) -> str:
    """Why a robot does not stand at a goal (2,) [m] in the end; empty if it does."""
    gap = _gap(space.ground, goal)
    short = np.hypot(*(space.places + space.ground.world.origin - goal).T).min()
    if gap < space.radius and short > SHORT:
        return f"too near to a wall: the robot stops {short:.1f} m short"
    return space.why_missed(goal) if space.nearest(goal) is None else ""
