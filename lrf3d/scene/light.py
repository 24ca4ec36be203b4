"""Light, baked once into walls, roofs and the ground: what comes from the sky and from other faces.

Faces and what stands in a world enter; light leaves, as what a white surface sends on, linear in
red, green and blue. From each point Embree casts rays over its half of space: what leaves for the
sky brings the sky's light, what meets a face or the ground brings what that sends on, for as many
bounces as matter (Goral et al., 1984, with rays in place of form factors). The sky is brighter on
one side, which gives things a form and no hard shadows.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

from lrf3d.casting.triangle_rays import TriangleRays, embreex_installed
from lrf3d.geometry import Float, Int, Single
from lrf3d.interrupts import Progress, silent
from lrf3d.scene.facades import layers
from lrf3d.scene.look import (
    GAMMA,
    GROUND_ALBEDO,
    GROUND_ALBEDO_INDOOR,
    SKYSHINE,
    SKYSHINE_INDOOR,
    SUN,
)
from lrf3d.scene.shapes import Painted, single

_RAYS = 128
"""Rays from a corner of a face, and from a place of the ground."""

_BOUNCES = 6
"""How often light goes on from face to face: between white walls a seventh time adds less than a
hundredth. Beside the rays they take no time."""

_AT_ONCE = 3000
"""Points that rays are cast from at a time."""

_OFF, _INWARD = 0.02, 0.10
"""How far off its face a ray starts, and from the edges of its face [m]: beyond them is a wall."""

_INSIDE = 0.2
"""Share of rays that meet walls from within from which on a place is inside of one."""

_DARK = 0.02
"""Share of the open sky's light below which a face is never seen from a room or a street."""

_CELL, _CELL_INDOOR, _CELLS, _BLUR = 0.8, 0.25, 130, 0.8
"""Least size of the cells of the ground that light is known in [m], the most of them to a side, and
how far it is smoothed [cells]: rays are few, and it changes slowly."""

_LAND, _UP = 1e4, np.array([0.0, 0.0, 1.0])
"""How far the land around them reaches [m], and where all ground looks."""

_MOST_FACES = 400_000
"""Worlds of more faces have the light of an open field: it would take a minute."""


class Light(NamedTuple):
    """The light of a world, linear."""

    faces: Float
    """(n, 4, 3) at the corners of faces."""
    ground: Float
    """(rows, columns, 3) on the cells of the ground, from the smallest x and y on."""


def sky_light(directions: Float, *, indoor: bool) -> Float:
    """What comes from the sky in directions (n, 3) of unit length: light (n, 3), linear."""
    # A large lamp on one side of an even sky gives things a bright and a dark side.
    toward = np.maximum(directions @ SUN, 0.0)[:, None]
    return np.asarray((SKYSHINE_INDOOR if indoor else SKYSHINE) * (0.72 + 0.75 * toward**3))


def screen(light: Float) -> Float:
    """Linear light as a factor of the colours that a screen shows."""
    return np.asarray(np.maximum(light, 0.0) ** (1.0 / GAMMA))


def open_light(*, indoor: bool) -> Float:
    """The light (3,) of the sky on open, level ground."""
    return np.asarray(sky_light(_sphere(512), indoor=indoor).mean(axis=0))


def bake_light(
    faces: Painted, low: Float, high: Float, *, indoor: bool, progress: Progress = silent
) -> Light:
    """The light of faces, and of the ground in a box from low to high (2,) [m]."""
    count, size, open_sky = len(faces.places), high - low, open_light(indoor=indoor)
    cell = max(_CELL_INDOOR if indoor else _CELL, float(size.max()) / _CELLS)
    columns, rows = np.ceil(size / cell).astype(int)
    # Without Embree the rays of all faces would take minutes: they get the light of the open.
    if not 0 < count <= _MOST_FACES or not embreex_installed():
        wanted = (count, 4, 3), (rows, columns, 3)
        return Light(*(np.broadcast_to(open_sky, shape) for shape in wanted))
    # All that sends light on: faces, the cells of the ground, and the land around, which lies just
    # below them; insides of houses, and the sky, whose light is known, send none.
    cells = _cells(low, high, columns, rows)
    facing = np.concatenate([faces.normals[:, :3].mean(axis=1), np.tile(_UP, (len(cells) + 1, 1))])
    land = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]]) * _LAND - _OFF * _UP
    quads = np.concatenate([faces.places, cells, land])
    rays = TriangleRays(single(quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3)))
    middles = np.concatenate([faces.places[:, :3].mean(axis=1), cells.mean(axis=1)])
    middles += _OFF * facing[:-1]
    places, normals, owner = _corners(faces)
    corners = len(places)
    places = np.concatenate([places, middles[count:]])
    normals = np.concatenate([normals, facing[count:-1]])
    seen, sky = _gather(rays, facing, places, normals, indoor, progress)
    albedo = np.concatenate([_albedo(faces, indoor), np.tile(_ground(indoor), (len(cells), 1))])
    sent = np.zeros((len(facing) + 2, 3), np.float32)
    sent[-3] = _ground(indoor) * open_sky
    for bounce in range(_BOUNCES + 1):
        light = sky + _mean_of(sent, seen)
        at_corners = light[owner].reshape(-1, 4, 3)
        if bounce < _BOUNCES:
            sent[:-3] = albedo * np.concatenate([at_corners.mean(axis=1), light[corners:]])
    # No light gets between the two lines of a wall, which is seen where it is cut off.
    at_corners[at_corners.max(axis=-1) < _DARK * open_sky.max()] = 0.5 * open_sky
    inside = (seen[corners:] == len(facing)).mean(axis=1).reshape(rows, columns) >= _INSIDE
    on_ground = light[corners:].reshape(rows, columns, 3)
    if not inside.all():
        # Under houses it is dark; what is next to them must not be for that.
        near = distance_transform_edt(inside, return_distances=False, return_indices=True)
        on_ground = gaussian_filter(on_ground[tuple(near)], (_BLUR, _BLUR, 0.0))
    return Light(at_corners, on_ground)


def _cells(low: Float, high: Float, columns: int, rows: int) -> Float:
    """Quads (rows · columns, 4, 3) of the ground in a box from low to high (2,) [m]."""
    x, y = np.linspace(low[0], high[0], columns + 1), np.linspace(low[1], high[1], rows + 1)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2)
    return np.concatenate([quads, np.zeros((rows, columns, 4, 1))], axis=3).reshape(-1, 4, 3)


def _gather(
    rays: TriangleRays,
    facing: Float,
    places: Float,
    normals: Float,
    indoor: bool,
    progress: Progress,
) -> tuple[NDArray[np.int32], Float]:
    """Which quads (n, rays) the rays of points meet, and the mean light (n, 3) of the sky there.

    After the last quad come insides of houses and the sky.
    """
    seen, sky = np.empty((len(places), _RAYS), np.int32), np.empty((len(places), 3))
    turns = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, len(places))
    inside = len(facing)
    for first in range(0, len(places), _AT_ONCE):
        part = slice(first, min(first + _AT_ONCE, len(places)))
        ways = _around(normals[part], turns[part], _sphere(_RAYS)).reshape(-1, 3)
        quad = rays.first(single(np.repeat(places[part], _RAYS, axis=0)), single(ways)) // 2
        behind = np.einsum("ij,ij->i", facing[quad], ways) >= 0.0
        quad = np.where(quad < 0, inside + 1, np.where(behind, inside, quad))
        seen[part] = quad.reshape(-1, _RAYS)
        light = sky_light(ways, indoor=indoor) * (quad > inside)[:, None]
        sky[part] = light.reshape(-1, _RAYS, 3).mean(axis=1)
        progress(part.stop, len(places))
    return seen, sky


def _ground(indoor: bool) -> Float:
    """What share (3,) of light the ground sends on."""
    return GROUND_ALBEDO_INDOOR if indoor else GROUND_ALBEDO


def _albedo(faces: Painted, indoor: bool) -> Float:
    """What share (n, 3) of light faces send on."""
    # The coarsest copy of the texture is its mean.
    means = layers(indoor)[-1][:, 0, 0].astype(np.float64) / 255.0
    layer = faces.texture[:, 0, 2].astype(int)
    colours = faces.colours[:, 0] * means[layer, 3:] + means[layer, :3]
    return np.asarray(np.clip(colours, 0.0, 1.0) ** GAMMA)


def _corners(faces: Painted) -> tuple[Float, Float, Int]:
    """Places and normals (n, 3) of the different corners of faces, and which of them each is."""
    places, normals = (each.reshape(-1, 3).astype(float) for each in (faces.places, faces.normals))
    middles = np.repeat(faces.places.mean(axis=1), 4, axis=0)
    keys = np.round(np.concatenate([100.0 * places, 50.0 * normals], axis=1)).astype(np.int64)
    _, first, owner = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    owner = owner.reshape(-1)
    inward = np.zeros((len(first), 3))
    np.add.at(inward, owner, middles - places)
    inward /= np.bincount(owner)[:, None]
    places, normals = places[first], normals[first]
    # Along the faces: the corner of a round body would else lie within it.
    inward -= (inward * normals).sum(axis=1)[:, None] * normals
    length = np.maximum(np.linalg.norm(inward, axis=1), 1e-9)[:, None]
    step = inward / length * np.minimum(_INWARD, 0.3 * length)
    return places + step + _OFF * normals, normals, owner


def _sphere(count: int) -> Float:
    """Directions (count, 3) over the upper half of space, as dense as they count on a surface."""
    number = np.arange(count) + 0.5
    radius, turn = np.sqrt(number / count), number * np.pi * (3.0 - np.sqrt(5.0))
    up = np.sqrt(1.0 - number / count)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), up])


def _around(normals: Float, turns: Float, local: Float) -> Float:
    """Directions (n, k, 3) around normals (n, 3), each set turned by an angle (n,)."""
    level = np.abs(normals[:, 2]) > 0.9
    side = np.where(level[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    first = np.cross(side, normals)
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(normals, first)
    cos, sin = np.cos(turns)[:, None], np.sin(turns)[:, None]
    axes = np.stack([cos * first + sin * second, cos * second - sin * first, normals], axis=1)
    return np.asarray(local @ axes)


def _mean_of(sent: Single, seen: NDArray[np.int32]) -> Float:
    """The mean (n, 3) of what quads send, over those seen (n, k)."""
    light = np.empty((len(seen), 3))
    for first in range(0, len(seen), _AT_ONCE):
        light[first : first + _AT_ONCE] = sent[seen[first : first + _AT_ONCE]].mean(axis=1)
    return light
