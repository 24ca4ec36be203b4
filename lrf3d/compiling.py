"""Compiling kernels: once, cached on disk, and without Python's lock while they run.

A kernel is a typed Python function of numbers and arrays that numba compiles to machine code. None
may ever have ``fastmath``, which would reorder the error-free sums of casting.

Numba's own cache checks only the file of a kernel, so it runs a stale kernel if a function that it
calls has changed in another file. Here the key of the cache is a stamp of what the kernel computes:
its bytecode and constants, and those of all functions that it calls. A stale kernel is never found,
and a change of comments does not cause compiling.
"""

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from pickle import loads
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType, NoneType
from typing import Any, TypeVar

import numba
import numpy as np
from numba import types
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps

from lrf3d.errors import Lrf3dError

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_LINKED_NUMBA = (0, 68)
"""The version of numba whose internals `_InnerLibrary` depends on. With others inner kernels are
compiled by numba's default, which takes longer and computes the same."""

_FIXED_PACKAGES = {"llvmlite", "math", "numba", "numpy"}
"""Packages that kernels may use freely; the version of numba is part of each key."""


LEAST_ADDRESSES = 1_200_000_000
"""Address space [bytes] that compiling and running the kernels takes; a program with less is ended
by LLVM in the middle of a run, without a message that helps."""


def _check_memory() -> None:
    """Check the limit of this process's memory.

    Raises:
        Lrf3dError: It is too low.
    """
    try:
        from resource import RLIM_INFINITY, RLIMIT_AS, getrlimit
    except ImportError:  # Windows has no such limits.
        return
    limit, _ = getrlimit(RLIMIT_AS)
    if limit != RLIM_INFINITY and limit < LEAST_ADDRESSES:
        raise Lrf3dError(
            f"the limit of memory is {limit / 1e9:.1f} GB, and compiled code needs"
            f" {LEAST_ADDRESSES / 1e9:.1f} GB; raise it: ulimit -v unlimited"
        )


_check_memory()


def compiled(function: Kernel) -> Kernel:
    """Decorate a kernel that Python calls."""
    kernel = _kernel(function)
    kernel._cache = _KernelCache(function)
    # Kernels that call this one include it like an inner one.
    twin: Any = inner(function)
    if twin is not function:
        kernel.get_call_template, kernel.get_overload = twin.get_call_template, twin.get_overload
    made: Kernel = kernel
    return made


def inner(function: Kernel) -> Kernel:
    """Decorate a kernel that only kernels call, and that becomes part of them."""
    return _inner(function)


def _inner(function: Kernel, **options: Any) -> Kernel:
    known = numba.version_info.short == _LINKED_NUMBA
    if known:
        options["pipeline_class"] = _InnerCompiler
    kernel: Kernel = _kernel(function, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)
    return kernel


def borrower(function: Kernel) -> Kernel:
    """Decorate an inner kernel that neither makes nor returns arrays, and becomes part of its user.

    Its callers hold the arrays that it gets, so it counts no references to them. Each count is an
    atomic operation, which takes longer than the test of a wall, and so does handing on arrays.

    Raises:
        TypeError: It returns arrays.
    """
    if "ndarray" in repr(function.__annotations__.get("return")):
        raise TypeError(f"kernel {function.__qualname__} returns an array that it does not hold")
    return _inner(function, _nrt=False, forceinline=True)


def _kernel(function: Callable[..., Any], **options: Any) -> Any:
    kernel: Any = numba.njit(nogil=True, error_model="numpy", **options)(function)
    if kernel is not function:  # With NUMBA_DISABLE_JIT they are the same.
        resolve = kernel.get_call_template
        # Otherwise numba compiles a kernel again for each literal number among its arguments.
        kernel.get_call_template = lambda args, names: resolve(
            tuple(types.unliteral(arg) for arg in args), names
        )
    return kernel


class _InnerLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of an inner kernel: linked with that of its callees, but not optimised.

    By default numba optimises and emits the code of each function, and does so again in each
    function that calls it.
    """

    def finalize(self) -> None:
        """Link the callees; numba's own method then optimises and emits code."""
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True

    @property
    def codegen(self) -> "_InnerLibrary":
        """The receiver of the Python objects that a function uses; inner kernels use none."""
        return self

    def set_env(self, name: str, env: object) -> None:
        """Drop them."""


class _InnerCompiler(Compiler):  # type: ignore[misc]
    """Numba's compiler with an `_InnerLibrary` for the code of a function."""

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        super().__init__(typing, target, _InnerLibrary(target.codegen(), "inner"), *rest)


class _KernelCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache of a function, with a file for each stamp, signature and processor.

    The contents of a file are determined by its name, so that processes that compile at the same
    time cannot mix their machine code.
    """

    _cache_file: Any

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The machine code for a signature; None if the kernel has to be compiled."""
        # The stamp is computed here: a kernel may call others that are defined later in its file.
        if self._cache_file is not self:
            self._cache_file = self
            self._stamp = stamp_of(self._py_func)
        found = super().load_overload(signature, target_context)
        if found is None:
            _announce()
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        """Save the machine code for a signature, if the disk has room."""
        with suppress(OSError):
            super().save_overload(signature, data)

    def load(self, key: str) -> Any:
        """The data that numba saved under a key, or None."""
        with suppress(OSError):
            return loads(self._path(key).read_bytes())
        return None

    def save(self, key: str, data: Any) -> None:
        """Save data under a key, and remove those of other stamps."""
        path = self._path(key)
        part = path.with_suffix(f".{os.getpid()}")
        part.write_bytes(dumps(data))
        part.replace(path)
        for old in path.parent.glob(f"{self._name_of_kernel()}-*.nbc"):
            if f"-{self._stamp}-" not in old.name:
                old.unlink(missing_ok=True)

    def _index_key(self, signature: Any, codegen: Any) -> str:
        kinds = ", ".join(_kind(kind) for kind in signature)
        return sha256(repr((numba.__version__, codegen.magic_tuple(), kinds)).encode()).hexdigest()

    def _name_of_kernel(self) -> str:
        python = f"py{sys.version_info[0]}{sys.version_info[1]}"
        name = f"{self._py_func.__module__}.{self._py_func.__qualname__}.{python}"
        return name.replace("<locals>", "locals")

    def _path(self, key: str) -> Path:
        return Path(self._cache_path) / f"{self._name_of_kernel()}-{self._stamp}-{key[:16]}.nbc"


def _kind(kind: Any) -> str:
    """A type of numba with the names of named tuples and of their fields.

    Kernels take them apart by these, and what is saved looks its classes up by their names.
    """
    if isinstance(kind, types.BaseTuple):
        fields = getattr(kind, "fields", range(len(kind)))
        parts = (f"{name}: {_kind(part)}" for name, part in zip(fields, kind, strict=True))
        named = getattr(kind, "instance_class", tuple)
        return f"{named.__module__}.{named.__qualname__}({', '.join(parts)})"
    return str(kind)


@cache
def _announce() -> None:
    """Print on a terminal, once in each process, why the first use takes so long."""
    if sys.stderr is not None and sys.stderr.isatty():
        print("lrf3d: compiling kernels, once after an install or update ...", file=sys.stderr)


def stamp_of(function: FunctionType) -> str:
    """A text that changes when a function, or any function that it calls, computes something else.

    Raises:
        TypeError: A kernel uses something whose changes cannot be detected.
    """
    digest = sha256()
    seen: set[FunctionType] = set()

    def add(value: Any, user: str) -> None:
        if isinstance(value, Dispatcher):
            digest.update(repr(sorted(value.targetoptions.items())).encode())
            value = value.py_func
        value = getattr(value, "_defn", value)  # An intrinsic writes machine code itself.
        if isinstance(value, FunctionType):
            digest.update(f"{value.__module__}.{value.__qualname__}\n".encode())
            if value not in seen:
                seen.add(value)
                add_code(value.__code__, value)
                for cell in value.__closure__ or ():
                    add(cell.cell_contents, value.__qualname__)
        elif isinstance(value, tuple):
            digest.update(f"{len(value)}\n".encode())
            for part in value:
                add(part, user)
        elif isinstance(value, np.ndarray):
            digest.update(f"{value.dtype} {value.shape}\n".encode() + value.tobytes())
        elif isinstance(value, ModuleType) and value.__name__.split(".")[0] in _FIXED_PACKAGES:
            digest.update(f"{value.__name__}\n".encode())
        elif isinstance(value, type):
            fields = getattr(value, "_fields", ())
            digest.update(f"{value.__module__}.{value.__qualname__} {fields}\n".encode())
        elif isinstance(value, str | float | int | NoneType | np.generic | BuiltinFunctionType):
            digest.update(f"{value!r}\n".encode())
        else:
            raise TypeError(f"kernel {user} uses {value!r}: import the number or function itself")

    def add_code(code: CodeType, of: FunctionType) -> None:
        # Neither the position of the code nor its docstring changes what it computes.
        digest.update(code.co_code + " ".join((*code.co_names, *code.co_freevars)).encode())
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                add_code(constant, of)
            elif constant != of.__doc__:
                digest.update(f"{constant!r}\n".encode())
        for name in code.co_names:
            if name in of.__globals__:
                add(of.__globals__[name], of.__qualname__)

    add(function, function.__qualname__)
    return digest.hexdigest()[:16]
