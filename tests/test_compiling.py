"""What is compiled is kept on disk, and only as long as it is what the source says."""

import importlib
import io
import os
import sys

import pytest

from lrf3d import compiling
from lrf3d.geometry import Float

PARTS = """
from typing import NamedTuple
from lrf3d.compiling import inner

STEP = 1.0

class Couple(NamedTuple):
    first: float
    second: float

Pair = Couple

@inner
def deepest(x: float) -> float:
    return x + STEP

@inner
def part(x: float, number: int) -> float:
    # Comments are no part of what is computed.
    return deepest(x) * number
"""

WHOLE = """
from lrf3d.compiling import compiled
from stale_parts import Pair, part

@compiled
def whole(pair: Pair) -> float:
    return part(pair.first, 2) + part(pair.first, 3)
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Write two modules as they would be after an edit, and import them as a new process would."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def fresh(parts=PARTS):
        for name, text in (("stale_parts", parts), ("stale_whole", WHOLE)):
            path = tmp_path / f"{name}.py"
            path.write_text(text)
            # The same time of change, which is all that numba itself looks at.
            os.utime(path, (1e9, 1e9))
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module("stale_whole"), importlib.import_module("stale_parts")

    yield fresh
    for name in ("stale_parts", "stale_whole"):
        sys.modules.pop(name, None)


def run(modules):
    """What the kernel returns, and whether it was compiled for that."""
    whole, parts = modules
    value = whole.whole(parts.Pair(4.0, 40.0))
    return value, bool(whole.whole.stats.cache_misses)


@pytest.mark.parametrize(
    ("old", "new", "value"),
    [
        ("x + STEP", "x - STEP", 15.0),
        ("STEP = 1.0", "STEP = 2.0", 30.0),
        ("* number", "+ number", 15.0),
        ("first: float\n    second: float", "second: float\n    first: float", 205.0),
        ("Couple", "Doublet", 25.0),
    ],
)
def test_a_kernel_is_compiled_again_when_what_it_calls_has_changed(load, tmp_path, old, new, value):
    run(load())
    assert run(load(PARTS.replace(old, new))) == (value, True)
    if "STEP" in old:
        # Files of older code are removed; NUMBA_CACHE_DIR may lie elsewhere.
        assert len(list(tmp_path.rglob("*.nbc"))) in (0, 1)


def test_a_kernel_is_compiled_once_for_all_numbers_and_then_found_on_disk(load):
    whole, parts = load()
    assert run((whole, parts)) == (25.0, True)
    assert len(parts.part.signatures) == 1
    # A comment changes nothing.
    assert run(load(PARTS.replace("Comments are", "Other comments\n    # are"))) == (25.0, False)


def test_what_cannot_be_seen_to_change_is_refused(load):
    whole, parts = load(PARTS.replace("STEP = 1.0", "import decimal\nSTEP = decimal"))
    with pytest.raises(TypeError, match=r"deepest uses .*decimal.*: import the number"):
        run((whole, parts))


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_shows_once_that_kernels_are_compiled(load, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    compiling._announce.cache_clear()
    run(load())
    assert sys.stderr.getvalue().count("compiling kernels") == 1
    monkeypatch.setattr(sys, "stderr", Terminal())
    compiling._announce.cache_clear()
    run(load())
    assert sys.stderr.getvalue() == ""


def test_a_kernel_that_counts_no_references_may_not_return_arrays():
    def kernel(row: Float) -> tuple[Float, int]:
        return row, 1

    with pytest.raises(TypeError, match="returns an array"):
        compiling.borrower(kernel)
