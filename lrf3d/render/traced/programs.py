"""What the vertex shaders of ``render/shaders`` do, for whole primitives at once.

In go a primitive's rows and the uniforms of its draw; out comes what the compiled triangles and
points take.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry import Float
from lrf3d.render.traced import shading

_NEAR = 0.25
"""Depth [m] before which lines are cut, as their shader does."""

_BEHIND = -1.0
"""A depth at which nothing is drawn."""


class ProjectedTriangles(NamedTuple):
    """Triangles to draw: program, rows (3 t, 4 + n) of corners, and what is the same for all."""

    program: int
    corners: Float
    fixed: Float


Uniforms = Mapping[str, Any]


def corners_of(name: str, rows: Float, uniforms: Uniforms) -> ProjectedTriangles:
    """The triangles of rows of a program's vertices."""
    return _PROGRAMS[name](rows, uniforms)


def points_of(rows: Float, uniforms: Uniforms, box: tuple[int, int, int, int]) -> Float:
    """Points (n, 7): x, y [pixels], depth, diameter [pixels] and colour."""
    place = rows[:, :3]
    clip = _project(place, uniforms)
    depth = _raised(place, uniforms["nearer"], uniforms)
    depth = np.where(_shown(place, rows[:, 6:8], uniforms), depth, _BEHIND)
    w = np.where(clip[:, 2] > _NEAR, clip[:, 2], 1.0)
    points = np.empty((len(rows), 7))
    points[:, 0] = box[0] + (0.5 + 0.5 * clip[:, 0] / w) * box[2]
    points[:, 1] = box[1] + (0.5 + 0.5 * clip[:, 1] / w) * box[3]
    points[:, 2] = np.where(clip[:, 2] > _NEAR, depth, _BEHIND)
    size, smallest, largest = uniforms["sizes"]
    points[:, 3] = np.clip(size * uniforms["focus"] / w, smallest, largest)
    points[:, 4:] = rows[:, 3:6]
    return points


def _project(places: Float, uniforms: Uniforms) -> Float:
    """x, y and w (n, 3) of places (n, 3) in the picture."""
    matrix = uniforms["view_projection"][[0, 1, 3]]
    return np.asarray(places @ matrix[:, :3].T + matrix[:, 3])


def _raised(places: Float, metres: float, uniforms: Uniforms) -> Float:
    """Depths (n,) of points nearer to the eye than places (n, 3) by a distance [m]."""
    ray = np.asarray(uniforms["eye"]) - places
    away = np.linalg.norm(ray, axis=1)
    step = np.minimum(metres + uniforms["slack"] * away, 0.5 * away) / np.maximum(away, 1e-9)
    return _project(places + ray * step[:, None], uniforms)[:, 2]


def _shown(places: Float, sides: Float, uniforms: Uniforms) -> Any:
    """Whether what lies on thin walls is seen (n,): from their sides, or from far above."""
    if uniforms["nearer"] > 1e3:
        return np.ones(len(places), dtype=bool)
    return np.einsum("ij,ij->i", np.asarray(uniforms["eye"])[:2] - places[:, :2], sides) >= 0.0


def _rows(clip: Float, depth: Float, *rest: Float) -> Float:
    return np.ascontiguousarray(np.column_stack([clip, depth, *rest]))


def _flat(rows: Float, uniforms: Uniforms) -> ProjectedTriangles:
    local = np.column_stack([rows[:, :2], np.zeros(len(rows)), np.ones(len(rows))])
    clip = _project((local @ uniforms["place"].T)[:, :3], uniforms)
    return ProjectedTriangles(shading.FLAT, _rows(clip, clip[:, 2], rows[:, 2:6]), np.zeros(2))


def _fan(rows: Float, uniforms: Uniforms) -> ProjectedTriangles:
    clip = _project(rows[:, :3], uniforms)
    fixed = np.array([uniforms["reach"], uniforms["strength"]])
    return ProjectedTriangles(shading.FAN, _rows(clip, clip[:, 2], rows[:, 3:5]), fixed)


def _blob(rows: Float, uniforms: Uniforms) -> ProjectedTriangles:
    x, y, radius, darkness = uniforms["blob"]
    place = np.column_stack([rows * radius + [x, y], np.zeros(len(rows))])
    clip, depth = _project(place, uniforms), _raised(place, 0.005, uniforms)
    return ProjectedTriangles(shading.BLOB, _rows(clip, depth, rows), np.array([darkness, 0.0]))


def _trail(rows: Float, uniforms: Uniforms) -> ProjectedTriangles:
    place = rows[:, :2] + rows[:, 2:4] * uniforms["half_width"]
    place = np.column_stack([place, np.zeros(len(rows))])
    clip, depth = _project(place, uniforms), _raised(place, 0.01, uniforms)
    fixed = np.array([uniforms["now"], uniforms["fade"]])
    return ProjectedTriangles(shading.TRAIL, _rows(clip, depth, rows[:, 4], place), fixed)


def _robot(rows: Float, uniforms: Uniforms) -> ProjectedTriangles:
    matrix = uniforms["world_from_robot"]
    place = rows[:, :3] @ matrix[:3, :3].T + matrix[:3, 3]
    clip = _project(place, uniforms)
    normal = rows[:, 3:6] @ matrix[:3, :3].T
    corners = _rows(clip, clip[:, 2], place, normal, rows[:, 6:9])
    return ProjectedTriangles(shading.ROBOT, corners, np.zeros(2))


def _bands(rows: Float, uniforms: Uniforms) -> ProjectedTriangles:
    thick, high, least = uniforms["band"]
    place = rows[:, 0:2] + (rows[:, 2:4] - rows[:, 0:2]) * uniforms["grown"]
    middle = np.column_stack([place, rows[:, 7]])
    size = np.maximum(1.0, least * _project(middle, uniforms)[:, 2] / high)
    place = place + rows[:, 4:6] * (thick * np.minimum(size, 3.0))[:, None]
    up = np.clip(rows[:, 7] + rows[:, 6] * high * size, 0.02, rows[:, 8])
    place = np.column_stack([place, up])
    clip = _project(place, uniforms)
    corners = _rows(clip, clip[:, 2], rows[:, 9:13], place)
    return ProjectedTriangles(shading.BAND, corners, np.zeros(2))


def _lines(rows: Float, uniforms: Uniforms) -> ProjectedTriangles:
    here, there, turn, side = rows[:, 0:3], rows[:, 3:6], rows[:, 6], rows[:, 11:13]
    viewport, width = np.asarray(uniforms["viewport"]), uniforms["width"]
    w, b = _project(here, uniforms)[:, 2], _project(there, uniforms)
    crosses = (w < _NEAR) & (b[:, 2] > _NEAR)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(crosses, (_NEAR - w) / (b[:, 2] - w), 0.0)[:, None]
        start = here + (there - here) * share
        a, depth = _project(start, uniforms), _raised(start, uniforms["nearer"], uniforms)
        ends = (b[:, 2] < _NEAR) & (a[:, 2] > _NEAR)
        b_share = np.where(ends, (_NEAR - b[:, 2]) / (a[:, 2] - b[:, 2]), 0.0)[:, None]
        b = b + (a - b) * b_share
        way = (b[:, :2] / b[:, 2:] - a[:, :2] / a[:, 2:]) * viewport
    across = np.column_stack([-way[:, 1] + 1e-9, way[:, 0]])
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-30)[:, None]
    half_width = 0.5 * width + 0.75
    a[:, :2] += (np.sign(turn) * half_width * a[:, 2])[:, None] * 2.0 * across / viewport
    off = np.sign(turn) * half_width * np.where(np.abs(turn) > 1.5, -1.0, 1.0)
    a[~_shown(here, side, uniforms), 2] = _BEHIND
    # How far off its middle a line is, is even in the picture and not in the scene.
    corners = _rows(a, depth, rows[:, 7:11], off * a[:, 2])
    return ProjectedTriangles(shading.LINE, corners, np.array([width, 0.0]))


_PROGRAMS: dict[str, Callable[[Float, Uniforms], ProjectedTriangles]] = {
    "bands": _bands,
    "blob": _blob,
    "fan": _fan,
    "flat": _flat,
    "lines": _lines,
    "robot": _robot,
    "trail": _trail,
}
