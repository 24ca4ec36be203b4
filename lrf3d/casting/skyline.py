"""Casting lidars and depth cameras among walls that stand on the floor, z = 0.

Level sensors are exact: see `kernels.skyline`. A tilted sensor casts each beam as a column of its
own, with the same exact decisions for its float64 direction. Behind mirrors and glass, and in
meshes, beams are cast in float64.
"""

import math
from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache
from sys import getrefcount
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from lrf3d.casting.crowd import Crowd, records
from lrf3d.casting.kernels.beams import RAY
from lrf3d.casting.kernels.fleets import cast_fans
from lrf3d.casting.kernels.layers import read_layers
from lrf3d.casting.kernels.raising import raise_fan, raise_obstacles, raise_rays
from lrf3d.casting.kernels.scans import PADDING, laser_of, rays_from
from lrf3d.casting.kernels.skyline import ENTRY
from lrf3d.casting.kernels.tree import Plain, build_tree
from lrf3d.geometry.lines import TINY, Bool, Float, Int, Records, sealed
from lrf3d.geometry.pose import between, compose
from lrf3d.laser.depth_camera import DepthCamera
from lrf3d.laser.lidar import Lidar
from lrf3d.laser.range_finder import turn
from lrf3d.world import World

Rows = NDArray[np.int32]

# Initial capacity of a skyline in entries; it is doubled as needed.
ROOM_AT_FIRST = 8

# [share] Rounding tolerance between the length of walls and that of the boundary of their area.
WHOLE = 1e-9

# Beams of lidars that are cast at a time: their ranges and noise fit into a cache of 2 MB.
AT_ONCE = 1 << 17

# [m] An outline that is nowhere wider is a wall: old ones of stone are 0.5 m thick, and no robot
# drives in it.
THICKEST = 0.6

# [m] Length in the plane that stands for 0, of a beam straight up or down.
UPRIGHT = 1e-20


class Layered(NamedTuple):
    """Layers by ascending slope, as kernels take them, and how far they measure."""

    plain: Plain
    extent: tuple[float, float, float]

    @classmethod
    def of(cls, slopes: Float, stretches: Float, sensor: Any) -> "Layered":
        """Layers of slopes (k, layers); stretches (layers,) are a beam's length for t = 1."""
        slopes = np.ascontiguousarray(slopes)
        limits = float(sensor.range_min), float(sensor.range_max)
        nears, reaches = (limit / stretches for limit in limits)
        extent = float(slopes.min()), float(slopes.max()), float(reaches.max())
        return cls((slopes, stretches, nears, reaches, limits[1]), extent)


class Conditions(NamedTuple):
    """What moves: the robot by a motion (3,) during a scan, and dynamic obstacles at a time [s]."""

    time: float = 0.0
    motion: Float | None = None
    obstacles: Crowd | None = None


# One moment, without obstacles.
STILL = Conditions()


class Solids(NamedTuple):
    """Closed objects, whose tops are seen from above."""

    areas: Any  # Their outlines as polygons (m,).
    area: Int  # (n,) the outline that each wall is a part of, or −1.
    inner: NDArray[np.int8]  # (n,) 1 where it is on the left of the wall, −1 on the right, or 0.
    corners: Float  # (n, 4) the corners before the wall's start and after its end.


class StandingWalls:
    """The walls of a world with their heights, and the tops of closed objects."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._tree = build_tree(world.segments)
        self._heights = world.heights[self._tree.rows]
        self._highest = float(world.heights.max(initial=0.0))
        self._lowest = float(world.heights.min(initial=np.inf))
        self._arrays: dict[str, Any] = {}
        self.room = ROOM_AT_FIRST
        self._without_tops = self._with(
            np.zeros(len(world.segments), np.int8), np.zeros((len(world.segments), 4))
        )

    def _with(self, inner: NDArray[np.int8], corners: Float) -> Plain:
        """The walls as kernels take them, with outlines in the order of the tree."""
        return self._tree[:], self._heights, inner, corners, self._highest

    @cached_property
    def _solids(self) -> "tuple[Solids, shapely.STRtree]":
        found = solids(self.world)
        return found, shapely.STRtree(found.areas)

    def standing(self, pose: Float, z: float) -> Plain:
        """The walls as kernels take them, a `Standing`, for a sensor at a pose and a height."""
        if not self._lowest < z:
            return self._without_tops
        return self._outside_of(self._around(pose[None])[0])

    def standings(self, poses: Float, z: float) -> Iterator[tuple[Int, Plain]]:
        """The walls for sensors at poses (k, 3), and the numbers of the poses that share them."""
        if not self._lowest < z:
            yield np.arange(len(poses)), self._without_tops
            return
        around = self._around(poses)
        groups: dict[bytes, list[int]] = {}
        for number, areas in enumerate(around):
            groups.setdefault(areas.tobytes(), []).append(number)
        for numbers in groups.values():
            yield np.array(numbers), self._outside_of(around[numbers[0]])

    def _around(self, poses: Float) -> list[Int]:
        """The outlines around each of the poses (k, 3)."""
        place, area = self._solids[1].query(shapely.points(poses[:, :2]), predicate="within")
        return [area[place == number] for number in range(len(poses))]

    def _outside_of(self, around: Int) -> Plain:
        """The walls for a sensor within some outlines that may see tops of others."""
        found, _ = self._solids
        # An outline around the sensor is the wall of a yard, and has no top.
        rows = self._tree.rows
        inner = np.where(np.isin(found.area, around), 0, found.inner).astype(np.int8)
        return self._with(inner[rows], found.corners[rows])

    def skies(self, columns: int) -> Plain:
        """Empty skylines of columns."""
        spare = self._arrays.pop("skies", None)
        if spare is not None and len(spare[1]) == columns and spare[3] == self.room:
            return spare
        empty = [np.zeros(columns, kind) for kind in (np.int64, np.int8, np.float64)]
        return np.empty(self.room * columns, ENTRY), *empty[:2], self.room, empty[2]

    def keep(self, skies: Plain) -> None:
        """Keep skylines, which are empty again, for the next scan."""
        self._arrays["skies"] = skies

    def reused(self, name: str, shape: tuple[int, ...], kind: Any) -> Any:
        """An uninitialised array: the last one of its name, unless it is still in use.

        Allocating new memory takes as long as a scan.
        """
        array = self._arrays.pop(name, None)
        # Two references are this variable and the argument of getrefcount.
        if array is None or getrefcount(array) > 2 or array.shape != shape:
            array = np.empty(shape, kind)
        self._arrays[name] = array
        return array


def _enclosed(lines: NDArray[Any]) -> NDArray[Any]:
    """The areas (n,) that lines (n,) enclose, which are invalid for some lines that cross."""
    try:
        return np.asarray(shapely.build_area(lines))
    except shapely.errors.GEOSException:
        return np.asarray(shapely.build_area(shapely.node(lines)))


def solids(world: World) -> Solids:
    """The closed objects of a world: all walls of one have one height and are an area's outline.

    Objects into which walls of others reach are rooms, without a top.
    """
    count = len(world.segments)
    lines = shapely.linestrings(world.segments.reshape(-1, 2, 2))
    order = np.argsort(world.objects, kind="stable")
    owners = world.objects[order]
    groups = np.full(world.object_count, None, dtype=object)
    groups = shapely.multilinestrings(lines[order], indices=owners, out=groups)
    areas = _enclosed(groups)
    outlines = shapely.length(shapely.boundary(areas))
    whole = np.abs(outlines - shapely.length(groups)) <= WHOLE * outlines
    low = np.full(world.object_count, np.inf)
    high = np.zeros(world.object_count)
    np.minimum.at(low, world.objects, world.heights)
    np.maximum.at(high, world.objects, world.heights)
    proper = (shapely.area(areas) > 0.0) & shapely.is_valid(areas)
    solid = np.flatnonzero(whole & (low == high) & proper)
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


def in_walls(world: World, centres: Float, places: Float, z: float) -> Bool:
    """Which sensors at places (n, 2) and a height are in walls, or behind them.

    Behind is what walls of that height part from the centres (n, 2) of the robots.
    """
    high = np.flatnonzero(world.heights >= z)
    tree = shapely.STRtree(shapely.linestrings(world.segments[high].reshape(-1, 2, 2)))
    points = shapely.points(places)
    arms = shapely.linestrings(np.stack([centres, places], axis=1))
    behind, _ = tree.query(arms, predicate="intersects")
    _, near = tree.query(points, predicate="dwithin", distance=THICKEST)
    own = high[np.isin(world.objects[high], world.objects[high[near]])]
    areas = solids(World(world.segments[own], world.objects[own], world.heights[own])).areas
    thin = areas[shapely.is_empty(shapely.buffer(areas, -0.5 * THICKEST))]
    inside, _ = shapely.STRtree(thin).query(points, predicate="within")
    return np.isin(np.arange(len(places)), [*behind, *inside])


def cast_lidar(
    walls: StandingWalls, lidar: Lidar, pose: Float, moment: Conditions = STILL
) -> tuple[Float, Rows]:
    """Ranges and walls (layers, columns) of a lidar at a pose (3,), at rest or moving."""
    moved = moment.motion is not None and bool(np.any(moment.motion))
    motion = moment.motion if moved else None
    if not lidar.is_level:
        return _cast_tilted(
            walls, lidar, pose, moment.time + lidar.planar.delays, motion, moment.obstacles
        )
    z = lidar.mount[2]
    standing = walls.standing(pose, z)
    layers, back, fan = _layers_of(lidar)
    if motion is None and not moment.obstacles:
        shape = lidar.columns, len(lidar.slopes)
        ranges = walls.reused("ranges", shape, np.float64)
        hits = walls.reused("hits", shape, np.int32)
        _cast_fans(walls, standing, lidar, pose[None], ranges[None], hits)
    else:
        times = moment.time + lidar.planar.delays
        rays: Records | None = None
        if motion is not None:
            rays = np.empty(lidar.columns, RAY)
            rays_from(fan[0], swept(lidar, pose, motion), times, rays[None])
        ranges, hits = _columns(
            walls, standing, rays, z, layers, (fan, pose, times), moment.obstacles
        )
    return (ranges.T, hits.T) if back is None else (ranges.T[back], hits.T[back])


def _cast_tilted(
    walls: StandingWalls, lidar: Lidar, pose: Float, times: Float, motion: Float | None,
    crowd: Crowd | None,
) -> tuple[Float, Rows]:  # fmt: skip
    """Ranges and walls of a lidar that is not level, whose columns are cast at times (columns,)."""
    z = lidar.mount[2]
    standing = walls.standing(pose, z)
    shape = len(lidar.slopes), lidar.columns
    if motion is None:
        layers, order, fan = _sorted_beams(lidar)
        along = fan, pose, times[order % lidar.columns]
        found = _columns(walls, standing, None, z, layers, along, crowd)
        ranges, hits = (np.empty(len(order), each.dtype) for each in found)
        ranges[order], hits[order] = (each.ravel() for each in found)
        return ranges.reshape(shape), hits.reshape(shape)
    poses = swept(lidar, pose, motion)
    beams = lidar.directions((0.0, 0.0, 0.0))
    cos: Any = np.cos(poses[:, 2])
    sin: Any = np.sin(poses[:, 2])
    beams[..., 0], beams[..., 1] = turn(beams[..., 0], beams[..., 1], cos, sin)
    places = np.broadcast_to(poses, (*shape, 3)).reshape(-1, 3)
    flat = beams.reshape(-1, 3)
    rays = rays_along(places.T, flat, np.broadcast_to(times, shape).ravel())
    layers = Layered.of(flat[:, 2:], np.ones(1), lidar)
    ranges, hits = _columns(walls, standing, rays, z, layers, crowd=crowd)
    return ranges.reshape(shape), hits.reshape(shape)


def cast_lidars(walls: StandingWalls, lidar: Lidar, poses: Float) -> Iterator[tuple[Int, Float]]:
    """Ranges (k, layers, columns) of a level lidar at some of the poses, with their numbers (k,).

    They come in parts that fit into the cache.
    """
    order = _layers_of(lidar)[1]
    shape = lidar.columns, len(lidar.slopes)
    many = max(1, AT_ONCE // (shape[0] * shape[1]))
    hits = np.empty(shape, np.int32)
    ranges = np.empty((many, *shape))
    for numbers, standing in walls.standings(poses, lidar.mount[2]):
        for part in (numbers[k : k + many] for k in range(0, len(numbers), many)):
            _cast_fans(walls, standing, lidar, poses[part], ranges, hits)
            found = ranges[: len(part)] if order is None else ranges[: len(part), :, order]
            yield part, found.transpose(0, 2, 1)


def _cast_fans(
    walls: StandingWalls, standing: Plain, lidar: Lidar, poses: Float, ranges: Float, hits: Rows
) -> None:
    """Fill ranges (k, columns, layers) of a level lidar, and the hits of the last of k poses."""
    layers, _, fan = _layers_of(lidar)
    sensor = fan, (lidar.mount[2], *layers.extent), layers.plain
    directions = walls.reused("directions", (2, lidar.columns + PADDING), np.float64)
    done = 0
    while done < len(poses):
        skies = walls.skies(lidar.columns)
        done += cast_fans(standing, sensor, poses[done:], directions, skies, ranges[done:], hits)
        if done < len(poses):
            walls.room *= 2
        else:
            walls.keep(skies)


def swept(lidar: Lidar, pose: Float, motion: Float) -> Float:
    """Poses (columns, 3) of a lidar at the times of its columns; its robot moves uniformly."""
    mount = np.array(lidar.planar.mount)
    shares = np.linspace(0.0, 1.0, lidar.columns)[:, None]
    return compose(pose, between(mount, compose(shares * motion, mount)))


def cast_depth(
    walls: StandingWalls, camera: DepthCamera, pose: Float, moment: Conditions = STILL
) -> tuple[Float, Rows]:
    """Depths and walls (height, width) of a depth camera at a pose (3,)."""
    z = camera.mount[2]
    standing = walls.standing(pose, z)
    if camera.is_level:
        # Azimuths are the same in all rows; directions of all pixels would take longer than depths.
        theta = float(pose[2])
        ahead, left = turn(np.ones(camera.width), camera.lefts, math.cos(theta), math.sin(theta))
        flat = np.column_stack([ahead, left])
        layers = Layered.of(camera.slopes[None, ::-1], np.ones(camera.height), camera)
    else:
        flat = camera.directions(pose).reshape(-1, 3)
        layers = Layered.of(flat[:, 2:], np.ones(1), camera)
    rays = rays_along(pose, flat, moment.time)
    depth, hits = _columns(walls, standing, rays, z, layers, crowd=moment.obstacles)
    if camera.is_level:
        return depth.T[::-1], hits.T[::-1]
    return depth.reshape(camera.height, -1), hits.reshape(camera.height, -1)


@lru_cache(8)
def _layers_of(lidar: Lidar) -> tuple[Layered, Int | None, Plain]:
    """A level lidar's layers, their order unless ascending, and its beams as of `raise_fan`."""
    order = np.argsort(lidar.slopes, kind="stable")
    layers = Layered.of(lidar.slopes[None, order], lidar.stretches[order], lidar)
    back = None if (order[1:] > order[:-1]).all() else np.argsort(order)
    slopes = layers.plain[0][:, [0, -1]]
    return layers, back, (laser_of(lidar.planar), (np.arange(lidar.columns + 1), 0.0, slopes))


@lru_cache(8)
def _sorted_beams(lidar: Lidar) -> tuple[Layered, Int, Plain]:
    """A tilted lidar's beams, each a layer, their order by azimuth, and as of `raise_fan`."""
    beams = lidar.directions((0.0, 0.0, 0.0)).reshape(-1, 3)
    count = len(beams)
    flat = np.where(np.abs(beams[:, :2]) < TINY, 0.0, beams[:, :2])
    flat[(np.abs(flat) < UPRIGHT).all(axis=1), 0] = UPRIGHT
    turns = 0.5 + np.arctan2(flat[:, 1], flat[:, 0]) / (2.0 * math.pi)
    sector = np.minimum((turns * count).astype(np.int64), count - 1)
    order = np.argsort(sector, kind="stable")
    half = math.pi / count
    laser = (
        sealed(np.ascontiguousarray(flat[order].T)),
        0.0,
        math.pi - half,
        *laser_of(lidar.planar)[-2:],
    )
    before = np.append(0, np.cumsum(np.bincount(sector, minlength=count)))
    layers = Layered.of(beams[order, 2:], np.ones(1), lidar)
    return layers, order, (laser, (before, half, layers.plain[0][:, [0, -1]]))


def rays_along(pose: Sequence[Any] | Float, beams: Float, times: Float | float = 0.0) -> Records:
    """Rays (n,) in the plane along beams (n, 2 or 3), from one pose or from one for each ray."""
    flat = np.where(np.abs(beams[:, :2]) < TINY, 0.0, beams[:, :2])
    flat[(np.abs(flat) < UPRIGHT).all(axis=1), 0] = UPRIGHT
    return records(RAY, pose[0], pose[1], *flat.T, times)


def _columns(
    walls: StandingWalls, standing: Plain, rays: Records | None, z: float, layers: Layered,
    fan: tuple[Any, ...] = (), crowd: Crowd | None = None,
) -> tuple[Float, Rows]:  # fmt: skip
    """Ranges and walls (columns, layers) along rays (columns,), or along a fan if rays are None.

    A fan is given with its pose and the times of its beams.
    """
    slopes = layers.plain[0]
    eye = z, *layers.extent
    limits = slopes[:, [0, -1]]
    count = len(fan[2]) if rays is None else len(rays)
    directions = walls.reused("directions", (2, count + PADDING), np.float64)
    while True:
        skies = walls.skies(count)
        if rays is None:
            fits = raise_fan(standing, fan[0], fan[1], directions, eye, skies)
        else:
            fits = raise_rays(standing, rays, eye, limits, skies)
            directions[:, :count] = rays["dx"], rays["dy"]
        if crowd:
            beams = (
                records(RAY, *fan[1][:2], *directions[:, :count], fan[2]) if rays is None else rays
            )
            near = crowd.as_seen(beams)
            fits = raise_obstacles(crowd.near, crowd.own, near, eye, limits, skies) and fits
        if fits:
            break
        walls.room *= 2
    shape = (count, slopes.shape[1])
    ranges = walls.reused("ranges", shape, np.float64)
    hits = walls.reused("hits", shape, np.int32)
    places = fan[1][None] if rays is None else np.column_stack([rays["x"], rays["y"]])
    read_layers(places, directions, z, layers.plain, skies, ranges, hits)
    walls.keep(skies)
    return ranges, hits
