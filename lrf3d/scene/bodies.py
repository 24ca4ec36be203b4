"""The robot, from ``assets/robot.glb``, and dynamic obstacles, as triangles in their own frames."""

from functools import cache
from typing import Any

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray

from lrf3d.files import assets_folder
from lrf3d.geometry import Float, Single, directions
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

_LASER_HEIGHT = 0.495
"""Height [m] of the laser's ring in the file."""

_DECK = 0.31
"""Height [m] of what carries the laser's column; above, the column is stretched."""


def robot_mesh(laser_height: float) -> tuple[Single, NDArray[np.uint32]]:
    """Vertices (v, 9) of the robot: position, normal, colour; and indices (3 · t,) of triangles.

    Its laser is at a height [m], which the column is stretched to.
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


_FOOT = 0.10
"""Height of the dark foot of a body [m]."""


def obstacle_colours(count: int) -> Float:
    """Colours (count, 3) of dynamic obstacles, 0…1."""
    return np.asarray(OBSTACLE_COLOURS[np.arange(count) % len(OBSTACLE_COLOURS)])


def obstacle_body(outline: Float, height: float, colour: Float) -> Faces:
    """A counter-clockwise outline (n, 2) of a height [m], on a dark foot, with a pale top."""
    after = np.roll(outline, -1, axis=0)
    normals = directions(np.hstack([outline, after])) @ np.array([[0.0, -1.0], [1.0, 0.0]])
    foot = min(_FOOT, 0.2 * height)
    rows = []
    for low, high, paint in ((0.0, foot, 0.35 * colour), (foot, height, colour)):
        side = np.zeros((len(outline), 4, 9))
        side[:, [0, 3], :2], side[:, 1:3, :2] = outline[:, None], after[:, None]
        side[:, :2, 2], side[:, 2:, 2] = low, high
        side[:, :, 3:5], side[:, :, 6:] = normals[:, None], paint
        rows.append(side[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 9))
    # A dart on the top says which way is ahead.
    dart = 0.5 * float(np.abs(outline).max(axis=0).min()) * DART[[0, 1, 2, 0, 2, 3]]
    top = outline_triangles(outline).reshape(-1, 2)
    for corners, level, paint in (
        (top, height, 0.55 + 0.45 * colour),
        (dart, height + 0.005, 0.35 * colour),
    ):
        count = len(corners)
        up = np.tile([level, 0.0, 0.0, 1.0, *paint], (count, 1))
        rows.append(np.hstack([corners, up]))
    return faces_of(single(np.concatenate(rows)))


def placed(points: Float, pose: Float) -> Float:
    """Points (n, 2) of a body's frame at its pose."""
    matrix = world_from_robot(pose)
    return np.asarray(points @ matrix[:2, :2].T + matrix[:2, 3])


def counter_clockwise(outline: Float) -> Float:
    """An outline (n, 2), turned round where it runs clockwise."""
    return outline if shapely.is_ccw(shapely.linearrings(outline)) else outline[::-1]


def outline_triangles(outline: Float) -> Float:
    """Corners (t, 3, 2) of counter-clockwise triangles of an outline's inside."""
    return triangles(np.array([shapely.make_valid(shapely.Polygon(outline))]))[0]


def soft_shadow(corners: Float, fringe: float, dark: float, height: float) -> Soft:
    """The hull of corners (n, 2) at a height [m]: dark inside, fading out over a fringe [m]."""
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(corners)))[:-1]
    middle = hull.mean(axis=0)
    away = hull - middle
    outer = hull + fringe * away / np.maximum(np.hypot(*away.T), 1e-9)[:, None]
    following, outer_following = np.roll(hull, -1, axis=0), np.roll(outer, -1, axis=0)
    middles = np.broadcast_to(middle, hull.shape)
    places = np.stack(
        [middles, hull, following, hull, outer, outer_following, hull, outer_following, following],
        axis=1,
    ).reshape(-1, 3, 2)
    levels = np.full((len(places), 3, 1), height)
    colours = np.empty((len(hull), 9, 4))
    colours[..., :3] = SHADOW_COLOUR
    colours[..., 3] = dark * np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
    return Soft(single(np.concatenate([places, levels], axis=2)), single(colours.reshape(-1, 3, 4)))
