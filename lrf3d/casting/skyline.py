"""Casting lidars and depth cameras among the walls of a world, from floor to height.

Level sensors are exact: see `kernels.skyline`. A tilted one casts each beam as a column of its own,
with the same decisions for its float64 direction. Behind mirrors and glass, and in meshes, beams
are cast in float64. The floor is z = 0.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from lrf3d.casting.kernels.beams import RAY
from lrf3d.casting.kernels.scans import laser_of, rays_from
from lrf3d.casting.kernels.skyline import ENTRY, Standing, raise_fan, raise_rays, read_layers
from lrf3d.casting.kernels.tree import Plain, build_tree
from lrf3d.geometry.lines import TINY, Float, Int, Records
from lrf3d.laser.depth_camera import DepthCamera
from lrf3d.laser.lidar import Lidar
from lrf3d.world import World

# Entries of a skyline for which there is room at first; it is doubled as needed.
ROOM_AT_FIRST = 8

# [share] How much the boundary of what walls enclose may differ from them by rounding.
WHOLE = 1e-9

# [m] In place of the length in the plane of a beam that has none, straight up or down.
UPRIGHT = 1e-20


class Layered(NamedTuple):
    """Layers for kernels: slopes (k, layers) that ascend, and their limits (layers,)."""

    slopes: Float
    stretches: Float
    range_min: float
    range_max: float


class Solids(NamedTuple):
    """Closed objects, whose tops are seen from above."""

    areas: Any  # Their outlines as polygons (m,).
    area: Int  # (n,) the outline that each wall is a part of, or −1.
    inner: NDArray[np.int8]  # (n,) 1 where it is on the left of the wall, −1 on the right, or 0.
    corners: Float  # (n, 4) the corners before the wall's start and after its end.


class Walls:
    """The walls of a world as they stand, with the tops of closed objects."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._tree = build_tree(world.segments)
        self._heights = world.heights[self._tree.rows]
        self._plain = np.zeros(len(world.segments), np.int8), np.zeros((len(world.segments), 4))

    @cached_property
    def _solids(self) -> "tuple[Solids, shapely.STRtree]":
        found = solids(self.world)
        return found, shapely.STRtree(found.areas)

    def standing(self, x: float, y: float, z: float) -> Plain:
        """The walls as kernels take them, for a sensor at a place."""
        highest = float(self._heights.max(initial=0.0))
        inner, corners = self._plain
        if (self._heights < z).any():
            found, tree = self._solids
            # An outline around the sensor is the wall of a yard.
            around = tree.query(shapely.Point(x, y), predicate="within")
            rows = self._tree.rows
            inner = np.where(np.isin(found.area, around), 0, found.inner).astype(np.int8)[rows]
            corners = found.corners[rows]
        return Standing(self._tree[:], self._heights, inner, corners, highest)[:]




def solids(world: World) -> Solids:
    """The closed objects of a world: of one height, all of whose walls are the outline of an area.

    Objects that the walls of another one reach into are rooms.
    """
    count = len(world.segments)
    lines = shapely.linestrings(world.segments.reshape(-1, 2, 2))
    order = np.argsort(world.objects, kind="stable")
    owners = world.objects[order]
    groups = np.full(world.object_count, None, dtype=object)
    groups = shapely.multilinestrings(lines[order], indices=owners, out=groups)
    areas = shapely.build_area(groups)
    outlines = shapely.length(shapely.boundary(areas))
    whole = np.abs(outlines - shapely.length(groups)) <= WHOLE * outlines
    low = np.full(world.object_count, np.inf)
    high = np.zeros(world.object_count)
    np.minimum.at(low, world.objects, world.heights)
    np.maximum.at(high, world.objects, world.heights)
    solid = np.flatnonzero(whole & (low == high) & (shapely.area(areas) > 0.0))
    tree = shapely.STRtree(areas[solid])
    wall, around = tree.query(lines, predicate="intersects")
    meets = shapely.relate_pattern(areas[solid][around], lines[wall], "T********")
    solid = np.delete(solid, np.unique(around[meets]))
    parts, part_of = shapely.get_parts(shapely.orient_polygons(areas[solid]), return_index=True)
    inner = np.zeros(count, np.int8)
    area = np.full(count, -1)
    corners = np.zeros((count, 4))
    named = {tuple(ends): row for row, ends in enumerate(world.segments.tolist())}
    for number, polygon in zip(part_of.tolist(), parts, strict=True):
        for ring in (polygon.exterior, *polygon.interiors):
            points = shapely.get_coordinates(ring)[:-1]
            for k in range(len(points)):
                before, start, stop, after = points[np.arange(k - 1, k + 3) % len(points)].tolist()
                sense = 1 if (*start, *stop) in named else -1
                row = named.get((*start, *stop), named.get((*stop, *start)))
                if row is not None:
                    inner[row] = sense
                    area[row] = number
                    corners[row] = (*before, *after) if sense > 0 else (*after, *before)
    return Solids(areas[solid], area, inner, corners)


def cast_lidar(walls: Walls, lidar: Lidar, pose: Float) -> tuple[Float, Int]:
    """Ranges and walls (layers, columns) of a lidar at a pose (3,)."""
    poses = np.asarray(pose, dtype=np.float64)[None]
    z = lidar.mount[2]
    standing = walls.standing(float(poses[0, 0]), float(poses[0, 1]), z)
    limits = float(lidar.range_min), float(lidar.range_max)
    if not lidar.is_level:
        beams = lidar.directions(poses[0]).reshape(-1, 3)
        rays = rays_along(poses[0], beams)
        single = Layered(beams[:, 2:], np.ones(1), *limits)
        found = _columns(standing, rays, z, single)
        return tuple(each.reshape(-1, lidar.columns) for each in found)
    order = np.argsort(lidar.slopes, kind="stable")
    layers = Layered(lidar.slopes[order][None], lidar.stretches[order], *limits)
    rays = np.empty((1, lidar.columns), RAY)
    laser = laser_of(lidar.planar)
    rays_from(laser, poses, np.zeros(1), rays)
    ranges, hits = _columns(standing, rays[0], z, layers, (laser, poses[0]))
    if (order[1:] > order[:-1]).all():
        return ranges.T, hits.T
    back = np.argsort(order)
    return ranges.T[back], hits.T[back]


def cast_depth(walls: Walls, camera: DepthCamera, pose: Float) -> tuple[Float, Int]:
    """Depths and walls (height, width) of a depth camera at a pose (3,)."""
    z = camera.mount[2]
    standing = walls.standing(float(pose[0]), float(pose[1]), z)
    limits = float(camera.range_min), float(camera.range_max)
    if not camera.is_level:
        beams = camera.directions(pose).reshape(-1, 3)
        single = Layered(beams[:, 2:], np.ones(1), *limits)
        found = _columns(standing, rays_along(pose, beams), z, single)
        return tuple(each.reshape(camera.height, camera.width) for each in found)
    row = camera.directions(pose)[0]
    layers = Layered(camera.slopes[::-1][None], np.ones(camera.height), *limits)
    depth, hits = _columns(standing, rays_along(pose, row), z, layers)
    return depth.T[::-1], hits.T[::-1]


def rays_along(pose: Sequence[float] | Float, beams: Float) -> Records:
    """Rays (n,) in the plane from a pose along beams (n, 3)."""
    rays = np.zeros(len(beams), RAY)
    rays["x"] = pose[0]
    rays["y"] = pose[1]
    flat = np.where(np.abs(beams[:, :2]) < TINY, 0.0, beams[:, :2])
    upright = (np.abs(flat) < UPRIGHT).all(axis=1)
    rays["dx"] = np.where(upright, UPRIGHT, flat[:, 0])
    rays["dy"] = flat[:, 1]
    return rays


def _columns(
    standing: Plain, rays: Records, z: float, layers: Layered,
    fan: tuple[Plain, Float] | None = None,
) -> tuple[Float, Int]:  # fmt: skip
    """Ranges and walls (columns, layers) along rays (columns,), which may be a fan at a pose."""
    slopes = np.ascontiguousarray(layers.slopes)
    reaches = layers.range_max / layers.stretches
    eye = z, float(slopes.min()), float(slopes.max()), float(reaches.max())
    limits = slopes[:, [0, -1]]
    room = ROOM_AT_FIRST
    while True:
        count = len(rays)
        entries = np.empty((count, room), ENTRY)
        skies = entries, np.zeros(count, np.int64), np.zeros(count, np.int8), np.zeros(count)
        if fan is not None:
            fits = raise_fan(standing, fan[0], fan[1], eye, skies)
        else:
            fits = raise_rays(standing, rays, eye, limits, skies)
        if fits:
            break
        room *= 2
    ranges = np.empty((len(rays), slopes.shape[1]))
    hits = np.empty(ranges.shape, np.int64)
    nears = layers.range_min / layers.stretches
    plain = slopes, layers.stretches, nears, reaches
    read_layers(rays, z, plain, layers.range_max, skies, ranges, hits)
    return ranges, hits
