"""What is released: the wheel as a type checker sees it, and files that repeat settings."""

import doctest
import os
import re
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path
from textwrap import indent

import pytest
import yaml

import lrf3d

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

USER = """
import numpy as np

import lrf3d


def drive(name: str) -> float:
    scenario = lrf3d.load_scenario(name)
    run = scenario.run(rng=0, sigma=0.05)
    scan: lrf3d.LaserScan = run.scan(0)
    picture = run.frame(1.0, size=(320, 180))
    axes = lrf3d.plot.map(run.map)
    reveal_type(run.map.segments)
    reveal_type(picture)
    return float(scan.ranges[np.isfinite(scan.ranges)].min())


class Counter:
    returns = 0

    def update(self, scan: lrf3d.LaserScan) -> None:
        self.returns += int(scan.hits.sum())


lrf3d.simulate(lrf3d.World([[0, 0, 1, 0]]), [(0, 1, 0)], mapper=Counter())
lrf3d.World([[0, 0, 1, 0]], height=2)
"""


def examples():
    """The examples of all public names, each as a function."""
    for name in lrf3d.__all__:
        value = getattr(lrf3d, name)
        [test] = doctest.DocTestFinder(recurse=False).find(value, name, module=False)
        if test.examples:
            yield f"def _{name}() -> None:\n"
            yield from (indent(example.source, "    ") for example in test.examples)


@pytest.mark.slow
def test_a_users_program_is_checked_against_the_types_of_the_wheel(tmp_path):
    pytest.importorskip("hatchling", reason="needs pip install 'lrf3d[dev]'")
    mypy = pytest.importorskip("mypy", reason="needs pip install 'lrf3d[dev]'")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    # The user's environment has the wheel, and of ours what the wheel needs.
    venv.create(tmp_path / "venv", symlinks=os.name != "nt")
    (site,) = (tmp_path / "venv").rglob("site-packages")
    zipfile.ZipFile(next(tmp_path.glob("*.whl"))).extractall(site)
    assert [each.name for each in (site / "lrf3d/assets").iterdir()] == ["robot.npz"]
    (site / "needed.pth").write_text(str(Path(mypy.__file__).parents[1]))
    (tmp_path / "user.py").write_text(USER + "".join(examples()), encoding="utf-8")
    python = tmp_path / "venv" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    words = ["--strict", "--python-executable", str(python), "--no-error-summary", "user.py"]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *words],
        cwd=tmp_path,
        env={**clean, "PYTHONSAFEPATH": "1"},
        capture_output=True,
        text=True,
    )
    notes = [line for line in done.stdout.splitlines() if ": note: Revealed" in line]
    # mypy versions differ in how they write these types, but each says what the elements are.
    assert len(notes) == 2
    assert re.search(r"ndarray\[.*float", notes[0])
    assert re.search(r"ndarray\[.*(uint8|unsignedinteger)", notes[1])
    # One line is wrong on purpose; nothing else is.
    errors = [line for line in done.stdout.splitlines() if ": error: " in line]
    assert len(errors) == 1 and "[call-arg]" in errors[0], done.stdout


def test_the_conda_recipe_needs_what_the_package_needs():
    recipe = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == PROJECT["version"]
    named = {word.replace(" ", "") for word in recipe["requirements"]["run"][1:]}
    renamed = {"matplotlib-base": "matplotlib"}
    named = {re.sub(r"^[\w-]+?(?=[<>=])", lambda m: renamed.get(m[0], m[0]), w) for w in named}
    needed = {word.partition(";")[0].strip() for word in PROJECT["dependencies"]}
    assert {word for word in needed if not word.startswith("embreex")} == named
    assert recipe["requirements"]["run"][0] == f"python {PROJECT['requires-python']}"
