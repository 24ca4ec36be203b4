"""Ctrl-C at moments drawn by chance: one line, the status 130, and nothing half-made is left.

``LRF3D_STOPS=30 pytest tests/apps/cli/test_stopping.py`` stops each command at thirty moments;
without it, at one.
"""

import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from test_cli import ROOM
from waiting import PATIENCE, until

pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="looks at processes")

STOPS = int(os.environ.get("LRF3D_STOPS", "1"))

FILM = ["--size", "64x64", "--fps", "2", "--playback", "2", "--workers"]

# Commands; OUT is the folder that each writes to.
COMMANDS = {
    "run": ["run", "WORLD", "--no-video", "--out", "OUT"],
    "run film": ["run", "WORLD", *FILM, "2", "--out", "OUT"],
    "render": ["render", "READY", *FILM, "1", "--out", "OUT/film.mp4"],
    "map": ["map", "LOG", "--out", "OUT"],
    "slam": ["slam", "LOG", "--out", "OUT"],
    "sweep": ["sweep", "WORLD", "--seeds", "4", "--mapper", "robust", "--sigma", "0.1",
              "--workers", "2", "--out", "OUT"],
    "export": ["export", "READY", "--to", "glb", "--every", "2", "--out", "OUT/run.glb"],
    "view": ["view", "READY", "--no-browser"],
    "world": ["world", "show", "WORLD", "--out", "OUT/w.png"],
    "localise": ["localise", "WORLD", "--seeds", "2", "--workers", "2"],
}  # fmt: skip

# What is the same, byte by byte, when a stopped command is resumed.
SAME = {"run": ("run.npz", "map.geojson"), "sweep": ("runs.csv",)}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a world, a run of it and its log."""
    folder = tmp_path_factory.mktemp("stopping")
    world = folder / "box.toml"
    world.write_text(ROOM.replace("scan_interval = 0.5", "scan_interval = 0.04"))
    ready, log = folder / "ready", folder / "drive.log"
    names = {"WORLD": str(world), "READY": str(ready), "LOG": str(log)}
    for command in (
        ["run", "WORLD", "--no-video", "--scans", "100", "--out", "READY"],
        ["export", "READY", "--to", "carmen", "--out", "LOG"],
    ):
        assert ended([names.get(word, word) for word in command])[0] == 0
    return names


def start(arguments, temporary=None):
    environment = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    if temporary is not None:
        environment["TMPDIR"] = str(temporary)
    command, pipe = [sys.executable, "-m", "lrf3d", *map(str, arguments)], subprocess.PIPE
    return subprocess.Popen(
        command, stdout=pipe, stderr=pipe, text=True, env=environment, start_new_session=True
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
    """Status and errors of a command that is stopped some time after it has begun [s].

    The signal goes to all of its processes, as from a terminal.
    """
    process = start(arguments, temporary)
    until(lambda: listens(process) or process.poll() is not None)
    try:
        _, err = process.communicate(timeout=moment)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    return process.returncode, err


def is_left(folder):
    """Whether there is no process whose command line speaks of a folder."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if str(folder).encode() in path.read_bytes():
                return False
        except OSError:
            continue
    return True


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n != "world")) for n in COMMANDS]
)
def test_ctrl_c_at_any_moment_ends_with_one_line(name, place, tmp_path):
    kind = name.split()[0]
    pytest.importorskip({"view": "websockets"}.get(kind, "lrf3d"))

    def command(out):
        out.mkdir()
        names = {**place, "OUT": str(out)}
        return [re.sub("^(WORLD|READY|LOG|OUT)", lambda m: names[m[0]], w) for w in COMMANDS[name]]

    whole, begin = tmp_path / "whole", time.monotonic()
    if kind == "view":
        process = start(command(whole))
        assert "http://" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)
    else:
        status, _, err = ended(command(whole))
        assert status == 0, err
    moments = np.random.default_rng(5).uniform(0.0, 0.95 * (time.monotonic() - begin), STOPS)
    for number, moment in enumerate(moments.tolist()):
        out, temporary = tmp_path / f"out{number}", tmp_path / f"tmp{number}"
        temporary.mkdir()
        arguments = command(out)
        status, err = stopped(arguments, moment, temporary)
        if (status, err) == (0, ""):
            continue
        kept = r"lrf3d: stopped(; [\w ]+ kept; go on with --resume|; .* holds the map)?\n"
        assert status == 130 and re.fullmatch(kept, err), (moment, status, err[-1500:])
        left = {path.name for path in out.glob("*")} - {path.name for path in whole.iterdir()}
        assert left <= {"run.journal", "summary.json"}, (moment, left)
        assert not [*out.rglob("*unfinished*"), *temporary.iterdir()], moment
        until(partial(is_left, out))
        if name in SAME:
            status, _, err = ended([*arguments, "--resume"])
            assert status == 0, (moment, err)
            for file in SAME[name]:
                assert (out / file).read_bytes() == (whole / file).read_bytes(), (moment, file)
