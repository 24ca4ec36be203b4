"""What kernels give to Python are plain tuples and arrays."""

import importlib
import pkgutil
import typing

from numba.core.dispatcher import Dispatcher

import lrf3d
from lrf3d.compiling.cache import KernelCache

ROOMS = tuple(
    f"lrf3d.{room}"
    for room in "mapping casting laser matching scoring slam world robot planning".split()
)


def is_named(kind):
    named = isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")
    return named or any(is_named(part) for part in typing.get_args(kind))


def kernels():
    for found in pkgutil.walk_packages(lrf3d.__path__, "lrf3d."):
        if found.name.startswith(ROOMS):
            for value in vars(importlib.import_module(found.name)).values():
                cache = getattr(value, "_cache", None)
                if isinstance(value, Dispatcher) and isinstance(cache, KernelCache):
                    yield value.py_func


def test_no_kernel_returns_a_named_tuple_to_python():
    # Numba makes one by Python code, in which an interrupt ends the interpreter.
    found = list(kernels())
    assert len(found) > 15
    returned = {kernel: typing.get_type_hints(kernel).get("return") for kernel in found}
    assert [kernel.__qualname__ for kernel, kind in returned.items() if is_named(kind)] == []
