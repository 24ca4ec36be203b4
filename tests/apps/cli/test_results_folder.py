"""Where commands write to: one rule for the name, and nothing of other sources is overwritten."""

import json
from pathlib import Path

import pytest
from program import lrf3d, ran, refused
from test_cli import ROOM

from lrf3d.base.files import folder_name, locked


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("Lab 3/west", "Lab_3_west"),
        ("../../etc", "etc"),
        ("..", "world"),
        ("Gebäude 7", "Gebäude_7"),
        ("x" * 999, "x" * 60),
        ("\ud800", "world"),
    ],
)
def test_a_name_becomes_the_name_of_one_folder(name, folder):
    assert folder_name(name) == folder


def test_a_folder_holds_one_run_and_what_the_next_does_not_write_is_removed(tmp_path):
    (tmp_path / "box.toml").write_text(ROOM)
    run = ("run", "box.toml", "--no-video", "--scans", 2)
    ran(*run, "--sigma", 0.1, 0.2, cwd=tmp_path)
    out = tmp_path / "out" / "box"
    (out / "mine.txt").write_text("kept")
    assert (out / "noise.png").exists()
    # A summary that somebody wrote lists files elsewhere.
    listed = json.loads((out / "summary.json").read_text())
    listed["files"] |= {"a": str(tmp_path / "box.toml"), "b": "../../box.toml"}
    (out / "summary.json").write_text(json.dumps(listed))
    (tmp_path / "box.flat.toml").write_text(ROOM)
    ended = lrf3d("run", "box.flat.toml", *run[2:], cwd=tmp_path)
    assert (tmp_path / "box.toml").exists()
    assert "noise.png: removed" in ended.stderr and not (out / "noise.png").exists()
    files = set(json.loads((out / "summary.json").read_text())["files"].values())
    assert {path.name for path in out.iterdir()} == {*files, "mine.txt"} - {"../../box.toml"}


@pytest.mark.slow
def test_commands_write_to_folders_of_their_own_and_to_no_others(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = ("run", "a/box.toml", "--no-video", "--scans", 3, "-q")
    for folder in ("a", "b"):
        Path(folder).mkdir()
        Path(folder, "box.toml").write_text(ROOM)
    for _ in range(2):
        ended = lrf3d(*run, cwd=tmp_path)
        assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
    assert json.loads(Path("out/box/summary.json").read_text())["made_by"] == {
        "command": "run", "sources": ["../../a/box.toml"], "seed": 0,
    }  # fmt: skip
    other = ("run", "b/box.toml", *run[2:])
    assert "out/box: holds results of lrf3d run ../../a/box.toml, seed 0; choose" in refused(
        *other, cwd=tmp_path
    )
    ran(*other, "-o", "out/b", cwd=tmp_path)
    # The same in another format is no other source.
    Path("a/box.toml").rename("a/box.yaml.toml")
    ran("run", "a/box.yaml.toml", *run[2:], cwd=tmp_path)
    Path("a/box.yaml.toml").rename("a/box.toml")
    # A folder that is given is no other, and one whose summary says nothing is somebody's.
    assert "out/box: holds results of lrf3d run" in refused(*other, "-o", "out/box", cwd=tmp_path)
    Path("out/box/summary.json").write_text("[]")
    assert "something else" in refused(*run, cwd=tmp_path)
    ended = lrf3d("map", "out/b", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "") and Path("out/b_map/map.geojson").exists()
    with locked(Path("out/b/results")):
        assert "out/b: " in refused(*other, "-o", "out/b", cwd=tmp_path)


# Commands that write, with the words for what they write; {0} is one source, or another.
WRITING = {
    "run": "run {0}.toml --no-video --scans 2 --out OUT",
    "run of a seed": "run a.toml --seed {0:d} --no-video --scans 2 --out OUT",
    "run of robots": "run {0}.toml --robots 2 --no-video --scans 2 --out OUT",
    "map": "map {0}.log.gz --out OUT",
    "slam": "slam {0}.log.gz --out OUT",
    "localise": "localise a.toml {0}.log.gz --out OUT",
    "score": "score run_{0} --trajectory a.tum --out OUT",
    "sweep": "sweep {0}.toml --sigma 0.1 --seeds 1 --mapper robust --workers 1 --out OUT",
    "render": "render run_{0} --at 0 --size 64x64 --renderer embree --out OUT/run.png",
    "export": "export run_{0} --to carmen --out OUT/run.log.gz",
    "degrade": "degrade a.log.gz --seed {0:d} --drop 0.5 --out OUT/worse.log.gz",
    "crosscheck": "crosscheck {0}.toml --figure OUT/beams.png",
    "world show": "world show {0}.toml --out OUT/world.png",
    "world convert": "world convert {0}.toml OUT/world.yaml",
    "world generate": "world generate rooms --seed {0:d} --size 12 --out OUT/rooms.toml",
}


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """A folder with two worlds, a run and a log of each."""
    folder = tmp_path_factory.mktemp("sources")
    for name, world in (("a", ROOM), ("b", ROOM.replace("[10, 8], [0, 8]", "[10, 9], [0, 9]"))):
        (folder / f"{name}.toml").write_text(world)
        drive = ("run", f"{name}.toml", "--no-video", "--scans", 4, "--out", f"run_{name}")
        for words in (drive, ("export", f"run_{name}", "--to", "carmen", "-o", f"{name}.log.gz")):
            ran(*words, cwd=folder)
    lrf3d("slam", "a.log.gz", "--out", "slam_a", cwd=folder)
    (folder / "slam_a/trajectory.tum").rename(folder / "a.tum")
    return folder


class Source(str):
    """A source whose seed is a number of its own."""

    def __format__(self, how):
        return str(ord(self)) if how == "d" else str(self)


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# Commands of each kind that are fast: of a world, of a run, and of a log.
FAST = ("map", "export", "world generate")


@pytest.mark.parametrize(
    "command", [pytest.param(c, marks=[pytest.mark.slow] * (c not in FAST)) for c in WRITING]
)
def test_what_is_of_another_source_is_replaced_by_force_alone(command, sources, tmp_path):
    def words(source):
        return WRITING[command].format(Source(source)).replace("OUT", str(tmp_path)).split()

    (tmp_path / "mine.txt").write_text("kept")
    ran(*words("a"), cwd=sources)
    before = contents(tmp_path)
    assert "--force" in refused(*words("b"), cwd=sources)
    assert contents(tmp_path) == before
    again = ["--resume"] if command == "sweep" else []
    ran(*words("a"), *again, cwd=sources)
    ran(*words("b"), "--force", cwd=sources)
    assert contents(tmp_path).keys() >= {tmp_path / "mine.txt"} and contents(tmp_path) != before
    if (summary := tmp_path / "summary.json").exists():
        files = {tmp_path / name for name in json.loads(summary.read_text())["files"].values()}
        rows = set(tmp_path.glob("sweep*.jsonl"))
        assert contents(tmp_path).keys() == files | rows | {tmp_path / "mine.txt"}


@pytest.mark.slow
def test_by_force_the_films_and_exports_of_the_old_run_go_too(sources, tmp_path):
    run = ("run", "a.toml", "--no-video", "--scans", 2, "--out", tmp_path)
    lrf3d(*run, cwd=sources)
    for target in ("carmen", "rosbag2", "html"):
        ran("export", tmp_path, "--to", target, cwd=sources)
    (tmp_path / "run_bag/mine.txt").write_text("kept")
    other = ("run", "b.toml", *run[2:])
    refused(*other, cwd=sources)
    assert (tmp_path / "run_bag/metadata.yaml").exists()
    ran(*other, "--force", cwd=sources)
    kept = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    assert kept == {"run.npz", "map.geojson", "map.png", "world.png", "summary.json", "mine.txt"}


@pytest.mark.slow
def test_files_that_no_summary_names_are_not_replaced(sources, tmp_path):
    (tmp_path / "map.png").write_bytes(b"of my own")
    run = ("run", "a.toml", "--no-video", "--scans", 2, "--out", tmp_path)
    assert "map.png of something else" in refused(*run, cwd=sources)
    assert "leave out" in refused(*run, "--force", "--resume", cwd=sources)
    ran(*run, "--force", cwd=sources)


@pytest.mark.slow
def test_a_command_that_failed_at_its_beginning_keeps_no_folder(sources, tmp_path):
    run = ("run", "a.toml", "--no-video", "--scans", 2, "--out", tmp_path)
    (tmp_path / "summary.json").write_text(
        json.dumps({"made_by": {"command": "map", "sources": ["x.log"]}})
    )
    ran(*run, cwd=sources)
