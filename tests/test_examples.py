"""The examples in the docstrings of public names: each name has one, and does what it shows."""

import doctest
import re
import warnings
from pathlib import Path

import pytest
from program import lrf3d as called

import lrf3d

ROOT = Path(__file__).parents[1]

TYPED = re.findall(r"`lrf3d ([^`]*examples/[^`]*)`", (ROOT / "README.md").read_text("utf-8"))
"""Commands of the README's table on files that lie in the repository."""


@pytest.mark.parametrize("words", TYPED)
def test_a_command_of_the_readme_can_be_typed_as_it_is_shown(words, tmp_path):
    settings = {
        "run": ("--no-video", "--scans", 3, "--out", "out"),
        "map": ("--out", "out"),
        "slam": ("--out", "out"),
    }
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    if "out/drive" in words:
        # What an earlier row of the table wrote.
        called("slam", "examples/drive.log.gz", "--out", "out/drive", cwd=tmp_path)
    done = called(*words.split(), *settings.get(words.split()[0], ()), cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "name",
    # A film takes its time; of errors only the root has an example.
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name == "render_video"))
        for name in lrf3d.__all__
        if name == "Lrf3dError" or not name.endswith("Error")
    ],
)
def test_a_public_name_has_an_example_that_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    value = getattr(lrf3d, name)
    [test] = doctest.DocTestFinder(recurse=False).find(value, name, module=False)
    assert test.examples
    report = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        failed, _ = doctest.DocTestRunner(verbose=False).run(test, out=report.append)
    assert not failed, "".join(report)
