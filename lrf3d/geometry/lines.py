"""Points, segments and lines of the plane, on arrays.

A segment is a row x1 y1 x2 y2 [m]; a line is a row alpha [rad] in (−π, π], p [m] of the normal
form x·cos α + y·sin α = p with p ≥ 0 (Eq. 3 of Teslić et al.).
"""

import math
import sys
from collections.abc import Mapping
from dataclasses import fields
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from lrf3d.base.errors import InputError, shown

Float = NDArray[np.float64]

Single = NDArray[np.float32]

Int = NDArray[np.int64]

Bool = NDArray[np.bool_]

# Rows of named fields, as kernels take them.
Records = NDArray[Any]

# An angle [rad]; files give it in degrees.
Radians = Annotated[float, "rad"]

AnyArray = TypeVar("AnyArray", bound=NDArray[Any])


# [m, rad] Largest size of a coordinate and of a heading: beyond it float64 has no nanometres.
LARGEST_COORDINATE = 1e9

# [s] Largest size of a time: nanoseconds of larger ones do not fit into stamps.
LARGEST_TIME = 1e12

# Share of a step or a length that is rounding: float64 errs by less, a user sees no more.
ROUNDING = 1e-9

# Probability of the intervals and ellipses that are shown, and median of the absolute values of
# deviates of a normal distribution, in standard deviations.
CONFIDENCE = 0.95
NORMAL_MEDIAN = 0.6745

# Sizes below this count as 0: products of smaller numbers would underflow in exact decisions.
TINY = 1e-44

# Turns rows of vectors to the left by a right angle: ``vectors @ LEFT``.
LEFT = np.array([[0.0, 1.0], [-1.0, 0.0]])


def sealed(array: AnyArray) -> AnyArray:
    """Mark an array that was just made, and is to be handed out, as read-only; nothing is copied.

    Otherwise a mapper or a noise that works in place would change the truth of its score.
    """
    # A seventh of the time of `flags.writeable = False`, and a scan has two such arrays.
    array.setflags(False)  # type: ignore[call-arg]
    return array


def _is_masked(values: Any) -> bool:
    """Whether values are a masked array, which there is none of before its module is loaded."""
    return "numpy.ma" in sys.modules and isinstance(values, np.ma.MaskedArray)


def least_of(values: NDArray[Any]) -> float:
    """The smallest number of an array, 0 of none, NaN if one is; ``min`` takes thrice as long."""
    return values.item(values.argmin()) if values.size else 0.0


def read_only(values: Any, name: str, dtype: DTypeLike = np.float64) -> Any:
    """Values from outside as a read-only array.

    They are copied, unless they are such an array already, contiguous and not writeable. Messages
    call them by the name.
    """
    plain = isinstance(values, np.ndarray) and not _is_masked(values)
    whole = values
    while isinstance(whole, np.ndarray) and not whole.flags.writeable:
        # All arrays that it is a view of must be read-only, too.
        whole = whole.base
    fits = plain and values.dtype == dtype and values.flags.c_contiguous
    if fits and not isinstance(whole, np.ndarray):
        return values
    array = numbers(values, name)
    if array.dtype.kind == "f" and np.dtype(dtype).kind in "iu" and not np.isfinite(array).all():
        raise InputError(f"{name}: expected whole numbers, found {shown(values)}")
    return sealed(np.array(array, dtype=dtype))


def numbers(values: Any, name: str) -> Any:
    """Values from outside as an array of numbers: floats, integers or booleans."""
    try:
        # Masked values become NaN, which is refused where no value may be missing.
        if _is_masked(values):
            values = np.where(np.ma.getmaskarray(values), np.nan, np.ma.getdata(values))
        array = np.asarray(values)
        if array.dtype.kind == "O":
            # Integers of more than 64 bits and fractions are accepted, too.
            array = array.astype(np.float64)
        if array.dtype.kind in "fiub":
            return array
    except (TypeError, ValueError, OverflowError):
        pass
    raise InputError(f"{name}: expected numbers in rows of equal length, found {shown(values)}")


def as_table(values: Any, name: str, columns: int, *, least: int = 0) -> Float:
    """Values from outside as rows (n, columns) of any numbers, at least a number of them."""
    array = np.asarray(numbers(values, name), dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != columns or len(array) < least:
        raise InputError(f"{name} of shape {array.shape}: expected (n, {columns}), n ≥ {least}")
    return array


def as_rows(values: Any, name: str, columns: int, *, least: int = 0, row: str = "row") -> Float:
    """Values from outside as rows (n, columns) of finite numbers, at least a number of them."""
    array = as_table(values, name, columns, least=least)
    if not np.abs(array).max(initial=0.0) <= LARGEST_COORDINATE:
        place = int(np.argmin((np.abs(array) <= LARGEST_COORDINATE).all(axis=1)))
        raise InputError(
            f"{name}: {row} {place} is {array[place].tolist()}, expected finite numbers of at most"
            f" {LARGEST_COORDINATE:g}"
        )
    return array


def is_finite(*values: object) -> bool:
    """Whether all values from outside are finite numbers; texts and None are not."""
    try:
        return all(map(math.isfinite, values))  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return False


def number(
    value: Any,
    name: str,
    unit: str = "",
    *,
    positive: bool = False,
    least: float = 0.0,
    most: float = math.inf,
) -> float:
    """A value from outside as a finite number, checked to lie within its limits."""
    if not isinstance(value, bool) and is_finite(value) and least <= value <= most:
        if value > 0.0 or not positive:
            return float(value)
    lower = "above 0" if positive else f"at least {least:g}"
    upper = "" if most == math.inf else f" and at most {most:g}"
    of = f" of {unit}" if unit else ""
    raise InputError(f"{name} {shown(value)}: expected a finite number{of}, {lower}{upper}")


def generator(rng: Any) -> "np.random.Generator":
    """The source of random numbers that a user gives: a generator, or what seeds one."""
    try:
        return np.random.default_rng(rng)
    except Exception:
        # What NumPy raises depends on what was given.
        raise InputError(
            f"rng {shown(rng)}: expected a whole number that seeds a generator, or a"
            " numpy.random.Generator"
        ) from None


def usual_step(values: NDArray[Any]) -> float:
    """The median of the steps by which values (n,), such as stamps, rise; 0 if none does."""
    steps = np.diff(values)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0


def whole_number(value: Any, name: str, *, least: int = 1, most: int | None = None) -> int:
    """A value from outside as an integer; 181.0 is accepted."""
    largest = value if most is None else most
    whole = not isinstance(value, bool) and is_finite(value) and value == int(value)
    if not whole or value < least or value > largest:
        limit = f"of at least {least}" if most is None else f"from {least} to {most:,}"
        raise InputError(f"{name} {shown(value)}: expected a whole number {limit}")
    return int(value)


class Value:
    """Base of values with arrays, which stay read-only in copies and after unpickling.

    NumPy drops the read-only flag when it copies or unpickles an array.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        """One line: a dataclass of arrays shows them by their shapes, if it has repr=False."""
        held = ((each.name, getattr(self, each.name)) for each in fields(self))  # type: ignore[arg-type]
        parts = (
            f"{name}={value.shape if isinstance(value, np.ndarray) else shown(value)}"
            for name, value in held
        )
        return f"{type(self).__name__}({', '.join(parts)})"

    def _hold(self, *names: str, dtype: DTypeLike = np.float64) -> None:
        """Replace the attributes of these names by read-only arrays."""
        for name in names:
            object.__setattr__(self, name, read_only(getattr(self, name), name, dtype))

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(
                self, name, sealed(value) if isinstance(value, np.ndarray) else value
            )


def wrap_angle(angle: ArrayLike) -> Any:
    """Wrap angles [rad] into (−π, π]; an angle that lies there keeps its bits."""
    # Most angles are single ones that lie there: arrays would take ten times as long.
    if isinstance(angle, float) and -np.pi < angle <= np.pi:
        return np.float64(angle)
    angle = np.asarray(angle, dtype=np.float64)
    inside = (angle > -np.pi) & (angle <= np.pi)
    if inside.all():
        return angle.copy()[()]
    wrapped = np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
    # The remainder of a float above π may round to a full turn.
    wrapped = np.where(wrapped > -np.pi, wrapped, np.pi)
    return np.where(inside, angle, wrapped)[()]


def lengths(segments: Float) -> Float:
    """Length [m] of each of the segments (n, 4)."""
    return np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])


def directions(segments: Float) -> Float:
    """Unit vectors (n, 2) from the first to the second end of the segments (n, 4)."""
    delta = segments[:, 2:] - segments[:, :2]
    return delta / np.hypot(delta[:, 0], delta[:, 1])[:, None]


def cross(first: Float, second: Float) -> Float:
    """Cross products (...) of vectors (..., 2): positive where the second is left of the first."""
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


def normal_lines(segments: Float) -> Float:
    """Lines (n, 2) that carry the segments (n, 4): alpha [rad] in (−π, π] and p ≥ 0 [m] (Eq. 3).

    For a line through the origin alpha is the direction of the segment's left normal.
    """
    segments = np.asarray(segments, dtype=np.float64).reshape(-1, 4)
    unit = directions(segments)
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])
    p = np.einsum("ij,ij->i", normal, 0.5 * (segments[:, :2] + segments[:, 2:]))
    normal[p < 0.0] *= -1.0
    alpha = np.arctan2(normal[:, 1], normal[:, 0])
    # A normal along −x, or below it by less than the resolution of an angle, gives −π.
    alpha[alpha <= -np.pi] = np.pi
    return np.column_stack([alpha, np.abs(p)])


def fit_line(points: Float, weights: Float | None = None) -> tuple[Float, Float]:
    """Total least squares: the (weighted) mean (2,) and the unit direction (2,) of points (n, 2).

    They are centred to lose no digits far away.
    """
    weight = np.ones(len(points)) if weights is None else weights
    mean = weight @ points / weight.sum()
    centred = points - mean
    (xx, xy), (_, yy) = (centred * weight[:, None]).T @ centred
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    return mean, np.array([np.cos(angle), np.sin(angle)])


def quad_indices(quads: int) -> NDArray[np.uint32]:
    """Indices (6 · quads,) of two triangles for each four vertices around a quad."""
    first = np.arange(quads, dtype=np.uint32)[:, None] * 4
    corners = np.array([[0, 1, 2, 0, 2, 3]], dtype=np.uint32)
    return (first + corners).ravel()
