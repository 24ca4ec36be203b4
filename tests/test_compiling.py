"""What is compiled is kept on disk, and only as long as it is what the source says."""

import importlib
import io
import os
import sys
from pathlib import Path

import pytest

import lrf3d
from lrf3d import compiling
from lrf3d.geometry import Float

PARTS = """
from typing import NamedTuple
from lrf3d.compiling import inner

STEP = 1.0

class Pair(NamedTuple):
    first: float
    second: float

@inner
def part(x: float, number: int) -> float:
    return (x + STEP) * number
"""

WHOLE = """
import edited.sides as by
from lrf3d.compiling import compiled
from edited import (
    parts,
)

Pair, part, SIDE = parts.Pair, parts.part, by.SIDE

@compiled
def whole(pair: Pair) -> float:
    return part(pair.first, 2) + part(pair.first, 3) * SIDE
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Write a package as it would be after an edit, and import it as a new process would."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "edited").mkdir()

    def forget():
        compiling._source.cache_clear()
        for name in ("edited", "edited.sides", "edited.parts", "edited.whole"):
            sys.modules.pop(name, None)

    def fresh(parts=PARTS, sides="SIDE = 1.0"):
        texts = {"__init__": "", "sides": sides, "parts": parts, "whole": WHOLE}
        for name, text in texts.items():
            path = tmp_path / "edited" / f"{name}.py"
            path.write_text(text)
            # The same time of change, which is all that numba itself looks at.
            os.utime(path, (1e9, 1e9))
        forget()
        importlib.invalidate_caches()
        return importlib.import_module("edited.whole")

    yield fresh
    forget()


def run(module):
    """What the kernel returns, and whether it was compiled for that."""
    value = module.whole(module.Pair(4.0, 40.0))
    return value, bool(module.whole.stats.cache_misses)


@pytest.mark.parametrize(
    ("changed", "value"),
    [
        ({"parts": PARTS.replace("x + STEP", "x - STEP")}, 15.0),
        (
            {
                "parts": PARTS.replace(
                    "first: float\n    second: float", "second: float\n    first: float"
                )
            },
            205.0,
        ),
        ({"parts": PARTS.replace("STEP = 1.0", "STEP = 2.0")}, 30.0),
        ({"sides": "SIDE = 2.0"}, 40.0),
    ],
)
def test_a_kernel_is_compiled_again_when_what_it_uses_has_changed(load, tmp_path, changed, value):
    run(load())
    assert run(load(**changed)) == (value, True)
    # Files of older code are removed; NUMBA_CACHE_DIR may lie elsewhere.
    assert len(list(tmp_path.rglob("*.nbc"))) in (0, 1)


def test_a_kernel_is_compiled_once_for_all_numbers_and_then_found_on_disk(load):
    module = load()
    assert run(module) == (25.0, True)
    assert len(module.part.signatures) == 1
    assert run(load()) == (25.0, False)


def test_kernels_use_nothing_from_packages_that_load_their_names_late():
    # The sources of such names are not among those whose change is noticed.
    root = Path(lrf3d.__file__).parent
    for path in root.rglob("*.py"):
        if "from lrf3d.compiling import" in path.read_text(encoding="utf-8"):
            name = ".".join(path.relative_to(root.parent).with_suffix("").parts)
            used = compiling.sources_of(name)
            assert not used.keys() & {"lrf3d", "lrf3d.casting", "lrf3d.io", "lrf3d.mapping"}, name


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
