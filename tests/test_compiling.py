"""What is compiled is kept on disk, and only as long as it is what the source says."""

import importlib
import io
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lrf3d.base.errors import Lrf3dWarning
from lrf3d.casting.kernels import beams, tree
from lrf3d.compiling import LANES, borrower, by_lanes, cache, compiled
from lrf3d.compiling.cache import stamp_of
from lrf3d.compiling.formulas import _in_python
from lrf3d.geometry.lines import Float
from test_kernel_results import kernels

PARTS = '''
from typing import NamedTuple
import numpy as np
from lrf3d.compiling import inner

STEP = 1.0
SCALES = np.array([1.0, 2.0])

class Pair(NamedTuple):
    first: float
    second: float

@inner
def part(x: float, number: int) -> float:
    """Work out a part."""
    return (x + STEP) * number * SCALES[0]

def unused(x: float) -> float:
    return x
'''

WHOLE = """
import edited.sides as by
from lrf3d.compiling import compiled
from edited import (
    parts,
)

Pair, part = parts.Pair, parts.part

@compiled
def whole(pair: Pair) -> float:
    return part(pair.first, 2) + part(pair.first, 3) * by.SIDE
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Write a package as it would be after an edit, and import it as a new process would."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "edited").mkdir()

    def forget():
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
        ({"parts": PARTS.replace("first: float\n    second", "second: float\n    first")}, 205.0),
        ({"parts": PARTS.replace("STEP = 1.0", "STEP = 2.0")}, 30.0),
        ({"parts": PARTS.replace("[1.0, 2.0]", "[2.0, 2.0]")}, 50.0),
        ({"parts": PARTS.replace("import inner", "import borrower as inner")}, 25.0),
        ({"sides": "SIDE = 2.0"}, 40.0),
    ],
)
def test_a_kernel_is_compiled_again_when_what_it_uses_has_changed(load, tmp_path, changed, value):
    run(load())
    assert run(load(**changed)) == (value, True)
    # Files of older code are removed; NUMBA_CACHE_DIR may lie elsewhere.
    assert len({path.name.split("-")[1] for path in tmp_path.rglob("*.nbc")}) in (0, 1)


@pytest.mark.parametrize(
    "changed",
    [
        {"parts": PARTS.replace("STEP = 1.0", "# One step.\nSTEP = 0.5 + 0.5")},
        {"parts": PARTS.replace("Work out a part.", "Work it out.\n\n    In metres.\n    ")},
        {"parts": PARTS.replace("    return x\n", "    return -x\n\n\nMORE = 3.0\n")},
        {"sides": "OTHER = 5.0\nSIDE = 1.0"},
    ],
)
def test_a_kernel_is_found_on_disk_when_only_the_rest_has_changed(load, changed):
    run(load())
    assert run(load(**changed)) == (25.0, False)


def test_a_kernel_is_compiled_once_for_all_numbers_and_then_found_on_disk(load):
    module = load()
    assert run(module) == (25.0, True)
    assert len(module.part.signatures) == 1
    assert run(load()) == (25.0, False)


@pytest.mark.parametrize(
    "damaged",
    [lambda data: b"", lambda data: data[: len(data) // 2], lambda data: data[:-1] + b"!",
     lambda data: b"cos\nsystem\n(S'true'\ntR."],
)  # fmt: skip
def test_a_damaged_file_of_the_cache_is_compiled_again(load, damaged):
    module = load()
    run(module)
    files = list(Path(module.whole._cache.cache_path).glob("*.nbc"))
    assert files
    for file in files:
        file.write_bytes(damaged(file.read_bytes()))
    assert run(load()) == (25.0, True)
    assert run(load()) == (25.0, False)


@pytest.mark.slow
def test_each_kernel_has_the_same_stamp_in_each_process():
    # What cannot be described gets another description in each.
    stamps = "from test_kernel_results import kernels; from lrf3d.compiling.cache import stamp_of"
    stamps += "; print(*(stamp_of(kernel) for kernel in kernels()))"
    other = subprocess.run([sys.executable, "-c", stamps], cwd=Path(__file__).parent,
                           capture_output=True, text=True, check=True)  # fmt: skip
    assert other.stdout.split() == [stamp_of(kernel) for kernel in kernels()]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1, True), (0.0, -0.0), ("a", b"a"), (np.float64(1), np.float32(1)), ((1, (2,)), (1, 2)),
        (np.zeros(2), np.zeros((2, 1))), (np.zeros((2, 2)), np.zeros((2, 2), order="F")),
        (np.dtype("u1,f8"), np.dtype("u1,f8", align=True)), (math.sin, math.cos),
        (np.sin, np.cos), (np.sort, np.argsort), (lambda: 1, lambda: 2), (object(), object()),
        (by_lanes(lambda row, by, limit: row), by_lanes(lambda row, by, limit: row[0])),
    ],
)  # fmt: skip
def test_constants_that_differ_give_different_stamps(one, other):
    def using(constant):
        return lambda: constant

    assert stamp_of(using(one)) != stamp_of(using(other))


@compiled
def by_vectors(columns: Float, plain: Any, limit: float, bounds: Float, entries: Float) -> Any:
    beam = beams.Beam(*plain)
    way = tree.way_of(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
    walls = beams.sift(columns, 1, beam, limit, bounds)
    return walls, tree.boxes_met(columns, 1, way, limit, entries)


@pytest.mark.parametrize("direction", [(0.6, 0.8), (-1.0, 0.0), (-0.0, 1.0), (1e-300, -1.0)])
def test_formulas_have_the_same_bits_in_vectors_and_in_python(direction):
    # Beams along sides and through corners, as coordinates are small integers.
    rng = np.random.default_rng(0)
    for _ in range(50):
        columns = np.sort(rng.integers(-3, 4, (4, LANES + 1)).astype(float), axis=0)
        plain = (*rng.integers(-3, 4, 2).astype(float), *direction)
        found = np.empty((2, 2 * LANES))
        expected = found.copy()
        met = by_vectors(columns, plain, 3.0, *found)
        beam = beams.Beam(*map(np.float64, plain))
        with np.errstate(divide="ignore"):
            way = tree.Way(*plain[:2], 0.0, 0.0, *(1.0 / (np.array(direction) + 0.0)))
        bits = _in_python(beams._bounds, False, columns, 1, beam, 3.0, expected[0])
        assert met[0] == bits
        assert met[1] == _in_python(tree._reaches, False, columns, 1, way, 3.0, expected[1])
        np.testing.assert_array_equal(found[0], expected[0])
        np.testing.assert_array_equal(found[1][:LANES], expected[1][:LANES])


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_shows_once_that_kernels_are_compiled(load, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    cache._announce.cache_clear()
    run(load())
    assert sys.stderr.getvalue().count("compiling kernels") == 1
    monkeypatch.setattr(sys, "stderr", Terminal())
    cache._announce.cache_clear()
    run(load())
    assert sys.stderr.getvalue() == ""


def test_kernels_work_where_no_folder_can_be_written(load, tmp_path, monkeypatch):
    run(load())
    monkeypatch.setattr(tempfile, "TemporaryFile", refused)  # Numba's way of trying a folder.
    assert run(load()) == (25.0, False)  # Kernels that were installed are found.
    cache._announce_unsaved.cache_clear()
    with pytest.warns(Lrf3dWarning, match="NUMBA_CACHE_DIR"):
        assert run(load(sides="SIDE = 2.0")) == (40.0, True)


def refused(*_, dir, **__):
    raise PermissionError(13, "Permission denied", str(dir))


def test_a_kernel_that_counts_no_references_may_not_return_arrays():
    def kernel(row: Float) -> tuple[Float, int]:
        return row, 1

    with pytest.raises(TypeError, match="returns an array"):
        borrower(kernel)


def test_a_kernel_whose_parts_were_in_a_module_that_is_gone_is_compiled_again(load, tmp_path):
    run(load())
    kept = list(tmp_path.rglob("*.nbc"))
    for path in kept:
        path.write_bytes(b"cmodule_that_is_gone\npart\n.")
    assert run(load()) == (25.0, bool(kept))


@pytest.mark.parametrize(
    ("needed", "changed", "compiles"),
    [
        ((), {}, False),
        (("an instruction of another processor",), {}, True),
        ((), {"sides": "SIDE = 2.0"}, True),
    ],
)
def test_released_kernels_are_used_where_all_that_decides_on_them_is_the_same(
    load, tmp_path, monkeypatch, needed, changed, compiles
):
    module = load()
    value, _ = run(module)
    (kernel,) = Path(module.whole._cache.cache_path).glob("*.nbc")
    released = tmp_path / "released"
    released.mkdir()
    kernel.rename(released / kernel.name)
    # The file has the name that it has for this processor.
    monkeypatch.setattr(cache, "PROCESSOR", module.whole.targetctx.codegen().magic_tuple()[1:])
    monkeypatch.setattr(cache, "RELEASED", released)
    monkeypatch.setattr(cache, "NEEDED", needed)
    cache._has_released.cache_clear()
    assert run(load(**changed)) == (40.0 if changed else value, compiles)
    cache._has_released.cache_clear()
