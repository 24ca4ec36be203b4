"""Where commands write to: one rule for the name, nothing of others overwritten without a word."""

import json
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from program import lrf3d
from test_cli import ROOM

from lrf3d import InputError
from lrf3d.cli.folder import folder_name, results_folder
from lrf3d.output import locked

FILES = {"run": "run.npz", "map": "map.geojson", "sweep": "sweep.parquet"}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@contextmanager
def command(what, *sources, name="hall", out=None):
    """A command at work in its folder."""
    with ExitStack() as stack:
        context = SimpleNamespace(info_name=what, with_resource=stack.enter_context)
        yield results_folder(context, sources, name, out)


def done(what, *sources, **how):
    """A command that came to its end."""
    with command(what, *sources, **how) as place:
        (place.path / FILES[what]).write_text("")
        (place.path / "summary.json").write_text(json.dumps({"made_by": place.made_by}))
    return place.path


def stopped(*sources, **how):
    """A run that was stopped."""
    with command("run", *sources, **how) as place:
        (place.path / "run.journal").write_text("")


@pytest.mark.parametrize("end", [done, stopped])
def test_results_of_another_world_are_not_overwritten_unless_the_folder_is_given(end, capsys):
    if end is done:
        done("run", "a/hall.toml")
    else:
        stopped("a/hall.toml")
    assert done("run", "city", name="city") == Path("out/city")
    said = "lrf3d: warning: out/hall: holds results of lrf3d run a/hall.toml; "
    for _ in range(2):
        assert done("run", "b/hall.toml") == Path("out/hall_2")
        assert capsys.readouterr().err == f"{said}the new ones go to out/hall_2\n"
    done("run", "b/hall.toml", out=Path("out/hall"))
    assert capsys.readouterr().err == f"{said}files of the same names are replaced\n"
    # It is b's now, and b's to overwrite.
    assert done("run", "b/hall.toml") == Path("out/hall")
    assert capsys.readouterr().err == ""
    assert done("run", "a/hall.toml") == Path("out/hall_3")
    assert sorted(path.name for path in Path("out/hall").glob(".*")) == []


def test_the_same_world_may_overwrite_its_results_however_it_is_named(tmp_path, monkeypatch):
    Path("a").mkdir()
    done("run", "a/hall.toml")
    done("run", tmp_path / "a" / "hall.toml")
    # A project that is moved keeps what it has.
    project = tmp_path.rename(tmp_path.with_name("elsewhere"))
    monkeypatch.chdir(project)
    done("run", "a/hall.toml")
    project.rename(tmp_path)


def test_another_command_on_the_same_source_is_another_maker(capsys):
    done("run", "city", out=Path("x"))
    done("sweep", "city", "corridor", out=Path("x"))
    assert "x: holds results of lrf3d run city; files" in capsys.readouterr().err
    done("run", "city", out=Path("x"))
    assert "x: holds results of lrf3d sweep city corridor; files" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"made_by": 3}', '{"made_by": {"command": 1}}'])
def test_results_that_say_nothing_of_their_maker_are_somebody_elses(text, capsys):
    Path("out/hall").mkdir(parents=True)
    Path("out/hall/summary.json").write_text(text)
    assert done("run", "city") == Path("out/hall_2")
    done("run", "city", out=Path("out/hall"))
    assert "holds results of something else; files" in capsys.readouterr().err


def test_a_folder_has_one_writer():
    with command("run", "city", name="city"):
        with pytest.raises(InputError, match=r"out/city: process \d+ writes here"):
            done("run", "city", name="city")
        # Another world of the same name has a folder of its own meanwhile.
        assert done("run", "a/city.toml", name="city") == Path("out/city_2")
    assert done("run", "city", name="city") == Path("out/city")


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("Lab 3/west", "Lab_3_west"),
        ("../../etc", "etc"),
        ("..", "world"),
        ("a\nb\0c", "a_b_c"),
        ("Gebäude 7", "Gebäude_7"),
        ("x" * 999, "x" * 100),
        ("\ud800", "world"),
    ],
)
def test_a_name_becomes_the_name_of_one_folder(name, folder):
    assert folder_name(name) == folder


def test_the_commands_write_to_folders_of_their_own(tmp_path):
    for folder in ("a", "b"):
        Path(folder).mkdir()
        Path(folder, "map.toml").write_text(ROOM.replace('name = "box"\n', ""))
        ended = lrf3d("run", f"{folder}/map.toml", "--no-video", "--scans", 3, cwd=tmp_path)
        assert (ended.returncode, ended.stderr) == (0, "")
    ended = lrf3d("map", "out/a_map", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert sorted(path.name for path in Path("out").iterdir()) == ["a_map", "a_map_map", "b_map"]
    summary = json.loads(Path("out/a_map/summary.json").read_text())
    assert summary["name"] == "a_map"
    assert summary["made_by"] == {"command": "run", "sources": ["../../a/map.toml"]}
    with locked(Path("out/a_map/.lrf3d.lock"), tmp_path):
        ended = lrf3d("run", "a/map.toml", "--no-video", "--scans", 3, cwd=tmp_path)
    assert ended.returncode == 1 and ended.stderr.count("\n") == 1
    assert "out/a_map: process" in ended.stderr
