"""Compiling kernels: once, cached on disk, and without Python's lock while they run.

A kernel is a typed Python function of numbers and arrays that numba compiles to machine code. None
may ever have ``fastmath``, which would reorder the error-free sums of casting.

Numba's own cache checks only the file of a kernel, so it runs a stale kernel if a function that it
calls has changed in another file. Here the key of the cache holds a digest of the sources that a
kernel can use: of its file, and of all files of the package that this imports. A stale kernel is
never found.
"""

import os
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from pickle import loads
from typing import Any, TypeVar

import numba
from numba import types
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.serialize import dumps

from lrf3d.errors import Lrf3dError

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_LINKED_NUMBA = (0, 68)
"""The version of numba whose internals `_InnerLibrary` depends on. With others inner kernels are
compiled by numba's default, which takes longer and computes the same."""

_IMPORT = re.compile(r"^(?:from ([\w.]+) )?import (\([^)]*\)|.*)$", re.MULTILINE)
"""A line that imports names, or modules, while a file is loaded."""

LEAST_ADDRESSES = 1_200_000_000
"""Address space [bytes] that compiling and running the kernels takes; a program with less is ended
by LLVM in the middle of a run, without a message that helps."""


def _check_memory() -> None:
    """Check the limit of this process's memory."""
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


def inner(function: Kernel, **options: Any) -> Kernel:
    """Decorate a kernel that only kernels call, and that becomes part of them."""
    if numba.version_info.short == _LINKED_NUMBA:
        options["pipeline_class"] = _InnerCompiler
    kernel: Kernel = _kernel(function, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)
    return kernel


def borrower(function: Kernel) -> Kernel:
    """Decorate an inner kernel that neither makes nor returns arrays, and becomes part of its user.

    Its callers hold the arrays that it gets, so it counts no references to them. Each count is an
    atomic operation, which takes longer than the test of a wall, and so does handing on arrays.
    """
    if "ndarray" in repr(function.__annotations__.get("return")):
        raise TypeError(f"kernel {function.__qualname__} returns an array that it does not hold")
    return inner(function, _nrt=False, forceinline=True)


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
        if self._cache_file is not self:
            self._cache_file = self
            self._stamp = stamp_of(self._py_func.__module__)
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
        kinds = ", ".join(map(str, signature))
        return sha256(repr((numba.__version__, codegen.magic_tuple(), kinds)).encode()).hexdigest()

    def _name_of_kernel(self) -> str:
        python = f"py{sys.version_info[0]}{sys.version_info[1]}"
        name = f"{self._py_func.__module__}.{self._py_func.__qualname__}.{python}"
        return name.replace("<locals>", "locals")

    def _path(self, key: str) -> Path:
        return Path(self._cache_path) / f"{self._name_of_kernel()}-{self._stamp}-{key[:16]}.nbc"


@cache
def _announce() -> None:
    """Print on a terminal, once in each process, why the first use takes so long."""
    if sys.stderr is not None and sys.stderr.isatty():
        print("lrf3d: compiling kernels, once after an install or update ...", file=sys.stderr)


def stamp_of(module: str) -> str:
    """A text that changes when a kernel of a module may compute something else."""
    return sha256(repr(sorted(sources_of(module).items())).encode()).hexdigest()[:16]


def sources_of(module: str) -> dict[str, str]:
    """Digests of the sources that a kernel of a module may use, by module.

    Other packages are left out: the version of numba is part of each key.
    """
    used, names = dict[str, str](), [module]
    while names:
        name = names.pop()
        if name not in used and name.split(".")[0] in (module.split(".")[0], "lrf3d"):
            used[name], imported = _source(name)
            names += imported
    return {name: digest for name, digest in used.items() if digest}


@cache
def _source(name: str) -> tuple[str, tuple[str, ...]]:
    """A digest of the file of a module, and all names that it imports when it is loaded.

    Not all of them are modules; the digest is empty where there is no file.
    """
    top, *inner = name.split(".")
    place = Path(sys.modules[top].__file__ or "").parent.joinpath(*inner)
    path = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    if not path.is_file():
        return "", ()
    source, names = path.read_text(encoding="utf-8"), list[str]()
    for package, imported in _IMPORT.findall(source):
        # A package may give one of its modules.
        names += [package, *(f"{package}.{n}".strip(".") for n in re.findall(r"[\w.]+", imported))]
    return sha256(source.encode()).hexdigest(), tuple(names)
