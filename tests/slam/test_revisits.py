from dataclasses import replace

import numpy as np
import pytest
from drives import drive, errors, followed, recorded

import lrf3d
from lrf3d.base.errors import Lrf3dWarning
from lrf3d.slam.closures import LEAST_DISTANCE
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.revisits import CERTAIN, Anchor, revisit

WORLD = lrf3d.World(
    [[0, 0, 10, 0], [10, 0, 10, 6], [10, 6, 4, 6], [4, 6, 0, 5.5], [0, 5.5, 0, 0],
     [3, 2.5, 7, 2.5], [7, 2.5, 7, 3.5], [7, 3.5, 3, 3.5], [3, 3.5, 3, 2.5]]
)  # fmt: skip

ROUND = [(1, 1), (9, 1), (9, 5), (1, 5)]


@pytest.fixture(scope="module")
def rounds():
    """Eight rounds through two rooms, as Slam follows them, and its key scans after each round."""
    scans, wheels, true = drive(WORLD, [*ROUND * 8, ROUND[0]])
    slam, counts = lrf3d.Slam(start=true[0]), []
    for number, _ in enumerate(followed(slam, scans, wheels), 1):
        if 8 * number // len(scans) > len(counts):
            counts.append(len(slam.key_scans))
    return slam, counts, true


@pytest.mark.slow
def test_in_a_known_place_the_number_of_key_scans_does_not_grow(rounds):
    _, counts, _ = rounds
    assert len(counts) == 8
    assert counts[0] > 20
    assert counts[7] - counts[3] <= 2
    assert counts[7] < 3 * counts[0]


def test_scans_in_known_places_have_poses_too(rounds):
    slam, _, true = rounds
    found = slam.trajectory()
    assert found.shape == true.shape
    assert errors(true, found).max() < 0.06
    assert found[-1] == pytest.approx([*slam.pose[:2], found[-1, 2]], abs=1e-9)


def test_a_robot_in_a_known_place_is_no_more_certain_than_what_it_sees(rounds):
    slam = rounds[0]
    last = np.array(slam.pose)
    apart = np.hypot(*(slam.trajectory()[slam.key_scans] - last)[:, :2].T)
    known = slam.covariances([int(apart.argmin())])[0]
    assert np.trace(slam.covariance()[:2, :2]) > 0.5 * np.trace(known[:2, :2])


def test_a_scan_is_attached_to_a_known_place_only_if_it_shows_what_is_known_there(rounds):
    slam = rounds[0]
    closer, poses = slam.closer, slam.key_poses
    attached = 0
    for number, key in enumerate(closer.keys[:10]):
        last = Anchor(key.scan, number, np.zeros(3), key.pose, closer.distance)
        found = revisit(closer, key, last, poses)
        if found is None:
            continue
        attached += 1
        # The walls of a room fix it in both directions.
        assert found.drifted == KEY_DISTANCE
        # It has driven too far to be certain of the place.
        far = replace(last, drifted=CERTAIN)
        assert revisit(closer, key, far, poses) is None
        surface = key.surface.copy()
        surface["x"] *= 0.8
        surface["y"] *= 0.8
        assert revisit(closer, replace(key, surface=surface), last, poses) is None
    assert attached > 3


def test_a_place_that_was_left_a_moment_ago_is_not_known():
    scans, wheels, true = drive(WORLD, [(1, 1), (1.9, 1), (1.6, 1.01)])
    *_, slam = followed(lrf3d.Slam(start=true[0], key_distance=0.2), scans, wheels)
    closer = slam.closer
    assert len(closer.keys) > 5 and closer.distance < LEAST_DISTANCE
    for number, key in enumerate(closer.keys):
        last = Anchor(key.scan, number, np.zeros(3), key.pose, closer.driven[number])
        assert revisit(closer, key, last, slam.key_poses) is None


def test_a_drive_that_agrees_with_itself_passes_its_check_and_has_each_wall_once(rounds):
    check = rounds[0].self_check()
    assert check.key_scans_compared > 10
    assert check.passed and check.violation < 0.02 and check.sentences() == []
    assert 9 <= len(rounds[0].map) <= 12


@pytest.mark.slow
def test_a_log_whose_map_contradicts_itself_warns():
    """In the second round the laser hangs upside down, unnoticed: left is right."""
    scans, wheels, _ = drive(WORLD, [*ROUND * 2, ROUND[0]])
    half = len(scans) // 2
    for number in range(half, len(scans)):
        scans[number] = replace(scans[number], ranges=scans[number].ranges[::-1])
    with pytest.warns(Lrf3dWarning, match="flipped: "):
        lrf3d.slam_log(recorded(scans, wheels, "flipped"))
