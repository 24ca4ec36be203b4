"""The scene of a run at a moment, as a value: see :mod:`lrf3d.scene.shapes`.

A moment of the run and a look enter; what is to be seen leaves. What has not changed since the
moment before is the same object again, so that nothing is made or sent twice.
"""

from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from lrf3d.geometry import Float, Single
from lrf3d.laser.unrolling import unrolled
from lrf3d.scene import look
from lrf3d.scene.beams import REACH, REACH_INDOOR, draw_beams, turning_walls
from lrf3d.scene.bodies import (
    Obstacles,
    flat_dart,
    goal_disc,
    robot_body,
    robot_shadow,
    world_from_robot,
)
from lrf3d.scene.camera import Look
from lrf3d.scene.drawn_map import BAND, DrawnMap
from lrf3d.scene.estimate import DrawnEstimate, trail_lines
from lrf3d.scene.shapes import Body, Lens, Lines, Mark, Plan, Points, Seen, Soft
from lrf3d.scene.stage import Stage, stage_of
from lrf3d.scene.structures import SIGHT_DISTANCE
from lrf3d.scene.timeline import Moment, Timeline, drive_keys

LAYERS = (
    "shadow", "goal", "trail", "estimate", "beams", "map", "points", "marker", "inset", "hud",
)  # fmt: skip
"""What can be left out of a picture; what is left out costs nothing."""

Goal = tuple[float, float, float]
"""Where a robot is to arrive: x, y and radius [m]."""

_HALF_HAZE, _HALF_HAZE_INDOOR, _CLEAR = 190.0, 120.0, 2.6
"""Distance [m] at which half of what is seen is haze, and what it is at the least, in distances to
what is looked at: the whole is seen through clear air."""

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
but not where the map is laid over all."""

_PAST_GROUND = 3.0
"""How far an eye far above the ground sees, in its heights: past all of it, at a slant too."""

_BAND_PIXELS = 5.0
"""Least height of the map's bands in a picture of 720 lines [pixels]: they show from far away."""

_MAP_WIDTH, _HIDDEN_WIDTH, _HIDDEN_STRENGTH = 4.0, 2.6, 0.25
"""Width of the map as lines from above, and of what of its bands is hidden [pixels of 720 lines],
and the opacity of that."""

_PLAN_WIDTH, _DART_SHARE, _PALER, _LEAST_PLAN = 2.6, 0.034, 0.35, 4.0
"""Width of the map in the plan [pixels of 720 lines], the robot's size as a share of what it shows,
how much paler colours are on its dark ground, and its least size [m]: there may be no wall."""

_LASER_TINTS = np.array(
    [(1.0, 1.0, 1.0), (0.5, 1.2, 3.0), (0.6, 2.0, 0.9), (1.0, 0.7, 3.0)], np.float32
)
"""By what the colour of beams is multiplied, laser by laser."""

_TRAIL_FADE = 15.0
"""Time of the film [s] in which the trail fades."""

_HITS_FADE, _HITS_STRENGTH, _HIT_SIZE, _HIT_PIXELS, _OLD_SCANS = 2.5, 0.8, 0.05, (2.0, 4.0), 8
"""Time of the film [s] in which hits fade, their opacity at first, their size [m], the smallest and
largest in a picture of 720 lines [pixels], and the most scans that they are of."""


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
        self.robot = Body(robot_body(run.lrf.height, run.radius), np.eye(4))
        self.keys = drive_keys(timeline).thinned()
        self._goal = None if goal is None else goal_disc(np.array(goal) - [*self.origin, 0.0])
        self._turning = turning_walls(run.world)
        self._walls = run.world.segments - np.tile(self.origin, 2)
        self._reach = min(run.lrf.range_max, REACH_INDOOR if structures.indoor else REACH)
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
        bodies = [("robot", self.robot._replace(pose=world_from_robot(pose)))]
        bodies += self.obstacles.bodies(moment.time)
        if "map" in layers and not view.shows_map:
            least = 0.5 * _BAND_PIXELS * min(size) / 720.0 / lens.focus
            drawn, *_ = self._map(self.run.snapshot_after(moment.scan))
            bands = drawn.bands(lens.eye, least=least, raised=view.raised)
            bodies.append(("map", Body(bands, np.eye(4))))
        marks = tuple(
            (name, mark)
            for layer, name, mark in self._marks(moment, pose, view, lens, size)
            if layer in layers and mark is not None
        )
        seen = Seen(lens, tuple(bodies), marks, view.ghost)
        if view.cuts and self.structures.indoor:
            # Ghosts are as high as the walls of the map that stand up in them.
            highest = float(self.structures.heights.max(initial=0.0))
            seen = seen._replace(cut=look.SECTION + view.ghost * highest)
        return seen

    def _lens(self, view: Look, size: tuple[int, int]) -> Lens:
        far = max(SIGHT_DISTANCE, _PAST_GROUND * float(view.eye[2]))
        half = _HALF_HAZE_INDOOR if self.structures.indoor else _HALF_HAZE
        return Lens(
            matrix=view.matrix(size[0] / size[1], far),
            eye=view.eye,
            focus=float(0.5 * size[1] / np.tan(0.5 * view.field)),
            thick=0.0 if view.shows_map else 1.0 / max(half, _CLEAR * view.away),
            slack=0.0 if view.shows_map else _SLACK,
            nearer=_ON_TOP if view.shows_map else _WALL_NEARER,
        )

    def _marks(
        self, moment: Moment, pose: Float, view: Look, lens: Lens, size: tuple[int, int]
    ) -> Iterator[tuple[str, str, Mark | None]]:
        """Layer, name and mark, in the order in which they are drawn."""
        yield "shadow", "shadow", robot_shadow(pose, self.run.radius, indoor=self.structures.indoor)
        yield "shadow", "shadows", self.obstacles.shadows(moment.time)
        yield "goal", "goal", self._goal
        yield from self._trails(moment.time)
        beams = self._beams(moment.scan, *moment.pose) if moment.scanning else None
        if beams is not None:
            yield "beams", "beams", beams[0]
        _, above, hidden, _ = self._map(self.run.snapshot_after(moment.scan))
        if view.shows_map:
            yield "map", "map lines", above
        elif view.raised == 0.0:
            yield "map", "hidden", hidden
        yield "points", "recent", self._recent_hits(moment)
        if beams is not None:
            yield "points", "points", beams[1]
        yield "marker", "marker", self._marker(pose, view, lens, size)

    def _drawn_map(self, stage: int) -> tuple[DrawnMap, Lines, Lines, Lines]:
        """A map snapshot, and its lines from above, where they are hidden, and in the plan."""
        drawn = DrawnMap.from_snapshot(self.run, stage, self.structures)
        above = drawn.lines(self.run.lrf.height, _MAP_WIDTH)
        hidden = drawn.lines(float(np.mean(BAND)), _HIDDEN_WIDTH, _HIDDEN_STRENGTH)
        plan = drawn.lines(0.0, _PLAN_WIDTH)
        pale = plan.colours + np.float32(_PALER) * (1.0 - plan.colours)
        return drawn, above, hidden._replace(hidden=True), plan._replace(colours=pale)

    def _drawn_trails(self, time: float) -> tuple[tuple[str, str, Lines], ...]:
        """Layer, name and lines of the trails up to a time [s]."""
        now, found = time - self.timeline.start, []
        # Of a recorded drive only the estimate is known, which is drawn as such.
        if self.run.knows_truth:
            fade = _TRAIL_FADE * self.timeline.playback
            found.append(("trail", "trail", trail_lines(self.keys, now, fade)))
        if self._estimate is not None:
            found.append(("estimate", "estimate", self._estimate.trail(now)))
            found.append(("estimate", "ellipses", self._estimate.rings(now)))
        return tuple(found)

    def _drawn_beams(self, number: int, *pose: float) -> tuple[Lines, Points]:
        """The beams and hits of all lasers at a scan, from where the robot is now, if given."""
        run, origin = self.run, np.array([*self.origin, 0.0])
        robot = np.array(pose) if pose else run.trajectory.poses[number]
        drawn = []
        for laser, (lrf, scan) in enumerate(zip(run.lasers, run.scans_at(number), strict=True)):
            scan = unrolled(scan)
            lines, points = draw_beams(
                replace(scan, pose=np.array(scan.pose) - origin),
                self._walls,
                (lrf.placed(robot) - origin)[:2],
                self._turning,
                height=lrf.height,
                reach=self._reach,
                by=run.film.points_by,
            )
            tint = _LASER_TINTS[laser % len(_LASER_TINTS)]
            colours = np.minimum(lines.colours * tint, np.float32(1.0))
            drawn.append((lines._replace(colours=colours), points))
        if len(drawn) == 1:
            return drawn[0]
        lines, points = (
            first._replace(
                **{
                    name: np.concatenate([getattr(each, name) for each in (first, *others)])
                    for name in first._fields
                    if isinstance(getattr(first, name), np.ndarray)
                }
            )
            for first, *others in zip(*drawn, strict=True)
        )
        return lines, points

    def _recent_hits(self, moment: Moment) -> Points:
        """The hits of the last seconds, which fade."""
        times, lasting = self.run.trajectory.times, _HITS_FADE * self.timeline.playback
        first = int(np.searchsorted(times, moment.time - lasting))
        last = moment.scan if moment.scanning else moment.scan + 1
        step = 1 + (last - first) // _OLD_SCANS
        chosen = tuple(number for number in range(first, last) if number % step == 0)
        hits, counts = self._recent(chosen)
        left = np.clip(1.0 - (moment.time - times[list(chosen)]) / lasting, 0.0, 1.0)
        colours = hits.colours.copy()
        colours[:, 3] = np.repeat(_HITS_STRENGTH * left, counts)
        return hits._replace(colours=colours)

    def _hits_together(self, chosen: tuple[int, ...]) -> tuple[Points, list[int]]:
        """The hits of chosen scans, and the number of each."""
        each = [self._hits(number)[:3] for number in chosen]
        none: tuple[Single, ...] = tuple(np.zeros((0, k), np.float32) for k in (3, 4, 2))
        places, colours, sides = (np.concatenate(part) for part in zip(none, *each, strict=True))
        points = Points(places, colours, sides, _HIT_SIZE, _HIT_PIXELS, glows=False)
        return points, [len(part[0]) for part in each]

    def _marker(self, pose: Float, view: Look, lens: Lens, size: tuple[int, int]) -> Soft | None:
        """An arrow over a robot that is too small to be seen."""
        place = np.array([*pose[:2], self.run.lrf.height])
        away = float(np.linalg.norm(place - lens.eye))
        pixel = min(size) / 720.0 * away / lens.focus
        if _ROBOT_SIZE > _LEAST_ROBOT * pixel:
            return None
        dart = flat_dart(pose, _MARKER * pixel, place[2])
        # Seen from the eye, what is drawn smaller and nearer is the same.
        share = max(_MARKER_NEARER, 1.5 * view.near / away)
        corners = lens.eye + share * (dart.corners - lens.eye)
        return dart._replace(corners=corners.astype(np.float32))

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
        *_, lines = self._map(self.run.snapshot_after(moment.scan))
        marks: list[tuple[str, Mark | None]] = [("map", lines)]
        if moment.scanning:
            _, hits = self._beams(moment.scan, *moment.pose)
            marks.append(("points", hits._replace(glows=False)))
        marks += [(name, line) for _, name, line in self._trails(moment.time)]
        marks.append(("obstacles", self.obstacles.plans(moment.time, window / box[2])))
        marks.append(("robot", flat_dart(pose, _DART_SHARE * window, 0.0)))
        return Plan(box, lens, tuple((f"plan {name}", mark) for name, mark in marks if mark))

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
