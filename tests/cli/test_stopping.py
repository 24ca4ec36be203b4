"""Ctrl-C at moments drawn by chance: one line, the status 130, and nothing half-made is left.

``LRF3D_STOPS=30 pytest tests/test_stopping.py`` stops each command at thirty moments and takes
many minutes; it runs the city. Without it a small room is stopped at two moments.
"""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from test_cli import ROOM

STOPS = int(os.environ.get("LRF3D_STOPS", "0"))
PATIENCE = 60.0

NEEDS = {"sweep": "pyarrow", "view": "nicegui"}

FILES = {
    "run": {"run.npz", "map.geojson", "map.png", "world.png", "summary.json", "run.mp4"},
    "map": {"map.geojson", "map.png", "summary.json"},
    "render": {"film.mp4"},
    "export": {"run.mcap"},
    "sweep": {"sweep.parquet", "summary.json", "sweep.jsonl", "means.csv", "means.tex"},
    "view": set(),
    "world": {"w.png"},
}
"""What may lie in the folder of a command when it was stopped."""

KEPT = {
    "run": r"lrf3d: stopped(; (\d+ of \d+|all) scans kept; go on with --resume)?\n",
    "sweep": r"lrf3d: stopped(; (\d+ of \d+|all) runs kept; go on with --resume)?\n",
}
"""What a command says when it was stopped, beside the bare line."""

DONE_WHEN_PRINTED = {"render": "film.mp4", "export": "run.mcap", "world": "w.png"}
"""Commands that print only when their file is there; a program may be stopped after its last line.
Others print results before they are drawn."""

SAME = {"run": ("run.npz", "map.geojson"), "sweep": ("sweep.parquet",)}
"""What is the same, byte by byte, when a stopped command went on."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a world, a run of it and its log."""
    folder = tmp_path_factory.mktemp("stopping")
    world = folder / "box.toml"
    world.write_text(ROOM.replace("scan_interval = 0.5", "scan_interval = 0.02"))
    world = "city" if STOPS else str(world)
    told = ["run", world, "--no-video", "--out", str(folder / "ready")]
    told += ["--scans", "400" if STOPS else "100"]
    assert ended(told)[0] == 0
    assert ended(["export", str(folder / "ready"), "--to", "carmen", "--out",
                  str(folder / "drive.log")])[0] == 0  # fmt: skip
    return folder, world


def command_of(name, place, out):
    """The arguments of a command that writes to a folder."""
    folder, world = place
    film = ["--size", "160x90", "--fps", "25" if STOPS else "5", "--playback", "2"]
    return {
        "run": ["run", world, "--no-video", "--out", out],
        "run film": ["run", world, *film, "--out", out],
        "render": ["render", folder / "ready", *film, "--out", out / "film.mp4"],
        "map": ["map", folder / "drive.log", "--out", out],
        "sweep": ["sweep", world, "--sigma", "0.04,0.4", "--seeds", "3", "--workers", "2",
                  "--every", "5", "--out", out],
        "export": ["export", folder / "ready", "--to", "mcap", "--out", out / "run.mcap"],
        "view": ["view", folder / "ready", "--no-browser"],
        "view world": ["view", world, "--no-browser"],
        "world": ["world", "show", world, "--out", out / "w.png"],
        "localise": ["localise", world, "--seeds", "4", "--workers", "2"],
    }[name]  # fmt: skip


def start(arguments, temporary=None):
    environment = {n: v for n, v in os.environ.items() if "PYTEST" not in n}
    if temporary is not None:
        environment["TMPDIR"] = str(temporary)
    return subprocess.Popen(
        [sys.executable, "-m", "lrf3d", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    )


def ended(arguments):
    """Status, output and errors of a command that nobody stops."""
    process = start(arguments)
    out, err = process.communicate(timeout=600)
    return process.returncode, out, err


def listens(process):
    """Whether the program has begun: Python itself has no handler of SIGHUP."""
    try:
        status = Path(f"/proc/{process.pid}/status").read_text()
    except OSError:
        return False
    return bool(int(re.search(r"SigCgt:\s*(\w+)", status)[1], 16) & 1 << (signal.SIGHUP - 1))


def stopped(arguments, moment, temporary):
    """Status, output and errors of a command that is stopped some time after it has begun [s].

    The signal goes to all of its processes, as from a terminal.
    """
    process = start(arguments, temporary)
    end = time.monotonic() + PATIENCE
    while not listens(process) and process.poll() is None:
        assert time.monotonic() < end, "the program does not begin"
    try:
        out, err = process.communicate(timeout=moment)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    return process.returncode, out, err


def duration(name, arguments):
    """How long a command takes [s], or a view until it is shown and for a moment more."""
    begin = time.monotonic()
    if not name.startswith("view"):
        status, _, err = ended(arguments)
        assert status == 0, err
        return time.monotonic() - begin
    process = start(arguments)
    assert "http://" in process.stdout.readline()
    taken = time.monotonic() - begin
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE)
    return 1.2 * taken


def working_in(folder):
    """The processes whose command lines speak of a folder."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if str(folder).encode() in path.read_bytes():
                found.append(path.parent.name)
        except OSError:
            continue
    return found


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="looks at processes in /proc")
@pytest.mark.parametrize(
    "name",
    ["map", "export"]
    + [pytest.param(each, marks=pytest.mark.slow) for each in ("run", "sweep", "view", "localise")]
    + (["run film", "render", "view world", "world"] if STOPS else []),
)
def test_ctrl_c_at_any_moment_ends_with_one_line(name, place, tmp_path):
    kind = name.split()[0]
    if kind in NEEDS:
        pytest.importorskip(NEEDS[kind])
    whole = tmp_path / "whole"
    whole.mkdir()
    taken = duration(name, command_of(name, place, whole))
    moments = np.random.default_rng(5).uniform(0.0, 0.95 * taken, STOPS or 2)
    wrong, late = [], 0
    for number, moment in enumerate(moments.tolist()):
        out, temporary = tmp_path / f"out{number}", tmp_path / f"tmp{number}"
        out.mkdir()
        temporary.mkdir()
        arguments = command_of(name, place, out)
        status, said, err = stopped(arguments, moment, temporary)
        problems = []
        if status == 0 and err == "":
            late += 1
            continue
        if status != 130 or not re.fullmatch(KEPT.get(kind, "lrf3d: stopped\n"), err):
            problems.append((status, err[-1500:]))
        if kind in DONE_WHEN_PRINTED and said and not (out / DONE_WHEN_PRINTED[kind]).exists():
            problems.append(("stdout", said))
        left = {path.name for path in out.iterdir() if path.suffix != ".png"}
        allowed = FILES.get(kind, set()) | ({"run.journal"} if kind == "run" else set())
        # The lock file remembers what made an unfinished folder.
        allowed |= {".lrf3d.lock"}
        unfinished = list(out.rglob("*unfinished*")) + list(temporary.iterdir())
        if left - allowed or unfinished:
            problems.append(("left", left - allowed, unfinished))
        end = time.monotonic() + 5.0
        while working_in(out) and time.monotonic() < end:
            pass
        if working_in(out):
            problems.append(("processes", working_in(out)))
        if kind in SAME:
            status, _, err = ended([*arguments, "--resume"])
            if status != 0:
                problems.append(("resumed", status, err))
            else:
                problems += [
                    ("differs", file)
                    for file in SAME[kind]
                    if (out / file).read_bytes() != (whole / file).read_bytes()
                ]
                if not {path.name for path in out.iterdir()} <= FILES[kind] | {
                    path.name for path in whole.iterdir()
                }:
                    problems.append(("left after", list(out.iterdir())))
        if problems:
            wrong.append((moment, problems))
    print(f"{name}: {len(moments)} moments of {taken:.1f} s, {late} too late, {len(wrong)} wrong")
    assert not wrong, wrong
