"""The scene of a run at a moment, as a value: see :mod:`lrf3d.studio.scene.shapes`.

A moment of the run and a look enter; what is to be seen leaves. What has not changed since the
moment before is the same object again, so that nothing is made or sent twice.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.laser.unrolling import unrolled
from lrf3d.studio.scene import bodies, look
from lrf3d.studio.scene.camera import AIM, Look
from lrf3d.studio.scene.marks import DrawnEstimate, DrawnMap, draw_beams, trail_lines
from lrf3d.studio.scene.shapes import (
    Body,
    Lens,
    Lines,
    Mark,
    Plan,
    Points,
    Seen,
    Soft,
    Tints,
    together,
)
from lrf3d.studio.scene.stage.exposure import LiveExposure
from lrf3d.studio.scene.stage.stage import Stage, stage_of
from lrf3d.studio.scene.stage.structures import SIGHT_DISTANCE, outlines_of, panes_of
from lrf3d.studio.scene.timeline import Moment, Timeline, drive_keys

# What can be left out of a picture; what is left out costs nothing.
LAYERS = (
    "outlines", "shadow", "goal", "trail", "estimate", "lamp", "beams", "map", "points", "marker",
    "inset", "hud",
)  # fmt: skip

# Further marks of films and pages, by the names of their layers, over those of a scene. Enter what
# returns a mark in the film's frame for a scene and a moment, or None.
MARKS: dict[str, Callable[["Scene", Moment], Mark | None]] = {}

# Where a robot is to arrive: x, y and radius [m].
Goal = tuple[float, float, float]

# How much nearer to the eye marks are than walls [m]; from straight above, tops of walls would hide
# them; and by how much their depth gains with their distance [m/m], as depths are coarser far away,
# but not where the map is laid over all.
_WALL_NEARER = 0.12
_ON_TOP = 1e6
_SLACK = 0.002

# Widths of the map as lines from above and in the plan [pixels of 720 lines]; the robot's size, as
# a share of what the plan shows; the plan's least size [m], as there may be no wall; and limits of
# its height, in its width.
_MAP_WIDTH = 4.0
_PLAN_WIDTH = 2.6
_DART_SHARE = 0.034
_LEAST_PLAN = 4.0
_PLAN_SHAPES = (0.22, 1.6)

# By what the colour of beams is multiplied, laser by laser.
_LASER_TINTS = np.array(
    [(1.0, 1.0, 1.0), (0.5, 1.2, 3.0), (0.6, 2.0, 0.9), (1.0, 0.7, 3.0)], np.float32
)

# Times of the film [s] in which the trail and hits fade, and the most scans that these are of.
_TRAIL_FADE = 15.0
_HITS_FADE = 2.5
_OLD_SCANS = 8

# Opacity of hits at first, their size [m], and the smallest and largest in a picture of 720 lines
# [pixels].
_HITS_STRENGTH = 0.8
_HIT_SIZE = 0.05
_HIT_PIXELS = (2.0, 4.0)


class Scene:
    """All that can be seen of a run, with a goal on the ground where one is given.

    What stands in the run's world may have been painted already. A live one is lit by scans as they
    come.
    """

    def __init__(
        self,
        timeline: Timeline,
        goal: Goal | None = None,
        stage: Stage | None = None,
        *,
        live: bool = False,
    ) -> None:
        run = self.run = timeline.run
        self.timeline = timeline
        self.stage = stage or stage_of(run)
        structures = self.structures = self.stage.structures
        self.exposure = self.stage.exposure
        self.live = LiveExposure(self.exposure, structures) if live else None
        self.origin = structures.origin
        self.obstacles = bodies.Obstacles(run.obstacles, self.origin, laser_height=run.lrf.height)
        self.robot = Body(bodies.robot_body(run.lrf.height, run.radius), np.eye(4))
        self.keys = drive_keys(timeline).thinned()
        self._goal = (
            None if goal is None else bodies.goal_disc(np.subtract(goal, [*self.origin, 0]))
        )
        self._walls = run.world.segments - np.tile(self.origin, 2)
        self._mirrors = structures.segments[structures.mirrors]
        self._outlines = outlines_of(structures)
        self._panes = lru_cache(2)(partial(panes_of, structures))
        self._map = lru_cache(1)(self._drawn_map)
        self._beams = lru_cache(1)(self._drawn_beams)
        self._trails = lru_cache(1)(self._drawn_trails)
        self._hits = lru_cache(2 * _OLD_SCANS)(lambda number: self._drawn_beams(number)[1])
        self._recent = lru_cache(1)(self._hits_together)
        self._estimate = DrawnEstimate.from_timeline(timeline)

    def seen(
        self, moment: Moment, view: Look, size: tuple[int, int], layers: Collection[str] = LAYERS
    ) -> Seen:
        """What is to be seen at a moment through a look, in a picture of a size [pixels]."""
        pose = moment.pose - [*self.origin, 0.0]
        lens = self._lens(view, size)
        robot = self.robot._replace(pose=bodies.world_from_robot(pose))
        marks = tuple(
            (name, mark)
            for layer, name, mark in self._marks(moment, pose, view, lens, size)
            if (layer in layers or layer in MARKS) and mark is not None
        )
        x, y, _ = pose.tolist()
        seen = Seen(
            lens,
            (("robot", robot), *self.obstacles.bodies(moment.time)),
            marks,
            self.exposure.clock(moment.now, self.timeline.playback),
            tints=self._snapshot(moment).tints if "map" in layers else None,
            glass=view.glass,
            robot=(x, y, AIM) if view.opens else None,
        )
        cuts = view.cuts and self.structures.indoor
        return seen._replace(cut=look.SECTION) if cuts else seen

    def _lens(self, view: Look, size: tuple[int, int]) -> Lens:
        wide, tall = size
        *_, eye_height = view.eye.tolist()
        # Least distance at which half of what is seen is haze, in distances to what is looked at,
        # as the whole is seen through clear air; and the far plane of a high eye, in its heights.
        clear = 2.6
        past_ground = 3.0
        haze = max(self.structures.setting.haze, clear * view.away)
        return Lens(
            matrix=view.matrix(wide / tall, max(SIGHT_DISTANCE, past_ground * eye_height)),
            eye=view.eye,
            focus=float(0.5 * tall / np.tan(0.5 * view.field)),
            thick=0.0 if view.shows_map else 1.0 / haze,
            slack=0.0 if view.shows_map else _SLACK,
            nearer=_ON_TOP if view.shows_map else _WALL_NEARER,
        )

    def _marks(
        self, moment: Moment, pose: Float, view: Look, lens: Lens, size: tuple[int, int]
    ) -> Iterator[tuple[str, str, Mark | None]]:
        """Layer, name and mark, in the order in which they are drawn."""
        if view.cuts or not self.structures.indoor:
            yield "outlines", "outlines", self._outlines
        if (self.structures.glass | self.structures.mirrors).any():
            cut = look.SECTION if view.cuts and self.structures.indoor else np.inf
            yield from zip(("outlines",) * 2, ("panes", "edges"), self._panes(cut), strict=True)
        yield "shadow", "shadow", bodies.robot_shadow(pose, self.run.radius)
        yield "shadow", "shadows", self.obstacles.shadows(moment.time)
        yield "goal", "goal", self._goal
        yield from self._trails(moment.time)
        beams = hits = lamp = None
        if moment.scanning:
            beams, hits, lamp = self._beams(moment.scan, *moment.pose)
        yield "lamp", "lamp", lamp
        yield "beams", "beams", beams
        drawn = self._snapshot(moment)
        if view.shows_map:
            yield "map", "map lines", drawn.above
        else:
            yield "map", "ghosts", drawn.ghosts
            yield "map", "bands", drawn.bands
        yield "points", "recent", self._recent_hits(moment)
        yield "points", "points", hits
        for layer, draw in MARKS.items():
            yield layer, layer, draw(self, moment)
        yield "marker", "marker", self._markers(moment.time, pose, lens, size)

    def _snapshot(self, moment: Moment) -> "_Snapshot":
        return self._map(self.run.snapshot_after(moment.mapped))

    def _drawn_map(self, stage: int) -> "_Snapshot":
        exposure = self.exposure
        drawn = DrawnMap.from_snapshot(self.run, stage, self.structures)
        flat = _from_above(exposure.corner + 0.5 * exposure.size, exposure.size)
        return _Snapshot(
            drawn.bands(),
            drawn.lines(self.run.lrf.height, _MAP_WIDTH),
            drawn.lines(0.0, _PLAN_WIDTH),
            drawn.ghosts(self.structures, exposure.tolerance),
            Tints(flat, drawn.lines(0.0, 2.0 * exposure.tolerance / exposure.cell)),
        )

    def _drawn_trails(self, time: float) -> tuple[tuple[str, str, Lines], ...]:
        now = time - self.timeline.start
        found = []
        fade = _TRAIL_FADE * self.timeline.playback
        # Of a recorded drive only the estimate is known, which is drawn as such.
        if self.run.knows_truth:
            found.append(("trail", "trail", trail_lines(self.keys, now, fade)))
        if self._estimate is not None:
            found.append(("estimate", "estimate", self._estimate.trail(now, fade)))
            found.append(("estimate", "ellipses", self._estimate.rings(now)))
        return tuple(found)

    def _drawn_beams(self, number: int, *pose: float) -> tuple[Lines, Points, Soft]:
        """Beams, hits and lamps of all lasers at a scan, from where the robot is now, if given."""
        run = self.run
        origin = np.array([*self.origin, 0.0])
        robot = np.array(pose) if pose else run.trajectory.poses[number]
        drawn = []
        reach = min(run.lrf.range_max, self.structures.setting.beams)
        for laser, (lrf, scan) in enumerate(zip(run.lasers, run.scans_at(number), strict=True)):
            scan = unrolled(scan)
            apex = (lrf.placed(robot) - origin)[:2]
            scan = replace(scan, pose=np.array(scan.pose) - origin)
            how: Any = {"height": lrf.height, "reach": reach, "by": run.film.points_by}
            lines, *others = draw_beams(scan, self._walls, self._mirrors, apex, **how)
            tint = _LASER_TINTS[laser % len(_LASER_TINTS)]
            colours = np.minimum(lines.colours * tint, np.float32(1.0))
            drawn.append((lines._replace(colours=colours), *others))
        lines, points, light = map(together, zip(*drawn, strict=True))
        return lines, points, light

    def _recent_hits(self, moment: Moment) -> Points:
        times = self.run.trajectory.times
        lasting = _HITS_FADE * self.timeline.playback
        first = int(np.searchsorted(times, moment.time - lasting))
        last = moment.scan if moment.scanning else moment.mapped + 1
        first = min(first, last)
        step = 1 + (last - first) // _OLD_SCANS
        chosen = tuple(number for number in range(first, last) if number % step == 0)
        hits, counts = self._recent(chosen)
        left = np.clip(1.0 - (moment.time - times[list(chosen)]) / lasting, 0.0, 1.0)
        colours = hits.colours.copy()
        colours[:, 3:] = np.repeat(_HITS_STRENGTH * left, counts)[:, None]
        return hits._replace(colours=colours)

    def _hits_together(self, chosen: tuple[int, ...]) -> tuple[Points, list[int]]:
        places, colours, sides = (np.zeros((0, columns), np.float32) for columns in (3, 4, 2))
        none = Points(places, colours, sides, _HIT_SIZE, _HIT_PIXELS, glows=False)
        each = [self._hits(number) for number in chosen]
        hits: Points = together([none, *each])
        return hits, [len(one.places) for one in each]

    def _markers(self, time: float, pose: Float, lens: Lens, size: tuple[int, int]) -> Soft | None:
        """An arrow over a robot that is too small to be seen, and what moves round it as large."""
        height = self.run.lrf.height
        away = float(np.linalg.norm([*pose[:2], height] - lens.eye))
        pixel = min(size) / 720.0 * away / lens.focus
        # Width of the robot [m]; a robot of fewer pixels than the second has an arrow over it,
        # whose unit is the third [pixels at 720 lines].
        robot_size = 0.75
        least_robot = 26.0
        marker = 10.0
        if robot_size > least_robot * pixel:
            return None
        dart = marker * pixel
        own = bodies.flat_dart(pose, dart, height)
        others = self.obstacles.plans(time, dart)
        marks: Soft = together([own, *others])
        return marks._replace(on_top=True)

    def plan(self, moment: Moment, box: tuple[int, int, int, int], window: "Window") -> Plan:
        """The map so far from straight above, on what was seen: what is not known is dark.

        The box is its left, top, width and height [pixels].
        """
        pose = moment.pose - [*self.origin, 0.0]
        middle = pose[:2] if window.middle is None else window.middle
        lens = _from_above(middle, window.width * np.array([1.0, -window.aspect]))
        marks: list[tuple[str, Mark | None]] = [("map", self._snapshot(moment).plan)]
        if moment.scanning:
            _, hits, _ = self._beams(moment.scan, *moment.pose)
            marks.append(("points", hits._replace(glows=False)))
        marks += [(name, line) for _, name, line in self._trails(moment.time)]
        dart = _DART_SHARE * window.width
        robot = bodies.flat_dart(pose, dart, 0.0)
        marks.append(("robot", together([*self.obstacles.plans(moment.time, dart), robot])))
        return Plan(box, lens, tuple((f"plan {name}", mark) for name, mark in marks if mark))

    def plan_window(self) -> "Window":
        """The window of the plan: the whole world or, in a large one, what is around the robot."""
        path = self.run.trajectory.poses[:, :2] - self.origin
        points = np.concatenate([self.structures.places, path])
        low = points.min(axis=0)
        high = points.max(axis=0)
        # A room needs less of a rim than a city.
        wide, tall = 1.04 * (high - low) + 2.0 * np.minimum(1.0, (high - low) / 40.0)
        aspect = float(np.clip(tall / max(wide, 1e-9), *_PLAN_SHAPES))
        size = max(float(wide), float(tall) / aspect, _LEAST_PLAN)
        if size > look.INSET_WHOLE:
            return Window(None, look.INSET_FOLLOWED, 1.0)
        return Window(0.5 * (low + high), size, aspect)


class Window(NamedTuple):
    """What the plan shows: its middle (2,), None where it follows the robot, and its width [m].

    Its height is given in its width.
    """

    middle: Float | None
    width: float
    aspect: float

    @property
    def bar(self) -> float:
        """The longest of 1, 2, 5, 10 … that takes up to a third of it, to show its scale by [m]."""
        most = self.width / 3.0
        power = float(10.0 ** np.floor(np.log10(most)))
        return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= most)


class _Snapshot(NamedTuple):
    """What is drawn of a map snapshot: bands, lines from above and in the plan."""

    bands: Lines
    above: Lines
    plan: Lines
    ghosts: Soft
    tints: Tints


def _from_above(middle: Float, size: Float) -> Lens:
    """A lens straight above a middle (2,), which shows a width and height (2,) [m].

    With a negative height the first row of the picture has the largest y.
    """
    matrix = np.diag([*2.0 / size, 0.0, 1.0])
    matrix[:2, 3] = -2.0 * middle / size
    return Lens(matrix, np.array([*middle, _ON_TOP]), 1.0, 0.0, 0.0, _ON_TOP)
