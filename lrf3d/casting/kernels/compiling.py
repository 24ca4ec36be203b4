"""How the kernels are compiled: once, kept on disk, without Python's lock while they run.

Numba keeps the machine code of a function beside its file, and looks at this file alone to tell
whether it is stale; `scripts/environment` clears it when any kernel has changed.
"""

from typing import Any

from numba import njit

_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
_NO_WAY_IN: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

compiled: Any = njit(**_OPTIONS)
"""For functions that Python calls."""

inner: Any = njit(**_OPTIONS, **_NO_WAY_IN)
"""For functions that only compiled ones call: no way in from Python is made, which takes time."""
