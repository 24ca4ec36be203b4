"""Faster loading of SciPy and matplotlib: parts that lrf3d does not need are left out."""

import gc
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from lrf3d.base.formats import function

# What `inspect.getdoc` is outside of the blocks, also if two threads are in one.
_DOCUMENTATION = inspect.getdoc


@contextmanager
def lean_loading() -> Iterator[None]:
    """In the block SciPy loads neither NumPy's tests nor its compiler, and no library edits docs.

    Both take a third of the time in which SciPy and matplotlib load. No garbage is collected in it,
    and what it loads is not searched for garbage afterwards.
    """
    collects = gc.isenabled()
    gc.disable()
    import numpy as np

    left_out = {"f2py", "testing"} - vars(np).keys()
    vars(np).update(dict.fromkeys(left_out))
    inspect.getdoc = lambda object: None
    try:
        yield
    finally:
        inspect.getdoc = _DOCUMENTATION
        if collects:
            gc.freeze()
            gc.enable()
        # What was loaded after all stays.
        for name in left_out:
            if vars(np).get(name) is None:
                vars(np).pop(name, None)


def load(target: str | Callable[..., Any]) -> Callable[..., Any]:
    """The function of ``module:function``, whose module is loaded in such a block."""
    with lean_loading():
        return function(target)
