"""Files: only ordinary ones are read, writing is whole or not at all, one writer at a time."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import lrf3d
from lrf3d import InputError, OutputError, WorldError, load_log, load_map, load_run, load_world
from lrf3d.base.files import locked, make_folder, own_name, replacing, unfinished_folder
from lrf3d.base.formats import WORLDS, endings
from lrf3d.recordings.reading import is_run
from lrf3d.world.files import find_world

ROOM = "[[object]]\npoints = [[0, 0], [4, 0], [4, 3]]\n"


@pytest.fixture(autouse=True)
def here_and_soon(tmp_path, monkeypatch):
    """The current folder is empty, and who waits for a pipe is stopped."""

    def stop(*_):
        raise TimeoutError("waits for ever")

    monkeypatch.chdir(tmp_path)
    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(300)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def fifo(path):
    os.mkfifo(path)


def zeros(path):
    os.symlink("/dev/zero", path)


def pair(path):
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path)


READ = {
    "a.log": load_log,
    "b.log.gz": load_log,
    "c.mcap": load_log,
    "d.db3": load_log,
    "e.npz": load_log,
    "f.npz": load_run,
    "map.json": load_map,
    **{f"world{ending}": load_world for ending in endings(*WORLDS)},
}


@pytest.mark.parametrize("make", [fifo, zeros, pair, os.mkdir])
@pytest.mark.parametrize("name", READ)
def test_what_is_no_ordinary_file_is_refused_at_once(name, make):
    make(name)
    # A folder may be a bag, or hold a run.
    a_folder = "a folder, expected|a folder without|no such file"
    said = a_folder if make is os.mkdir else "not an ordinary file"
    with pytest.raises(InputError, match=said) as refused:
        READ[name](Path(name))
    assert str(refused.value).startswith(name)


@pytest.mark.parametrize("inside", ["metadata.yaml", "a.mcap", "b.mcap.zstd"])
def test_a_bag_with_a_pipe_in_it_is_refused(inside):
    bag = Path("bag")
    bag.mkdir()
    (bag / "metadata.yaml").write_text("")
    (bag / inside).unlink(missing_ok=True)
    fifo(bag / inside)
    with pytest.raises(InputError, match=f"{inside}: not an ordinary file"):
        load_log(bag)


def test_a_built_in_world_comes_before_a_folder_of_its_name():
    for name in ("city", "mine"):
        Path(name).mkdir()
    assert not is_run("city") and find_world("city").name == "city.toml"
    assert is_run("./city") and is_run("mine") and is_run("a/run.npz")
    assert not is_run("plan.dxf")
    with pytest.raises(WorldError, match="city: a folder; expected a world: city, corridor"):
        find_world("./city")
    (Path("mine") / "run.npz").write_text("")
    with pytest.raises(WorldError, match="mine: a run, for `lrf3d view` and others; expected"):
        find_world("mine")


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("map.geojson", "the folder of a map that was made from a log, with no run.npz in it"),
        ("runs.csv", "the folder of a sweep"),
        ("metadata.yaml", "the folder of a ROS 2 bag"),
        ("run.journal", "the run was stopped"),
        ("notes.txt", "run.npz: no such file; `lrf3d run WORLD` writes one"),
    ],
)
def test_a_folder_without_a_run_is_named_for_what_it_holds(file, said):
    Path("out").mkdir()
    (Path("out") / file).write_text("")
    with pytest.raises(InputError, match=said):
        load_run("out")


def test_a_world_is_called_as_it_says_or_as_its_file_or_with_the_folder_before_it():
    for folder in ("berlin", "bonn"):
        Path(folder).mkdir()
        Path(folder, "map.toml").write_text(ROOM)
    Path("berlin/hall.toml").write_text(ROOM)
    Path("berlin/lab.toml").write_text(f'name = "Lab 3"\n{ROOM}')
    names = [load_world(f"{n}.toml").name for n in ("berlin/map", "bonn/map", "berlin/hall")]
    assert names == ["berlin_map", "bonn_map", "hall"]
    assert load_world("berlin/lab.toml").name == "Lab 3"
    os.chdir("bonn")
    assert own_name("map.yaml") == own_name("../bonn/map.yaml") == "bonn_map"
    assert own_name("a/run.log.gz", stem="run") == "a_run"


HOLD = """
import sys
from pathlib import Path
from lrf3d.base.formats import WORLDS, endings
from lrf3d.base.files import locked, replacing
target = Path("film.mp4")
with locked(target), replacing(target) as unfinished:
    unfinished.write_text("half")
    print("ready", flush=True)
    sys.stdin.read()
"""


def test_a_lock_excludes_others_and_what_a_killed_process_left_is_cleared_up(tmp_path):
    target, pipe = Path("film.mp4"), subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", HOLD], stdin=pipe, stdout=pipe) as process:
        assert process.stdout.readline() == b"ready\n"
        with pytest.raises(InputError, match=r"film\.mp4: another process writes here"):
            locked(target).__enter__()
        process.kill()
    assert len({*tmp_path.glob(".film.mp4.lock"), *tmp_path.glob(".lrf3d-*.unfinished/*.mp4")}) == 2
    with locked(target), replacing(target) as unfinished:
        unfinished.write_text("whole")
        with pytest.raises(InputError, match="writes here"):
            locked(target).__enter__()
    assert list(Path().iterdir()) == [target] and target.read_text() == "whole"
    with pytest.raises(OutputError, match="there is no folder no; make it"):
        locked(Path("no/a")).__enter__()


def test_a_folder_is_under_way_to_one_place_and_names_that_are_invalid_are_refused(tmp_path):
    path = Path("ü.txt")
    with replacing(path) as file, unfinished_folder(path) as folder:
        (folder / "part").write_text("whole")
        os.replace(folder / "part", file)
    assert path.read_text() == "whole" and list(Path().iterdir()) == [path]
    with pytest.raises(OutputError, match="cannot be written: File name too long"):
        with replacing("a" * 300) as file:
            file.write_text("")
    for write in (lambda name: replacing(name).__enter__(), make_folder):
        with pytest.raises(OutputError, match=r"a.x00b: not a file name; remove its NUL"):
            write("a\0b")


def test_what_is_written_follows_no_link_that_somebody_put_there(tmp_path):
    """Names of temporary files cannot be guessed, and a link at a known name is never followed."""
    victim, out = tmp_path / "victim", tmp_path / "out"
    victim.write_text("precious")
    out.mkdir()
    room = lrf3d.load_world("paper_room")
    begin = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
    fixed = [".run.unfinished.npz", ".run.log.unfinished.gz", ".run.npz.lock", "run.journal"]
    for name in [*fixed, ".run.mcap.parts.unfinished", "run.npz", "run.log.gz", "run.mcap"]:
        (out / name).symlink_to(victim)
    with pytest.raises(OutputError, match=r"run\.npz: cannot be written"):
        lrf3d.record(lrf3d.Simulation(room, [(1, 1, 0), (2, 1, 0)], rng=0), out / "run.npz")
    (out / ".run.npz.lock").unlink()
    lrf3d.record(lrf3d.Simulation(room, [(1, 1, 0), (2, 1, 0)], rng=0), out / "run.npz")
    lrf3d.export_run(begin, "carmen", out / "run.log.gz")
    lrf3d.export_run(begin, "mcap", out / "run.mcap")
    (out / "rows").mkdir()
    (out / "rows" / "sweep.jsonl").symlink_to(tmp_path / "absent")
    with pytest.raises(InputError, match=r"sweep\.jsonl: no such file"):
        lrf3d.sweep("paper_room", seeds=1, workers=1, folder=out / "rows")
    assert victim.read_text() == "precious" and not (tmp_path / "absent").exists()
    assert not any(path.is_symlink() for path in (out / "run.npz", out / "run.mcap"))
    with unfinished_folder(out / "a") as first, unfinished_folder(out / "a") as second:
        assert first != second and first.is_dir() and first.stat().st_mode & 0o777 == 0o700
