import numpy as np
import pytest

from lrf3d.geometry.pose import Pose, between
from lrf3d.laser import LaserScan
from lrf3d.matching.key_scans import Key, MixedPixelModel, fan_of
from lrf3d.matching.surface import SURFACE
from lrf3d.slam.closures import Closure, LoopCloser

NOTHING = np.empty(0, SURFACE)
INFORMATION = np.diag([1e3, 1e3, 1e4])


def key(number, pose):
    scan = LaserScan(Pose(0, 0, 0), np.linspace(-1.0, 1.0, 3), np.ones(3))
    return Key(number, pose, NOTHING, NOTHING, NOTHING, fan_of(scan, scan.pose, 0.01))


def driven(poses, jump):
    """A closer with key scans (k,) at poses, and a gap in the drive before one of them."""
    closer = LoopCloser(MixedPixelModel())
    for number, pose in enumerate(poses):
        closer.drive(np.array([1.0 + 50.0 * (number == jump), 0.0, 0.0]), 0)
        closer.add_key(key(number, pose))
        if number:
            closer.paths.link(number - 1, number, 1.0 + 50.0 * (number == jump), 1e-4 * np.eye(3))
    return closer


def test_closures_that_most_others_contradict_are_dropped_at_the_end():
    """The wrong ones came first, and agree with each other."""
    there = [np.array([float(x), 0.0, 0.0]) for x in range(10)]
    poses = np.array([*there, *(pose + np.array([0.0, 0.1, 0.0]) for pose in there)])
    closer = driven(poses, 10)
    right = [Closure(k, k + 10, between(poses[k], poses[k + 10]), INFORMATION) for k in range(3, 7)]
    wrong = [Closure(k, k + 10, np.array([4.0, 1.0, 0.0]), INFORMATION) for k in range(2)]
    closer.accepted = [*wrong, *right]
    closer.settle(poses)
    assert closer.accepted == right
    assert closer.unconfirmed == wrong


def test_closures_with_two_earlier_drives_past_a_place_agree():
    """One with each is not enough: but the place is the same, as loops that were closed say."""
    poses = np.array([[float(x), 0.0, 0.0] for x in [*range(10), *range(30, 35), *range(10)]])
    last = np.array([*poses, [0.0, 20.0, 0.0], [2.0, 0.1, 0.0], [3.0, 0.1, 0.0]])
    pairs = (2, 26), (18, 27)
    closures = [Closure(*pair, between(*last[list(pair)]), INFORMATION) for pair in pairs]
    for joined in (False, True):
        closer = driven(last, 10)
        if joined:
            closer.paths.link(3, 18, 0.5, 1e-4 * np.eye(3))
        closer.unconfirmed = list(closures)
        closer.settle(last)
        assert closer.accepted == (closures if joined else [])


@pytest.mark.parametrize(
    ("agreeing", "against", "accepted"), [(2, 0, True), (1, 0, False), (3, 1, True), (2, 1, False)]
)
def test_a_closure_is_confirmed_by_doubtful_places(agreeing, against, accepted):
    there = [np.array([float(x), 0.0, 0.0]) for x in range(10)]
    poses = np.array([*there, *(pose + np.array([0.0, 0.1, 0.0]) for pose in there)])
    closer = driven(poses, 10)
    pairs = [(k, k + 10) for k in range(3, 4 + agreeing)]
    clear, *doubtful = [Closure(*k, between(*poses[list(k)]), INFORMATION) for k in pairs]
    elsewhere = np.array([4.0, 1.0, 0.0])
    contradicting = [Closure(1, 18 - k, elsewhere, INFORMATION) for k in range(against)]
    closer.unconfirmed, closer.doubtful = [clear], doubtful + contradicting
    # A scan of which one place agrees has one vote, whatever its other places are.
    closer.doubtful += [Closure(1, each.new, elsewhere, INFORMATION) for each in doubtful]
    closer.settle(poses)
    assert closer.accepted == [clear] * accepted
