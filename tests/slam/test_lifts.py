"""Robots that were lifted and put down elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from drives import drive, recorded
from synthetic_run import box

import lrf3d
from lrf3d.geometry.pose import between, compose
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.slam.lifts import lifts
from lrf3d.slam.offline import solve_log

ROOM = lrf3d.World(
    [
        *([0, 0, 9, 0], [9, 0, 9, 7], [9, 7, 0, 7], [0, 7, 0, 0]),
        *([3, 2, 3.5, 2], [6, 5, 6, 4.2], [2, 5.5, 2.6, 5.1], [7, 1.5, 7.4, 1.9]),
    ]
)

HALL = lrf3d.World(
    [
        *np.vstack([box(0, 0, 12, 8), box(3, 2, 1, 0.6), box(8, 5, 0.5, 1.2), box(1, 6, 0.8, 0.5)]),
        *([6, 0, 6, 3], [6, 4.2, 6, 8], [9, 1, 10.5, 1]),
    ]
)


@pytest.mark.parametrize("wide, turn, step, moved, found", [
    (1.6, 0.1, [4.5, 2.5, 2.0], False, [4]),
    (0.7, 0.4, [0.5, 2.5, 1.5], False, [4]),
    (1.6, 0.1, [4.5, 2.5, 2.0], True, []),
    (1.6, 0.1, [0.0, 0.0, 2.2], True, []),
], ids=["lifted", "few scans", "driven", "quick turn"])  # fmt: skip
def test_a_lift_is_found_where_sides_agree_and_beams_contradict(wide, turn, step, moved, found):
    poses = np.array([[1.5 + turn * k, 3.0, turn * k] for k in range(8)])
    there = poses + (np.arange(8) >= 4)[:, None] * np.array(step)
    lrf = lrf3d.LaserRangeFinder(-wide, wide, 181, range_max=12.0)
    scans = [lrf3d.PlanarCaster(ROOM).cast(lrf, pose) for pose in there]
    claimed = there if moved else poses
    known = [replace(scan, pose=pose) for scan, pose in zip(scans, claimed, strict=True)]
    assert lifts(ScanConverter(), known, claimed, np.zeros(8)) == found


@pytest.mark.slow
@pytest.mark.parametrize("world, route, word", [
    (HALL, [(11, 2.5), (7, 2.5), (7, 1), (7.2, 3.6), (4.5, 3.6), (4.5, 6)], "placed on the map"),
    (ROOM, [(1, 1), (5, 1), (5, 3), (8, 4), (8, 6), (4, 6)], "left out"),
], ids=["here", "elsewhere"])  # fmt: skip
def test_what_follows_a_lift_is_placed_on_the_map_or_left_out_with_a_word(world, route, word):
    before = [(1.5, 1.5), (5, 1.5), (5, 6.5), (7.5, 3.6), (10, 3.5), (10.5, 6.8), (7, 7)]
    scans, wheels, true = drive(HALL, before, seed=1)
    count = len(scans)
    later, on, there = drive(world, route, seed=2)
    scans += [replace(scan, time=scan.time + scans[-1].time + 1.0) for scan in later]
    wheels = np.vstack([wheels, compose(wheels[-1], between(on[0], on))])
    solution = solve_log(recorded(scans, wheels), apart=[(0, 9)])
    lifted, placed, *_ = solution.warnings
    assert f"scans {count - 1} and {count} show nothing in common" in lifted and word in placed
    parts = [true, there][: 1 + (world is HALL)]
    length = sum(np.hypot(*np.diff(part[:, :2], axis=0).T).sum() for part in parts)
    assert solution.summary()["slam"]["length_m"] == pytest.approx(length, abs=0.5)
    true = np.vstack([true, there[: len(there) * (world is HALL)]])
    found = solution.run.trajectory.poses
    off = compose(true[0], between(found[0], found)) - true
    assert np.hypot(*off[:, :2].T).max() < 0.1
