"""Inputs of every kind that lrf3d takes, mutated: files, grids, settings and flags.

A seed and a number enter; an input leaves, the files of it and the command that takes them, always
the same. `end` runs one in a process of its own, and says how it ended and what it took.
"""

import os
import random
import re
import resource
import signal
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

import damaged_worlds
import numpy as np

import lrf3d
from lrf3d.errors import Lrf3dError
from lrf3d.exporting import export_run

SECONDS, BYTES = 10, 1 << 30
"""What an input may take of a processor [s] and of the memory [bytes]."""

FRESH = 200 << 20
"""What a program takes to begin with [bytes], without any input."""

TOKENS = [
    b"nan", b"inf", b"-inf", b"-1", b"0", b"-0.0", b"1e308", b"-1e308", b"1e-308", b"1e400", b".5",
    b"5.", b"1_000", b"0x10", b"1e16", b"99999999999999999999", b"9" * 5000, b"2026-11-21", b"true",
    b'""', b'"a"', b"'", b'"', b"[]", b"[[]]", b"{}", b"[nan]", b"[[1, 2], [3]]", b"\0", b"\n",
    b"\r\n", b"\x1b[31m", b"\xff\xfe", "σ".encode(), "\U0001f916".encode(), b"x" * 100_000,
    b"$^$", b"<!-- ", b"%s%n", b"../../etc", b"-", b"--", b"null", b"None", b",", b"#",
]  # fmt: skip
"""What stands in the place of something else."""

NUMBER = re.compile(rb"[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?")
WORD = re.compile(rb"[A-Za-z_][\w]*")

ROOM = b"""\
name = "box"
[[object]]
name = "walls"
points = [[0, 0], [10, 0], [10, 8], [0, 8]]
closed = true
height = [3, 3, 2.5, 3]
colour = "#c8b49a"
number = 2
[[camera]]
name = "door"
position = [1, 1, 2]
target = [5, 5, 1]
field_deg = 60
[[obstacle]]
route = [[5, 6], [8, 6]]
speed = 1.5
radius = 0.3
[robot]
start = [2, 2, 90]
route = [[2, 2], [8, 2], [8, 5]]
speed = 2.0
scan_interval = 0.5
radius = 0.3
[laser]
angle_min_deg = -90
angle_max_deg = 90
beams = 31
range_min = 0.1
range_max = 20.0
scan_duration = 0.1
[noise]
sigma = [0.05, 0.1]
constant = 0.01
drop_outs = 0.1
resolution = 0.01
[mapper]
mode = "robust"
gap = 1.0
min_points = 3
[film]
view = "door"
playback = 2
"""

GRID = b"""\
worlds = ["city", "box.toml"]
seeds = 2
every = 8
[noise]
sigma = [0, 0.07]
[laser]
beams = [31, 61]
[mapper]
mode = ["robust", "paper"]
gap = [1, 2.5]
"""

FLAGS = {
    "--sigma": b"0.04", "--seed": b"3", "--scans": b"3", "--mode": b"paper", "--caster": b"planar",
    "--fps": b"25", "--playback": b"4", "--size": b"640x360", "--workers": b"2", "--view": b"top",
    "--mapper": b"box:Mapper", "--noise": b"box.py:noise",
}  # fmt: skip

SETTINGS = [
    b"laser.beams=31", b"laser.range_max=20.5", b"laser.angle_min_deg=-45", b"noise.sigma=[0.1,1]",
    b"mapper.mode=paper", b"mapper.gap=1.5", b"robot.start=[3, 3, 0]", b"robot.speed=2",
    b"robot.route=[[2, 2], [8, 2]]", b"film.view=top", b"laser.scan_duration=0.2",
    b"laser.height=1", b"robot.radius=.3", b"noise.drop_outs=0.5", b"mapper.min_points=4",
]  # fmt: skip


@dataclass(frozen=True)
class Input:
    """An input: what to call it, its files by name, and how lrf3d is given them.

    Args:
        name: What it is.
        files: The files in an empty folder.
        command: Arguments of the program.
        call: A function that is called in the folder instead.
    """

    name: str
    files: dict[str, bytes] = field(default_factory=dict)
    command: tuple[str, ...] = ()
    call: Callable[[], object] | None = None


class Inputs:
    """Whole inputs, made in a folder, and mutations of them."""

    def __init__(self, folder: Path) -> None:
        # What is imported here, no child has to import anew.
        for module in ("cli", "cli.results", "sweeping.plan", "render.figures"):
            import_module(f"lrf3d.{module}")
        self.worlds = {kind: dict(files) for kind, files in damaged_worlds.valid().items()}
        self.worlds["room"] = {"box.toml": ROOM}
        for name in ("paper_room", "corridor"):
            world = lrf3d.load_world(name)
            for ending in ("toml", "geojson", "glb", "yaml"):
                path = folder / f"{name}.{ending}"
                lrf3d.save_world(world, path)
                files = [path, path.with_suffix(".pgm")] if ending == "yaml" else [path]
                self.worlds[f"{name} {ending}"] = {f.name: f.read_bytes() for f in files}
        lrf = lrf3d.LaserRangeFinder(beams=31, range_max=20.0)
        poses = np.column_stack([np.linspace(2, 8, 12), np.full(12, 2.0), np.zeros(12)])
        (folder / "box.toml").write_bytes(ROOM)
        run = lrf3d.simulate(lrf3d.load_world(folder / "box.toml"), poses, lrf, rng=0)
        lrf3d.save_run(run, folder / "run.npz")
        lrf3d.save_map(run.map, folder / "map.geojson")
        export_run(run, "carmen", folder / "a.log")
        export_run(run, "carmen", folder / "a.log.gz")
        names = ["run.npz", "a.log", "a.log.gz"]
        try:
            export_run(run, "mcap", folder / "a.mcap")
            names.append("a.mcap")
        except lrf3d.MissingLibraryError:
            pass
        self.logs = {name: (folder / name).read_bytes() for name in names}
        self.map = (folder / "map.geojson").read_bytes()

    def mutated(self, seed: int) -> Input:
        """The input of a seed."""
        rng = random.Random(f"mutated {seed}")
        kinds = [self._world] * 10 + [self._log] * 4 + [self._map, self._grid] + [self._flags] * 4
        return rng.choice(kinds)(rng)

    def _world(self, rng: random.Random) -> Input:
        kind = rng.choice(sorted(self.worlds))
        files = dict(self.worlds[kind])
        target = rng.choice(list(files))
        files[target] = mutate(files[target], rng)
        first = next(iter(files))
        planned = ("run", first, "--no-video", "--scans", "3", "--caster", "planar")
        ways = [("world", "convert", first, "to.toml")] * 5 + [("world", "show", first), planned]
        return Input(f"world {kind}", files, rng.choice(ways))

    def _log(self, rng: random.Random) -> Input:
        name = rng.choice(sorted(self.logs))
        files = {name: mutate(self.logs[name], rng)}
        ways = [("map", name, "--out", "out")]
        if name == "run.npz":
            ways += [("export", name, "--to", "carmen"), ("export", name, "--to", "glb")]
        return Input(f"log {name}", files, rng.choice(ways))

    def _map(self, rng: random.Random) -> Input:
        def load() -> None:
            lrf3d.save_map(lrf3d.load_map("map.geojson"), "again.geojson")

        return Input("map", {"map.geojson": mutate(self.map, rng)}, call=load)

    def _grid(self, rng: random.Random) -> Input:
        def plan() -> None:
            from lrf3d.sweeping.grid import read_grid
            from lrf3d.sweeping.plan import make_plan

            make_plan(read_grid(Path("grid.toml"), {}))

        files = {"grid.toml": mutate(GRID, rng), "box.toml": ROOM}
        return Input("grid", files, call=plan)

    def _flags(self, rng: random.Random) -> Input:
        files = {"box.toml": ROOM}
        command = ["run", "box.toml", "--no-video"]
        for flag in rng.sample(sorted(FLAGS), rng.randrange(3)):
            command += [flag, argument(FLAGS[flag], rng)]
        for setting in rng.sample(SETTINGS, rng.randrange(1, 3)):
            command += ["--set", argument(setting, rng)]
        return Input("flags", files, tuple(command))


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Data with one to three mutations, mostly one: what is half right gets farthest."""
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        data = rng.choice([_cut, _flip, _hole, _twice, _token, _token, _number, _number, _word])(
            data, rng
        )
    return data


def argument(text: bytes, rng: random.Random) -> str:
    """An argument of a program, mutated: it holds no NUL, and no more than a system takes."""
    return os.fsdecode(mutate(text, rng).replace(b"\0", b"")[:100_000])


def _place(data: bytes, rng: random.Random) -> int:
    return rng.randrange(len(data) + 1)


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: _place(data, rng)]


def _flip(data: bytes, rng: random.Random) -> bytes:
    spoilt = bytearray(data)
    for _ in range(rng.choice([1, 1, 4, 32]) if data else 0):
        spoilt[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(spoilt)


def _hole(data: bytes, rng: random.Random) -> bytes:
    first, last = sorted((_place(data, rng), _place(data, rng)))
    return data[:first] + data[last:]


def _twice(data: bytes, rng: random.Random) -> bytes:
    first, last = sorted((_place(data, rng), _place(data, rng)))
    return data[:last] + data[first:]


def _token(data: bytes, rng: random.Random) -> bytes:
    place = _place(data, rng)
    return data[:place] + rng.choice(TOKENS) + data[place:]


def _number(data: bytes, rng: random.Random) -> bytes:
    return _instead(data, rng, NUMBER)


def _word(data: bytes, rng: random.Random) -> bytes:
    return _instead(data, rng, WORD)


def _instead(data: bytes, rng: random.Random, pattern: re.Pattern[bytes]) -> bytes:
    # The beginning is enough: what follows is more of the same.
    found = list(pattern.finditer(data[:100_000]))
    if not found:
        return data
    match = rng.choice(found)
    return data[: match.start()] + rng.choice(TOKENS) + data[match.end() :]


@dataclass(frozen=True)
class End:
    """How an input ended.

    Args:
        status: Exit status; minus the signal where there was one.
        out: What was printed on stdout and on stderr.
        seconds: Time of the processor [s].
        bytes: Most memory of it and of what it started.
    """

    status: int
    out: str
    err: str
    seconds: float
    bytes: int

    def fault(self) -> str:
        """What is wrong with this end; empty where nothing is."""
        if self.seconds > SECONDS or self.status in (-signal.SIGXCPU, -signal.SIGALRM):
            return f"took {self.seconds:.1f} s of a processor, or waits for ever"
        if self.bytes > BYTES:
            return f"took {self.bytes / 2**20:.0f} MiB"
        if "Traceback" in self.err or self.status not in (0, 1, 2):
            return f"ended with status {self.status} and\n{self.err[-3000:]}"
        lines = [line for line in self.err.splitlines() if not line.startswith("lrf3d: warning: ")]
        # What was chosen for the user is said in lines of the program's own.
        if self.status == 0 and not all(line.startswith("lrf3d: ") for line in lines):
            return f"said\n{self.err[:2000]}"
        # Usage errors are the command line's own: how it is called, and what is wrong.
        if self.status == 1 and not (len(lines) == 1 and lines[0].startswith("lrf3d: ")):
            return f"said not one line but\n{self.err[:2000]}"
        if self.status == 1 and len(self.err) > 5000:
            return f"said {len(self.err)} characters"
        return ""


def end(case: Input, folder: Path) -> End:
    """Run an input in a process of its own, forked from this one, in an empty folder.

    What this process holds is its own: after hundreds of tests that may be a gigabyte.
    """
    for name, data in case.files.items():
        (folder / name).write_bytes(data)
    said = [folder / ".stdout", folder / ".stderr"]
    # A fork takes over what is no file: what is resident without what is shared.
    resident, shared = map(int, Path("/proc/self/statm").read_text().split()[1:3])
    held = (resident - shared) * resource.getpagesize()
    child = os.fork()
    if child == 0:
        try:
            _run(case, folder, said)
        finally:
            os._exit(99)
    _, status, used = os.wait4(child, 0)
    out, err = (path.read_text(errors="backslashreplace") for path in said)
    # What the children of the child took counts as well.
    return End(
        os.waitstatus_to_exitcode(status), out, err, used.ru_utime + used.ru_stime,
        max((used.ru_maxrss << 10) - held, 0) + FRESH,
    )  # fmt: skip


def _run(case: Input, folder: Path, said: list[Path]) -> None:
    """Be the child: run the input and leave with its status."""
    os.chdir(folder)
    for number, path in enumerate(said, start=1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT), number)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    sys.stdout, sys.stderr = (open(n, "w", encoding="utf-8", errors="backslashreplace", buffering=1)
                              for n in (1, 2))  # fmt: skip
    resource.setrlimit(resource.RLIMIT_CPU, (2 * SECONDS, 2 * SECONDS + 1))
    # What waits for ever takes no time of the processor; a busy machine is given its time.
    signal.alarm(20 * SECONDS)
    status: int | str | None = 0
    try:
        if case.call is None:
            from lrf3d.cli import main

            sys.argv = ["lrf3d", *case.command]
            main()
        else:
            case.call()
    except Lrf3dError as error:
        print(f"lrf3d: {error}", file=sys.stderr)
        status = 1
    except SystemExit as error:
        status = error.code  # type: ignore[assignment]
    except BaseException:
        traceback.print_exc()
        status = 70
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status if isinstance(status, int) else 0 if status is None else 71)
