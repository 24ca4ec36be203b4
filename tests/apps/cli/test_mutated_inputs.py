"""Mutated inputs of every kind end in a result or in one clear line, in bounded time.

A seed enters; an input leaves, its files and the command that takes them, always the same.
``LRF3D_MUTATED=2000`` tries two thousand instead of a hundred.
"""

import os
import random
import re
import signal
import traceback

import bags
import damaged_worlds
import numpy as np
import pytest
from program import lrf3d as program
from test_scenario import ROOM as TABLES

import lrf3d

COUNT = int(os.environ.get("LRF3D_MUTATED", "100"))

# Those that are tried also where slow tests are left out.
FEW = 4

# What an input may take [s]; one that takes longer ends the process of the tests.
SECONDS = 300

# What stands in the place of something else.
TOKENS = [
    b"nan", b"inf", b"-inf", b"-1", b"0", b"-0.0", b"1e308", b"-1e308", b"1e-308", b"1e400", b".5",
    b"5.", b"1_000", b"0x10", b"1e16", b"99999999999999999999", b"9" * 5000, b"2026-11-21", b"true",
    b'""', b'"a"', b"'", b'"', b"[]", b"[[]]", b"{}", b"[nan]", b"[[1, 2], [3]]", b"\0", b"\n",
    b"\r\n", b"\x1b[31m", b"\xff\xfe", "σ".encode(), "\U0001f916".encode(), b"x" * 100_000,
    b"$^$", b"<!-- ", b"%s%n", b"../../etc", b"-", b"--", b"null", b"None", b",", b"#",
]  # fmt: skip

# Numbers and words.
PATTERNS = [re.compile(rb"[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?"), re.compile(rb"[A-Za-z_][\w]*")]

ROOM = f"""\
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
{TABLES}""".encode()

AXES = [
    b"noise.sigma=0,0.07", b"laser.beams=31,61", b"mapper.gap=1,2.5", b"robot.speed=.5,1",
]  # fmt: skip

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


def mutate(data, rng):
    """Data with one to three mutations, mostly one: what is half right gets farthest."""
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        first, last = sorted(rng.randrange(len(data) + 1) for _ in range(2))
        kind = rng.choice(["cut", "flip", "hole", "twice", "token", "word", "word", "word"])
        if kind == "cut":
            data = data[:first]
        elif kind == "flip" and data:
            spoilt = bytearray(data)
            for _ in range(rng.choice([1, 1, 4, 32])):
                spoilt[rng.randrange(len(data))] = rng.randrange(256)
            data = bytes(spoilt)
        elif kind == "hole":
            data = data[:first] + data[last:]
        elif kind == "twice":
            data = data[:last] + data[first:]
        elif kind == "token":
            data = data[:first] + rng.choice(TOKENS) + data[first:]
        # The beginning is enough: what follows is more of the same.
        elif found := list(rng.choice(PATTERNS).finditer(data[:100_000])):
            match = rng.choice(found)
            data = data[: match.start()] + rng.choice(TOKENS) + data[match.end() :]
    return data


def argument(text, rng):
    """An argument of a program, mutated: it holds no NUL, and no more than a system takes."""
    return os.fsdecode(mutate(text, rng).replace(b"\0", b"")[:100_000])


class Inputs:
    """Whole inputs, made in a folder, and mutations of them."""

    def __init__(self, folder):
        self.worlds = {kind: dict(files) for kind, files in damaged_worlds.valid().items()}
        self.worlds["room"] = {"box.toml": ROOM}
        world = lrf3d.load_world("paper_room")
        for ending in ("toml", "geojson", "glb", "yaml"):
            path = folder / f"paper_room.{ending}"
            lrf3d.save_world(world, path)
            files = [path, path.with_suffix(".pgm")] if ending == "yaml" else [path]
            self.worlds[ending] = {file.name: file.read_bytes() for file in files}
        lrf = lrf3d.LaserRangeFinder(beams=31, range_max=20.0)
        poses = np.column_stack([np.linspace(2, 8, 12), np.full(12, 2.0), np.zeros(12)])
        (folder / "box.toml").write_bytes(ROOM)
        run = lrf3d.simulate(lrf3d.load_world(folder / "box.toml"), poses, lrf, rng=0)
        lrf3d.save_run(run, folder / "run.npz")
        lrf3d.save_map(run.map, folder / "map.geojson")
        for name, kind in (("a.log", "carmen"), ("a.log.gz", "carmen"), ("a.mcap", "mcap")):
            lrf3d.export_run(run, kind, folder / name)
        drive = [("/scan", scan.time, bags.SCAN, bags.of_scan(scan)) for scan in run.scans]
        drive += [bags.mounted(), *bags.wheels(12)]
        bags.write(folder / "old", *drive, storage="SQLITE3")
        (folder / "old" / "old.db3").rename(folder / "a.db3")
        names = ["run.npz", "a.log", "a.log.gz", "a.mcap", "a.db3", "map.geojson"]
        self.data = {name: (folder / name).read_bytes() for name in names}

    def mutated(self, seed):
        """The files and the command of a seed."""
        rng = random.Random(f"mutated {seed}")
        kind = rng.choice(["world"] * 10 + ["file"] * 5 + ["sweep"] + ["flags"] * 4)
        if kind == "world":
            files = dict(self.worlds[rng.choice(sorted(self.worlds))])
            target, first = rng.choice(list(files)), next(iter(files))
            files[target] = mutate(files[target], rng)
            planned = ["run", first, "--no-video", "--scans", "3", "--caster", "planar"]
            ways = [["world", "convert", first, "to.toml"]] * 5 + [["world", "show", first]]
            return files, rng.choice([*ways, planned])
        if kind == "file":
            name = rng.choice(sorted(self.data))
            ways = [["map", name, "--out", "out"]]
            if name == "map.geojson":
                ways = [["world", "show", name]]
            elif name == "run.npz":
                ways += [["export", name, "--to", "carmen"], ["export", name, "--to", "glb"]]
            return {name: mutate(self.data[name], rng)}, rng.choice(ways)
        if kind == "sweep":
            axis = argument(rng.choice(AXES), rng)
            return {"box.toml": ROOM}, ["sweep", "box.toml", "--vary", axis, "--merge"]
        command = ["run", "box.toml", "--no-video"]
        for flag in rng.sample(sorted(FLAGS), rng.randrange(3)):
            command += [flag, argument(FLAGS[flag], rng)]
        for setting in rng.sample(SETTINGS, rng.randrange(1, 3)):
            command += ["--set", argument(setting, rng)]
        return {"box.toml": ROOM}, command


def fault_of(case, folder):
    """What is wrong with how an input ends; empty if nothing."""
    files, command = case
    for name, data in files.items():
        (folder / name).write_bytes(data)
    signal.alarm(SECONDS)
    try:
        done = program(*command, cwd=folder)
    except BaseException:
        return traceback.format_exc()[-3000:]
    finally:
        signal.alarm(0)
    if done.returncode not in (0, 1, 2):
        return f"ended with status {done.returncode} and\n{done.stderr[-3000:]}"
    lines = done.stderr.splitlines()
    lines = [line for line in lines if not line.startswith("lrf3d: warning: ")]
    # What was read of a plan is said before what its route lacks.
    lines = [line for line in lines if not line.endswith(("` draws it", "` settles it"))]
    # Usage errors are the command line's own; what was chosen for the user is said, too.
    said = done.returncode == 2 or all(line.startswith("lrf3d: ") for line in lines)
    one = done.returncode != 1 or (len(lines) == 1 and len(done.stderr) < 5000)
    return "" if said and one else f"said\n{done.stderr[:2000]}"


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return Inputs(tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize(
    "seed",
    [pytest.param(n, marks=[pytest.mark.slow] if n >= FEW else []) for n in range(COUNT)],
)
def test_a_mutated_input_ends_well(seed, inputs, tmp_path):
    case = inputs.mutated(seed)
    fault = fault_of(case, tmp_path)
    assert not fault, f"{' '.join(case[1])[:500]}: {fault}"
