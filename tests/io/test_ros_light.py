"""Intensities in ROS bags, and bags without the library that reads them."""

import sys

import bags
import numpy as np
import pytest

import lrf3d
from lrf3d.errors import MissingLibraryError
from lrf3d.exporting import export_run
from lrf3d.io import load_log
from lrf3d.laser import LaserRangeFinder

assert bags.rosbag2


def lit_run():
    walls = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0], [5, 0.5, 5, 5.5]]
    materials = ["plaster", "mirror", "brick", "plaster", "glass"]
    world = lrf3d.World(walls, objects=range(5), materials=materials)
    lrf = LaserRangeFinder(-2.0, 2.0, 81, range_max=20.0)
    poses = [(1.0, 2.0, 0.1), (2.0, 2.5, 0.2), (3.0, 3.0, 0.4)]
    return lrf3d.simulate(world, poses, lrf, rng=0)


def test_intensities_come_back_equal(tmp_path):
    run = lit_run()
    export_run(run, "mcap", tmp_path / "run.mcap")
    scans = load_log(tmp_path / "run.mcap").scans
    assert len(scans) == len(run)
    for before, after in zip(run.scans, scans, strict=True):
        assert np.array_equal(after.intensities, before.intensities.astype(np.float32))
        assert after.echoes is None


def test_without_rosbags_the_error_says_what_to_install(tmp_path, monkeypatch):
    bag = tmp_path / "run.mcap"
    export_run(lit_run(), "mcap", bag)
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(MissingLibraryError, match=r"pip install -e .*\[ros\]"):
        load_log(bag)
    with pytest.raises(MissingLibraryError, match=r"pip install -e .*\[ros\]"):
        export_run(lit_run(), "mcap", tmp_path / "again.mcap")
    assert list(tmp_path.iterdir()) == [bag]
