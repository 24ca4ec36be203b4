import subprocess
import sys

import numpy as np
import pytest

import lrf3d

CASTING = (
    "import lrf3d; w = lrf3d.World([[1, -1, 1, 1]]);"
    "lrf3d.PlanarCaster(w).cast(lrf3d.LaserRangeFinder(), (0, 0, 0))"
)


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        # Soon after Python's own start, the program answers Ctrl-C in one line.
        ("import lrf3d.__main__", "importlib warnings re typing enum"),
        ("import lrf3d", "numba numpy trimesh pyrender matplotlib scipy shapely"),
        ("import lrf3d.apps.cli", "numba numpy trimesh pyrender matplotlib scipy shapely rich"),
        ("import lrf3d; lrf3d.load_scenario('city')", "numba trimesh scipy shapely"),
        ("import lrf3d.apps.cli.world", "numba scipy matplotlib"),
        ("import lrf3d.apps.cli.run", "matplotlib"),
        (CASTING, "trimesh embreex pyrender matplotlib"),
    ],
)
def test_what_is_not_needed_is_not_loaded(code, heavy):
    program = f"import sys\nbefore = {{*sys.modules}}\n{code}\nprint(*{{*sys.modules}} - before)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert not set(heavy.split()) & set(done.stdout.split())


def test_the_public_names_are_sorted_and_all_there():
    assert lrf3d.__all__ == sorted(lrf3d.__all__)
    assert dir(lrf3d) == lrf3d.__all__
    assert all(getattr(lrf3d, name) is not None for name in lrf3d.__all__)


def test_what_is_large_is_shown_in_one_line():
    scenario = lrf3d.load_scenario("paper_room")
    run = lrf3d.simulate(scenario.world, [(1, 1, 0), (2, 1, 0)], scenario.lrf)
    known = lrf3d.KnownLines.from_world(scenario.world)
    start = lrf3d.PoseEstimate((1, 1, 0), np.eye(3))
    for value in (
        *(scenario, scenario.world, run, run.map, run.trajectory, run.scan(0), known, start),
        *(lrf3d.Localiser(known, start), lrf3d.PlanarCaster(scenario.world)),
        lrf3d.DynamicObstacle([[0, 0], [1, 0], [0, 1]], run.trajectory),
        lrf3d.crosscheck(scenario.world, scenario.lrf, run.trajectory.poses),
    ):
        text = repr(value)
        assert "\n" not in text and len(text) < 200
        assert text.startswith(type(value).__name__ + "(")
    assert repr(run.scan(0)).startswith(f"LaserScan({run.lrf.beams} beams, ")
    assert f"{len(run.map)} segments in {run.map.object_count} objects" in repr(run)
