"""The page turns beams at mirrors as films do."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import lrf3d
from lrf3d.laser import LaserRangeFinder, beam_directions
from lrf3d.scenario import load_scenario
from lrf3d.scene.turns import Turns, WallOptics
from lrf3d.view.page_data import make_scene

SCRIPT = Path(lrf3d.__file__).parent / "view" / "page" / "turns.js"

CALL = """
const { mirrors, origin, ends } = JSON.parse(process.argv[1]);
console.log(JSON.stringify(ends.map((end) => follow(mirrors, origin, end))));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
@pytest.mark.parametrize("place", [(2.0, 3.8, 0.0), (10.2, 4.2, 2.0), (6.0, 4.0, 0.5)])
def test_legs_are_those_of_the_film(place):
    hall = load_scenario("mirror_hall")
    optics = WallOptics.of(hall.world)
    mirrors = hall.world.segments[optics.mirrors]
    lrf = LaserRangeFinder(-np.pi, np.pi, 361)
    scan = lrf3d.PlanarCaster(hall.world).cast(lrf, place)
    ways = beam_directions(scan.pose.theta, scan.angles)
    ends = scan.pose[:2] + np.where(scan.hits, scan.ranges, 40.0)[:, None] * ways
    told = {"mirrors": mirrors.ravel().tolist(), "origin": place[:2], "ends": ends.tolist()}
    result = subprocess.run(
        ["node", "--input-type=module", "-e", SCRIPT.read_text() + CALL, json.dumps(told)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = json.loads(result.stdout)
    turns = Turns.of(np.array(place[:2]), ends, mirrors)
    assert [one["first"] for one in found] == turns.mirrors.tolist()
    assert np.array([one["corners"][0] for one in found]) == pytest.approx(turns.first, abs=1e-9)
    assert np.array([one["corners"][-1] for one in found]) == pytest.approx(turns.last, abs=1e-9)
    counts = np.bincount(turns.beams, minlength=len(ends))
    assert [len(one["corners"]) - 1 for one in found] == counts.tolist()
    assert counts.max() > 3


def test_the_page_gets_the_mirrors_where_its_walls_are():
    hall = load_scenario("mirror_hall")
    scene = make_scene(hall.world, LaserRangeFinder(), np.empty((0, 2)), title="hall")
    mirrors = np.reshape(scene.setup["mirrors"], (-1, 4))
    assert len(mirrors) == 2
    assert mirrors + np.tile(scene.setup["origin"], 2) == pytest.approx(
        hall.world.segments[WallOptics.of(hall.world).mirrors]
    )
    plain = load_scenario("paper_room").world
    assert make_scene(plain, LaserRangeFinder(), np.empty((0, 2)), title="").setup["mirrors"] == []
