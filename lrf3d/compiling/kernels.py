"""The decorators of kernels: numba's own, with less work for functions that only kernels call.

None may ever have ``fastmath``, which would reorder the error-free sums of casting.
"""

import gc
from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any, TypeVar

import numba
import numpy as np
from llvmlite.binding.newpassmanagers import create_new_function_pass_manager
from numba import types
from numba.core import base, registry
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import DumpParforDiagnostics, InlineOverloads, NopythonRewrites
from numba.core.untyped_passes import (
    DeadBranchPrune,
    FindLiterallyCalls,
    InlineClosureLikes,
    InlineInlinables,
    LiteralPropagationSubPipelinePass,
    LiteralUnroll,
    MakeFunctionToJitFunction,
    RewriteDynamicRaises,
    RewriteSemanticConstants,
    WithLifting,
)

from lrf3d.base.errors import Lrf3dError, storage
from lrf3d.compiling.cache import KernelCache
from lrf3d.compiling.formulas import Lanes

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

# The version of numba whose internals the compilers below depend on. With others kernels are
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
            f"the limit of memory is {storage(limit)}, and compiled code needs"
            f" {storage(LEAST_ADDRESSES)}; raise it: ulimit -v unlimited"
        )


_check_memory()


def record(**columns: type) -> np.dtype[Any]:
    """The type of rows with these columns, in the order given: ``row.column``, also in Python."""
    return np.dtype((np.record, np.dtype(list(columns.items()), align=True)))


def compiled(function: Kernel) -> Kernel:
    """Decorate a kernel that Python calls."""
    kernel = _kernel(function, _KernelCompiler)
    kernel._cache = KernelCache(function, *_COMPILERS)
    # Kernels that call this one include it like an inner one.
    twin: Any = inner(function)
    if twin is not function:
        kernel.get_call_template = twin.get_call_template
        kernel.get_overload = twin.get_overload
    made: Kernel = kernel
    return made


def entry_of(kernel: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """The machine code of a kernel for arguments of these types.

    It does not look at the types of what it is called with, which takes a third of a short call.
    """
    compiler = getattr(kernel, "compile", None)
    # With NUMBA_DISABLE_JIT it is no kernel.
    return compiler(tuple(map(numba.typeof, arguments))) if compiler else kernel


def inner(function: Kernel, **options: Any) -> Kernel:
    """Decorate a kernel that only kernels call, and that becomes part of them."""
    kernel: Kernel = _kernel(function, _InnerCompiler, no_cpython_wrapper=True, **options)
    return kernel


def borrower(function: Kernel) -> Kernel:
    """Decorate an inner kernel that neither makes nor returns arrays, and becomes part of its user.

    Its callers hold the arrays that it gets, so it counts no references to them. Each count is an
    atomic operation, which takes longer than the test of a wall, and so does handing on arrays.
    """
    if "ndarray" in repr(function.__annotations__.get("return")):
        raise TypeError(f"kernel {function.__qualname__} returns an array that it does not hold")
    return inner(function, _nrt=False, forceinline=True)


def _kernel(function: Callable[..., Any], compiler: type[Compiler], **options: Any) -> Any:
    if numba.version_info.short == _LINKED_NUMBA:
        options["pipeline_class"] = compiler
    options.update(nogil=True, error_model="numpy", no_cfunc_wrapper=True)
    kernel: Any = numba.njit(**options)(function)
    if kernel is not function:  # With NUMBA_DISABLE_JIT they are the same.
        resolve = kernel.get_call_template
        # Otherwise numba compiles a kernel again for each literal number among its arguments.
        kernel.get_call_template = lambda args, names: resolve(
            tuple(types.unliteral(arg) for arg in args), names
        )
    return kernel


class _KernelLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of a kernel."""

    def _optimize_functions(self, module: Any) -> None:
        """Keep variables in registers, and remove what is not needed, before code is inlined."""
        module.data_layout = self._codegen._data_layout
        builder = self._codegen._pass_builder()
        for function in module.functions:
            if not function.is_declaration:
                passes = create_new_function_pass_manager()
                passes.add_sroa_pass()
                passes.add_simplify_cfg_pass()
                passes.add_instruction_combine_pass()
                passes.run(function, builder)


class _InnerLibrary(_KernelLibrary):
    """The code of an inner kernel: linked with that of its callees, but only simplified.

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


@cache
def _remembering(context: Any) -> Any:
    """Numba's context of types, which types the same operation for the same types once.

    It tries all meanings of an operator, also those for arrays, each time that it occurs. It also
    asks LLVM for the size of a type by a program of its own each time, and each function that makes
    code for the names of its arguments.
    """
    results: dict[Any, Any] = {}
    target = registry.cpu_target.target_context
    target.get_abi_sizeof = cache(target.get_abi_sizeof)
    base._has_loc = cache(base._has_loc)

    class Remembering(type(context)):  # type: ignore[misc]
        def resolve_function_type(self, function: Any, args: Any, named: Any) -> Any:
            """The signature of a function for the types of its arguments."""
            resolve = super().resolve_function_type
            if named or isinstance(function, types.Dispatcher | str):
                return resolve(function, args, named)
            key = function, tuple(args), ConfigStack().top().nrt
            if key not in results:
                results[key] = resolve(function, args, named)
            return results[key]

    remembering = object.__new__(Remembering)
    remembering.__dict__ = context.__dict__
    return remembering


# Steps of numba for closures, contexts, functions to be inlined as Python, array expressions,
# branches and loops that the types of arguments decide on, and errors with values.
_NEEDLESS_STEPS = (
    WithLifting, InlineClosureLikes, MakeFunctionToJitFunction, InlineInlinables, InlineOverloads,
    NopythonRewrites, RewriteSemanticConstants, DeadBranchPrune, FindLiterallyCalls, LiteralUnroll,
    LiteralPropagationSubPipelinePass, RewriteDynamicRaises, DumpParforDiagnostics,
)  # fmt: skip


class _KernelCompiler(Compiler):  # type: ignore[misc]
    """Numba's compiler without work that changes no machine code."""

    _library: type[_KernelLibrary] = _KernelLibrary

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        self._codegen = target.codegen()
        own = self._library(self._codegen, "kernel")
        own.enable_object_caching()
        super().__init__(_remembering(typing), target, own, *rest)

    def define_pipelines(self) -> list[PassManager]:
        """The steps of compiling, without those for what kernels do not have."""
        steps = DefaultPassBuilder.define_nopython_pipeline(self.state)
        steps.passes = [each for each in steps.passes if each[0] not in _NEEDLESS_STEPS]
        return [steps]

    def compile_extra(self, function: Any) -> Any:
        """Compile a function; NumPy's functions become part of it like inner kernels.

        Garbage is collected once, at the end: collections in between find little.
        """
        collecting = gc.isenabled()
        gc.disable()
        default = self._codegen._library_class
        self._codegen._library_class = _InnerLibrary
        try:
            return super().compile_extra(function)
        finally:
            self._codegen._library_class = default
            if collecting:
                gc.enable()


class _InnerCompiler(_KernelCompiler):
    """The same for an inner kernel."""

    _library = _InnerLibrary


# The functions that decide how a kernel is compiled.
_COMPILERS = tuple(
    function
    for function in (
        *(compiled, inner, borrower, _kernel),
        *vars(Lanes).values(),
        *vars(_KernelLibrary).values(),
        *vars(_InnerLibrary).values(),
        *vars(_KernelCompiler).values(),
        *vars(_InnerCompiler).values(),
    )
    if isinstance(function, FunctionType)
)
