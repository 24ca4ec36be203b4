"""The state of an editor: a source, the decisions about it, and the plan that follows from both.

A path and the decisions of a page enter; after each change the plan leaves as a message. The
decisions are saved before the page is answered.
"""

import io
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lrf3d.apps.edit.message import packed, plan_message
from lrf3d.apps.edit.sources import USUAL_SIZE, Sheet, sheet_of, suggestions
from lrf3d.base.errors import InputError, WorldError
from lrf3d.base.files import write_text
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import Float, Int, directions
from lrf3d.planning.free_space import Ground, find_free_space
from lrf3d.planning.planner import find_route
from lrf3d.planning.rooms import reached_rooms
from lrf3d.plans.decisions import KeepOut, Obstacle, PlacedRobot, Scale
from lrf3d.plans.edits import PlanEdits, digest_of, read_edits
from lrf3d.plans.parts import Parts
from lrf3d.plans.plan import Plan
from lrf3d.plans.reading import drawn_plan
from lrf3d.robot.kinematics import RADIUS
from lrf3d.simulation.scenario import Scenario, scenario_of
from lrf3d.world import World
from lrf3d.world.files import edits_path, is_picture
from lrf3d.world.toml_file import WorldFile, toml_table, world_text


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
        plan = edits.applied(self._source(edits), self.journal.name)
        self.edits = edits
        self.plan = plan
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
        header = {
            "name": self.path.name,
            "edits": self.edits.as_dict(),
            "readOnly": self.read_only,
            "scaled": bool(scale) or "resolution" in self._options or not is_picture(self.path),
            "rosMap": self.path.suffix.lower() in (".yaml", ".yml"),
            "sheet": self.sheet and [*self.sheet.size],
            "suggestions": [] if scale else suggestions(self.plan),
            "said": "; ".join(filter(None, [self.plan.doubt, self.plan.said])),
            "leftOut": self.plan.left_out,
            "lost": self.plan.lost,
            "radius": self.scenario.radius,
        }
        return plan_message(self.plan, header)

    def scan(self, pose: Any) -> bytes:
        """The exact beams from a pose: where each first hits a wall, and where it ends.

        Rows (beams, 4) [m] of these two points, which differ behind mirrors and glass. A beam
        without return ends at range_max.
        """
        lrf = self.scenario.lrf
        x, y, _ = pose
        scan = self.caster.cast(lrf, pose)
        far = np.where(np.isfinite(scan.ranges), scan.ranges, lrf.range_max)[:, None]
        ways = lrf.directions(pose)
        here = np.array([x, y], dtype=np.float64)
        first = far
        beyond = ways
        if self.caster.lighting is not None:
            # In the world without materials, beams end at the first mirror or pane.
            ranges, walls = self._plain_caster.scan_batch(lrf, [pose])
            first = np.minimum(ranges.T, far)
            beyond = self._behind(walls[0], scan.walls, ways)
        met = here + first * ways
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
        """The message with the rooms, and which of them the robot reaches."""
        scenario = self.scenario
        start = None if scenario.start is None else np.array(scenario.start[:2])
        radius = scenario.radius if "radius" in self.plan.tables.get("robot", {}) else 0.22
        ground = Ground(scenario.world, start, scenario.keep_out)
        space = find_free_space(ground, min(radius, RADIUS), start=start)
        bare, rooms, numbers, reached = reached_rooms(space)
        label = np.zeros(rooms.max() + 1, np.uint8)
        label[numbers] = 2
        label[reached] = 1
        corner = bare.places[0, 0] - 0.5 * bare.size + bare.world.origin
        values = {
            "kind": "rooms",
            "corner": corner.tolist(),
            "size": bare.size,
            "shape": rooms.shape,
            "reached": int(np.isin(numbers, reached).sum()),
            "count": len(numbers),
        }
        return packed(values, cells=label[rooms])

    def route(self) -> bytes:
        """The message with the route that the planner finds, and its notes."""
        scenario = self.scenario
        known = self.plan.tables.get("robot", {})
        found = find_route(
            scenario.world,
            radius=known.get("radius"),
            speed=known.get("speed"),
            start=scenario.start,
            goals=scenario.goals,
            keep_out=scenario.keep_out,
        )
        values = {
            "kind": "route",
            "route": found.waypoints.tolist(),
            "notes": found.notes,
            "radius": found.radius,
        }
        return packed(values)

    def save_world(self) -> Path:
        """Write a world file: the walls, the robot, and the dynamic obstacles."""
        path = self.path.with_suffix(".toml")
        if path == self.path and not self.empty:
            path = self.path.with_name(f"{self.path.stem}_edited.toml")
        world = self.scenario.world
        if not len(world.segments):
            raise InputError("there is no wall yet; draw one")
        robot = self.edits.one(PlacedRobot)
        values = {} if robot is None else robot.as_dict()
        if "route" in values:
            values["goals"] = values.pop("route")
        if areas := [each.as_dict()["points"] for each in self.edits.all(KeepOut)]:
            values["keep_out"] = areas
        blocks = [world_text(world)] + ([toml_table("[robot]", values)] if values else [])
        blocks += [toml_table("[[obstacle]]", e.as_dict()) for e in self.edits.all(Obstacle)]
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
