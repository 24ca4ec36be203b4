"""The scene of a run at a moment, as a value: see :mod:`lrf3d.studio.scene.shapes`.

A moment of the run and a look enter; what is to be seen leaves. What has not changed since the
moment before is the same object again, so that nothing is made or sent twice.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from lrf3d.base.latest import Latest
from lrf3d.geometry.lines import Float
from lrf3d.laser.unrolling import unrolled
from lrf3d.studio.scene import bodies, look
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.cameras import places_of
from lrf3d.studio.scene.clouds import draw_clouds
from lrf3d.studio.scene.drift import GHOST_COLOUR, Drift
from lrf3d.studio.scene.glass import Panes, bounced, some_beams
from lrf3d.studio.scene.inset import InsetView, lens_from_above
from lrf3d.studio.scene.marks import TRAIL_FADE, DrawnEstimate, DrawnMap, draw_beams, trail_lines
from lrf3d.studio.scene.pins import Pins, pointing, share_of
from lrf3d.studio.scene.shapes import (
    ON_TOP,
    UNCUT,
    Inset,
    Lens,
    Lines,
    Mark,
    Points,
    PosedFaces,
    Seen,
    Soft,
    Tints,
    level_lines,
    single,
    together,
)
from lrf3d.studio.scene.shots import PROOF
from lrf3d.studio.scene.stage.exposure import WAVE_GAP, LiveExposure
from lrf3d.studio.scene.stage.stage import Stage, stage_of
from lrf3d.studio.scene.stage.structures import SIGHT_DISTANCE, outlines_of
from lrf3d.studio.scene.subject import beams_told, subject_of
from lrf3d.studio.scene.timeline import Moment, Timeline, drive_keys, obstacle_keys

# Optional layers; a disabled layer is neither built nor drawn.
LAYERS = (
    "outlines", "shadow", "goal", "trail", "estimate", "lamp", "beams", "map", "points", "marker",
    "inset", "hud",
)  # fmt: skip

# Further marks of films and pages, drawn over those of a scene, by the names of their layers. Each
# is a function that returns a mark in the film's frame for a scene and a moment, or None.
MARKS: dict[str, Callable[["Scene", Moment], Mark | None]] = {}

# Where a robot is to arrive: x, y and radius [m].
Goal = tuple[float, float, float]

# How much nearer to the eye the depth of marks is than that of walls [m].
_WALL_NEARER = 0.12

# By how much the depth of marks gains with their distance [m/m], as depths are coarser far away.
_SLACK = 0.002

# Least distance at which half of what is seen is haze, in distances of the target: the whole is
# seen through clear air.
_CLEAR = 2.6

# Far plane of a high camera, in multiples of its height: past all of the ground.
_PAST_GROUND = 3.0

# Size of the robot in the inset, in the inset's width.
_DART_SHARE = 0.034

# Factors of the colour of beams, laser by laser.
_LASER_TINTS = np.array(
    [(1.0, 1.0, 1.0), (0.5, 1.2, 3.0), (0.6, 2.0, 0.9), (1.0, 0.7, 3.0)], np.float32
)

# How much wider walls are that have the colour of their robot: of those, some are lost.
_CLEARER = 1.5

# Diameter of a point of the inset [m], at least and at most [pixels of 720 lines].
_SPOT = 0.1, (6.0, 12.0)

# Diameter of the end of a beam that tells what the film is about, likewise.
_FLARE = 0.15, (9.0, 16.0)

# Number of points of a lidar's scan.
_CLOUD_POINTS = 4000

# Width of a robot [m].
_ROBOT_SIZE = 0.75

# Width of the smallest robot that is seen without an arrow over it [pixels of 720 lines].
_LEAST_ROBOT = 32.0

# Unit of that arrow [pixels of 720 lines].
_MARKER = 10.0


class Scene:
    """All that can be seen of a run, with a goal on the ground where one is given.

    What stands in the run's world may have been painted already. A live one is lit by scans as they
    come. Of a team of robots, each of a run, walls have the colour of the one that found them; so
    do those of a run that meets other robots.
    """

    def __init__(
        self,
        timeline: Timeline,
        goal: Goal | None = None,
        stage: Stage | None = None,
        *,
        live: bool = False,
        team: Mapping[Any, look.Colour | None] | None = None,
    ) -> None:
        run = self.run = timeline.run
        self.timeline = timeline
        self.stage = stage or stage_of(run)
        structures = self.structures = self.stage.structures
        self.exposure = self.stage.exposure
        self.live = LiveExposure(self.exposure, structures) if live else None
        self.origin = structures.origin
        self._frame = np.array([*self.origin, 0.0])
        self._height = run.lasers[0].height
        self.obstacles = bodies.Obstacles(run.obstacles, self.origin, laser_height=self._height)
        self.robot = PosedFaces(bodies.robot_body(self._height, run.radius), np.eye(4))
        self.keys = drive_keys(timeline).thinned()
        self._robots = [
            (obstacle_keys(robot, timeline).thinned(), colour)
            for robot, colour in bodies.robots_of(run.obstacles)
        ]
        self._goal = None if goal is None else bodies.goal_disc(goal - self._frame)
        self._walls = run.world.segments - np.tile(self.origin, 2)
        self._mirrors = structures.segments[structures.mirrors]
        self._outlines = outlines_of(structures)
        self._estimate = DrawnEstimate.from_timeline(timeline)
        self.drift = Drift.of(run, self.origin)
        # Among robots, a colour is a robot, not when a wall was found.
        own = look.TRAIL_COLOUR if self._robots else None
        self.team: Mapping[Any, look.Colour | None] = team or {run: own}
        # The runs, by name, whose missed walls are shown in the end; if empty, this one.
        self.judged: Mapping[str, Any] = {}
        self._panes = Latest(2)
        self._maps = Latest()
        self._beams = Latest()
        self._clouds = Latest()
        self._trails = Latest()

    def seen(
        self, moment: Moment, view: Look, size: tuple[int, int], layers: Collection[str] = LAYERS
    ) -> Seen:
        """What is to be seen at a moment through a look, in a picture of a size [pixels]."""
        pose = moment.pose - self._frame
        lens = self._lens(view, size)
        stands = bodies.world_from_robot(pose)
        stands[:3, :3] = self._lean(moment.scan) @ stands[:3, :3]
        marks = tuple(
            (name, mark)
            for layer, name, mark in self._marks(moment, pose, view, lens, size)
            if (layer in layers or layer in MARKS) and mark is not None
        )
        return Seen(
            lens,
            (
                ("robot", self.robot._replace(pose=stands)),
                *self.obstacles.bodies(moment.time),
            ),
            marks,
            self.exposure.clock(moment.now, self.timeline.playback),
            tints=self._snapshot(moment).tints if "map" in layers else None,
            dusk=view.dusk,
            cut=self._cut(view),
        )

    def _lean(self, number: int) -> Float:
        """The rotation (3, 3) of a robot that leans at a scan, relative to a level one."""
        if self.run.attitudes is None:
            return np.eye(3)
        from scipy.spatial.transform import Rotation

        theta = self.run.trajectory.poses[number, 2]
        lean = Rotation.from_euler("ZYX", [theta, *self.run.attitudes[number]])
        return np.asarray((lean * Rotation.from_euler("Z", -theta)).as_matrix())

    def _lens(self, view: Look, size: tuple[int, int]) -> Lens:
        wide, tall = size
        *_, eye_height = view.eye.tolist()
        lens = Lens(
            matrix=view.matrix(wide / tall, max(SIGHT_DISTANCE, _PAST_GROUND * eye_height)),
            eye=view.eye,
            focus=float(0.5 * tall / np.tan(0.5 * view.field)),
            thick=1.0 / max(look.HAZY, _CLEAR * view.away),
            slack=_SLACK,
            nearer=_WALL_NEARER,
        )
        # The map is laid over all: from straight above, tops of walls would hide it.
        return lens._replace(thick=0.0, slack=0.0, nearer=ON_TOP) if view.shows_map else lens

    def _marks(
        self, moment: Moment, pose: Float, view: Look, lens: Lens, size: tuple[int, int]
    ) -> list[tuple[str, str, Mark | None]]:
        """Layer, name and mark, in the order in which they are drawn."""
        beams, hits, lamp = self._beams_at(moment)
        telling = [*self._telling_beams(moment, view.shot)]
        if telling and view.shot == PROOF:
            beams = None
        drawn = self._snapshot(moment)
        playback = self.timeline.playback
        drifted = self.drift.marks(moment, view.shot, playback) if self.drift else ()
        along = [("map", "ghosts", drawn.ghosts), ("map", "bands", drawn.bands)]
        return [
            *self._edges(moment, view),
            ("shadow", "shadow", bodies.robot_shadow(pose, self.run.radius)),
            ("shadow", "shadows", self.obstacles.shadows(moment.time)),
            ("trail", "past", self.obstacles.past(moment.time, self.timeline.playback)),
            ("goal", "goal", self._goal),
            *(("estimate", name, mark) for name, mark in drifted),
            *self._trails_at(moment.time),
            ("lamp", "lamp", lamp),
            ("beams", "beams", beams),
            *telling,
            *([("map", "map lines", drawn.above)] if view.shows_map else along),
            *self._pinned(view, size),
            ("points", "clouds", self._clouds_at(moment, view)),
            ("points", "points", hits),
            *((layer, layer, draw(self, moment)) for layer, draw in MARKS.items()),
            ("marker", "marker", self._markers(moment.time, pose, lens, size)),
        ]

    def _edges(self, moment: Moment, view: Look) -> Iterator[tuple[str, str, Mark]]:
        """Edges of houses or of walls that are cut, of glass and mirrors, and panes of glass."""
        if view.cuts or not self.structures.indoor:
            yield "outlines", "outlines", self._outlines
        if (self.structures.glass | self.structures.mirrors).any():
            cut = self._cut(view)
            exposure = None if self.live else self.exposure
            panes = self._panes.of(cut, partial(Panes.of, self.structures, cut, exposure))
            now, _ = self.exposure.clock(moment.now, self.timeline.playback)
            yield "outlines", "panes", panes.faces(view.eye, now)
            yield "outlines", "edges", panes.edges

    def _snapshot(self, moment: Moment) -> "_Snapshot":
        # Robots scan at times of their own.
        when = moment.time if moment.mapped >= 0 else -np.inf
        key = tuple(
            run.snapshot_after(
                moment.mapped
                if run is self.run
                else int(np.searchsorted(run.trajectory.times, when, "right")) - 1
            )
            for run in self.team
        )
        return self._maps.of(key, partial(self._drawn_map, key))

    def _drawn_map(self, numbers: tuple[int, ...]) -> "_Snapshot":
        exposure = self.exposure
        known = self.live.exposure if self.live else exposure
        parts = [
            DrawnMap.from_snapshot(run, number, self.structures, known, colour)
            for (run, colour), number in zip(self.team.items(), numbers, strict=True)
        ]
        drawn = DrawnMap(
            np.concatenate([part.segments for part in parts]),
            np.concatenate([part.colours for part in parts]),
        )
        wide = 2.0 * exposure.tolerance / exposure.cell
        flat = lens_from_above(exposure.corner + 0.5 * exposure.size, exposure.size)
        return _Snapshot(
            bands=drawn.bands(self.structures),
            above=drawn.lines(self._height, look.BOLD),
            inset=drawn.lines(0.0, look.BOLD),
            ghosts=drawn.ghosts(self.structures, exposure.tolerance),
            tints=Tints(flat, drawn.longer(0.5 * WAVE_GAP).lines(0.0, wide)),
        )

    def _trails_at(self, time: float) -> tuple[tuple[str, str, Lines], ...]:
        return self._trails.of(time, partial(self._drawn_trails, time - self.timeline.start))

    def _drawn_trails(self, now: float) -> tuple[tuple[str, str, Lines], ...]:
        found = []
        fade = TRAIL_FADE * self.timeline.playback
        # Of a recorded drive only the estimate is known, which is drawn as such.
        if self.run.knows_truth:
            found.append(("trail", "trail", trail_lines(self.keys, now, fade)))
        for number, (keys, colour) in enumerate(self._robots):
            found.append(("trail", f"trail {number}", trail_lines(keys, now, fade, colour)))
        if self._estimate is not None:
            trail = trail_lines(self._estimate.keys, now, fade, look.ESTIMATE_COLOUR)
            found.append(("estimate", "estimate", trail))
            found.append(("estimate", "ellipses", self._estimate.rings(now)))
        return tuple(found)

    def _beams_at(self, moment: Moment) -> tuple[Lines | None, Points | None, Soft | None]:
        """Beams, hits and lamps of all lasers, from where the robot is now; none while it glides.

        The latest scan of a live scene has one number while it changes with what moves.
        """
        if not moment.scanning:
            return None, None, None
        key = moment.scan, moment.pose.tobytes(), moment.time if self.live else None
        return self._beams.of(key, partial(self._drawn_beams, moment.scan, moment.pose))

    def shine(self, time: float) -> list[tuple[str, Mark]]:
        """The beams of this robot and what they hit, for the picture of another one."""
        shone = self._beams_at(self.timeline.moment(time))
        names = (f"{what} from {id(self)}" for what in ("beams", "points", "lamp"))
        return [(name, mark) for name, mark in zip(names, shone, strict=True) if mark]

    def _clouds_at(self, moment: Moment, view: Look) -> Points | None:
        """What lidars hit at the newest scan; None without lidars."""
        if not moment.scanning:
            return None
        key = moment.scan, moment.time if self.live else None, self._cut(view)
        return self._clouds.of(key, partial(self._drawn_clouds, moment.scan, key[2]))

    def _drawn_clouds(self, number: int, cut: float) -> Points | None:
        scans, _ = self.run.clouds(number)
        return draw_clouds(scans, self.origin, _CLOUD_POINTS, cut, self.run.film.points_by)

    def _cut(self, view: Look) -> float:
        """The height above which nothing is drawn [m]."""
        is_cut = view.cuts and self.structures.indoor
        return look.SECTION + view.above if is_cut else UNCUT

    def _drawn_beams(self, number: int, robot: Float) -> tuple[Lines, Points, Soft]:
        """Beams, hits and lamps of all lasers at a scan, with the robot at a pose (3,)."""
        run = self.run
        drawn = []
        for laser, (lrf, scan) in enumerate(zip(run.lasers, run.scans_at(number), strict=True)):
            scan = unrolled(scan)
            scan = replace(scan, pose=np.array(scan.pose) - self._frame)
            lines, *others = draw_beams(
                scan,
                self._walls,
                self._mirrors,
                (lrf.placed(robot) - self._frame)[:2],
                height=lrf.height,
                reach=min(run.lasers[0].range_max, self.structures.setting.beams),
                by=run.film.points_by,
            )
            tint = _LASER_TINTS[laser % len(_LASER_TINTS)]
            colours = np.minimum(lines.colours * tint, np.float32(1.0))
            drawn.append((lines._replace(colours=colours), *others))
        lines, points, light = map(together, zip(*drawn, strict=True))
        if run.attitudes is not None:
            # Level beams turn with the robot, around where it stands.
            centre = run.trajectory.poses[number] * [1.0, 1.0, 0.0] - self._frame
            lean = self._lean(number)
            starts, ends, places = (
                single(centre + (each - centre) @ lean.T)
                for each in (lines.starts, lines.ends, points.places)
            )
            lines = lines._replace(starts=starts, ends=ends)
            points = points._replace(places=places)
        return lines, points, light

    def _telling_beams(self, moment: Moment, shot: str) -> Iterator[tuple[str, str, Mark | None]]:
        """Beams at glass and reflectors, and one that a mirror turns; by hand, all are equal."""
        if self.live or not moment.scanning:
            return
        apex = self.run.lasers[0].placed(moment.pose)[:2] - self.origin
        told = beams_told(self.run, moment, self.timeline.playback, shot)
        for number, beams in enumerate(told):
            lines = some_beams(apex, beams, self.origin, self._height)
            yield "beams", f"telling beams {number}", lines
            yield "points", f"flares {number}", _spots(lines.ends, beams.colour, _FLARE)
        aim = subject_of(self.run, self.timeline.playback).aim_at(moment.time)
        if aim is not None:
            scan = unrolled(self.run.scans_at(moment.scan)[0])
            scan = replace(scan, pose=np.array(scan.pose) - self._frame)
            turned = bounced(scan, self._mirrors, apex, aim - self.origin, self._height)
            yield "beams", "turned beam", turned

    def pins(self, view: Look, size: tuple[int, int]) -> Pins:
        """Pins at the walls that maps miss, in the end; robots share their walls."""
        missed = self.judged or {"": self.run}
        runs = missed if view.shot == "end" and not self._robots else {}
        place = self._frame - [0.0, 0.0, self._height]
        return Pins.of(runs, share_of(size) * view.away, place)

    def _pinned(self, view: Look, size: tuple[int, int]) -> Iterator[tuple[str, str, Mark]]:
        """In the end, pins at what the story was about, and at the walls that the map misses."""
        if view.shot == "end":
            pinned = subject_of(self.run, self.timeline.playback).pinned - self.origin
            yield "map", "pinned", pointing(pinned, self._height, view, share_of(size))
            yield "map", "lost", self.pins(view, size).mark

    def _markers(self, time: float, pose: Float, lens: Lens, size: tuple[int, int]) -> Soft | None:
        """An arrow over a robot that is too small to be seen, and what moves round it as large."""
        away = float(np.linalg.norm([*pose[:2], self._height] - lens.eye))
        pixel = look.scale(size) * away / lens.focus
        if _ROBOT_SIZE > _LEAST_ROBOT * pixel:
            return None
        dart = _MARKER * pixel
        parts = [bodies.flat_dart(pose, dart, self._height), *self.obstacles.from_above(time, dart)]
        marks: Soft = together(parts)
        return marks._replace(on_top=True)

    def inset(
        self,
        moment: Moment,
        view: InsetView,
        colours: Sequence[look.Colour] = (),
        lost: Float = look.NOTHING,
    ) -> Inset:
        """The map so far from straight above, on what was seen: what is not known is dark.

        Where its walls and its robot have colours, no others are drawn but those of a team. Lost
        walls (n, 4) are red.
        """
        pose = moment.pose - self._frame
        _, hits, _ = self._beams_at(moment)
        dart = _DART_SHARE * view.width * max(1.0, view.aspect) ** 0.5
        trails: dict[str, Mark] = {name: line for _, name, line in self._trails_at(moment.time)}
        others = self.obstacles.from_above(moment.time, dart)
        walls = self._snapshot(moment).inset
        if colours:
            now = moment.time - self.timeline.start
            trails = {"trail": trail_lines(self.keys, now, np.inf, colours[1])}
            others = []
            walls = walls._replace(width=_CLEARER * walls.width)
        tint = colours[1] if colours else look.ROBOT
        if self.drift and view.close:
            playback = self.timeline.playback
            ghost, _ = self.drift.seen(moment, playback).ends(moment.time)
            others = [bodies.flat_dart(ghost, dart, 0.0, GHOST_COLOUR)]
            trails = {**dict(self.drift.marks(moment, "", playback)), **trails}
            tint = look.ESTIMATE_COLOUR
        red = np.tile(look.FALSE_COLOUR, (len(lost), 1))
        start, end = np.hsplit(lost - np.tile(self.origin, 2), 2)
        robot = bodies.flat_dart(pose, dart, 0.0, tint)
        marks: list[tuple[str, Mark | None]] = [
            ("points", hits and hits._replace(glows=False)),
            ("map", walls),
            ("lost", level_lines(0.0, start, end, red, np.ones((len(lost), 2)), 2.0 * walls.width)),
            *trails.items(),
            ("robot", together([*others, robot])),
        ]
        return Inset(
            view.lens(pose[:2]),
            tuple((f"plan {name}", mark) for name, mark in marks if mark),
            self.exposure.clock(moment.now, self.timeline.playback),
        )

    def spots(self, places: Float) -> Points:
        """Places in the world (n, 2) as points of the inset."""
        level = np.insert(places - self.origin, 2, 0.0, axis=1)
        return _spots(level, look.EMBER, _SPOT)._replace(glows=False)

    def inset_view(self, *shape: float, turns: bool = False, compared: bool = False) -> InsetView:
        """What the inset shows: the whole world or, in a large one, what is around the robot.

        A false room is in it, too, but not where it is compared: each run has its own.
        """
        places = [
            self.run.trajectory.poses[:, :2] - self.origin,
            places_of(self.run, self.structures),
        ]
        alone = not (self.live or compared)
        subject = subject_of(self.run, self.timeline.playback) if alone else None
        if subject and subject.aim is not None:
            places.append(subject.places - self.origin)
        return InsetView.of(np.concatenate(places), *shape, turns=turns)


def _spots(places: Any, colour: look.Colour, diameter: tuple[float, tuple[float, float]]) -> Points:
    """Places (n, 3) as points of one colour."""
    colours = np.tile([*colour, 1.0], (len(places), 1))
    return Points(single(places), single(colours), single(0.0 * places[:, :2]), *diameter)


class _Snapshot(NamedTuple):
    """What is drawn of a map snapshot."""

    # Along the walls.
    bands: Lines
    # From straight above.
    above: Lines
    # In the inset.
    inset: Lines
    # Where there is no wall.
    ghosts: Soft
    # In the colours of walls.
    tints: Tints
