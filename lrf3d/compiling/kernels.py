"""The decorators of kernels: numba's own, with less work for functions that only kernels call.

None may ever have ``fastmath``, which would reorder the error-free sums of casting.
"""

from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

import numba
import numpy as np
from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

from lrf3d.base.errors import Lrf3dError
from lrf3d.compiling.cache import KernelCache

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

# The version of numba whose internals `_InnerLibrary` depends on. With others inner kernels are
# compiled by numba's default, which takes longer and computes the same.
_LINKED_NUMBA = (0, 68)

# Address space [bytes] that compiling and running the kernels takes; a program with less is ended
# by LLVM in the middle of a run, without a message that helps.
LEAST_ADDRESSES = 1_200_000_000


def _check_memory() -> None:
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


def record(**columns: type) -> np.dtype[Any]:
    """The type of rows with these columns, in the order given: ``row.column``, also in Python."""
    return np.dtype((np.record, np.dtype(list(columns.items()), align=True)))


def compiled(function: Kernel) -> Kernel:
    """Decorate a kernel that Python calls."""
    kernel = _kernel(function)
    kernel._cache = KernelCache(function, *_COMPILERS)
    # Kernels that call this one include it like an inner one.
    twin: Any = inner(function)
    if twin is not function:
        kernel.get_call_template = twin.get_call_template
        kernel.get_overload = twin.get_overload
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


# The functions that decide how a kernel is compiled.
_COMPILERS = tuple(
    function
    for function in (
        *(compiled, inner, borrower, _kernel),
        *vars(_InnerLibrary).values(),
        *vars(_InnerCompiler).values(),
    )
    if isinstance(function, FunctionType)
)
