"""Golden digests: SHA-256 of scans, runs, maps, poses, plans, frames and files.

A change of the code that should change no number is checked by running this before and after it.
Versions, times of day and durations are left out of what is hashed. The digests hold on one
machine: other processors round differently.
"""

import hashlib
import json
import os
import re
import subprocess
import sys
import warnings
import zipfile
from argparse import ArgumentParser
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import lrf3d

WORLDS = ("paper_room", "corridor", "warehouse", "city", "mirror_hall", "glass_office")
SEEDS = (0, 1, 2, 3, 4)

# Scans of each drive.
SCANS = 40

PLAN_ENDINGS = (".dxf", ".svg", ".pdf", ".png", ".jpg")
WORLD_ENDINGS = (".yaml", ".geojson", ".osm", ".toml", ".glb", ".obj", ".stl")

# Keys of JSON objects that differ from run to run.
TIMED = re.compile(r"seconds|_s$|^version$|duration|cpu|started|elapsed|created|memory")

# Formats of logs whose files do not say how their lines are laid out, by words in their names.
LOG_FORMATS = {
    "robot4": "stamp:ms@2, ranges:mm@4, first=-120.0156deg, step=0.3515625deg",
    "exp1.dat": "stamp:us@1, left@3, right@4, ranges:mm*682@25, first=-120deg, last=120deg,"
    " tick=0.24190263mm, track=0.33m, offset=0.145m",
}

# Poses of the two robots of a fleet.
STARTS = ((1.0, 1.0, 0.0), (2.0, 1.2, 0.5))

Digests = dict[str, str]


def digest(*values: Any) -> str:
    """The digest of arrays, bytes and texts."""
    total = hashlib.sha256()
    for value in values:
        if isinstance(value, bytes):
            total.update(value)
        elif isinstance(value, np.ndarray) and value.dtype != object:
            total.update(f"{value.dtype}{value.shape}".encode())
            total.update(np.ascontiguousarray(value).tobytes())
        else:
            total.update(repr(value).encode())
    return total.hexdigest()[:32]


def of_map(line_map: Any) -> str:
    """The digest of a line map, or of any other map by its text."""
    if not isinstance(line_map, lrf3d.LineMap):
        return digest(type(line_map).__name__)
    return digest(line_map.segments, line_map.lines, line_map.objects)


def of_run(run: lrf3d.Run) -> Digests:
    """The digests of what a run holds."""
    found = {
        "poses": digest(run.trajectory.times, run.trajectory.poses),
        "ranges": digest(run.ranges, run.truth, run.walls),
        "world": digest(run.world.segments, run.world.objects, run.world.heights),
        "maps": digest(*map(of_map, run.maps)),
    }
    if run.estimate is not None:
        found["estimate"] = digest(run.estimate.poses)
    if run.wheels is not None:
        found["wheels"] = digest(run.wheels)
    if run.intensities is not None:
        found["intensities"] = digest(run.intensities)
    return found


def of_npz(path: Path) -> str:
    """The digest of the members of an .npz file, by their names."""
    with zipfile.ZipFile(path) as archive:
        names = sorted(name for name in archive.namelist() if not TIMED.search(name))
        return digest(*((name, hashlib.sha256(archive.read(name)).hexdigest()) for name in names))


def untimed(value: Any) -> Any:
    """A JSON value without durations and versions."""
    if isinstance(value, dict):
        return {key: untimed(each) for key, each in value.items() if not TIMED.search(key)}
    return [untimed(each) for each in value] if isinstance(value, list) else value


def command(*words: str) -> str:
    """The digest of what a command prints with --json, or of its error."""
    done = subprocess.run(
        [sys.executable, "-m", "lrf3d", *words, "--json"], capture_output=True, text=True
    )
    printed = untimed(json.loads(done.stdout)) if done.stdout.strip() else done.stderr
    return digest(done.returncode, json.dumps(printed, sort_keys=True))


def of_world(name: str) -> Digests:
    """Scans, runs and maps of a built-in world."""
    found: Digests = {}
    scenario = lrf3d.load_scenario(name)
    for seed in SEEDS:
        run = scenario.run(rng=seed, scans=SCANS, snapshots=3)
        found |= {f"{name}/{seed}/{key}": value for key, value in of_run(run).items()}
    paper = scenario.run(rng=0, scans=10, mode="paper", caster="planar")
    found[f"{name}/paper mode"] = of_map(paper.map)
    score = lrf3d.score_run(run)
    found[f"{name}/score"] = digest(repr(score))
    for time in (0.5, 1.0):
        frame = run.frame(time, size=(160, 90), view="overview", renderer="embree")
        found[f"{name}/frame at {time:g}"] = digest(np.asarray(frame))
    for kind, file in {"carmen": "run.log", "glb": "run.glb", "mcap": "run.mcap"}.items():
        lrf3d.export_run(run, kind, file, every=4)
        found[f"{name}/{kind}"] = digest(Path(file).read_bytes())
    return found


class Straight:
    """A controller that drives a wide arc until it touches something."""

    def command(self, time: float, pose: Any, scan: Any) -> tuple[float, float]:
        """Speed [m/s] and rate of turn [rad/s]."""
        return 0.5, 0.05


def of_drives() -> Digests:
    """Drives with several lasers, rolling scans, wheels, an IMU, fleets, controllers and SLAM."""
    corridor = lrf3d.load_scenario("corridor")
    rolling = lrf3d.LaserRangeFinder(beams=91, scan_duration=0.05, name="front")
    rear = lrf3d.LaserRangeFinder(beams=61, mount=(-0.2, 0.0, np.pi), name="rear")
    room = lrf3d.load_scenario("paper_room")
    drive = corridor.simulation(rng=0, scans=30).drive
    several = lrf3d.simulate(corridor.world, drive, lrf=[rolling, rear], rng=3)
    found = {f"two lasers/{key}": value for key, value in of_run(several).items()}
    sensors = ["odometry.slip=0.02", "imu.rate=50"]
    wheeled = lrf3d.load_scenario("corridor", sensors).run(rng=2, scans=60)
    found |= {f"wheels/{key}": value for key, value in of_run(wheeled).items()}
    found["imu"] = digest(wheeled.imu.turn_rates)
    found["odometry"] = digest(wheeled.odometry)
    controller = Straight()
    controlled = room.run(rng=4, drive=controller, scans=40, on_collision="stop")
    found |= {f"controller/{key}": value for key, value in of_run(controlled).items()}
    fleet = lrf3d.simulate_fleet(
        room.world, [Straight(), Straight()], starts=STARTS, scans=30, on_collision="stop", rng=5
    )
    for number, run in enumerate(fleet):
        found |= {f"fleet {number}/{key}": value for key, value in of_run(run).items()}
    lrf3d.save_run(room.run(rng=1), "kept.npz")
    found["run.npz"] = of_npz(Path("kept.npz"))
    found["run.npz again"] = digest(*of_run(lrf3d.load_run("kept.npz")).values())
    return found


COMMANDS: tuple[tuple[str, ...], ...] = (
    ("run", "paper_room", "--no-video", "--out", "p"),
    ("run", "corridor", "--scans", "30", "--no-video", "--slam", "--out", "c"),
    ("run", "warehouse", "--scans", "12", "--robots", "2", "--no-video", "--out", "w"),
    ("run", "paper_room", "--sigma", "0.01,0.05", "--no-video", "--out", "sigmas"),
    ("render", "p", "--at", "1", "--size", "96x54", "--renderer", "embree", "--out", "p.png"),
    ("export", "c", "--to", "carmen", "--out", "c.log"),
    ("map", "c.log", "--out", "mapped"),
    ("slam", "c.log", "--out", "solved"),
    ("score", "c", "--trajectory", "solved/trajectory.tum"),
    ("crosscheck", "paper_room"),
    ("localise", "paper_room"),
    ("sweep", "paper_room", "--sigma", "0.01,0.02", "--seeds", "2", "--out", "s"),
    ("world", "show", "city", "--out", "city.png"),
    ("world", "convert", "corridor", "corridor.geojson"),
    ("world", "generate", "rooms", "--seed", "3", "--out", "rooms.toml"),
    ("run", "no_such_world"),
    ("map", "p/map.geojson"),
)


def of_commands() -> Digests:
    """What commands print."""
    found = {}
    for words in COMMANDS:
        found[f"lrf3d {' '.join(words)}"] = command(*words)
    return found


def of_live() -> Digests:
    """The messages of a live robot without wheels."""
    from lrf3d.ros.stream import Settings, Stream

    scenario = lrf3d.load_scenario("paper_room")
    scenario = scenario.with_route() if scenario.poses is None else scenario
    stream = Stream(scenario, Settings(), lambda *_: None)
    messages = [repr(message) for _ in range(30) for message in stream.encoded(stream.step())]
    return {"live": digest(len(messages), *messages)}


def of_file(path: str) -> Digests:
    """What is read from a file: the segments of a world, or the poses and the map of a log."""
    name, ending = "/".join(Path(path).parts[-2:]), Path(path).suffix.lower()
    try:
        if ending in (*PLAN_ENDINGS, *WORLD_ENDINGS):
            options = {"resolution": 0.02} if ending in (".png", ".jpg") else {}
            world = lrf3d.load_world(path, **options)
            return {name: digest(world.segments, world.objects, world.heights, world.name)}
        given = next((spec for word, spec in LOG_FORMATS.items() if word in name), None)
        log = lrf3d.load_log(path, format=given)
        run = lrf3d.slam_log(log)
    except lrf3d.Lrf3dError as error:
        return {f"{name}/error": digest(str(error).replace(path, name))}
    read = {
        f"{name}/read": digest(*(array for scan in log.scans for array in (scan.pose, scan.ranges)))
    }
    return read | {f"{name}/{key}": value for key, value in of_run(run).items()}


def measured(part: Callable[[], Digests]) -> Digests:
    """The digests of a part, in a folder of its own; warnings are digested too."""
    before = Path.cwd()
    with TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        os.chdir(folder)
        try:
            found = part()
        finally:
            os.chdir(before)
        texts = sorted(
            {str(each.message) for each in caught if isinstance(each.message, UserWarning)}
        )
    if texts:
        found[f"{next(iter(found)).split('/')[0]}/warnings"] = digest(*texts)
    return found


def parts(files: list[str], only: str) -> Iterator[Callable[[], Digests]]:
    """All that is digested whose name has a word in it, what takes longest first."""
    for path in sorted(files, key=lambda path: -Path(path).stat().st_size):
        if only in f"files {path}":
            yield partial(of_file, str(Path(path).absolute()))
    for name in WORLDS:
        if only in f"worlds {name}":
            yield partial(of_world, name)
    for name, part in (("drives", of_drives), ("commands", of_commands), ("live", of_live)):
        if only in name:
            yield part


def main() -> None:
    """Digest everything, in two processes."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", help="logs, plans, maps and towns")
    parser.add_argument("--out", help="write the digests to this file")
    parser.add_argument("--against", help="compare with the digests of this file")
    parser.add_argument(
        "--only",
        default="",
        help="of all parts, files PATH, worlds NAME, drives, commands and live, those with this",
    )
    args = parser.parse_args()
    found: Digests = {}
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for part in pool.map(measured, parts(args.files, args.only)):
            found |= part
            print(f"\r{len(found)} digests", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    if args.out:
        Path(args.out).write_text(json.dumps(found, indent=1) + "\n")
    if args.against:
        kept = json.loads(Path(args.against).read_text())
        both = [name for name in found if name in kept]
        differing = [name for name in both if found[name] != kept[name]]
        for name in differing:
            print(f"differs: {name}")
        for name in [] if args.only else sorted({*kept} ^ {*found}):
            print(f"only {'before' if name in kept else 'now'}: {name}")
        print(f"{len(differing)} of {len(both)} digests differ")
        sys.exit(bool(differing))


if __name__ == "__main__":
    main()
