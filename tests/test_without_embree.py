"""Without embreex, which has no wheel for Linux on ARM, all but the cross-check works."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_without_gl import NO_GL

import lrf3d

BLOCKED = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "embreex":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocker())
"""

DRAWN = """
import numpy as np, lrf3d
from lrf3d.apps.cli import main

run = lrf3d.load_scenario("corridor").run(rng=0, scan_interval=2.0)
for view in ("chase", "top"):
    np.save(f"{view}.npy", run.frame(10.0, size=(96, 54), view=view))
sys.argv = ["lrf3d", "crosscheck", "paper_room"]
main()
"""


@pytest.mark.slow
def test_pictures_without_opengl_too_are_those_of_embree(tmp_path):
    path = f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})\n"
    command = [sys.executable, "-c", path + BLOCKED + NO_GL + DRAWN]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("lrf3d: a cross-check needs Embree")
    run = lrf3d.load_scenario("corridor").run(rng=0, scan_interval=2.0)
    for view in ("chase", "top"):
        expected = run.frame(10.0, size=(96, 54), view=view, renderer="embree").astype(int)
        apart = np.abs(np.load(tmp_path / f"{view}.npy") - expected).max(axis=2)
        # Rays along a face, as those from above on a wall, may see its neighbour: the limits are
        # those between OpenGL and Embree.
        assert apart.mean() < 1.0 and (apart > 48).mean() < 0.005
