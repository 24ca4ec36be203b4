"""World: the walls of a scene as line segments, grouped into objects."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.errors import InputError, WorldError, shown
from lrf3d.geometry import (
    LARGEST_COORDINATE,
    LATER,
    Float,
    Int,
    Value,
    is_finite,
    normal_lines,
    read_only,
    sealed,
)
from lrf3d.notebook import Pictured
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.materials import Material, checked

DEFAULT_HEIGHT = 2.5
"""Height of a wall [m] if none is given: a room's storey."""

MOST_OBJECTS = 1_000_000
"""Largest number of an object: a name and a colour are stored for every number up to it."""


@dataclass(frozen=True, eq=False)
class World(Value, Pictured):
    """Walls: line segments with a height, each a part of an object.

    Args:
        segments: (n, 4) rows x1 y1 x2 y2 [m], in the coordinates of the source, also far from
            the origin.
        objects: (n,) number of the object that each wall belongs to, from 0 to 1,000,000; 0 for
            all walls if not given.
        heights: (n,) heights of the walls above the ground [m]; 2.5 if not given.
        name: Name of the world in pictures and files.
        object_names: A name for each object, or no names.
        cameras: Fixed cameras, each with a unique name.
        colours: (objects, 3) red, green, blue in 0…1 for each object; NaN if none is given.
        place: Longitude and latitude [°] of the point (0, 0), where the source was in degrees.
        free: Cells that are known to be free, which only ROS maps have: routes are planned through
            them. They do not affect beams.
        materials: A material for each object, as a :class:`Material` or the name of a built-in one,
            and None for objects that are of plaster; or no materials. Scans of a world with
            materials have intensities, its mirrors turn beams, and its glass lets them through.

    Raises:
        WorldError: A segment has no length or an end that is not finite or over 1e9 m away, the
            shapes do not fit, a material is unknown, or a value is of the wrong kind.

    Examples:
        >>> import lrf3d
        >>> world = lrf3d.World([[0, 0, 4, 0], [4, 0, 4, 3]], objects=[0, 0], name="corner")
        >>> world.bounds.tolist()
        [[0.0, 0.0], [4.0, 3.0]]
        >>> world.heights.tolist()
        [2.5, 2.5]
    """

    segments: Float
    objects: Int
    heights: Float
    name: str
    object_names: tuple[str, ...]
    colours: Float
    cameras: tuple[FixedCamera, ...]
    place: tuple[float, float] | None
    free: FreeCells | None
    materials: tuple[Material | None, ...] = field(default=(), metadata=LATER)

    def __init__(
        self,
        segments: ArrayLike,
        objects: ArrayLike | None = None,
        heights: ArrayLike | None = None,
        name: str = "",
        *,
        object_names: Sequence[str] = (),
        colours: ArrayLike | None = None,
        cameras: Sequence[FixedCamera] = (),
        place: tuple[float, float] | None = None,
        free: FreeCells | None = None,
        materials: Sequence[str | Material | None] | None = None,
    ) -> None:
        rows = _rows(segments, 4, "segments")
        count = len(rows)
        _check_segments(rows)
        numbers = _object_numbers(np.zeros(count) if objects is None else objects, count)
        heights = np.full(count, DEFAULT_HEIGHT) if heights is None else heights
        object.__setattr__(self, "segments", rows)
        object.__setattr__(self, "objects", numbers)
        object.__setattr__(self, "heights", _heights(heights, count))
        object.__setattr__(self, "name", _text(name, "name"))
        colours = np.full((self.object_count, 3), np.nan) if colours is None else colours
        object.__setattr__(self, "colours", _colours(colours))
        names = [_text(each, "object_names") for each in _items(object_names, "object_names")]
        object.__setattr__(self, "object_names", tuple(names))
        object.__setattr__(self, "cameras", _cameras(cameras))
        object.__setattr__(self, "place", None if place is None else _place(place))
        if not (free is None or isinstance(free, FreeCells)):
            raise WorldError(f"free: expected FreeCells or None, found {shown(free)}")
        object.__setattr__(self, "free", free)
        materials = None if materials is None else _items(materials, "materials")
        object.__setattr__(self, "materials", checked(materials, self.object_count))
        count = self.object_count
        if len(self.colours) != count or len(names) not in (0, count):
            raise WorldError(
                f"{len(self.colours)} colours and {len(names)} names for {count} objects:"
                " expected one for each, or none at all"
            )

    def __repr__(self) -> str:
        name = f"{self.name!r}, " if self.name else ""
        (x1, y1), (x2, y2) = self.bounds
        return (
            f"World({name}{len(self.segments)} walls, {self.object_count} objects,"
            f" {x2 - x1:.4g} m x {y2 - y1:.4g} m)"
        )

    @cached_property
    def lines(self) -> Float:
        """Lines (n, 2) of the walls: alpha [rad] in (−π, π], p [m] (Eq. 3)."""
        return sealed(normal_lines(self.segments))

    @cached_property
    def bounds(self) -> Float:
        """Corners (2, 2) of the box around all walls: smallest x, y and largest x, y [m]."""
        ends = self.segments.reshape(-1, 2)
        if not len(ends):
            return sealed(np.zeros((2, 2)))
        return sealed(np.stack([ends.min(axis=0), ends.max(axis=0)]))

    @cached_property
    def origin(self) -> Float:
        """Origin (2,) of the local frame: the middle of the world, in whole metres."""
        low, high = self.bounds
        return sealed(np.asarray(np.round(low + 0.5 * (high - low)), dtype=np.float64))

    @cached_property
    def object_count(self) -> int:
        """Number of objects."""
        return int(self.objects.max(initial=-1)) + 1

    def scaled(self, factor: float) -> "World":
        """The world with x and y scaled about (0, 0); heights stay the same.

        Raises:
            WorldError: The factor is not from 0.000001 to 1000000, or a wall has no length left.
        """
        if not (is_finite(factor) and 1e-6 <= factor <= 1e6):
            raise WorldError(f"scale {shown(factor)}: expected 0.000001 to 1000000")
        if factor == 1.0:
            return self
        return replace(
            self,
            segments=self.segments * factor,
            cameras=tuple(camera.scaled(factor) for camera in self.cameras),
            place=None,
            free=None if self.free is None else self.free.scaled(factor),
        )


def _array(values: ArrayLike, name: str) -> Float:
    try:
        array: Float = read_only(values, name)
    except InputError as error:
        raise WorldError(str(error)) from None
    return array


def _rows(values: ArrayLike, columns: int, name: str) -> Float:
    array = _array(values, name)
    if array.size == 0:
        return sealed(np.empty((0, columns)))
    if array.ndim != 2 or array.shape[1] != columns:
        raise WorldError(f"{name} of shape {array.shape}: expected (n, {columns})")
    return array


def _column(values: ArrayLike, count: int, name: str) -> Float:
    array = _array(values, name)
    if array.shape != (count,):
        raise WorldError(f"{name} of shape {array.shape}: expected ({count},), one for each wall")
    if not np.isfinite(array).all():
        wall = int(np.flatnonzero(~np.isfinite(array))[0])
        raise WorldError(f"wall {wall}: {name} is {array[wall]}, expected a finite number")
    return array


def _object_numbers(values: ArrayLike, count: int) -> Int:
    objects = _column(values, count, "object")
    invalid = (objects < 0.0) | (objects > MOST_OBJECTS) | (objects != np.floor(objects))
    if invalid.any():
        wall = int(np.flatnonzero(invalid)[0])
        raise WorldError(
            f"wall {wall}: object {objects[wall]:.17g}, expected whole numbers from 0 to"
            f" {MOST_OBJECTS}; renumber the objects 0, 1, 2, …"
        )
    return sealed(objects.astype(np.int64))


def _heights(values: ArrayLike, count: int) -> Float:
    heights = _column(values, count, "height")
    bad = np.flatnonzero(~((heights > 0.0) & (heights <= LARGEST_COORDINATE)))
    if len(bad):
        raise WorldError(
            f"wall {bad[0]}: height {heights[bad[0]]:g} m, expected more than 0 and at most"
            f" {LARGEST_COORDINATE:g}"
        )
    return heights


def _items(values: Any, name: str) -> list[Any]:
    """The items of a list or tuple from outside; a text is neither."""
    if isinstance(values, list | tuple):
        return list(values)
    raise WorldError(f"{name}: expected a list, found {shown(values)}")


def _text(value: Any, name: str) -> str:
    if not isinstance(value, str):
        raise WorldError(f"{name}: expected a text, found {shown(value)}")
    return value


def _colours(values: ArrayLike) -> Float:
    colours = _rows(values, 3, "colours")
    known = ((colours >= 0.0) & (colours <= 1.0)).all(axis=1)
    bad = np.flatnonzero(~known & ~np.isnan(colours).all(axis=1))
    if len(bad):
        raise WorldError(
            f"object {bad[0]}: colour {colours[bad[0]].tolist()}, expected red, green, blue from 0"
            " to 1, or three NaN for none"
        )
    return colours


def _cameras(values: Any) -> tuple[FixedCamera, ...]:
    cameras = _items(values, "cameras")
    for index, camera in enumerate(cameras):
        if not isinstance(camera, FixedCamera):
            raise WorldError(f"cameras: expected FixedCamera, found {shown(camera)}")
        if camera.name in [other.name for other in cameras[:index]]:
            raise WorldError(f"cameras: two of the name {camera.name!r}; rename one")
    return tuple(cameras)


def _place(values: Any) -> tuple[float, float]:
    items = _items(values, "place")
    if len(items) != 2 or not is_finite(*items):
        raise WorldError(f"place: expected longitude and latitude, found {shown(values)}")
    return float(items[0]), float(items[1])


def _check_segments(segments: Float) -> None:
    bad = ~(np.abs(segments) <= LARGEST_COORDINATE).all(axis=1)
    if bad.any():
        wall = int(np.flatnonzero(bad)[0])
        raise WorldError(
            f"wall {wall}: ends {segments[wall].tolist()}, expected finite numbers of at most"
            f" {LARGEST_COORDINATE:g} m"
        )
    empty = (segments[:, :2] == segments[:, 2:]).all(axis=1)
    if empty.any():
        wall = int(np.flatnonzero(empty)[0])
        x, y = segments[wall, :2]
        raise WorldError(
            f"wall {wall}: both ends at ({x:g}, {y:g}), a segment of no length; remove one"
        )
