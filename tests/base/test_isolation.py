"""A stranger's file is read in a process of its own, whatever happens there."""

import io
import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections import Counter
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from program import refused

import lrf3d
from lrf3d.base import formats, isolation
from lrf3d.base.formats import Format
from lrf3d.base.isolation import read_file
from lrf3d.base.packing import receive, send
from lrf3d.laser.range_finder import CENTRE
from lrf3d.plans.decisions import Remove, Scale

EXAMPLES = Path(__file__).parents[2] / "examples"

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="limits that Linux has")

# What happens while a file is read, as Python that the reader runs, and what is said of it.
FAILURES = {
    "hold = [bytes(10**7) for _ in range(10**4)]": r"more than 60\.\d MB of memory; cut it down",
    "import numpy\nhold = numpy.ones(10**9)": r"more than 60\.\d MB of memory; .* LRF3D_READING=4",
    "while True: pass": "more than 1 s of computing; cut it down",
    "import ctypes\nctypes.string_at(0)": r"the library that reads it crashed \(SIGSEGV\)",
    "import os\nos._exit(3)": r"crashed \(status 3\)",
    "import os\nos.kill(os.getpid(), 9)": "stopped from outside",
    "import time\ntime.sleep(99)": r"waited for 0\.4 s for something that never comes",
    "def f(): f()\nf()": "nested too deeply",
    "raise KeyError('x')": r"damaged, or no py file \(KeyError: 'x'\); save it again",
    "open('written', 'w')": "cannot be read: Permission denied",
    "import os\nos.execv('/bin/true', ['true'])": "cannot be read: Permission denied",
    "values = {1, 2}": "not handed to another process",
    "import lrf3d\nraise lrf3d.WorldError('there is no wall')": "there is no wall",
}


@pytest.fixture
def started(monkeypatch):
    """The processes that were started, since files are read apart; all have ended."""
    monkeypatch.setenv(isolation.FACTOR, "1")
    found = []
    start = subprocess.Popen
    monkeypatch.setattr(
        subprocess, "Popen", lambda *a, **k: found.append(start(*a, **k)) or found[-1]
    )
    yield found
    assert all(each.poll() is not None for each in found)


def run_apart(path):
    """Run a file as Python in the process that reads."""
    return read_file("runpy:run_path", path, {}, isolated=True)


@needs_linux
@pytest.mark.parametrize("code", FAILURES)
def test_whatever_happens_to_the_process_is_one_line(code, started, written, tmp_path, monkeypatch):
    monkeypatch.setattr(isolation, "LEAST_MEMORY", 60_000_000)
    monkeypatch.setattr(isolation, "LEAST_SECONDS", 0)
    if "sleep" in code:
        monkeypatch.setattr(isolation, "PATIENCE", 0.4)
    monkeypatch.chdir(tmp_path)
    path = written("a.py", code)
    with pytest.raises(lrf3d.Lrf3dError, match=FAILURES[code]) as caught:
        run_apart(path)
    assert "\n" not in str(caught.value) and [*tmp_path.iterdir()] == [path] and len(started) == 1
    assert not Path(started[0].args[-1]).exists()


def same(a, b):
    """Whether two values are the same to the bit, in all their parts."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray) and a.dtype.kind == "O":
        return a.tolist() == b.tolist()
    if isinstance(a, np.ndarray):
        return (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    if isinstance(a, dict):
        return same([*a.items()], [*b.items()])
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if hasattr(a, "__dataclass_fields__"):
        names = a.__dataclass_fields__
        return all(same(getattr(a, name), getattr(b, name)) for name in names)
    return repr(a) == repr(b)


@pytest.mark.parametrize(
    ("name", "read", "options"),
    [
        ("flat.dxf", lrf3d.load_world, {"layers": ("WALL*",), "scale": 2.0}),
        ("flat.svg", lrf3d.read_plan, {}),
        ("flat.svg", lrf3d.load_world, {"edits": [Scale([[0, 0], [100, 0]], 1.0)]}),
        ("town.geojson", lrf3d.read_plan, {"edits": [Remove([[0, 0], [1, 1]])]}),
        ("town.geojson", lrf3d.load_world, {}),
        ("drive.log.gz", lrf3d.load_log, {"without_repairs": ("no_return",)}),
    ],
)
def test_a_file_that_is_read_apart_is_read_once_and_is_the_same(name, read, options, started):
    notes = []
    found = []
    for isolated in (True, False):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found.append(read(EXAMPLES / name, isolated=isolated, **options))
        notes.append([(each.category, str(each.message)) for each in caught])
        assert len(started) == 1
    assert same(*found) and notes[0] == notes[1]


def test_built_in_worlds_and_toml_start_no_process(started, tmp_path):
    lrf3d.load_scenario("city")
    lrf3d.save_world(lrf3d.load_world("paper_room"), tmp_path / "a.toml")
    lrf3d.load_world(tmp_path / "a.toml")
    with pytest.raises(lrf3d.WorldError, match="no such file"):
        lrf3d.load_world(tmp_path / "a.dxf")
    assert not started


def test_a_reader_that_a_program_enters_runs_in_that_program(started, tmp_path, monkeypatch):
    row = Format(kind="world", endings=(".obj",), read=lambda path: lrf3d.World([[0, 0, 1, 0]]))
    monkeypatch.setattr(formats, "FORMATS", [*formats.FORMATS, row])
    (tmp_path / "a.obj").touch()
    assert len(lrf3d.load_world(tmp_path / "a.obj").segments) == 1 and not started


def test_the_command_line_says_the_limit_and_how_it_is_raised(started, tmp_path, monkeypatch):
    monkeypatch.setattr(isolation, "LEAST_MEMORY", 1000)
    (tmp_path / "a.log").write_text("FLASER 2 1 1 0 0 0 0 0 0 0\n" * 100)
    said = refused("map", tmp_path / "a.log", "--out", tmp_path / "out")
    assert f"{tmp_path}/a.log: reading it takes more than" in said and "LRF3D_READING=4" in said
    monkeypatch.setenv(isolation.FACTOR, "1e6")
    assert len(lrf3d.load_log(tmp_path / "a.log")) == 100
    for wrong in ("-1", "much", "nan"):
        monkeypatch.setenv(isolation.FACTOR, wrong)
        assert f"LRF3D_READING='{wrong}': expected a factor" in refused("map", tmp_path / "a.log")


def test_an_option_that_no_process_takes_is_named(started):
    with pytest.raises(lrf3d.WorldError, match=r"flat\.svg: .*object.*"):
        lrf3d.load_world(EXAMPLES / "flat.svg", layers=object())


@needs_linux
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_process_ends_with_its_parent(number, written, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setenv(isolation.FACTOR, "1")
    begun = tmp_path / "begun"
    os.mkfifo(begun)
    path = written("a.py", f"open({str(begun)!r}).read()")
    code = f"read_file('runpy:run_path', Path({str(path)!r}), {{}}, isolated=True)"
    code = f"from pathlib import Path; from lrf3d.base.isolation import read_file; {code}"
    parent = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE)
    with begun.open("w"):
        # The process waits for what is written here.
        parent.send_signal(number)
        parent.communicate()
        while [*tmp_path.glob("lrf3d-*")]:
            time.sleep(0.01)
    assert parent.returncode in (-number, 1)


SCANS = [
    lrf3d.LaserScan((x, 0, 0), CENTRE, [1.0, np.inf, 2.0], time=x, motion=motion)
    for x, motion in ((0.5, None), (1.5, (1, 0, 0)))
]
NUMBERS = st.one_of(st.integers(), st.floats(), st.booleans(), st.none(), st.text())
VALUES = st.recursive(
    NUMBERS | st.just(SCANS[0]) | st.just(lrf3d.Pose(1.0, 2.0, 3.0)),
    lambda each: st.lists(each) | st.tuples(each, each) | st.dictionaries(st.text(), each),
)


def sent(value):
    stream = io.BytesIO()
    send(stream, value)
    return stream.getvalue()


@pytest.mark.slow
@settings(max_examples=30)
@given(VALUES)
def test_a_value_is_the_same_in_another_process(value):
    assert same(receive(io.BytesIO(sent(value)), 1 << 30), value)


@pytest.mark.parametrize(
    "value",
    [
        SCANS,
        SCANS * 20,
        [0.5] * 20,
        [*map(float, range(20))],
        np.zeros((0, 4)),
        Counter({"a": 1}),
        np.array(["wall", "wall", "door"], dtype=object),
    ],
)
def test_columns_of_many_values_are_the_same_in_another_process(value):
    assert same(receive(io.BytesIO(sent(value)), 1 << 30), value)


@settings(max_examples=50)
@given(st.data())
def test_bytes_of_a_process_that_was_taken_over_make_nothing_but_a_value(data):
    """Whatever comes through the pipe, it ends in one of these errors, or is a checked value."""
    whole = bytearray(sent([SCANS * 2, {"a": 0.5}, lrf3d.load_world("paper_room")]))
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    with suppress(EOFError, ValueError, MemoryError):
        receive(io.BytesIO(whole), 1 << 20)


@pytest.mark.parametrize(
    "tree",
    [
        ["record", "os:stat_result", []],
        ["record", "lrf3d.world.files:load_world", ["city"]],
        ["record", "lrf3d.base.isolation:ReadingLimits", [1, 2, 3]],
        ["record", "lrf3d.laser.scan:np", []],
        ["record", "lrf3d.world.nothing:World", []],
        ["array", 7],
        ["call", 1],
    ],
)
def test_a_record_that_is_none_of_ours_is_refused(tree):
    text = json.dumps([tree, []]).encode()
    head = len(text).to_bytes(8, "little") + bytes(8)
    with pytest.raises(ValueError, match=r"record|kind|Error"):
        receive(io.BytesIO(head + text), 1 << 20)
