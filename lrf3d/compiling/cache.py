"""Compiled kernels on disk, by stamps that change when a kernel may compute something else.

Numba's own cache checks only the file of a kernel: it runs a stale kernel if a function that it
calls has changed in another file, and compiles a kernel again after an edit of a comment. A stamp
covers what numba compiles: the bytecode of the kernel and of all kernels that it calls, in any
file, and the values of the constants that they use. Comments, docstrings and functions that the
kernel does not call do not count.
"""

import os
import sys
import warnings
from collections.abc import Callable, Set
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from pickle import loads
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from llvmlite.binding import add_symbol, get_host_cpu_features, parse_assembly
from numba import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, InTreeCacheLocator
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic
from numba.core.runtime._nrt_python import c_helpers
from numba.core.serialize import dumps

from lrf3d.base.errors import Lrf3dWarning
from lrf3d.base.files import replacing

# Versions that decide on machine code: numba's, and NumPy's but for its last number.
VERSIONS = (numba.__version__, np.__version__.rpartition(".")[0])

# Kernels that a release brings. Where there are none for this version of numba, or the processor is
# older than theirs, kernels are compiled.
RELEASED = Path(__file__).with_name("released") / "-".join(VERSIONS)

# Processor, by LLVM's name and without other features, that kernels are released for.
PROCESSOR = ("x86-64-v3", "")

# What its instructions need, by LLVM's names: processors have it since 2015.
NEEDED = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")

# Size of the digest that begins a file [bytes].
DIGEST_SIZE = 32

# What counts references, which kernels call, by the names that they have in machine code. Numba's
# own way, `rtsys.initialize`, compiles more than saved kernels need: 30 MB in each process.
for _name, _address in c_helpers.items():
    add_symbol(_name if _name.startswith("_") else f"NRT_{_name}", _address)

# Kinds of functions and types that their names determine, at given versions of the packages.
_NAMED = (type, BuiltinFunctionType, np.ufunc, type(np.where))

# Kinds of constants that their texts determine.
_SCALARS = (bool, int, float, complex, str, bytes, type(None), np.dtype, types.Type)


def stamp_of(kernel: Callable[..., Any], *compilers: Callable[..., Any]) -> str:
    """A text that changes when a kernel, or one that it calls, may compute something else.

    The code of the functions that compile it counts too.
    """
    functions = [kernel]
    rows = [code_of(compiler) for compiler in compilers]
    for function in functions:  # The list grows by the functions that those in it call.
        rows.append(_function(function, functions))
    return sha256(repr((VERSIONS, rows)).encode()).hexdigest()[:16]


def kind_of(kind: types.Type) -> Any:
    """A description of the type of an argument, with the names of the fields, unlike numba's."""
    if isinstance(kind, types.BaseTuple):
        return type(kind).__name__, getattr(kind, "fields", ()), [kind_of(part) for part in kind]
    return str(kind)


def _function(function: Any, functions: list[Any]) -> Any:
    """What numba compiles of a function; those that it calls are added to the functions."""
    code = function.__code__
    names = _names(code)
    used = {name: function.__globals__[name] for name in names & function.__globals__.keys()}
    for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
        used[name] = cell.cell_contents
    used[":defaults"] = function.__defaults__
    return code_of(function), [
        (name, _value(used[name], names, functions)) for name in sorted(used)
    ]


def _names(code: CodeType) -> Set[str]:
    inner = (_names(part) for part in code.co_consts if isinstance(part, CodeType))
    return set(code.co_names).union(*inner)


@cache
def code_of(function: Any) -> Any:
    """A description of the code of a function, without its docstring, which is a constant."""
    code = function.__code__
    doc = function.__doc__
    return _code(code, tuple(None if part == doc else part for part in code.co_consts))


def _code(code: CodeType, constants: tuple[Any, ...]) -> Any:
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    parts = [
        _code(part, part.co_consts) if isinstance(part, CodeType) else _value(part, set(), [])
        for part in constants
    ]
    return code.co_code, code.co_exceptiontable, names, counts, parts


def _value(value: Any, names: Set[str], functions: list[Any], within: tuple[Any, ...] = ()) -> Any:
    """A description of a value that a function with these names uses.

    Functions are described by their place in the list of functions, as they may call themselves.
    What could change unnoticed gets a description that nothing else has: its user is compiled by
    each process.
    """
    if isinstance(value, Dispatcher):
        options = sorted(value.targetoptions.items())
        return "kernel", _place(value.py_func, functions), repr(options)
    if isinstance(value, _Intrinsic):
        value = value._defn
    if isinstance(value, FunctionType):
        if value.__module__.split(".")[0] in ("numpy", "numba"):
            return value.__module__, value.__qualname__
        return "function", _place(value, functions)
    if isinstance(value, tuple):
        parts = [_value(part, names, functions, within) for part in value]
        return _value(type(value), names, functions), parts
    if isinstance(value, ModuleType) and (value is np or not hasattr(value, "__getattr__")):
        inside = () if value in within else sorted(names & vars(value).keys())
        return value.__name__, [
            (name, _value(vars(value)[name], names, functions, (*within, value))) for name in inside
        ]
    return _constant(value)


def _constant(value: Any) -> Any:
    """A description of a value that uses no others: see `_value`."""
    if isinstance(value, _SCALARS):
        return type(value).__name__, repr(value)
    if isinstance(value, ir.Type):
        return str(value)
    if isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
        return repr(value.dtype), value.shape, value.strides, sha256(value.tobytes()).hexdigest()
    if type(value) in _NAMED:
        fields = getattr(value, "_fields", ()), repr(getattr(value, "_field_defaults", ()))
        return getattr(value, "__module__", ""), value.__name__, fields
    return "unknown", os.urandom(16)


def _place(function: Any, functions: list[Any]) -> int:
    if function not in functions:
        functions.append(function)
    return functions.index(function)


class _ReadOnlyLocator(InTreeCacheLocator):  # type: ignore[misc]
    """The folder next to a kernel's file, where no folder can be written."""

    @classmethod
    def from_function(cls, function: Callable[..., Any], path: str) -> Any:
        """A locator, whether the folder can be written or not."""
        return cls(function, path)


class _CacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    """Numba's cache of compiled functions, which raises where no folder can be written."""

    _locator_classes = (*CompileResultCacheImpl._locator_classes, _ReadOnlyLocator)

    def reduce(self, result: Any) -> Any:
        """What is saved of a kernel: its machine code, and the names by which Python finds it.

        No kernel is linked with a saved one, so the code for linking, the text of the types and
        the environments of what the kernel calls stay out: they are four fifths of the file, and
        numba loads its compiler for NumPy's functions with them.
        """
        (name, kind, (machine_code, _)), *rest, _, reload, _ = super().reduce(result)
        found = result.fndesc.llvm_cpython_wrapper_name, result.fndesc.llvm_func_name
        stubs = parse_assembly("".join(f'define void @"{n}"() {{ unreachable }}\n' for n in found))
        return (name, kind, (machine_code, stubs.as_bitcode())), *rest, "", reload, ()


class KernelCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache of a function, with a file for each stamp, signature and processor.

    The contents of a file are determined by its name, so that processes that compile at the same
    time cannot mix their machine code.
    """

    _impl_class = _CacheImpl
    _cache_file: Any
    _key_of_release: str

    def __init__(self, function: Callable[..., Any], *compilers: Callable[..., Any]) -> None:
        super().__init__(function)
        self._compilers = compilers

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The machine code for a signature; None if the kernel has to be compiled.

        What was compiled for this very processor comes before what a release brought.
        """
        self._cache_file, self._stamp = self, stamp_of(self._py_func, *self._compilers)
        found = self._load_overload(signature, target_context)
        if found is None:
            _announce()
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        """Save the machine code for a signature, if a folder can be written and has room."""
        try:
            super().save_overload(signature, data)
        except OSError as error:
            _announce_unsaved(self._cache_path, str(error.strerror or error.__cause__))

    def load(self, key: str) -> Any:
        """The data that numba saved under a key, or None."""
        places = [
            (Path(self._cache_path), key),
            # An installation that cannot be written may have come with its kernels.
            (Path(self._py_func.__code__.co_filename).parent / "__pycache__", key),
            (RELEASED, self._key_of_release),
        ]
        for folder, name in places[: 2 + _has_released()]:
            path = folder / self._file_name(name)
            with suppress(OSError):
                kept = path.read_bytes()
                # A flipped bit of machine code would run: what is not whole is compiled again.
                if kept[:DIGEST_SIZE] != sha256(kept[DIGEST_SIZE:]).digest():
                    path.unlink()
                    continue
                # Code that has moved to another module is the same code: its old home may be gone.
                with suppress(ImportError):
                    return loads(kept[DIGEST_SIZE:])
        return None

    def save(self, key: str, data: Any) -> None:
        """Save data under a key with its digest, and remove those of other stamps."""
        path = Path(self._cache_path) / self._file_name(key)
        kernel = dumps(data)
        with replacing(path) as part, open(part, "wb") as file:
            file.write(sha256(kernel).digest() + kernel)
            # A power failure must not leave a file whose contents were never written.
            file.flush()
            os.fsync(file.fileno())
        for old in path.parent.glob(f"{self._name_of_kernel()}-*.nbc"):
            if f"-{self._stamp}-" not in old.name:
                old.unlink(missing_ok=True)

    def _index_key(self, signature: Any, codegen: Any) -> str:
        kinds = [kind_of(kind) for kind in signature]
        own = codegen.magic_tuple()
        key, self._key_of_release = (
            sha256(repr((processor, kinds, numba.config.BOUNDSCHECK)).encode()).hexdigest()
            for processor in (own, (own[0], *PROCESSOR))
        )
        return key

    def _name_of_kernel(self) -> str:
        python = f"py{sys.version_info[0]}{sys.version_info[1]}"
        name = f"{self._py_func.__module__}.{self._py_func.__qualname__}.{python}"
        return name.replace("<locals>", "locals")

    def _file_name(self, key: str) -> str:
        return f"{self._name_of_kernel()}-{self._stamp}-{key[:16]}.nbc"


@cache
def _has_released() -> bool:
    """Whether there are released kernels that this processor runs, and no other is asked for."""
    runs = all(map(get_host_cpu_features().get, NEEDED))
    return RELEASED.is_dir() and runs and not numba.config.CPU_NAME


@cache
def _announce() -> None:
    """Print on a terminal, once in each process, why the first use takes so long."""
    if sys.stderr is not None and sys.stderr.isatty():
        print("lrf3d: compiling kernels, once after an install or update ...", file=sys.stderr)


@cache
def _announce_unsaved(folder: str, reason: str) -> None:
    """Warn, once in each process, that the next one will have to compile the kernels too."""
    warnings.warn(
        f"{folder}: compiled kernels could not be kept ({reason}), so that each start compiles"
        " them, for half a minute; set NUMBA_CACHE_DIR to a folder that can be written",
        Lrf3dWarning,
        stacklevel=2,
    )
