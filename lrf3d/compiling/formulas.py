"""Formulas: arithmetic without branches, which kernels compute for LANES rows of columns at once.

A formula is a Python function of four numbers, such as the ends of a wall, of a tuple of numbers,
such as a beam, and of a limit; it returns a condition and numbers. To compile it, it is called with
`Lanes` in place of numbers: each operation appends its instruction of LLVM, which translates those
for LANES numbers to the vectors of the processor, however wide these are. With NUMBA_DISABLE_JIT
it is called with arrays. Each operation is rounded as in Python, so the bits are the same.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, SupportsIndex

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

# Most float64 numbers that a vector register holds. Loops over whole vectors are rounded up to a
# multiple of it, and their arrays have room for that.
LANES = 8

# LANES numbers as LLVM names them.
VECTOR = ir.VectorType(ir.DoubleType(), LANES)

# Vectors may begin at each number [bytes].
ALIGNMENT = 8

# A formula of LANES rows, from a first one on, of columns (4, n); the rest is that of the formula.
# It returns the conditions as bits. Numbers fill a buffer, LANES places for each.
ByLanes = Callable[[NDArray[np.float64], SupportsIndex, Any, float, NDArray[np.float64]], Any]


class Lanes:
    """LANES numbers in code that is being built, or conditions; operations append instructions."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder = builder
        self.value = value

    def __add__(self, other: Any) -> "Lanes":
        return self.append(self.builder.fadd, other)

    def __sub__(self, other: Any) -> "Lanes":
        return self.append(self.builder.fsub, other)

    def __mul__(self, other: Any) -> "Lanes":
        return self.append(self.builder.fmul, other)

    def __truediv__(self, other: Any) -> "Lanes":
        return self.append(self.builder.fdiv, other)

    def __and__(self, other: Any) -> "Lanes":
        return self.append(self.builder.and_, other)

    def __neg__(self) -> "Lanes":
        return self.append(self.builder.fneg)

    def __abs__(self) -> "Lanes":
        name = f"llvm.fabs.v{LANES}f64"
        kind = ir.FunctionType(VECTOR, [VECTOR])
        absolute = self.builder.module.declare_intrinsic(name, (), kind)
        return Lanes(self.builder, self.builder.call(absolute, [self.value]))

    # No relation holds for what is not a number.

    def __lt__(self, other: Any) -> "Lanes":
        return self.append(partial(self.builder.fcmp_ordered, "<"), other)

    def __le__(self, other: Any) -> "Lanes":
        return self.append(partial(self.builder.fcmp_ordered, "<="), other)

    def __gt__(self, other: Any) -> "Lanes":
        return self.append(partial(self.builder.fcmp_ordered, ">"), other)

    def __ge__(self, other: Any) -> "Lanes":
        return self.append(partial(self.builder.fcmp_ordered, ">="), other)

    def append(self, instruction: Callable[..., Any], *others: Any) -> "Lanes":
        """The result of an instruction for this and others, of which constants fill all lanes."""
        values = [
            each.value if isinstance(each, Lanes) else VECTOR([each] * LANES) for each in others
        ]
        return Lanes(self.builder, instruction(self.value, *values))


def choose(condition: bool, yes: float, no: float) -> float:
    """One of two numbers, by a condition: in formulas in place of ``yes if condition else no``."""
    if isinstance(condition, Lanes):
        return condition.append(condition.builder.select, yes, no)
    return np.where(condition, yes, no)  # type: ignore[return-value]


@overload(choose, strict=False)  # type: ignore[untyped-decorator]
def _chosen(condition: Any, yes: Any, no: Any) -> Any:
    """The same for one row."""
    return lambda condition, yes, no: yes if condition else no


def by_lanes(function: Callable[..., Any], *, width: int = 4, adds: bool = False) -> ByLanes:
    """Decorate a formula that kernels call for LANES rows of columns (width, n): see `ByLanes`.

    If it `adds`, its numbers are added to the buffer instead of stored.
    """
    if numba.config.DISABLE_JIT:
        return partial(_in_python, function, adds)

    def in_kernels(typing: Any, columns: Any, first: Any, given: Any, limit: Any, room: Any) -> Any:
        kinds = columns, types.uintp, given, types.float64, room
        return types.uint64(*kinds), partial(_build, function, width, adds)

    made: ByLanes = intrinsic(in_kernels)
    return made


@np.errstate(all="ignore")
def _in_python(
    function: Callable[..., Any], adds: bool, columns: Any, first: SupportsIndex, given: Any,
    limit: float, room: Any,
) -> Any:  # fmt: skip
    """A formula of LANES rows without numba."""
    start = int(first)
    met, *numbers = function(columns[:, start : start + LANES], given, limit)
    # Rows or places that are missing do not fit, which raises.
    filled = room[: len(numbers) * LANES]
    # Adding −0 to a number keeps its bits.
    filled[:] = np.concatenate(numbers) + (filled if adds else -0.0)
    return np.uint64(np.packbits(met, bitorder="little")[0])


def _build(
    function: Callable[..., Any],
    width: int,
    adds: bool,
    context: Any,
    builder: Any,
    signature: Any,
    arguments: Any,
) -> Any:
    """Append the instructions of a formula of LANES rows."""
    columns, first, given, limit, room = arguments
    # What the rows have in common fills all lanes.
    parts = [_spread(builder, part) for part in cgutils.unpack_tuple(builder, given)]
    rows = []
    for column in range(width):
        place = _place(context, builder, signature.args[0], columns, [column, first])
        rows.append(Lanes(builder, builder.load(place, align=ALIGNMENT)))
    common = signature.args[2].instance_class(*parts)
    met, *numbers = function(rows, common, _spread(builder, limit))
    for k, each in enumerate(numbers):
        place = _place(context, builder, signature.args[4], room, [k * LANES])
        value = (
            builder.fadd(builder.load(place, align=ALIGNMENT), each.value) if adds else each.value
        )
        builder.store(value, place, align=ALIGNMENT)
    bits = builder.bitcast(met.value, ir.IntType(LANES))
    return builder.zext(bits, context.get_value_type(signature.return_type))


def _spread(builder: Any, value: Any) -> Lanes:
    """A number in all lanes."""
    first = builder.insert_element(VECTOR(None), value, cgutils.int32_t(0))
    places = ir.Constant(ir.VectorType(cgutils.int32_t, LANES), [0] * LANES)
    return Lanes(builder, builder.shuffle_vector(first, first, places))


def _place(context: Any, builder: Any, kind: Any, array: Any, index: list[Any]) -> Any:
    """The address of LANES numbers of an array, from an index on."""
    numbers = context.make_array(kind)(context, builder, array)
    at = [cgutils.intp_t(each) if isinstance(each, int) else each for each in index]
    first = cgutils.get_item_pointer(context, builder, kind, numbers, at)
    return builder.bitcast(first, VECTOR.as_pointer())
