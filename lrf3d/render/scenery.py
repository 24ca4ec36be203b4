"""The scene of a run: all that can be seen in it, as layers of primitives.

A frame enters, which is worked out once for a picture; each layer brings its own primitives up to
it and gives what is drawn. No layer needs another to have been drawn before.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lrf3d.geometry import Float, Int, Single
from lrf3d.render.bindings import GL, pyrender
from lrf3d.render.estimate_layer import EstimateLayer
from lrf3d.render.ground_layer import GroundLayer
from lrf3d.render.moving_bodies import MovingBodies
from lrf3d.render.parts import build_walls
from lrf3d.render.primitives import Draw, Mesh, Primitive
from lrf3d.scene import look
from lrf3d.scene.beams import LINE_SIZES, POINT_SIZES, DrawnBeams, beam_reach
from lrf3d.scene.bodies import goal_disc, robot_arrow, robot_mesh, world_from_robot
from lrf3d.scene.camera import Look
from lrf3d.scene.estimate import DrawnEstimate
from lrf3d.scene.map_bands import BAND_SIZES, GLOW, SOLID, WallTops
from lrf3d.scene.stage import Stage, stage_of
from lrf3d.scene.timeline import Moment, Timeline, drive_keys
from lrf3d.scene.trail_and_map import (
    RIBBON_SIZES,
    DrawnMap,
    legs_begun,
    smoothed,
    thinned,
    trail_ribbon,
)
from lrf3d.scene.turns import WallOptics

_BLOB_RADIUS, _BLOB_DARKNESS, _BLOB_SHIFT = 0.52, 0.55, 0.16
"""Radius of the robot's shadow [m], its darkness in the middle, and how far it lies from the robot
where the sun shines, as a part of the level way to the sun."""

_THINNEST_TRAIL, _THINNEST_UNDER = 0.9, 2.0
"""Half the width of the trail [pixels at 720 lines] that it has at the least, by itself and under
that of an estimate."""

_BEAM_WIDTH, _TRACE_WIDTH, _MAP_WIDTH, _THROUGH_WIDTH = 0.9, 1.6, 4.0, 1.8
"""Widths of lines [pixels at 720 lines]."""

_BEAM_NEARER, _WALL_NEARER = 0.02, 0.12
"""How much nearer to the eye [m] beams, and marks on walls, are than what they may lie in."""

_ROBOT_SIZE, _LEAST_ROBOT, _MARKER = 0.75, 26.0, 10.0
"""Width of the robot [m]; a robot of fewer pixels than the second has an arrow over it, whose unit
is the third [pixels at 720 lines]."""

_MARKER_NEARER = 0.3
"""Share of the way from the eye to the robot at which that arrow is drawn."""

_GOAL_HEIGHT = 0.04
"""Height of a goal's disc over the ground [m]."""

_GROWING = 0.5
"""Time of the film [s] in which a wall of the map grows to its length."""

_ON_TOP = 1e6
"""The same, for marks [m] that nothing hides: from straight above, tops of walls would."""


Goal = tuple[float, float, float]
"""Where a robot is to arrive: x, y and radius [m]."""


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """What is to be seen in one picture, and from where.

    Args:
        moment: The moment of the run.
        pose: (3,) pose of the robot in the film's frame.
        look: The look of the camera.
        matrix: (4, 4) from the film's frame to the picture.
        eye: (3,) where the eye is [m].
        focus: Pixels that a metre takes at a distance of one metre.
        scale: How many times their size at 720 lines lines and points are.
        camera: What all programs know of it: ``view_projection``, ``eye``, ``viewport`` [pixels],
            ``slack``, by how much the depth of marks gains with their distance, and how ``thick``
            the air is [1/m].
    """

    moment: Moment
    pose: Float
    look: Look
    matrix: Float
    eye: Float
    focus: float
    scale: float
    camera: Mapping[str, Any]


class Scenery:
    """The primitives of a run.

    Args:
        timeline: The run, as time goes by in its film.
        goal: A goal to be marked on the ground.
        stage: What stands in the run's world, if it has been painted already.

    Attributes:
        scene: pyrender's scene of them.
        structures: What the walls make up.
        beams: The beams of the newest frame.
    """

    def __init__(
        self, timeline: Timeline, goal: Goal | None = None, stage: Stage | None = None
    ) -> None:
        run = self.run = timeline.run
        stage = stage or stage_of(run)
        self.structures = stage.structures
        self.origin = self.structures.origin
        self.scene = pyrender.Scene()
        self.walls = build_walls(self.structures, stage.walls)
        self.obstacles = MovingBodies(run.obstacles, self.origin, self.structures.indoor)
        self.ground = GroundLayer(stage, self.scene)
        self.beams: DrawnBeams | None = None
        self._optics = WallOptics.of(run.world)
        rows, indices = robot_mesh(run.lrf.height)
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]], np.float32)
        self._keys, self._start = thinned(smoothed(drive_keys(timeline))), timeline.start
        self._robot = Primitive("robot", (3, 3, 3), rows, indices=indices, cull=True)
        self._marker = Primitive("flat", (2, 4), robot_arrow(), blend=True)
        self._goal = goal
        self._disc = Primitive("flat", (2, 4), goal_disc(), blend=True) if goal else None
        self._sky = Primitive("sky", (2,), _mesh(10, 10))
        self._blob = Primitive("blob", (2,), corners, blend=True)
        self._trail = Primitive("trail", RIBBON_SIZES, trail_ribbon(self._keys), blend=True)
        # Of a recorded drive only the estimate is known, which is drawn as such.
        self._trail_is_true = run.knows_truth
        self._estimate = EstimateLayer(DrawnEstimate.from_timeline(timeline))
        self._fan = _dynamic("fan", (3, 2))
        self._lines = _dynamic("lines", LINE_SIZES)
        self._trace = _dynamic("lines", LINE_SIZES)
        self._dots = _dynamic("points", POINT_SIZES, mode=GL.GL_POINTS)
        self._map = _dynamic("lines", LINE_SIZES)
        self._bands = _dynamic("bands", BAND_SIZES, blend=False, pattern=SOLID)
        self._glow = _dynamic("bands", BAND_SIZES, pattern=GLOW)
        self._tops = WallTops(self.structures.segments, self.structures.heights)
        self._scan_shown: tuple[Any, ...] = ()
        self._map_shown = self._bands_shown = -1
        self._drawn_maps: dict[int, DrawnMap] = {}
        self._growing = _GROWING * timeline.playback
        self._fade = look.TRAIL_FADE * timeline.playback
        self._reach = beam_reach(run.lrf.range_max, self.structures)
        for primitive in (
            self._robot, self.walls.faces, self._sky, self._blob, self._trail, self._fan,
            self._lines, self._trace, self._dots, self._map, self._bands, self._glow, self._marker,
            *self.obstacles.all, *self._estimate.all, *((self._disc,) if self._disc else ()),
        ):  # fmt: skip
            self.scene.add(Mesh([primitive]))

    @property
    def constants(self) -> dict[str, Any]:
        """What is the same in all pictures: the haze's colour, indoor or not, and the ground's."""
        indoor = self.structures.indoor
        haze = look.HAZE_INDOOR if indoor else look.HAZE
        return {"HAZE": tuple(haze), "INDOOR": float(indoor), **self.ground.constants}

    @property
    def thick(self) -> float:
        """How thick the air is: one over the distance at which half is haze [1/m]."""
        return 1.0 / (look.HALF_HAZE_INDOOR if self.structures.indoor else look.HALF_HAZE)

    def draw_robot(self, frame: Frame) -> Iterator[Draw]:
        """The robot."""
        yield Draw(self._robot, {"world_from_robot": world_from_robot(frame.pose)})

    def draw_obstacles(self, frame: Frame) -> Iterator[Draw]:
        """The dynamic obstacles."""
        return self.obstacles.bodies(frame.moment.time)

    def draw_walls(self, frame: Frame) -> Iterator[Draw]:
        """Walls and roofs, near ones first."""
        self.walls.look_from(frame.matrix, frame.eye)
        yield Draw(self.walls.faces, {})

    def draw_ground(self, frame: Frame) -> Iterator[Draw]:
        """The ground, finely painted round the eye."""
        width, height = frame.camera["viewport"]
        # How much is seen to each side by an eye that looks down from far above [m].
        across = 0.5 * height / frame.focus * float(frame.eye[2]) * max(1.0, width / height)
        return self.ground.draws(frame.eye, across if frame.look.clear else 0.0, frame.focus)

    def draw_sky(self, frame: Frame) -> Iterator[Draw]:
        """The sky, where the picture has any."""
        horizon = frame.look.horizon
        if horizon < 1.0:
            # The picture is drawn upside down, so that the sky begins at the row of −1.
            band = (-1.0, -max(horizon, -1.0))
            yield Draw(self._sky, {"band": band, "ray_from_corner": np.linalg.inv(frame.matrix)})

    def draw_marker(self, frame: Frame) -> Iterator[Draw]:
        """An arrow over a robot that is too small to be seen; nothing hides it."""
        eye, place = frame.look.eye, np.array([*frame.pose[:2], self.run.lrf.height])
        away = float(np.linalg.norm(place - eye))
        pixel = frame.scale * away / frame.focus
        if _ROBOT_SIZE > _LEAST_ROBOT * pixel:
            return
        matrix = world_from_robot(frame.pose)
        matrix[:2, :2] *= _MARKER * pixel
        matrix[2, 3] = place[2]
        # Seen from the eye, what is drawn smaller and nearer is the same.
        share = max(_MARKER_NEARER, 1.5 * frame.look.near / away)
        nearer = share * np.eye(4)
        nearer[:3, 3], nearer[3, 3] = (1.0 - share) * eye, 1.0
        yield Draw(self._marker, {"place": nearer @ matrix})

    def draw_shadows(self, frame: Frame) -> Iterator[Draw]:
        """The shadows of what moves."""
        shift = -_BLOB_SHIFT * look.SUN[:2] * (0.0 if self.structures.indoor else 1.0)
        place = (*(frame.pose[:2] + shift).tolist(), _BLOB_RADIUS, _BLOB_DARKNESS)
        yield Draw(self._blob, {"blob": place})
        yield from self.obstacles.shadows(frame.moment.time)

    def draw_trail(self, frame: Frame) -> Iterator[Draw]:
        """The trail, as far as it is driven, and at no distance thinner than some pixels."""
        if not self._trail_is_true:
            return
        now = frame.moment.time - self._start
        self._trail.count = 6 * legs_begun(self._keys, now)
        metre = frame.focus / float(np.linalg.norm(frame.look.eye - frame.look.target))
        thinnest = _THINNEST_UNDER if self.run.estimate is not None else _THINNEST_TRAIL
        half_width = max(0.5 * look.TRAIL_WIDTH, thinnest * frame.scale / metre)
        uniforms = {"now": now, "half_width": half_width, "fade": 1.0 / self._fade}
        yield Draw(self._trail, uniforms)

    def draw_goal(self, frame: Frame) -> Iterator[Draw]:
        """The goal on the ground, if there is one."""
        if self._goal is not None and self._disc is not None:
            x, y, radius = self._goal
            matrix = np.diag([radius, radius, 1.0, 1.0])
            matrix[:3, 3] = x - self.origin[0], y - self.origin[1], _GOAL_HEIGHT
            yield Draw(self._disc, {"place": matrix})

    def draw_estimate(self, frame: Frame) -> Iterator[Draw]:
        """The estimated pose, and the estimated trail."""
        return self._estimate.draws(frame.moment.time - self._start, frame.scale, _over(frame))

    def draw_fan(self, frame: Frame) -> Iterator[Draw]:
        """The fan of all beams."""
        self._show_beams(frame)
        strength = look.FAN_STRENGTH_INDOOR if self.structures.indoor else look.FAN_STRENGTH
        yield Draw(self._fan, {"reach": self._reach, "strength": frame.look.fan * strength})

    def draw_beams(self, frame: Frame) -> Iterator[Draw]:
        """Single beams."""
        self._show_beams(frame)
        yield Draw(self._lines, {"width": _BEAM_WIDTH * frame.scale, "nearer": _BEAM_NEARER})

    def draw_map(self, frame: Frame) -> Iterator[Draw]:
        """The map as lines, over all; thin ones where it only shines through houses."""
        stage = self.run.snapshot_after(frame.moment.scan)
        if stage != self._map_shown:
            self._map_shown = stage
            self._map.update(self._drawn_map(stage).lines(self.run.lrf.height))
        width = _MAP_WIDTH if frame.look.shows_map else _THROUGH_WIDTH * frame.look.through
        yield Draw(self._map, {"width": width * frame.scale, "nearer": _ON_TOP})

    def draw_bands(self, frame: Frame) -> Iterator[Draw]:
        """The map as bands on the walls; from straight above, lines show it better."""
        if not frame.look.shows_map:
            self._show_bands(frame)
            yield Draw(self._bands, self._band(frame))

    def draw_glow(self, frame: Frame) -> Iterator[Draw]:
        """The glow of the bands on their walls."""
        if not frame.look.shows_map:
            self._show_bands(frame)
            yield Draw(self._glow, self._band(frame))

    def grown(self, moment: Moment) -> float:
        """Share 0…1 of the way that walls have grown since the map before."""
        stage = self.run.snapshot_after(moment.scan)
        if stage < 0:
            return 1.0
        since = self.run.trajectory.times[self.run.snapshot_scans[stage]]
        share = min(1.0, (moment.time - float(since)) / self._growing)
        return share * (2.0 - share)

    def _band(self, frame: Frame) -> dict[str, Any]:
        """The uniforms of bands: how far they have grown, and their sizes."""
        low, high = look.MAP_BAND
        least = 0.5 * look.BAND_PIXELS * frame.scale / frame.focus
        sizes = (0.5 * look.MAP_WIDTH, 0.5 * (high - low), least)
        return {"grown": self.grown(frame.moment), "band": sizes}

    def _show_bands(self, frame: Frame) -> None:
        """Bring the bands up to a frame."""
        stage = self.run.snapshot_after(frame.moment.scan)
        if stage == self._bands_shown:
            return
        self._bands_shown = stage
        before, drawn = self._drawn_map(max(stage - 1, -1)), self._drawn_map(stage)
        bands = drawn.bands_from(before, self._tops)
        self._bands.update(bands.solid)
        self._glow.update(bands.glow)

    def _drawn_map(self, stage: int) -> DrawnMap:
        """The map of a snapshot; the last two are kept, as each is shown more than once."""
        drawn = self._drawn_maps.get(stage)
        if drawn is None:
            drawn = DrawnMap.from_snapshot(self.run, stage, self.origin)
            kept = list(self._drawn_maps.items())[-1:]
            self._drawn_maps = dict([*kept, (stage, drawn)])
        return drawn

    def draw_trace(self, frame: Frame) -> Iterator[Draw]:
        """The line on the walls where the scan hit them."""
        self._show_beams(frame)
        yield Draw(self._trace, {"width": _TRACE_WIDTH * frame.scale, "nearer": _over(frame)})

    def draw_points(self, frame: Frame) -> Iterator[Draw]:
        """The reflection points."""
        self._show_beams(frame)
        sizes = (look.POINT_SIZE, *(frame.scale * size for size in look.POINT_PIXELS))
        uniforms = {"nearer": _over(frame), "focus": frame.focus, "sizes": sizes}
        yield Draw(self._dots, uniforms)

    def _show_beams(self, frame: Frame) -> None:
        """Bring all that shows a scan up to a frame, once for all its layers."""
        moment, place = frame.moment, frame.pose[:2]
        obstacles = self.obstacles.poses(moment.time)
        shown = (moment.scan, moment.scanning, *place, obstacles.tobytes())
        if shown == self._scan_shown:
            return
        self._scan_shown = shown
        height = self.run.lrf.height
        if not moment.scanning:
            for primitive in (self._fan, self._lines, self._trace, self._dots):
                primitive.update(np.zeros(0, np.float32))
            return
        scan = self.run.scan(moment.scan)
        local = replace(scan, pose=np.array(scan.pose) - [*self.origin, 0.0])
        world = self.run.world
        walls = world.segments - np.tile(self.origin, 2)
        carry = self.obstacles.carrying(moment.time)
        self.beams = DrawnBeams.from_scan(local, walls, world.objects, place, carry, self._optics)
        self._fan.update(self.beams.fan(height))
        self._lines.update(self.beams.lines(height, self._reach))
        self._trace.update(self.beams.trace(height))
        by = self.run.film.points_by
        self._dots.update(self.beams.dots(height, self.run.lrf.range_max, by=by))


def _over(frame: Frame) -> float:
    """How much nearer to the eye marks on walls are [m]."""
    return _ON_TOP if frame.look.shows_map else _WALL_NEARER


def _mesh(columns: int, rows: int) -> Single:
    """Corners (6 · columns · rows, 2) of the triangles of a mesh over −1…1."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    first = np.column_stack([x.ravel(), y.ravel()])
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]])
    places = (first[:, None] + corners) / [columns, rows]
    return np.asarray((2.0 * places - 1.0).reshape(-1, 2), np.float32)


def _dynamic(
    program: str,
    sizes: tuple[int, ...],
    mode: int = GL.GL_TRIANGLES,
    *,
    blend: bool = True,
    pattern: Int | None = None,
) -> Primitive:
    empty = np.zeros((0, sum(sizes)), np.float32)
    return Primitive(program, sizes, empty, mode=mode, capacity=2048, blend=blend, pattern=pattern)
