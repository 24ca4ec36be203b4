"""World: the walls of a scene as line segments, grouped into objects."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.errors import InputError, WorldError, shown
from lrf3d.geometry import (
    LARGEST_COORDINATE,
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
from lrf3d.world.schema import MOST_OBJECTS

DEFAULT_HEIGHT = 2.5
"""Height of a wall [m] if none is given: a room's storey."""


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
        rows = _rows(segments, 4, "segments")
        walls = len(rows)
        _refuse(
            ~(np.abs(rows) <= LARGEST_COORDINATE).all(axis=1),
            lambda wall: (
                f"wall {wall}: ends {rows[wall].tolist()}, expected finite numbers of at"
                f" most {LARGEST_COORDINATE:g} m"
            ),
        )
        _refuse(
            (rows[:, :2] == rows[:, 2:]).all(axis=1),
            lambda wall: (
                f"wall {wall}: both ends at ({rows[wall, 0]:g}, {rows[wall, 1]:g}), a"
                " segment of no length; remove one"
            ),
        )
        numbers = _column(np.zeros(walls) if objects is None else objects, walls, "object")
        _refuse(
            (numbers < 0.0) | (numbers > MOST_OBJECTS) | (numbers != np.floor(numbers)),
            lambda wall: (
                f"wall {wall}: object {numbers[wall]:.17g}, expected whole numbers from 0"
                f" to {MOST_OBJECTS}; renumber the objects 0, 1, 2, …"
            ),
        )
        tops = np.full(walls, DEFAULT_HEIGHT) if heights is None else heights
        tops = _column(tops, walls, "height")
        _refuse(
            (tops <= 0.0) | (tops > LARGEST_COORDINATE),
            lambda wall: (
                f"wall {wall}: height {tops[wall]:g} m, expected more than 0 and at most"
                f" {LARGEST_COORDINATE:g}"
            ),
        )
        owned = sealed(numbers.astype(np.int64))
        count = int(owned.max(initial=-1)) + 1
        shades = _rows(np.full((count, 3), np.nan) if colours is None else colours, 3, "colours")
        _refuse(
            ~((shades >= 0.0) & (shades <= 1.0)).all(axis=1) & ~np.isnan(shades).all(axis=1),
            lambda number: (
                f"object {number}: colour {shades[number].tolist()}, expected red,"
                " green, blue from 0 to 1, or three NaN for none"
            ),
        )
        names = _items(object_names, "object_names")
        for each, key in ((name, "name"), *((each, "object_names") for each in names)):
            if not isinstance(each, str):
                raise WorldError(f"{key}: expected a text, found {shown(each)}")
        if len(shades) != count or len(names) not in (0, count):
            raise WorldError(
                f"{len(shades)} colours and {len(names)} names for {count} objects:"
                " expected one for each, or none at all"
            )
        if not (free is None or isinstance(free, FreeCells)):
            raise WorldError(f"free: expected FreeCells or None, found {shown(free)}")
        made_of = None if materials is None else _items(materials, "materials")
        for key, value in {
            "segments": rows,
            "objects": owned,
            "heights": tops,
            "name": name,
            "object_names": tuple(names),
            "colours": shades,
            "cameras": _cameras(cameras),
            "place": None if place is None else _place(place),
            "free": free,
            "materials": checked(made_of, count),
        }.items():
            object.__setattr__(self, key, value)

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


def _refuse(bad: Any, message: Callable[[int], str]) -> None:
    """Raise the error of the first bad row, if there is one."""
    if bad.any():
        raise WorldError(message(int(np.argmax(bad))))


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
    _refuse(
        ~np.isfinite(array),
        lambda wall: f"wall {wall}: {name} is {array[wall]}, expected a finite number",
    )
    return array


def _array(values: ArrayLike, name: str) -> Float:
    try:
        array: Float = read_only(values, name)
    except InputError as error:
        raise WorldError(str(error)) from None
    return array


def _items(values: Any, name: str) -> list[Any]:
    """The items of a list or tuple from outside; a text is neither."""
    if isinstance(values, list | tuple):
        return list(values)
    raise WorldError(f"{name}: expected a list, found {shown(values)}")


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
