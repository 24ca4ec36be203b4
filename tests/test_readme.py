"""The README's snippets do what they say."""

import re
from pathlib import Path

import pytest

import lrf3d
from lrf3d.scenario import load_scenario

README = (Path(__file__).parent.parent / "README.md").read_text()


def snippet(language):
    return re.search(rf"```{language}\n(.*?)```", README, re.DOTALL).group(1)


def test_the_ten_lines_of_python_run(tmp_path, monkeypatch, capsys):
    films = []
    monkeypatch.setattr(lrf3d, "render_video", lambda run, path, **how: films.append(path))
    monkeypatch.chdir(tmp_path)
    assert len(snippet("python").strip().splitlines()) <= 11
    exec(compile(snippet("python"), "README.md", "exec"), {})
    assert re.fullmatch(r"2\d\d segments in \d\d objects\n", capsys.readouterr().out)
    assert len(lrf3d.LineMap.load("map.geojson")) > 200
    assert films == ["city.mp4"]


def test_the_robot_of_the_readme_finds_itself(capsys):
    code = next(
        code
        for code in re.findall(r"```python\n(.*?)```", README, re.DOTALL)
        if "Localiser" in code
    )
    exec(compile(code, "README.md", "exec"), {})
    errors = [float(word) for word in capsys.readouterr().out.strip("[] \n").split()]
    assert len(errors) == 3 and max(errors) < 0.02


@pytest.mark.parametrize("number", range(1, README.count("```python")))
def test_every_other_snippet_of_python_runs(number, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = re.findall(r"```python\n(.*?)```", README, re.DOTALL)[number]
    exec(compile(code, "README.md", "exec"), {})


def test_the_world_of_the_readme_is_one(tmp_path):
    (tmp_path / "yard.toml").write_text(snippet("toml"))
    scenario = load_scenario(tmp_path / "yard.toml")
    assert scenario.world.object_names == ("shed",)
    assert scenario.sigmas == (0.03,) and len(scenario.route) == 4


@pytest.mark.parametrize("picture", re.findall(r"\((assets/[^)]*)\)", README))
def test_every_picture_is_there(picture):
    assert (Path(__file__).parent.parent / picture).is_file()
