"""Light, baked once into walls, roofs and the ground: what comes from the sky and from other faces.

Faces and what stands in a world enter; light leaves, as what a white surface sends on, linear in
red, green and blue. From each point Embree casts rays over its half of space: what leaves for the
sky brings the sky's light, what meets a face or the ground brings what that sends on, for as many
bounces as matter (Goral et al., 1984, with rays in place of form factors). The light of the sun
itself is added where it is drawn, as its shadows have sharp edges.
"""

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.triangle_rays import TriangleRays, embreex_installed
from lrf3d.geometry import Bool, Float, Int, Single
from lrf3d.progress import Progress, silent
from lrf3d.scene.facades import layers
from lrf3d.scene.look import (
    GAMMA,
    GROUND_ALBEDO,
    GROUND_ALBEDO_INDOOR,
    SKYSHINE,
    SKYSHINE_INDOOR,
    SUN,
    SUNSHINE,
)
from lrf3d.scene.panels import Panels
from lrf3d.scene.shapes import single
from lrf3d.scene.structures import Structures

_RAYS, _GROUND_RAYS = 128, 96
"""Rays from a corner of a face, and from a place of the ground."""

_BOUNCES = 3
"""How often light goes on from face to face: a fourth time adds less than a hundredth."""

_AT_ONCE = 400_000
"""Rays that are cast at a time."""

_OFF, _INWARD = 0.02, 0.10
"""How far off its face a ray starts, and from the edges of its face [m]: beyond them is a wall."""

_INSIDE = 0.2
"""Share of rays that meet walls from within from which on a place is inside of one."""

_DARK = 0.02
"""Share of the open sky's light below which a face is never seen from a room or a street."""

_CELL, _CELLS = 1.0, 110
"""Least side of a cell of the ground that light goes on from [m], and the most cells to a side."""

_MOST_FACES = 400_000
"""Worlds of more faces have the light of an open field: it would take a minute."""


def sky_light(directions: Float, *, indoor: bool) -> Float:
    """What comes from the sky in directions (n, 3) of unit length: light (n, 3), linear."""
    if not indoor:
        return np.broadcast_to(SKYSHINE, directions.shape)
    # A large lamp on the sun's side of an even ceiling gives rooms a bright and a dark side.
    toward = np.maximum(directions @ SUN, 0.0)[:, None]
    return np.asarray(SKYSHINE_INDOOR * (0.72 + 0.75 * toward**3))


def screen(light: Float) -> Float:
    """Linear light as a factor of the colours that a screen shows."""
    return np.asarray(np.maximum(light, 0.0) ** (1.0 / GAMMA))


def open_light(*, indoor: bool) -> Float:
    """The light (3,) of the sky on open, level ground."""
    return np.asarray(sky_light(_sphere(512), indoor=indoor).mean(axis=0))


class Light:
    """The light of a world, at the corners of its faces (n, 4, 3)."""

    def __init__(self, structures: Structures, faces: Panels, progress: Progress = silent) -> None:
        self._indoor, self._count = structures.indoor, len(faces.places)
        self._open = open_light(indoor=self._indoor)
        self.faces: Float = np.broadcast_to(self._open, faces.places.shape)
        self._rays: TriangleRays | None = None
        # Without Embree the rays of all faces would take minutes: they get the light of the open.
        if not 0 < self._count <= _MOST_FACES or not embreex_installed():
            return
        self._turns = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, 4096)
        halves = faces.places[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3)
        self._rays = TriangleRays(single(halves))
        self._facing = faces.normals[:, :3].mean(axis=1)
        cells = self._cells(structures.places)
        places, normals, owner = _corners(faces)
        seen, sky = self._gather(places, normals, _RAYS, progress)
        seen_below, sky_below = self._gather(cells, _up(cells), _GROUND_RAYS)
        sun, albedo = self._sunlit(faces, cells), self._albedo(faces, cells)
        # What patches send on: faces, cells of the ground, the land around; insides of houses
        # and the sky, whose light is known, nothing.
        self._sent = np.zeros((self._count + len(cells) + 3, 3), np.float32)
        land = GROUND_ALBEDO_INDOOR if self._indoor else GROUND_ALBEDO
        self._sent[-3] = land * (self._open + self._shone(_up(np.zeros((1, 3))))[0])
        for bounce in range(_BOUNCES + 1):
            self.faces = (sky + _mean_of(self._sent, seen))[owner].reshape(-1, 4, 3)
            if bounce < _BOUNCES:
                below = sky_below + _mean_of(self._sent, seen_below)
                self._sent[:-3] = albedo * (np.concatenate([self.faces.mean(axis=1), below]) + sun)
        # No light gets between the two lines of a wall, which is seen where it is cut off.
        self.faces[self.faces.max(axis=-1) < _DARK * self._open.max()] = 0.5 * self._open

    def ground(self, places: Float) -> tuple[Float, Bool]:
        """The light (n, 3) on the ground at places (n, 2), and which are not inside of a house."""
        if self._rays is None:
            return np.broadcast_to(self._open, (len(places), 3)), np.ones(len(places), dtype=bool)
        places = np.column_stack([places, np.full(len(places), _OFF)])
        seen, sky = self._gather(places, _up(places), _GROUND_RAYS)
        return sky + _mean_of(self._sent, seen), (seen == self._land + 1).mean(axis=1) < _INSIDE

    def _cells(self, ends: Float) -> Float:
        """Middles (n, 3) of the cells of the ground that light goes on from, around ends (m, 2)."""
        low, high = ends.min(axis=0) - 4.0, ends.max(axis=0) + 4.0
        cell = max(_CELL * (0.5 if self._indoor else 1.0), float((high - low).max()) / _CELLS)
        self._low, self._cell = low, cell
        self._shape = np.ceil((high - low) / cell).astype(int)
        self._land = self._count + int(np.prod(self._shape))
        x, y = np.meshgrid(*(np.arange(side) + 0.5 for side in self._shape), indexing="ij")
        places = low + cell * np.column_stack([x.ravel(), y.ravel()])
        return np.column_stack([places, np.full(len(places), _OFF)])

    def _gather(
        self, places: Float, normals: Float, rays: int, progress: Progress = silent
    ) -> tuple[NDArray[np.int32], Float]:
        """Which patches (n, rays) the rays of points meet, and the mean light (n, 3) of the sky."""
        seen = np.empty((len(places), rays), np.int32)
        sky = np.empty((len(places), 3))
        for first in range(0, len(places), _AT_ONCE // rays):
            part = slice(first, min(first + _AT_ONCE // rays, len(places)))
            turn = self._turns[np.arange(part.start, part.stop) % len(self._turns)]
            ways = _around(normals[part], turn, _sphere(rays))
            patches = self._met(np.repeat(places[part], rays, axis=0), ways.reshape(-1, 3))
            seen[part] = patches.reshape(-1, rays)
            light = sky_light(ways.reshape(-1, 3), indoor=self._indoor).reshape(ways.shape)
            free = (patches == self._land + 2).reshape(-1, rays, 1)
            sky[part] = np.where(free, light, 0.0).mean(axis=1)
            progress(part.stop, len(places))
        return seen, sky

    def _met(self, origins: Float, ways: Float) -> Int:
        """The patch that each ray meets: faces, cells, the land around, insides, the sky."""
        assert self._rays is not None
        hits = self._rays.first(single(origins), single(ways))
        patches = np.full(len(ways), self._land + 2)
        down = (hits < 0) & (ways[:, 2] < 0.0)
        reach = origins[down, 2] / -ways[down, 2]
        place = origins[down, :2] + reach[:, None] * ways[down, :2]
        cell = np.floor((place - self._low) / self._cell).astype(int)
        inside = ((cell >= 0) & (cell < self._shape)).all(axis=1)
        number = cell[:, 0] * self._shape[1] + cell[:, 1]
        patches[down] = np.where(inside, self._count + number, self._land)
        met = np.flatnonzero(hits >= 0)
        owner = hits[met] // 2
        front = np.einsum("ij,ij->i", self._facing[owner], ways[met]) < 0.0
        patches[met] = np.where(front, owner, self._land + 1)
        return patches

    def _shone(self, normals: Float) -> Float:
        """The light (n, 3) of the sun on faces by their normals (n, 3), where nothing hides it."""
        if self._indoor:
            return np.zeros((len(normals), 3))
        return np.asarray(np.maximum(normals @ SUN, 0.0)[:, None] * SUNSHINE)

    def _sunlit(self, faces: Panels, cells: Float) -> Float:
        """The light (n, 3) of the sun on all patches, by a ray from the middle of each."""
        shine = self._shone(np.concatenate([self._facing, _up(cells)]))
        if self._indoor:
            return shine
        assert self._rays is not None
        middles = faces.places[:, :3].mean(axis=1)
        origins = np.concatenate([middles + _OFF * self._facing, cells])
        ways = np.broadcast_to(SUN, origins.shape)
        free = self._rays.first(single(origins), single(ways)) < 0
        return shine * free[:, None]

    def _albedo(self, faces: Panels, cells: Float) -> Float:
        """What share (n, 3) of light all patches send on."""
        # The coarsest copy of the texture is its mean.
        means = layers(self._indoor)[-1][:, 0, 0].astype(np.float64) / 255.0
        layer = faces.texture[:, 0, 2].astype(int)
        colours = faces.colours[:, 0] * means[layer, 3:] + means[layer, :3]
        ground = GROUND_ALBEDO_INDOOR if self._indoor else GROUND_ALBEDO
        below = np.broadcast_to(ground, cells.shape)
        return np.concatenate([np.clip(colours, 0.0, 1.0) ** GAMMA, below])


def _up(places: Float) -> Float:
    """Normals (n, 3) of the ground at places (n, 3)."""
    return np.broadcast_to([0.0, 0.0, 1.0], places.shape)


def _corners(faces: Panels) -> tuple[Float, Float, Int]:
    """Places and normals (n, 3) of the different corners of faces, and which of them each is."""
    places, normals = faces.places.reshape(-1, 3), faces.normals.reshape(-1, 3)
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
    x = cos * local[:, 0] - sin * local[:, 1]
    y = sin * local[:, 0] + cos * local[:, 1]
    return np.asarray(
        x[..., None] * first[:, None]
        + y[..., None] * second[:, None]
        + local[:, 2, None] * normals[:, None]
    )


def _mean_of(sent: Single, seen: NDArray[np.int32]) -> Float:
    """The mean (n, 3) of what patches send, over those seen (n, k)."""
    light = np.empty((len(seen), 3))
    for first in range(0, len(seen), 4096):
        light[first : first + 4096] = sent[seen[first : first + 4096]].mean(axis=1)
    return light
