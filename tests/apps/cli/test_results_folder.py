"""Where commands write to: one rule for the name, and nothing of other sources is overwritten."""

import json
from pathlib import Path

import pytest
from program import lrf3d, refused
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
    assert lrf3d(*run, "--sigma", 0.1, 0.2, cwd=tmp_path).returncode == 0
    out = tmp_path / "out" / "box"
    (out / "mine.txt").write_text("kept")
    assert (out / "noise.png").exists()
    (tmp_path / "box.toml").rename(tmp_path / "box.flat.toml")
    ended = lrf3d("run", "box.flat.toml", *run[2:], cwd=tmp_path)
    assert "noise.png: removed" in ended.stderr and not (out / "noise.png").exists()
    files = set(json.loads((out / "summary.json").read_text())["files"].values())
    assert {path.name for path in out.iterdir()} == {*files, "mine.txt"}


def test_commands_write_to_folders_of_their_own_and_to_no_others(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = ("run", "a/box.toml", "--no-video", "--scans", 3, "-q")
    for folder in ("a", "b"):
        Path(folder).mkdir()
        Path(folder, "box.toml").write_text(ROOM)
    for _ in range(2):
        ended = lrf3d(*run, cwd=tmp_path)
        assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
    summary = json.loads(Path("out/box/summary.json").read_text())
    assert summary["made_by"] == {"command": "run", "sources": ["../../a/box.toml"]}
    other = ("run", "b/box.toml", *run[2:])
    assert "out/box: holds results of ../../a/box.toml; choose" in refused(*other, cwd=tmp_path)
    assert lrf3d(*other, "-o", "out/b", cwd=tmp_path).returncode == 0
    # The same in another format is no other source.
    Path("a/box.toml").rename("a/box.yaml.toml")
    assert lrf3d("run", "a/box.yaml.toml", *run[2:], cwd=tmp_path).returncode == 0
    Path("a/box.yaml.toml").rename("a/box.toml")
    # A folder that is given is written to, as is one whose summary says nothing.
    assert lrf3d(*other, "-o", "out/box", cwd=tmp_path).returncode == 0
    Path("out/box/summary.json").write_text("[]")
    assert "something else" in refused(*run, cwd=tmp_path)
    ended = lrf3d("map", "out/b", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "") and Path("out/b_map/map.geojson").exists()
    with locked(Path("out/b/results")):
        assert "out/b: " in refused(*other, "-o", "out/b", cwd=tmp_path)
