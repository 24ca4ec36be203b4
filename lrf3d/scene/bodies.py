"""The robot, from ``assets/robot.glb``, and dynamic obstacles, as triangles in their own frames."""

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray

from lrf3d.files import assets_folder
from lrf3d.geometry import Float, Single
from lrf3d.scene.look import (
    DART,
    GOAL,
    GOAL_OPACITY,
    OBSTACLE_COLOURS,
    ROBOT,
    ROBOT_RIM,
    SHADOW_COLOUR,
    SUN,
)
from lrf3d.scene.panels import triangles
from lrf3d.scene.shapes import Faces, Soft, single

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle

_LASER_HEIGHT = 0.495
"""Height [m] of the laser's ring in the file."""

_DECK = 0.31
"""Height [m] of what carries the laser's column; above, the column is stretched."""


def robot_mesh(laser_height: float) -> tuple[Single, NDArray[np.uint32]]:
    """Load the robot, with its laser at a height [m], which the column is stretched to.

    Returns:
        Vertices (v, 9), position, normal and colour, and indices (3 · t,) of triangles.
    """
    mesh = trimesh.load_mesh(assets_folder() / "robot.glb", process=False)
    visual: Any = mesh.visual
    # glTF has y up, films have z up.
    vertices = np.asarray(mesh.vertices)[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    normals = np.asarray(mesh.vertex_normals)[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    colours = np.asarray(visual.vertex_colors)[:, :3] / 255.0
    column = vertices[:, 2] > _DECK
    stretch = max(0.3, (laser_height - _DECK) / (_LASER_HEIGHT - _DECK))
    vertices[column, 2] = _DECK + (vertices[column, 2] - _DECK) * stretch
    rows = np.column_stack([vertices, normals, colours]).astype(np.float32)
    return rows, np.asarray(mesh.faces).astype(np.uint32).ravel()


def world_from_robot(pose: Float) -> Float:
    """The matrix (4, 4) of a pose x, y [m], theta [rad]."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    matrix = np.eye(4)
    matrix[:2, :2] = [[cos, -sin], [sin, cos]]
    matrix[:2, 3] = pose[:2]
    return matrix


def faces_of(rows: Single) -> Faces:
    """Faces of the rows (3 t, 9) of a body: position, normal, colour."""
    parts = rows.reshape(-1, 3, 9)
    return Faces(*(single(parts[..., first : first + 3]) for first in (0, 3, 6)))


def robot_body(laser_height: float) -> Faces:
    """The robot, with its laser at a height [m]."""
    rows, indices = robot_mesh(laser_height)
    return faces_of(rows[indices])


def flat_dart(pose: Float, size: float, height: float) -> Soft:
    """The robot as a dart with a dark rim, of a size at a pose, seen from above."""
    head = DART[[0, 1, 2, 0, 2, 3]]
    outline = placed(size * np.concatenate([1.4 * head, head]), pose)
    corners = np.column_stack([outline, np.full(12, height)]).reshape(-1, 3, 3)
    colours = np.repeat([(*ROBOT_RIM, 1.0), (*ROBOT, 1.0)], 6, axis=0).reshape(-1, 3, 4)
    return Soft(single(corners), single(colours))


_RING, _RING_CORNERS, _GOAL_HEIGHT = 0.86, 48, 0.04
"""Inner radius of a goal's ring, in outer ones; its number of corners; height over the ground [m].
"""


def goal_disc(goal: Float) -> Soft:
    """A goal (3,), x, y and radius [m], on the ground: a ring and a pale disc."""
    turns = np.linspace(0.0, 2.0 * np.pi, _RING_CORNERS + 1)
    rim = np.column_stack([np.cos(turns), np.sin(turns)])
    outer, inner, middle = rim, _RING * rim, np.zeros((_RING_CORNERS, 2))
    ring = [outer[:-1], outer[1:], inner[1:], outer[:-1], inner[1:], inner[:-1]]
    corners, colours = [], []
    for shape, opacity in zip((ring, [middle, inner[:-1], inner[1:]]), GOAL_OPACITY, strict=True):
        places = goal[:2] + goal[2] * np.stack(shape, axis=1).reshape(-1, 2)
        corners.append(np.column_stack([places, np.full(len(places), _GOAL_HEIGHT)]))
        colours.append(np.tile((*GOAL, opacity), (len(places), 1)))
    return Soft(
        single(np.concatenate(corners).reshape(-1, 3, 3)),
        single(np.concatenate(colours).reshape(-1, 3, 4)),
    )


_BLOB, _BLOB_FRINGE, _BLOB_DARKNESS, _BLOB_SHIFT = 0.24, 0.28, 0.55, 0.16
"""Radius of the robot's shadow and of its soft rim [m], its darkness, and how far it lies from the
robot where the sun shines, as a part of the level way to the sun."""


def robot_shadow(pose: Float, *, indoor: bool) -> Soft:
    """The shadow of the robot at a pose."""
    shadow = _round_shadow()
    middle = pose[:2] - (0.0 if indoor else _BLOB_SHIFT) * SUN[:2]
    return shadow._replace(corners=single(shadow.corners + np.append(middle, 0.0)))


@cache
def _round_shadow() -> Soft:
    turns = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    rim = _BLOB * np.column_stack([np.cos(turns), np.sin(turns)])
    return soft_shadow(rim, _BLOB_FRINGE, _BLOB_DARKNESS, 0.0)


_BASE, _BEVEL = 0.10, 0.06
"""Height of the dark foot of a body, and width of its slanted upper edge [m]."""

_SHARPEST = 0.77
"""Cosine of the angle between two sides from which on their edge is drawn sharp."""


def obstacle_colours(obstacles: "tuple[DynamicObstacle, ...]") -> Float:
    """Colours (m, 3) of dynamic obstacles, 0…1."""
    return np.asarray(OBSTACLE_COLOURS[np.arange(len(obstacles)) % len(OBSTACLE_COLOURS)])


def obstacle_bodies(obstacles: "tuple[DynamicObstacle, ...]") -> list[Single]:
    """Triangles (v, 9) of each body, in its own frame: position [m], normal, colour."""
    return [
        _body(counter_clockwise(obstacle.outline), obstacle.height, colour)
        for obstacle, colour in zip(obstacles, obstacle_colours(obstacles), strict=True)
    ]


def placed(points: Float, pose: Float) -> Float:
    """Points (n, 2) of a body's frame at its pose."""
    matrix = world_from_robot(pose)
    return np.asarray(points @ matrix[:2, :2].T + matrix[:2, 3])


def in_body(points: Float, pose: Float) -> Float:
    """Points (n, 2) in the frame of a body at a pose."""
    matrix = world_from_robot(pose)
    return np.asarray((points - matrix[:2, 3]) @ matrix[:2, :2])


def counter_clockwise(outline: Float) -> Float:
    """An outline (n, 2), turned round where it runs clockwise."""
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
    rows.append(_level(outline_triangles(inner).reshape(-1, 2), height, 0.55 + 0.45 * colour))
    # A dart on the top says which way is ahead.
    reach = 0.55 * float(np.abs(inner).max(axis=0).min())
    dart = 0.9 * reach * DART[[0, 1, 2, 0, 2, 3]]
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


def outline_triangles(outline: Float) -> Float:
    """Corners (t, 3, 2) of counter-clockwise triangles of an outline's inside."""
    return triangles(np.array([shapely.make_valid(shapely.Polygon(outline))]))[0]


def soft_shadow(corners: Float, fringe: float, dark: float, height: float) -> Soft:
    """The hull of corners (n, 2) at a height [m]: dark inside, fading out over a fringe [m]."""
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(corners)))[:-1]
    hull = counter_clockwise(hull)
    outer = hull + fringe * _outward(hull)[1]
    following, outer_following = np.roll(hull, -1, axis=0), np.roll(outer, -1, axis=0)
    middle = np.broadcast_to(hull.mean(axis=0), hull.shape)
    places = np.stack(
        [middle, hull, following, hull, outer, outer_following, hull, outer_following, following],
        axis=1,
    ).reshape(-1, 3, 2)
    levels = np.full((len(places), 3, 1), height)
    colours = np.empty((len(hull), 9, 4))
    colours[..., :3] = SHADOW_COLOUR
    colours[..., 3] = dark * np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
    return Soft(single(np.concatenate([places, levels], axis=2)), single(colours.reshape(-1, 3, 4)))
