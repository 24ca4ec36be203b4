"""Without embreex, which has no wheel for Linux on ARM, all but the cross-check works."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_without_gl import NO_GL

import lrf3d
from lrf3d.scene import light
from lrf3d.scene.stage import stage_of
from lrf3d.view.shown import Played, Wanted

ROOT = Path(__file__).parents[1]
NOTICE = "embreex is not installed"
BLOCKED = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "embreex":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocker())
"""


def environment(folder, code):
    """That of a process, and of those that it starts, in which this code runs first."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(code)
    path = os.pathsep.join([str(folder), str(ROOT), *filter(None, sys.path)])
    return {**os.environ, "PYTHONPATH": path}


@pytest.fixture
def without_embree(tmp_path):
    return environment(tmp_path / "no_embree", BLOCKED)


@pytest.fixture
def without_both(tmp_path):
    return environment(tmp_path / "no_both", BLOCKED + NO_GL)


def python(code, env, folder):
    return subprocess.run(
        [sys.executable, "-c", code], env=env, cwd=folder, capture_output=True, text=True
    )


def command(arguments, env, folder):
    return subprocess.run(
        [sys.executable, "-m", "lrf3d", *arguments.split()],
        env=env,
        cwd=folder,
        capture_output=True,
        text=True,
    )


PICTURES = """
import numpy as np, lrf3d
from lrf3d.scene.stage import stage_of
from lrf3d.view.shown import Played, Wanted

run = lrf3d.load_scenario("corridor").run(rng=0, scan_interval=2.0)
np.save("chase.npy", run.frame(10.0, size=(96, 54), view="chase"))
np.save("top.npy", run.frame(10.0, size=(96, 54), view="top"))
message = Played(run, stage_of(run), 1.0).answer(Wanted(time=10.0), 0.0)
np.save("page.npy", np.frombuffer(message, np.uint8))
"""


@pytest.mark.slow
def test_pictures_without_both_are_those_of_embree_in_open_light(
    without_both, tmp_path, monkeypatch
):
    # Light between walls is baked by Embree alone.
    monkeypatch.setattr(light, "_MOST_FACES", 0)
    done = python(PICTURES, without_both, tmp_path)
    assert done.returncode == 0, done.stderr
    run = lrf3d.load_scenario("corridor").run(rng=0, scan_interval=2.0)
    for view in ("chase", "top"):
        expected = run.frame(10.0, size=(96, 54), view=view, renderer="embree").astype(int)
        apart = np.abs(np.load(tmp_path / f"{view}.npy") - expected).max(axis=2)
        # Rays along a face, as those from above on a wall, may see its neighbour: the limits are
        # those between OpenGL and Embree.
        assert apart.mean() < 1.0
        assert (apart > 48).mean() < 0.005
    message = Played(run, stage_of(run), 1.0).answer(Wanted(time=10.0), 0.0)
    assert np.array_equal(np.load(tmp_path / "page.npy"), np.frombuffer(message, np.uint8))


def test_a_cross_check_without_embree_is_refused_in_one_line(without_embree, tmp_path):
    done = command("crosscheck paper_room", without_embree, tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("lrf3d: a cross-check needs Embree")
