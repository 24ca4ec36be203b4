"""The examples in the docstrings of public names: each name has one, and does what it shows."""

import ast
import doctest
import inspect
import re
import runpy
import warnings
from importlib import import_module
from pathlib import Path

import pytest
from program import lrf3d as called

import lrf3d
from lrf3d.recordings.formats.trajectory import load_tum

ROOT = Path(__file__).parents[1]

# Commands of the README's table on files that lie in the repository.
TYPED = re.findall(r"`lrf3d ([^`]*examples/[^`]*)`", (ROOT / "README.md").read_text("utf-8"))

# How those begin that take more than some seconds.
LONG = ("run examples/town", "run examples/flat.png", "localise")


@pytest.mark.parametrize(
    "words",
    [pytest.param(each, marks=[pytest.mark.slow] * each.startswith(LONG)) for each in TYPED],
)
def test_a_command_of_the_readme_can_be_typed_as_it_is_shown(words, tmp_path, monkeypatch):
    # What shows pages would serve them until it is stopped.
    monkeypatch.setattr("lrf3d.apps.edit.server.serve_pages", lambda *_, **__: None)
    settings = {
        "run": ("--no-video", "--scans", 3, "--out", "out"),
        "map": ("--out", "out"),
        "slam": ("--out", "out"),
    }
    if "out/drive" in words:
        # What an earlier row of the table wrote.
        called("slam", "examples/drive.log.gz", "--out", "out/drive", cwd=tmp_path)
    done = called(*words.split(), *settings.get(words.split()[0], ()), cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_bag_is_fed_to_another_slam(tmp_path, monkeypatch):
    pytest.importorskip("rosbags")
    run = lrf3d.load_scenario("corridor").run(rng=0, scans=4)
    lrf3d.export_run(run, "mcap", tmp_path / "run.mcap")
    files = [str(tmp_path / name) for name in ("run.mcap", "theirs.tum")]
    monkeypatch.setattr("sys.argv", ["feed_slam.py", *files])
    runpy.run_path(str(ROOT / "examples/feed_slam.py"))
    assert load_tum(tmp_path / "theirs.tum").poses == pytest.approx(run.trajectory.poses)


# A film takes its time; of errors only the root has an example.
NAMES = [
    pytest.param(name, marks=[pytest.mark.slow] * (name == "render_video"))
    for name in lrf3d.__all__
    if name == "Lrf3dError" or not name.endswith("Error")
]


def inner_examples():
    """Public functions, classes and methods of all modules with an example, by dotted names.

    Those of :data:`lrf3d.__all__` are left out, but for their methods.
    """
    for file in sorted(Path(lrf3d.__file__).parent.rglob("*.py")):
        text = file.read_text("utf-8")
        if ">>>" in text:
            module = ".".join(file.relative_to(ROOT).with_suffix("").parts)
            for name in documented(ast.parse(text).body):
                if name not in lrf3d.__all__:
                    yield f"{module}:{name}"


def documented(nodes, within=""):
    """The public names among nodes whose docstrings have an example."""
    for node in nodes:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name[0] != "_":
            if ">>>" in (ast.get_docstring(node) or ""):
                yield within + node.name
            if isinstance(node, ast.ClassDef):
                yield from documented(node.body, f"{within}{node.name}.")


@pytest.fixture(autouse=True)
def beside_the_examples(tmp_path, monkeypatch):
    """Run in a folder of one's own, with the examples of the repository in it."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)


def run_example(value, name, known=None):
    """Run the example in the docstring of a value, in the current folder, with known names."""
    [test] = doctest.DocTestFinder(recurse=False).find(value, name, module=False, globs=known)
    assert test.examples
    report = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        failed, _ = doctest.DocTestRunner(verbose=False).run(test, out=report.append)
    assert not failed, "".join(report)


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_has_an_example_that_runs(name):
    run_example(getattr(lrf3d, name), name)


@pytest.mark.parametrize("name", list(inner_examples()))
def test_an_example_of_a_name_inside_a_room_runs(name):
    module, _, path = name.partition(":")
    try:
        value = import_module(module)
    except (ImportError, lrf3d.MissingLibraryError) as error:
        pytest.skip(str(error))
    # An example may use its own name without an import.
    first = path.split(".")[0]
    known = {first: getattr(value, first)}
    for part in path.split("."):
        value = inspect.getattr_static(value, part)
    run_example(getattr(value, "__func__", getattr(value, "fget", value)), name, known)
