import json
import subprocess
import sys

import pytest


def lrf3d(*arguments):
    command = [sys.executable, "-m", "lrf3d", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_a_generated_world_goes_through_every_format(tmp_path):
    done = lrf3d(
        "world", "generate", "rooms", "--seed", 2, "--size", 16, "--out", tmp_path / "a.toml"
    )
    assert (done.returncode, done.stderr) == (0, "")
    walls = {}
    for source, target in (("a.toml", "b.geojson"), ("b.geojson", "c.glb"), ("c.glb", "d.yaml")):
        done = lrf3d("world", "convert", tmp_path / source, tmp_path / target, "--json")
        assert done.returncode == 0, done.stderr
        report = json.loads(done.stdout)
        walls[target] = report["walls"]
        assert report["written"] == str(tmp_path / target)
    assert walls["b.geojson"] == walls["c.glb"] == walls["d.yaml"] > 20
    picture = tmp_path / "d.png"
    done = lrf3d("world", "show", tmp_path / "d.yaml", "--out", picture, "--json")
    assert json.loads(done.stdout)["walls"] == pytest.approx(walls["d.yaml"], rel=0.2)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_scale_and_resolution_are_what_is_written(tmp_path):
    path = tmp_path / "room.yaml"
    done = lrf3d(
        "world", "convert", "paper_room", path, "--scale", 0.5, "--resolution", 0.1, "--json"
    )
    assert done.returncode == 0, done.stderr
    (_, _), (x2, y2) = json.loads(done.stdout)["bounds_m"]
    plain = json.loads(lrf3d("world", "show", "paper_room", "--json").stdout)["bounds_m"]
    assert [x2, y2] == pytest.approx([0.5 * plain[1][0], 0.5 * plain[1][1]])
    assert "resolution: 0.1" in path.read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["convert", "city", "city.xyz"], "unknown ending"),
        (["convert", "city", "city.toml", "--resolution", 1], "for a ROS map"),
        (["convert", "city", "city.toml", "--scale", 0], "scale 0: expected"),
        (["generate", "maze", "--size", 2, "--out", "m.toml"], "size 2 m"),
        (["generate", "maze", "--out", "/proc/none/m.toml"], "cannot be written"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(arguments, said):
    done = lrf3d("world", *arguments)
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and said in done.stderr
