"""The scene of a run at a moment, as a value: see :mod:`lrf3d.scene.shapes`.

A moment of the run and a look enter; what is to be seen leaves. What has not changed since the
moment before is the same object again, so that nothing is made or sent twice.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from lrf3d.geometry import Float
from lrf3d.scene import look
from lrf3d.scene.beams import DrawnBeams, beam_reach
from lrf3d.scene.bodies import flat_dart, goal_disc, robot_body, robot_shadow, world_from_robot
from lrf3d.scene.camera import Look
from lrf3d.scene.estimate import DrawnEstimate
from lrf3d.scene.map_bands import WallTops, bands
from lrf3d.scene.obstacles import Obstacles
from lrf3d.scene.shapes import Body, Cut, Lens, Lines, Mark, Plan, Points, Seen, Soft
from lrf3d.scene.stage import Stage, stage_of
from lrf3d.scene.structures import SIGHT_DISTANCE
from lrf3d.scene.timeline import Moment, Timeline, drive_keys
from lrf3d.scene.trail_and_map import DrawnMap, thinned, trail_lines
from lrf3d.scene.turns import turning_walls

LAYERS = (
    "shadow", "goal", "trail", "estimate", "fan", "beams", "map", "points", "marker", "inset",
    "hud",
)  # fmt: skip
"""What can be left out of a picture; what is left out costs nothing."""

Goal = tuple[float, float, float]
"""Where a robot is to arrive: x, y and radius [m]."""

_ROBOT_SIZE, _LEAST_ROBOT, _MARKER = 0.75, 26.0, 10.0
"""Width of the robot [m]; a robot of fewer pixels than the second has an arrow over it, whose unit
is the third [pixels at 720 lines]."""

_MARKER_NEARER = 0.3
"""Share of the distance from the eye to the robot at which that arrow is drawn: nothing hides
it."""

_WALL_NEARER, _ON_TOP = 0.12, 1e6
"""How much nearer to the eye marks are than walls [m]; from straight above, tops of walls would
hide them."""

_SLACK = 0.002
"""By how much the depth of marks gains with their distance [m/m], as depths are coarser far away;
but not for an eye that looks from far on purpose."""

_PAST_GROUND = 3.0
"""How far an eye far above the ground sees, in its heights: past all of it, at a slant too."""

_LEAST_PLAN = 4.0
"""Least size [m] that the plan shows: there may be no wall, and a robot that stands."""

_OLD_SCANS = 8
"""Earlier scans whose hits are still shown, at the most."""

_REAR = 0.3
"""How far from its middle the robot ends [m], where it stands on the ground: so much of it is to be
seen over walls that are cut."""

_BELOW_SIGHT = 0.8
"""Share of the line of sight from there to the eye that cut walls reach up to."""


Made = TypeVar("Made")


class Scene:
    """All that can be seen of a run, with a goal on the ground where one is given.

    What stands in the run's world may have been painted already.
    """

    def __init__(
        self, timeline: Timeline, goal: Goal | None = None, stage: Stage | None = None
    ) -> None:
        run = self.run = timeline.run
        self.timeline = timeline
        self.stage = stage or stage_of(run)
        structures = self.structures = self.stage.structures
        self.origin = structures.origin
        self.obstacles = Obstacles(run.obstacles, self.origin, indoor=structures.indoor)
        self.tops = WallTops(structures.segments, structures.heights)
        self.robot = Body(robot_body(run.lrf.height), np.eye(4))
        self._goal = None if goal is None else goal_disc(np.array(goal) - [*self.origin, 0.0])
        self._turning = turning_walls(run.world)
        self._walls = run.world.segments - np.tile(self.origin, 2)
        self.keys = thinned(drive_keys(timeline))
        self._estimate = DrawnEstimate.from_timeline(timeline)
        self._reach = beam_reach(run.lrf.range_max, structures)
        self._fade = look.TRAIL_FADE * timeline.playback
        self._recent = look.HITS_FADE * timeline.playback
        self._kept: dict[str, tuple[Any, Any]] = {}
        self._hits: dict[int, Points] = {}

    def seen(
        self, moment: Moment, view: Look, size: tuple[int, int], layers: Collection[str] = LAYERS
    ) -> Seen:
        """What is to be seen at a moment through a look, in a picture of a size [pixels]."""
        pose = moment.pose - [*self.origin, 0.0]
        lens = self._lens(view, size)
        bodies = [("robot", self.robot._replace(pose=world_from_robot(pose)))]
        bodies += self.obstacles.bodies(moment.time)
        if "map" in layers and not view.shows_map:
            drawn = self.drawn_map(moment.scan)
            least = 0.5 * look.BAND_PIXELS * min(size) / 720.0 / lens.focus
            stage = self.run.snapshot_after(moment.scan)
            tops = self._same("tops", stage, self.tops.of, drawn.segments)
            standing = bands(drawn, tops, lens.eye, least=least, raised=view.raised)
            bodies.append(("map", Body(standing, np.eye(4))))
        marks = tuple(
            (name, mark)
            for layer, name, mark in self._marks(moment, pose, view, lens, size)
            if layer in layers and mark is not None
        )
        cut = None
        if view.cuts and self.structures.indoor:
            away = lens.eye[:2] - pose[:2]
            level = max(float(np.hypot(*away)), 2.0 * _REAR)
            toward = away / level
            slope = _BELOW_SIGHT * float(lens.eye[2]) / (level - _REAR)
            start, gain = look.LEFT_FROM_AFAR
            top = look.LEFT_STANDING[1] + gain * max(level - start, 0.0)
            cut = Cut(pose[:2] + _REAR * toward, toward, slope, top)
        return Seen(lens, tuple(bodies), marks, view.sky_below, view.ghost, cut)

    def _lens(self, view: Look, size: tuple[int, int]) -> Lens:
        far = max(SIGHT_DISTANCE, _PAST_GROUND * float(view.eye[2]))
        half = look.HALF_HAZE_INDOOR if self.structures.indoor else look.HALF_HAZE
        return Lens(
            matrix=view.matrix(size[0] / size[1], far),
            eye=view.eye,
            focus=float(0.5 * size[1] / np.tan(0.5 * view.field)),
            thick=0.0 if view.clear else min(1.0 / half, 1.0 / max(view.air, 1e-9)),
            slack=0.0 if view.clear else _SLACK,
            nearer=_ON_TOP if view.shows_map else _WALL_NEARER,
        )

    def _marks(
        self, moment: Moment, pose: Float, view: Look, lens: Lens, size: tuple[int, int]
    ) -> Iterator[tuple[str, str, Mark | None]]:
        """Layer, name and mark, in the order in which they are drawn."""
        height = self.run.lrf.height
        yield "shadow", "shadow", robot_shadow(pose, indoor=self.structures.indoor)
        yield "shadow", "shadows", self.obstacles.shadows(moment.time)
        yield "goal", "goal", self._goal
        yield "trail", "trail", self._trail(moment)
        for name, line in self._estimated(moment):
            yield "estimate", name, line
        beams = self._beams(moment)
        if beams is not None:
            fainter = np.array([1.0, 1.0, 1.0, view.fan], np.float32)
            yield "fan", "fan", beams[0]._replace(colours=beams[0].colours * fainter)
            yield "beams", "beams", beams[1]
        stage = self.run.snapshot_after(moment.scan)
        if view.shows_map:
            lines = self._same("map", stage, self._map_lines, moment.scan, height)
            yield "map", "map lines", lines
        elif view.raised == 0.0:
            yield "map", "hidden", self._same("hidden", stage, self._hidden_lines, moment.scan)
        yield "points", "recent", self._recent_hits(moment)
        if beams is not None:
            yield "points", "points", beams[2]
        yield "marker", "marker", self._marker(pose, view, lens, size, height)

    def _same(self, name: str, key: object, make: Callable[..., Made], *arguments: object) -> Made:
        """What was made for this key the last time, or made now."""
        kept = self._kept.get(name)
        if kept is None or kept[0] != key:
            kept = self._kept[name] = key, make(*arguments)
        made: Made = kept[1]
        return made

    def drawn_map(self, scan: int) -> DrawnMap:
        """The map after a scan."""
        stage = self.run.snapshot_after(scan)
        return self._same("drawn", stage, DrawnMap.from_snapshot, self.run, stage, self.origin)

    def _map_lines(self, scan: int, height: float) -> Lines:
        return self.drawn_map(scan).lines(height, look.MAP_LINE_WIDTH, 1.0)

    def _hidden_lines(self, scan: int) -> Lines:
        height = float(np.mean(look.MAP_BAND))
        drawn = self.drawn_map(scan)
        return drawn.lines(height, look.HIDDEN_WIDTH, look.HIDDEN_STRENGTH, hidden=True)

    def _trail(self, moment: Moment) -> Lines | None:
        # Of a recorded drive only the estimate is known, which is drawn as such.
        if not self.run.knows_truth:
            return None
        now = moment.time - self.timeline.start
        return self._same("trail", now, trail_lines, self.keys, now, self._fade)

    def _estimated(self, moment: Moment) -> Iterator[tuple[str, Lines]]:
        if self._estimate is not None:
            now = moment.time - self.timeline.start
            yield "estimate", self._same("estimate", now, self._estimate.trail, now)
            yield "ellipses", self._same("ellipses", now, self._estimate.rings, now)

    def _beams(self, moment: Moment) -> tuple[Soft, Lines, Points] | None:
        """The glow, single beams and hits of the newest scan, from where the robot is now."""
        if not moment.scanning:
            return None
        key = moment.scan, *moment.pose.tolist()
        return self._same("beams", key, self._drawn_beams, moment.scan, moment.pose)

    def _drawn_beams(self, number: int, pose: Float | None = None) -> tuple[Soft, Lines, Points]:
        scan, origin, lrf = self.run.scan(number), np.array([*self.origin, 0.0]), self.run.lrf
        place = np.array(scan.pose) - origin
        apex = place if pose is None else pose - origin
        local = replace(scan, pose=place)
        drawn = DrawnBeams.from_scan(local, self._walls, apex[:2], self._turning)
        return (
            drawn.glow(lrf.height, indoor=self.structures.indoor),
            drawn.single(lrf.height, self._reach),
            drawn.hit_points(lrf.height, lrf.range_max, by=self.run.film.points_by),
        )

    def _recent_hits(self, moment: Moment) -> Points:
        """The hits of the last seconds, which fade."""
        times = self.run.trajectory.times
        first = int(np.searchsorted(times, moment.time - self._recent))
        last = moment.scan if moment.scanning else moment.scan + 1
        step = 1 + (last - first) // _OLD_SCANS
        chosen = [number for number in range(first, last) if number % step == 0]
        recent = self._same("recent", chosen, self._old_hits, chosen)
        left = np.clip(1.0 - (moment.time - times[chosen]) / self._recent, 0.0, 1.0)
        counts = [len(hits.places) for hits in self._hits.values()]
        colours = recent.colours.copy()
        colours[:, 3] = np.repeat(look.HITS_STRENGTH * left, counts)
        return recent._replace(colours=colours)

    def _old_hits(self, chosen: list[int]) -> Points:
        self._hits = {
            number: self._hits[number] if number in self._hits else self._drawn_beams(number)[2]
            for number in chosen
        }
        none = tuple(np.zeros((0, columns), np.float32) for columns in (3, 4, 2))
        each = [none, *(hits[:3] for hits in self._hits.values())]
        places, colours, sides = (np.concatenate(column) for column in zip(*each, strict=True))
        return Points(places, colours, sides, look.HIT_SIZE, look.HIT_PIXELS, glows=False)

    def _marker(
        self, pose: Float, view: Look, lens: Lens, size: tuple[int, int], height: float
    ) -> Soft | None:
        """An arrow over a robot that is too small to be seen."""
        place = np.array([*pose[:2], height])
        away = float(np.linalg.norm(place - lens.eye))
        pixel = min(size) / 720.0 * away / lens.focus
        if _ROBOT_SIZE > _LEAST_ROBOT * pixel:
            return None
        dart = flat_dart(pose, _MARKER * pixel, height)
        # Seen from the eye, what is drawn smaller and nearer is the same.
        share = max(_MARKER_NEARER, 1.5 * view.near / away)
        return dart._replace(
            corners=(lens.eye + share * (dart.corners - lens.eye)).astype(np.float32)
        )

    def plan(
        self, moment: Moment, box: tuple[int, int, int], middle: Float | None, window: float
    ) -> Plan:
        """The map so far from straight above, on nothing: what is not known yet is empty.

        The box is its left, top and side [pixels]; it shows a window [m] round a middle (2,), or
        round the robot.
        """
        pose = moment.pose - [*self.origin, 0.0]
        x, y = pose[:2] if middle is None else middle
        zoom = 2.0 / window
        matrix = np.diag([zoom, -zoom, 0.0, 1.0])
        matrix[:2, 3] = -zoom * x, zoom * y
        lens = Lens(matrix, np.array([x, y, _ON_TOP]), 1.0, 0.0, 0.0, _ON_TOP)
        stage = self.run.snapshot_after(moment.scan)
        lines = self._same("plan", stage, self._plan_lines, moment.scan)
        beams = self._beams(moment)
        marks: list[tuple[str, Mark | None]] = [("plan map", lines)]
        if beams is not None:
            marks.append(("plan points", beams[2]._replace(glows=False)))
        marks.append(("plan trail", self._trail(moment)))
        marks += [(f"plan {name}", line) for name, line in self._estimated(moment)]
        marks.append(("plan obstacles", self.obstacles.plans(moment.time, window / box[2])))
        marks.append(("plan robot", flat_dart(pose, look.DART_SHARE * window, 0.0)))
        shown = tuple((name, mark) for name, mark in marks if mark is not None)
        return Plan(box, lens, shown)

    def plan_window(self) -> tuple[Float | None, float]:
        """The middle (2,) of what the plan shows and its size [m]; no middle where it follows."""
        path = self.run.trajectory.poses[:, :2] - self.origin
        points = np.concatenate([self.structures.places, path])
        low, high = points.min(axis=0), points.max(axis=0)
        size = float((high - low).max())
        if size > look.INSET_WHOLE:
            return None, look.INSET_FOLLOWED
        # A room needs less of a rim than a city.
        return 0.5 * (low + high), max(1.04 * size + 2.0 * min(1.0, size / 40.0), _LEAST_PLAN)

    def _plan_lines(self, scan: int) -> Lines:
        drawn = self.drawn_map(scan)
        # On a dark ground, paler colours are seen more easily.
        pale = drawn.colours + 0.35 * (1.0 - drawn.colours)
        return replace(drawn, colours=pale).lines(0.0, look.PLAN_LINE_WIDTH, 1.0)
