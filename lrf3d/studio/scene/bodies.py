"""Bodies as they are drawn: the robot, from ``assets/robot.npz``, a goal, and dynamic obstacles.

All have a pose: they are triangles in their own frames, and shadows and darts where they stand.
"""

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from lrf3d.base.files import data_folder
from lrf3d.geometry.lines import LEFT, Float, directions
from lrf3d.robot.kinematics import RADIUS
from lrf3d.studio.scene.look import (
    BODY_LIGHT,
    DART,
    ROBOT,
    SUN,
    TINY,
    TRAIL_HEIGHT,
    WHITE,
    paler,
    rgb,
)
from lrf3d.studio.scene.shapes import Faces, PosedFaces, Soft, single, together
from lrf3d.studio.scene.stage.stage import triangles

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle

# Colour of shadows and of the rim of a dart.
_DARK = rgb("#05080d")

# Width of the soft edge of a body's shadow [m].
_SHADOW_EDGE = 0.35

# Opacity of a body's shadow under it.
_SHADOW_STRENGTH = 0.40

# Radius of the part of the usual robot that casts a shadow [m].
_SHADOW_RADIUS = 0.27

# Radius of smaller robots, also of points, as drawn [m].
_LEAST_RADIUS = 0.05

# Height of the laser's ring in the robot's file [m].
_RING = 0.495

# Height in the robot's file of what carries the laser's column [m]; only the column is stretched.
_DECK = 0.31

# Least length of the column, in that of the file.
_LEAST_STRETCH = 0.3

# Size of the dark dart under a dart, which is its rim.
_RIM = 1.4

# Colour of a goal.
_GOAL = rgb("#1ab25c", 2)

# Opacity of a goal's disc.
_GOAL_DISC = 0.28

# Opacity of the ring round a goal.
_GOAL_RING = 0.9

# Inner radius of that ring, in its outer one.
_RING_INSIDE = 0.86

# Colours of dynamic obstacles: strong, and none is the robot's orange or the red of false walls.
_OBSTACLE_COLOURS = [rgb(code, 2) for code in ("#2aa6bf", "#8f6fc4", "#b3ad3b", "#4fb060")]

# Least half size of an obstacle from above, in darts, so that it can be seen.
_LEAST = 0.3

# Factor of the colour of an obstacle in the dart on its top.
_DARKER = 0.35

# Share of its own colour in the top of an obstacle, the rest of which is white.
_TOP_COLOUR = 0.45

# Number of earlier places of an obstacle that are seen.
_PAST = 5

# Time from one to the next [s of the film].
_PAST_STEP = 0.35

# Corners (6, 2) of the triangles of the robot as seen from above.
_DART = DART[[0, 1, 2, 0, 2, 3]]


def robot_body(laser_height: float, radius: float, colour: ArrayLike = ROBOT) -> Faces:
    """The robot, of a radius [m], with its laser at a height [m]; its column is stretched to it.

    Another robot has another colour (3,).
    """
    parts = _robot_parts()
    x, y, z = parts["places"].astype(float).T
    size = _size(radius)
    low = min(size, 1.0)
    stretch = max(_LEAST_STRETCH, (laser_height / low - _DECK) / (_RING - _DECK))
    z = low * z + np.maximum(low * (z - _DECK), 0.0) * (stretch - 1.0)
    vertices = np.column_stack([size * x, size * y, z])
    colours = parts["colours"] / WHITE
    # Of the colours in the file, the one next to the robot's is its own.
    off = np.abs(colours - ROBOT).max(axis=1)
    colours = np.where((off == off.min())[:, None], colour, colours)
    lit = _lit(colours, parts["normals"].astype(float))
    return Faces(single(vertices[parts["faces"]]), single(lit[parts["faces"]]))


@cache
def _robot_parts() -> dict[str, Any]:
    """Places (v, 3) [m], normals (v, 3) and colours (v, 3) of vertices; faces (t, 3) of them."""
    with np.load(data_folder("assets") / "robot.npz") as file:
        return dict(file)


def _lit(colours: Float, normals: Float) -> Float:
    """Colours (n, 3) of a body's faces in a light that goes with it, from behind, as cameras do."""
    everywhere, sunny, upward = BODY_LIGHT
    light = (
        everywhere
        + sunny * np.maximum(normals @ (SUN * [-1.0, 1.0, 1.0]), 0.0)
        + upward * (normals @ [0.0, 0.0, 1.0])
    )
    return np.asarray(colours * light[..., None])


def world_from_robot(pose: Float) -> Float:
    """The matrix (4, 4) of a pose x, y [m], theta [rad]."""
    x, y, theta = pose.tolist()
    cos = np.cos(theta)
    sin = np.sin(theta)
    return np.array([[cos, -sin, 0, x], [sin, cos, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]])


def flat_dart(pose: Float, size: float, height: float, colour: Sequence[float] = ROBOT) -> Soft:
    """A robot as a dart with a dark rim, of a size at a pose, seen from above."""
    outline = _placed(size * np.concatenate([_RIM * _DART, _DART]), pose)
    return _flat(outline, height, np.repeat([(*_DARK, 1.0), (*colour, 1.0)], 6, axis=0))


def goal_disc(goal: Float) -> Soft:
    """A goal (3,), x, y and radius [m], on the ground: a pale disc and a ring round it."""
    x, y, radius = goal.tolist()
    outlines = [x, y] + radius * _circle(48) * np.array([0.0, _RING_INSIDE, 1.0])[:, None, None]
    return _rings(outlines, [[_GOAL_DISC] * 2, [_GOAL_RING] * 2], _GOAL, 2.0 * TRAIL_HEIGHT)


def robot_shadow(pose: Float, radius: float) -> Soft:
    """The shadow of the robot, of a radius [m], at a pose."""
    return _shadow(_size(radius) * _SHADOW_RADIUS * _circle(24), pose)


def _size(radius: float) -> float:
    """Size of a robot of a radius [m], in that of the usual one."""
    return max(radius, _LEAST_RADIUS) / RADIUS


def _shadow(outline: Float, pose: Float) -> Soft:
    """The shadow of a body with an outline (n, 2) at a pose: dark, fading out over an edge."""
    corners = shapely.multipoints(_placed(outline, pose))
    hull = shapely.get_coordinates(shapely.convex_hull(corners))[:-1]
    middle = np.broadcast_to(hull.mean(axis=0), hull.shape)
    away = hull - middle
    outer = hull + _SHADOW_EDGE * away / np.maximum(np.hypot(*away.T), TINY)[:, None]
    opacities = [[_SHADOW_STRENGTH, _SHADOW_STRENGTH], [_SHADOW_STRENGTH, 0.0]]
    return _rings(np.stack([middle, hull, outer]), opacities, _DARK, 0.5 * TRAIL_HEIGHT)


def robots_of(
    obstacles: "Sequence[DynamicObstacle]",
) -> "list[tuple[DynamicObstacle, tuple[float, float, float]]]":
    """The other robots among obstacles, and the colours of their trails."""
    return [
        (each, _OBSTACLE_COLOURS[number % len(_OBSTACLE_COLOURS)])
        for number, each in enumerate(obstacles)
        if each.is_robot
    ]


def robot_names(obstacles: "Sequence[DynamicObstacle]", names: Sequence[str] = ()) -> Sequence[str]:
    """Names of a robot and of others among obstacles: usual ones for those that have none."""
    usual = ["this robot", *["another robot"] * len(robots_of(obstacles))]
    return [*names, *usual[len(names) :]]


class Obstacles:
    """The dynamic obstacles of a run, in a frame with an origin (2,) in the world [m].

    Other robots have their laser at a height [m], too.
    """

    def __init__(
        self, obstacles: "tuple[DynamicObstacle, ...]", origin: Float, *, laser_height: float
    ) -> None:
        self._obstacles = obstacles
        self._origin = np.array([*origin, 0.0])
        self._colours = np.resize(_OBSTACLE_COLOURS, (len(obstacles), 3))
        self._tops = []
        self._bodies = list[Faces]()
        for each, colour in zip(obstacles, self._colours, strict=True):
            top, _ = triangles(np.array([shapely.make_valid(shapely.Polygon(each.outline))]))
            self._tops.append(top)
            prism = _prism(each.outline, top, each.height, colour)
            self._bodies.append(
                robot_body(laser_height, each.reach, colour) if each.is_robot else prism
            )

    def _poses(self, time: float) -> list[Float]:
        now = np.array([time])
        return [pose - self._origin for each in self._obstacles for pose in each.path.at(now)]

    def bodies(self, time: float) -> list[tuple[str, PosedFaces]]:
        """The bodies at a time [s]."""
        bodies = enumerate(zip(self._bodies, self._poses(time), strict=True))
        return [
            (f"obstacle {n}", PosedFaces(one, world_from_robot(pose))) for n, (one, pose) in bodies
        ]

    def shadows(self, time: float) -> Soft | None:
        """The shadows of all bodies at a time [s]."""
        shadows = [
            _shadow(each.outline, pose)
            for each, pose in zip(self._obstacles, self._poses(time), strict=True)
        ]
        return together(shadows) if shadows else None

    def past(self, time: float, playback: float) -> Soft | None:
        """Where the bodies were shortly before a time [s], fading with age; robots have trails."""
        found = list[Soft]()
        for age in range(1, _PAST + 1):
            poses = self._poses(time - age * _PAST_STEP * playback)
            bodies = zip(self._obstacles, poses, self._tops, self._colours, strict=True)
            for each, pose, top, colour in bodies:
                if each.is_robot:
                    continue
                level = _placed(top.reshape(-1, 2), pose)
                tint = [*colour, 0.5 * (1.0 - age / (_PAST + 1))]
                found.append(_flat(level, 0.5 * TRAIL_HEIGHT, np.tile(tint, (len(level), 1))))
        return together(found) if found else None

    def from_above(self, time: float, dart: float) -> list[Soft]:
        """The bodies from straight above, where robots are darts of a size [m]."""
        found = list[Soft]()
        placed = zip(self._obstacles, self._poses(time), strict=True)
        for (each, pose), top, colour in zip(placed, self._tops, self._colours, strict=True):
            if each.is_robot:
                found.append(flat_dart(pose, dart, 0.0, paler(colour)))
                continue
            level = _placed(max(1.0, _LEAST * dart / each.reach) * top.reshape(-1, 2), pose)
            found.append(_flat(level, 0.0, np.tile([*colour, 1.0], (len(level), 1))))
        return found


def _prism(outline: Float, top: Float, height: float, colour: Float) -> Faces:
    """An outline (n, 2) of a height [m] with a top of triangles (t, 3, 2).

    The top is pale; a dart on it says which way is ahead.
    """
    if not shapely.is_ccw(shapely.linearrings(outline)):
        outline = outline[::-1]
    after = np.roll(outline, -1, axis=0)
    outward = -directions(np.hstack([outline, after])) @ LEFT
    up = np.array([0.0, 0.0, 1.0])
    sides = np.stack([outline, after, after, outline, after, outline], axis=1).reshape(-1, 2)
    outward = np.insert(np.repeat(outward, 6, axis=0), 2, 0.0, axis=1)
    dart = 0.5 * float(np.abs(outline).max(axis=0).min()) * _DART
    parts = []
    for corners, levels, normals, paint in (
        (sides, np.array([0.0, 0.0, height, 0.0, height, height]), outward, colour),
        (top.reshape(-1, 2), np.full(3, height), up, (1.0 - _TOP_COLOUR) + _TOP_COLOUR * colour),
        (dart, np.full(6, height + 0.5 * TRAIL_HEIGHT), up, _DARKER * colour),
    ):
        places = np.column_stack([corners, np.resize(levels, len(corners))])
        lit = _lit(paint, np.broadcast_to(normals, places.shape))
        parts.append(np.stack([places, lit]).reshape(2, -1, 3, 3))
    return Faces(*map(single, np.concatenate(parts, axis=1)))


def _placed(points: Float, pose: Float) -> Float:
    return np.asarray(points @ world_from_robot(pose)[:2, :2].T + pose[:2])


def _circle(corners: int) -> Float:
    turns = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    return np.column_stack([np.cos(turns), np.sin(turns)])


def _flat(corners: Float, height: float, colours: Float) -> Soft:
    """Triangles with corners (3 t, 2), which have colours (3 t, 4), at a height [m]."""
    places = np.insert(corners, 2, height, axis=1)
    return Soft(single(places.reshape(-1, 3, 3)), single(colours.reshape(-1, 3, 4)))


def _rings(
    outlines: Float, opacities: list[list[float]], colour: tuple[float, ...], height: float
) -> Soft:
    """What lies between outlines (k, n, 2), the inmost first.

    The opacities at both sides of each ring are given.
    """
    inner = outlines[:-1]
    outer = outlines[1:]
    quads = [inner, outer, np.roll(outer, -1, axis=1), np.roll(inner, -1, axis=1)]
    corners = np.stack(quads, axis=2)[:, :, [0, 1, 2, 0, 2, 3]].reshape(-1, 2)
    alpha = np.array(opacities)[:, None, [0, 1, 1, 0, 1, 0]]
    alpha = np.broadcast_to(alpha, (*inner.shape[:2], 6)).reshape(-1, 1)
    return _flat(corners, height, np.hstack([np.tile(colour, (len(alpha), 1)), alpha]))
