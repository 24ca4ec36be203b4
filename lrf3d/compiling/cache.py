"""Compiled kernels on disk, by the stamps of what they were compiled from."""

import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from pickle import loads
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, InTreeCacheLocator
from numba.core.serialize import dumps

from lrf3d.compiling.stamps import kind_of, stamp_of
from lrf3d.errors import Lrf3dWarning
from lrf3d.files import replacing


class _ReadOnlyLocator(InTreeCacheLocator):  # type: ignore[misc]
    """The folder next to a kernel's file, where no folder can be written."""

    @classmethod
    def from_function(cls, function: Callable[..., Any], path: str) -> Any:
        """A locator, whether the folder can be written or not."""
        return cls(function, path)


class _CacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    """Numba's cache of compiled functions, which raises where no folder can be written."""

    _locator_classes = (*CompileResultCacheImpl._locator_classes, _ReadOnlyLocator)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache of a function, with a file for each stamp, signature and processor.

    The contents of a file are determined by its name, so that processes that compile at the same
    time cannot mix their machine code.
    """

    _impl_class = _CacheImpl
    _cache_file: Any

    def __init__(self, function: Callable[..., Any], *compilers: Callable[..., Any]) -> None:
        super().__init__(function)
        self._compilers = compilers

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The machine code for a signature; None if the kernel has to be compiled."""
        self._cache_file, self._stamp = self, stamp_of(self._py_func, *self._compilers)
        found = super().load_overload(signature, target_context)
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
        # An installation that cannot be written may have come with its kernels.
        beside = Path(self._py_func.__code__.co_filename).parent / "__pycache__"
        for folder in (Path(self._cache_path), beside):
            with suppress(OSError):
                return loads((folder / self._file_name(key)).read_bytes())
        return None

    def save(self, key: str, data: Any) -> None:
        """Save data under a key, and remove those of other stamps."""
        path = Path(self._cache_path) / self._file_name(key)
        with replacing(path) as part:
            part.write_bytes(dumps(data))
        for old in path.parent.glob(f"{self._name_of_kernel()}-*.nbc"):
            if f"-{self._stamp}-" not in old.name:
                old.unlink(missing_ok=True)

    def _index_key(self, signature: Any, codegen: Any) -> str:
        kinds, checked = [kind_of(kind) for kind in signature], numba.config.BOUNDSCHECK
        return sha256(repr((codegen.magic_tuple(), kinds, checked)).encode()).hexdigest()

    def _name_of_kernel(self) -> str:
        python = f"py{sys.version_info[0]}{sys.version_info[1]}"
        name = f"{self._py_func.__module__}.{self._py_func.__qualname__}.{python}"
        return name.replace("<locals>", "locals")

    def _file_name(self, key: str) -> str:
        return f"{self._name_of_kernel()}-{self._stamp}-{key[:16]}.nbc"


@cache
def _announce() -> None:
    """Print on a terminal, once in each process, why the first use takes so long."""
    if sys.stderr is not None and sys.stderr.isatty():
        print("lrf3d: compiling kernels, once after an install or update ...", file=sys.stderr)


@cache
def _announce_unsaved(folder: str, reason: str) -> None:
    """Warn, once in each process, that the next one will have to compile the kernels too."""
    text = f"{folder}: compiled kernels could not be kept ({reason}), so that each start compiles"
    text += " them, for half a minute; set NUMBA_CACHE_DIR to a folder that can be written"
    warnings.warn(text, Lrf3dWarning, stacklevel=2)
