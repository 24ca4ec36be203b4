import numpy as np

from lrf3d.pose import between
from lrf3d.slam.closures import Closure, LoopCloser
from lrf3d.slam.views import Key

NOTHING, LASER = np.empty((0, 4)), np.zeros(2)


def key(number, pose):
    beams = np.linspace(-1.0, 1.0, 3), np.ones(3)
    return Key(number, pose, NOTHING, NOTHING, NOTHING[:, :2], *beams, LASER, 0.01)


def test_closures_that_most_others_contradict_are_taken_back_in_the_end():
    """The wrong ones came first, and agree with each other."""
    there = [np.array([float(x), 0.0, 0.0]) for x in range(10)]
    poses = [*there, *(pose + np.array([0.0, 0.1, 0.0]) for pose in there)]
    closer = LoopCloser()
    for number, pose in enumerate(poses):
        closer.drive(np.array([1.0 + 50.0 * (number == 10), 0.0, 0.0]), 0)
        closer.add_key(key(number, pose))
    information = np.diag([1e3, 1e3, 1e4])
    right = [Closure(k, k + 10, between(poses[k], poses[k + 10]), information) for k in range(3, 7)]
    wrong = [Closure(k, k + 10, np.array([4.0, 1.0, 0.0]), information) for k in range(2)]
    closer.accepted = [*wrong, *right]
    closer.settle()
    assert closer.accepted == right
    assert closer.unconfirmed == wrong
