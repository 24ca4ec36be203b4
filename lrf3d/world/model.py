"""World: the walls of a scene as line segments, grouped into objects; implausible sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError, WorldError, shown
from lrf3d.base.lazy import Pictured
from lrf3d.base.units import FOOT, METRES
from lrf3d.geometry.lines import (
    LARGEST_COORDINATE,
    Float,
    Int,
    Value,
    is_finite,
    lengths,
    normal_lines,
    read_only,
    sealed,
)
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.materials import Material, checked
from lrf3d.world.schema import MOST_OBJECTS, check_unique

# Height of a wall [m] if none is given: a room's storey.
DEFAULT_HEIGHT = 2.5

# Width of a door [m] if none is given.
DOOR = 0.9

# Largest side of a cell of a map [m].
LARGEST_CELL = 1e4

# Side [m] of a world below which there is no room for a robot.
LEAST = 0.5

# Side [m] below which a plan may be a drawing on paper.
SHEET = 2.0

# Geometric mean [m] of the size and the usual wall length of buildings: 8 for a flat, 30 for a
# town. Below 7.5, centimetres would be taken for inches; the message names the resulting size.
TYPICAL = 12.0

# Names of units other than metres by their size [m].
UNITS = dict(zip(METRES.values(), "millimetres centimetres inches feet km".split(), strict=True))

# Largest factor by which a plan is enlarged.
LARGEST_SCALE = 1e6


def check_scale(factor: float) -> None:
    """Check a factor by which a plan is enlarged."""
    if not (is_finite(factor) and 1.0 / LARGEST_SCALE <= factor <= LARGEST_SCALE):
        raise WorldError(f"scale {shown(factor)}: expected 0.000001 to 1000000")


@dataclass(frozen=True, eq=False)
class World(Value, Pictured):
    """Walls: line segments with a height, each a part of an object.

    Args:
        segments: (n, 4) rows x1 y1 x2 y2 [m], in the coordinates of the source, also far from
            the origin.
        objects: (n,) number of the object of each wall, from 0 to 1,000,000; 0 if not given.
        heights: (n,) heights of the walls above the ground [m]; 2.5 if not given.
        name: Name of the world in pictures and files.
        object_names: A name for each object, or no names.
        cameras: Fixed cameras, each with a unique name.
        colours: (objects, 3) red, green, blue in 0…1 for each object; NaN if none is given.
        place: Longitude and latitude [°] of the point (0, 0), where the source was in degrees.
        free: Cells that a map knows to be free: routes are planned through them.
        materials: A :class:`Material` for each object, the name of a built-in one, or None for
            plaster; or no materials. Scans of a world with materials have intensities, its mirrors
            turn beams, and its glass lets them through.

    Raises:
        WorldError: A segment has no length or an end that is not finite or over 1e9 m away, the
            shapes do not fit, a material is unknown, or a value is of the wrong kind.

    Examples:
        >>> import lrf3d
        >>> world = lrf3d.World([[0, 0, 4, 0], [4, 0, 4, 3]], objects=[0, 0], name="corner")
        >>> world.bounds.tolist(), world.heights.tolist()
        ([[0.0, 0.0], [4.0, 3.0]], [2.5, 2.5])
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
    materials: tuple[Material | None, ...] = ()

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
        rows = _array(segments, "segments", (-1, 4))
        walls = len(rows)
        far = LARGEST_COORDINATE
        near = (np.abs(rows) <= far).all(axis=1)
        long = (rows[:, :2] != rows[:, 2:]).any(axis=1)
        _check(near, "wall", "ends", rows, f"finite numbers of at most {far:g} m")
        _check(long, "wall", "ends", rows, "two different points; remove one")
        numbers = _array(np.zeros(walls) if objects is None else objects, "objects", (walls,))
        whole = (numbers >= 0.0) & (numbers <= MOST_OBJECTS) & (numbers == np.floor(numbers))
        _check(
            whole, "wall", "object", numbers, f"whole numbers from 0 to {MOST_OBJECTS}: renumber"
        )
        owned = sealed(numbers.astype(np.int64))
        count = int(owned.max(initial=-1)) + 1
        given = np.full(walls, DEFAULT_HEIGHT) if heights is None else heights
        tops = _array(given, "heights", (walls,))
        stands = (tops > 0.0) & (tops <= far)
        _check(stands, "wall", "height", tops, f"more than 0 and at most {far:g} m")
        given = np.full((count, 3), np.nan) if colours is None else colours
        shades = _array(given, "colours", (count, 3))
        seen = ((shades >= 0.0) & (shades <= 1.0)).all(axis=1) | np.isnan(shades).all(axis=1)
        _check(seen, "object", "colour", shades, "red, green, blue from 0 to 1, or three NaN")
        names = _items(object_names, str, "object_names")
        if len(names) not in (0, count):
            raise WorldError(f"{len(names)} names for {count} objects: expected one for each")
        filmed = _items(cameras, FixedCamera, "cameras")
        check_unique("cameras", [camera.name for camera in filmed])
        made_of = _items(() if materials is None else materials, str | Material | None, "materials")
        [called] = _items([name], str, "name")
        [cells] = _items([free], FreeCells | None, "free")
        looks = (called, names, shades, filmed, _place(place), cells, checked(made_of, count))
        for each, value in zip(fields(self), (rows, owned, tops, *looks), strict=True):
            object.__setattr__(self, each.name, value)

    def __repr__(self) -> str:
        name = f"{self.name!r}, " if self.name else ""
        wide, high = np.ptp(self.bounds, axis=0)
        held = f"{len(self.segments)} walls, {self.object_count} objects"
        return f"World({name}{held}, {wide:.4g} m x {high:.4g} m)"

    @cached_property
    def lines(self) -> Float:
        """Lines (n, 2) of the walls: alpha [rad] in (−π, π], p [m] (Eq. 3)."""
        return sealed(normal_lines(self.segments))

    @cached_property
    def bounds(self) -> Float:
        """Corners (2, 2) of the box around all walls: smallest x, y and largest x, y [m]."""
        ends = self.segments.reshape(-1, 2) if len(self.segments) else np.zeros((1, 2))
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

    def scaled(self, factor: float) -> World:
        """The world with x and y scaled about (0, 0) by 0.000001 to 1000000; heights stay."""
        check_scale(factor)
        if factor == 1.0:
            return self
        return replace(
            self,
            segments=self.segments * factor,
            cameras=tuple(camera.scaled(factor) for camera in self.cameras),
            place=None,
            free=None if self.free is None else self.free.scaled(factor),
        )


def size_problem(world: World, least: float = SHEET) -> str | None:
    """The problem with an implausible size of a world, and a scale that would fit, or None."""
    if not len(world.segments):
        return None
    width, height = np.ptp(world.bounds, axis=0).tolist()
    if max(width, height) < least:
        size = f"the world is {width:.3g} m by {height:.3g} m, small for a robot"
        return f"{size}; --scale enlarges it, if it is a model or in another unit"
    # Half of all wall length is of walls of this length or more.
    long = np.sort(lengths(world.segments))
    usual = float(long[np.searchsorted(np.cumsum(long), 0.5 * long.sum())])
    # A single wall that reaches far away does not make a large plan.
    most = np.ptp(np.quantile(world.segments.reshape(-1, 2), [0.1, 0.9], axis=0), axis=0)
    # A town may be as large, but its walls are shorter.
    if most.max() <= 1000.0 or usual <= 100.0:
        return None
    between = np.sqrt(usual * most.max())
    small = [each for each in UNITS if each < FOOT]
    scale = min(small, key=lambda each: abs(np.log(each * between / TYPICAL)))
    large = f"{width:,.0f} m by {height:,.0f} m, with walls of {usual:,.0f} m, is too large"
    fitting = f"{scale * width:.3g} m by {scale * height:.3g} m, if it is in {UNITS[scale]}"
    return f"{large} to plan a route in; --scale {scale:g} makes it {fitting}"


def check_size(world: World) -> None:
    """Check that a world is not so large or small that it must be in other units than metres."""
    if problem := size_problem(world, LEAST):
        raise WorldError(f"{world.name or 'world'}: {problem}, or give a route")


def _check(good: Any, row: str, what: str, values: Float, expected: str) -> None:
    """Raise the error of the first bad row, if there is one."""
    if not good.all():
        place = int(np.argmin(good))
        raise WorldError(f"{row} {place}: {what} {values[place].tolist()}, expected {expected}")


def _place(place: Any) -> tuple[float, float] | None:
    """A longitude and latitude from outside, or None."""
    if place is None:
        return None
    if not (isinstance(place, list | tuple) and len(place) == 2 and is_finite(*place)):
        raise WorldError(f"place: expected longitude and latitude, found {shown(place)}")
    return float(place[0]), float(place[1])


def _array(values: ArrayLike, name: str, shape: tuple[int, ...]) -> Float:
    """Values from outside as an array of a shape, in which −1 is any number."""
    try:
        array: Float = read_only(values, name)
    except InputError as error:
        raise WorldError(str(error)) from None
    if array.size == 0 and shape[0] <= 0:
        return sealed(np.empty((0, *shape[1:])))
    if not array.ndim or array.shape != (len(array) if shape[0] < 0 else shape[0], *shape[1:]):
        raise WorldError(f"{name} of shape {array.shape}: expected {shape}".replace("-1", "n"))
    return array


def _items(values: Any, kind: Any, name: str) -> tuple[Any, ...]:
    """The items of a list or tuple from outside, all of one kind; a text is no list."""
    if not isinstance(values, list | tuple):
        raise WorldError(f"{name}: expected a list, found {shown(values)}")
    for each in values:
        if not isinstance(each, kind):
            kinds = getattr(kind, "__name__", kind)
            raise WorldError(f"{name}: expected {kinds}, found {shown(each)}")
    return tuple(values)
