"""Loading SciPy and matplotlib without what no program here needs of them."""

import inspect
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def lean_loading() -> Iterator[None]:
    """In the block SciPy loads neither NumPy's tests nor its compiler, and no library edits docs.

    Both take a third of the time in which SciPy and matplotlib load.
    """
    import numpy as np

    left_out = {"f2py", "testing"} - vars(np).keys()
    documentation = inspect.getdoc
    vars(np).update(dict.fromkeys(left_out))
    inspect.getdoc = lambda object: None
    try:
        yield
    finally:
        inspect.getdoc = documentation
        for name in left_out:
            del vars(np)[name]
