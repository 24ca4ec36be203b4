"""Robots that were lifted and put down elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

import lrf3d
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.slam.lifts import lifts

ROOM = lrf3d.World(
    [
        *([0, 0, 9, 0], [9, 0, 9, 7], [9, 7, 0, 7], [0, 7, 0, 0]),
        *([3, 2, 3.5, 2], [6, 5, 6, 4.2], [2, 5.5, 2.6, 5.1], [7, 1.5, 7.4, 1.9]),
    ]
)


@pytest.mark.parametrize("step, moved, found", [
    ([4.5, 2.5, 2.0], False, [4]),
    ([4.5, 2.5, 2.0], True, []),
    ([0.0, 0.0, 2.2], True, []),
], ids=["lifted", "driven", "quick turn"])  # fmt: skip
def test_a_lift_is_found_where_both_sides_agree_and_beams_contradict(step, moved, found):
    poses = np.array([[1.5 + 0.1 * k, 3.0, 0.1 * k] for k in range(8)])
    there = poses + (np.arange(8) >= 4)[:, None] * np.array(step)
    lrf = lrf3d.LaserRangeFinder(-np.pi / 2, np.pi / 2, 181, range_max=12.0)
    scans = [lrf3d.PlanarCaster(ROOM).cast(lrf, pose) for pose in there]
    claimed = there if moved else poses
    known = [replace(scan, pose=pose) for scan, pose in zip(scans, claimed, strict=True)]
    assert lifts(ScanConverter(), known, claimed, np.zeros(8)) == found
