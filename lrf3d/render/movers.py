"""Drawing dynamic obstacles: their bodies, and their shadows on the ground.

Enters: a run and a time of it. Leaves: primitives in the film's frame. Bodies are drawn by the
robot's program, each at its own pose, so that both renderers can draw them.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float
from lrf3d.render.arrays import Single
from lrf3d.render.ground import SUN
from lrf3d.render.palette import MOVERS
from lrf3d.render.primitives import Primitive
from lrf3d.render.robot_model import world_from_robot

if TYPE_CHECKING:
    from lrf3d.casting.mover import Mover

_BASE, _BEVEL = 0.10, 0.06
"""Height of the dark foot of a body, and width of its slanted upper edge [m]."""

_SHARPEST = 0.77
"""Cosine of the angle between two sides from which on their edge is drawn sharp."""

_NEAR = 0.3
"""How far off a body [m] a return is still one of it: noise moves it by as much."""

_SHADE, _SHADE_INDOOR = 0.42, 0.30
"""Darkness of the shadow on the ground."""

_FRINGE, _FRINGE_INDOOR = 0.08, 0.35
"""Width of the soft edge of the shadow [m]: in the sun it is narrow, in a lit room wide."""

_LIFT = 0.01
"""Height of the shadow above the ground [m]."""

_LEAST = 2.5
"""Least half size of a body in the inset [pixels], so that it can be seen."""


def mover_colours(movers: "tuple[Mover, ...]") -> Float:
    """Colours (m, 3) of dynamic obstacles, 0…1."""
    return np.asarray(MOVERS[np.arange(len(movers)) % len(MOVERS)])


def mover_bodies(movers: "tuple[Mover, ...]") -> list[Single]:
    """Triangles (v, 9) of each body, in its own frame: position [m], normal, colour."""
    return [
        _body(_counter_clockwise(mover.outline), mover.height, colour)
        for mover, colour in zip(movers, mover_colours(movers), strict=True)
    ]


class MovingBodies:
    """Draws the dynamic obstacles of a run; nothing if there are none.

    Args:
        movers: The dynamic obstacles.
        origin: (2,) of the film's frame in the world [m].
        indoor: Whether this is the inside of a house, where no sun shines.
    """

    def __init__(self, movers: "tuple[Mover, ...]", origin: Float, indoor: bool) -> None:
        self._movers = movers
        self._origin = np.array([*origin, 0.0])
        self._indoor = indoor
        self._outlines = [_counter_clockwise(mover.outline) for mover in movers]
        colours = mover_colours(movers)
        self._bodies = [
            Primitive("robot", (3, 3, 3), body, cull=True) for body in mover_bodies(movers)
        ]
        self._plans = [
            Primitive("flat", (2, 4), _plan(outline, colour), blend=True)
            for outline, colour in zip(self._outlines, colours, strict=True)
        ]
        empty = np.zeros((0, 6), np.float32)
        self._shade = [
            Primitive("flat", (2, 4), empty, capacity=256, blend=True) for _ in movers[:1]
        ]
        self.poses: Float = np.full((len(movers), 3), np.nan)
        """(m, 3) where the bodies are in the film's frame, since they were last placed."""

    @property
    def all(self) -> tuple[Primitive, ...]:
        """All primitives."""
        return (*self._bodies, *self._shade, *self._plans)

    def place(self, time: float) -> None:
        """Place all bodies where they are at a time [s]."""
        poses = self._at(time)
        if not len(poses) or np.array_equal(poses, self.poses):
            return
        self.poses = poses
        fringe = _FRINGE_INDOOR if self._indoor else _FRINGE
        dark = _SHADE_INDOOR if self._indoor else _SHADE
        shades = []
        for pose, outline, mover in zip(poses, self._outlines, self._movers, strict=True):
            corners = _moved(outline, pose)
            if not self._indoor:
                slide = -SUN[:2] / SUN[2] * mover.height
                corners = np.concatenate([corners, corners + slide])
            shades.append(_soft(corners, fringe, dark))
        self._shade[0].update(np.concatenate(shades))

    def bodies(self) -> Iterator[tuple[Primitive, dict[str, Any]]]:
        """The bodies, each with its own uniforms."""
        for body, pose in zip(self._bodies, self.poses, strict=True):
            yield body, {"world_from_robot": world_from_robot(pose)}

    def shades(self) -> Iterator[tuple[Primitive, dict[str, Any]]]:
        """The shadows of all bodies."""
        lifted = np.eye(4)
        lifted[2, 3] = _LIFT
        for shade in self._shade:
            yield shade, {"place": lifted}

    def plans(self, pixel: float) -> Iterator[tuple[Primitive, dict[str, Any]]]:
        """The bodies from straight above, in a picture whose pixels have a size [m]."""
        for plan, mover, pose in zip(self._plans, self._movers, self.poses, strict=True):
            matrix = world_from_robot(pose)
            matrix[:2, :2] *= max(1.0, _LEAST * pixel / mover.reach)
            yield plan, {"place": matrix}

    def carry(self, points: Float, loose: Bool, since: float) -> Float:
        """Points (n, 2) of a scan of a time [s], those on bodies moved to where these are now.

        A scan is held until the next one; without it, returns would lag behind what they are of.

        Args:
            points: Where the beams ended in the film's frame [m].
            loose: (n,) which of them are returns of no known wall.
            since: When the scan was taken [s].
        """
        if not loose.any() or not self._movers:
            return points
        points, left = points.copy(), loose.copy()
        poses = self._at(since)
        for outline, before, now in zip(self._outlines, poses, self.poses, strict=True):
            chosen = np.flatnonzero(left)
            local = _local(points[chosen], before)
            own = shapely.distance(shapely.Polygon(outline), shapely.points(local)) < _NEAR
            points[chosen[own]] = _moved(local[own], now)
            left[chosen[own]] = False
        return points

    def _at(self, time: float) -> Float:
        """Poses (m, 3) of all at a time [s] in the film's frame."""
        poses = [mover.path.at(np.array([time]))[0] for mover in self._movers]
        return np.asarray(np.reshape(poses, (-1, 3)) - self._origin)


def _moved(points: Float, pose: Float) -> Float:
    """Points (n, 2) of a body's frame at its pose."""
    matrix = world_from_robot(pose)
    return np.asarray(points @ matrix[:2, :2].T + matrix[:2, 3])


def _local(points: Float, pose: Float) -> Float:
    """Points (n, 2) in the frame of a body at a pose."""
    matrix = world_from_robot(pose)
    return np.asarray((points - matrix[:2, 3]) @ matrix[:2, :2])


def _counter_clockwise(outline: Float) -> Float:
    after = np.roll(outline, -1, axis=0)
    area = float(np.sum(outline[:, 0] * after[:, 1] - outline[:, 1] * after[:, 0]))
    return outline if area >= 0.0 else outline[::-1]


def _outward(outline: Float) -> tuple[Float, Float]:
    """Normals (n, 2) of the sides, each from its corner to the next, and mitres of the corners."""
    along = np.roll(outline, -1, axis=0) - outline
    along /= np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    normals = np.column_stack([along[:, 1], -along[:, 0]])
    mitres = normals + np.roll(normals, 1, axis=0)
    # As far out as both sides are, but at sharp corners no more than twice that.
    square = np.maximum(np.einsum("ij,ij->i", mitres, mitres), 1.0)
    return normals, 2.0 * mitres / square[:, None]


def _body(outline: Float, height: float, colour: Float) -> Single:
    """Triangles (v, 9) of a body: sides on a dark foot, a slanted edge and the top."""
    normals, mitres = _outward(outline)
    size = float(np.ptp(outline, axis=0).min())
    bevel = min(_BEVEL, 0.3 * height, 0.2 * size)
    inner = outline - bevel * mitres
    # Of two sides that hardly bend the edge is round.
    before = np.roll(normals, 1, axis=0)
    smooth = (np.einsum("ij,ij->i", normals, before) > _SHARPEST)[:, None]
    mean = normals + before
    mean /= np.maximum(np.hypot(mean[:, 0], mean[:, 1]), 1e-9)[:, None]
    starts = np.where(smooth, mean, normals)
    ends = np.roll(np.where(smooth, mean, before), -1, axis=0)
    foot = min(_BASE, 0.2 * height)
    shoulder = height - bevel
    rows = []
    for low, high, below, above, rise, paint in (
        (outline, outline, 0.0, foot, 0.0, 0.35 * colour),
        (outline, outline, foot, shoulder, 0.0, colour),
        (outline, inner, shoulder, height, 1.0, colour),
    ):
        faces = np.zeros((len(outline), 4, 9), np.float32)
        corners = (low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high)
        levels, facing = (below, below, above, above), (starts, ends, ends, starts)
        for corner in range(4):
            faces[:, corner, :2] = corners[corner]
            faces[:, corner, 2] = levels[corner]
            faces[:, corner, 3:5] = facing[corner]
            faces[:, corner, 5] = rise
            faces[:, corner, 6:9] = paint
        rows.append(faces[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 9))
    rows.append(_level(_triangles(inner), height, 0.55 + 0.45 * colour))
    # A dart on the top says which way is ahead.
    reach = 0.55 * float(np.abs(inner).max(axis=0).min())
    dart = np.array([[1.0, 0.0], [-0.7, 0.6], [-0.35, 0.0]])
    dart = reach * np.concatenate([dart, (dart * [1.0, -1.0])[::-1]])
    rows.append(_level(dart, height + 0.005, 0.35 * colour))
    return np.concatenate(rows).astype(np.float32)


def _level(corners: Float, height: float, colour: Float) -> Single:
    """Rows (v, 9) of triangles that look up."""
    rows = np.zeros((len(corners), 9), np.float32)
    rows[:, :2] = corners
    rows[:, 2] = height
    rows[:, 5] = 1.0
    rows[:, 6:9] = colour
    return rows


def _triangles(outline: Float) -> Float:
    """Corners (v, 2) of counter-clockwise triangles of an outline's inside."""
    shape = shapely.make_valid(shapely.Polygon(outline))
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shape))
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    return np.concatenate([_counter_clockwise(each) for each in corners])


def _plan(outline: Float, colour: Float) -> Single:
    """Triangles (v, 6) of a body from above."""
    corners = _triangles(outline)
    paint = np.tile([*colour, 1.0], (len(corners), 1))
    return np.concatenate([corners, paint], axis=1).astype(np.float32)


def _soft(corners: Float, fringe: float, dark: float) -> Single:
    """Triangles (v, 6) of the hull of corners (n, 2): dark inside, fading out over a fringe [m]."""
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(corners)))[:-1]
    hull = _counter_clockwise(hull)
    outer = hull + fringe * _outward(hull)[1]
    following, outer_following = np.roll(hull, -1, axis=0), np.roll(outer, -1, axis=0)
    middle = np.broadcast_to(hull.mean(axis=0), hull.shape)
    places = np.stack(
        [middle, hull, following, hull, outer, outer_following, hull, outer_following, following],
        axis=1,
    )
    rows = np.zeros((len(hull), 9, 6), np.float32)
    rows[:, :, :2] = places
    rows[:, :, 2:5] = [0.02, 0.03, 0.05]
    rows[:, :, 5] = dark * np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
    return rows.reshape(-1, 6)
