"""Without embreex, which has no wheel for Linux on ARM, all but the cross-check works."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_without_gl import NO_GL

import lrf3d
from lrf3d.scene import light
from lrf3d.view.shown import Shown, Wanted

BLOCKED = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "embreex":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocker())
"""

PICTURES = """
import numpy as np, lrf3d
from lrf3d.view.shown import Shown, Wanted

run = lrf3d.load_scenario("corridor").run(rng=0, scan_interval=2.0)
np.save("chase.npy", run.frame(10.0, size=(96, 54), view="chase"))
np.save("top.npy", run.frame(10.0, size=(96, 54), view="top"))
message = Shown.played(run, 1.0).answer(Wanted(time=10.0), 0.0)
np.save("page.npy", np.frombuffer(message, np.uint8))
"""

CROSSCHECK = """
from lrf3d.cli import main
sys.argv = ["lrf3d", "crosscheck", "paper_room"]
main()
"""


def without_embreex(code, folder):
    """Run code in a process of its own that finds no embreex."""
    code = f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})\n{BLOCKED}{code}"
    words = [sys.executable, "-c", code]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True)


@pytest.mark.slow
def test_pictures_without_opengl_too_are_those_of_embree_in_open_light(tmp_path, monkeypatch):
    # Light between walls is baked by Embree alone.
    monkeypatch.setattr(light, "_MOST_FACES", 0)
    done = without_embreex(NO_GL + PICTURES, tmp_path)
    assert done.returncode == 0, done.stderr
    run = lrf3d.load_scenario("corridor").run(rng=0, scan_interval=2.0)
    for view in ("chase", "top"):
        expected = run.frame(10.0, size=(96, 54), view=view, renderer="embree").astype(int)
        apart = np.abs(np.load(tmp_path / f"{view}.npy") - expected).max(axis=2)
        # Rays along a face, as those from above on a wall, may see its neighbour: the limits are
        # those between OpenGL and Embree.
        assert apart.mean() < 1.0 and (apart > 48).mean() < 0.005
    message = Shown.played(run, 1.0).answer(Wanted(time=10.0), 0.0)
    assert np.array_equal(np.load(tmp_path / "page.npy"), np.frombuffer(message, np.uint8))


def test_a_cross_check_without_embree_is_refused_in_one_line(tmp_path):
    done = without_embreex(CROSSCHECK, tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("lrf3d: a cross-check needs Embree")
