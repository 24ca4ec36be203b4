"""What a robot believed, in run.npz."""

import numpy as np
import pytest

import lrf3d
from lrf3d.errors import InputError
from lrf3d.slam import SlamMapper
from lrf3d.slam.simulated import COVARIANCE_INTERVAL

PLACES = np.linspace(0.0, 1.5 * np.pi, 90)
POSES = np.column_stack([5 + 3 * np.cos(PLACES), 5.5 + 1.5 * np.sin(PLACES), PLACES + np.pi / 2])


class Stop(Exception):
    pass


def simulation(scans=90, mapper=None):
    """A drive in a room with a step in its wall."""
    room = lrf3d.World([[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 4, 8], [4, 8, 0, 7], [0, 7, 0, 0]])
    mapper = SlamMapper(rng=1) if mapper is None else mapper
    lrf = lrf3d.LaserRangeFinder(beams=61, range_max=20.0)
    noise = lrf3d.ProportionalNoise(0.1)
    return lrf3d.Simulation(room, POSES, lrf, noise=noise, mapper=mapper, rng=7, scans=scans)


def stopping(done, total):
    if done == 60:
        raise Stop


def test_what_a_robot_believed_is_kept_and_resumed_to_the_last_bit(tmp_path):
    whole = lrf3d.record(simulation(), tmp_path / "whole.npz")
    assert len(whole.estimate) == len(whole.estimate.odometry) == 90
    assert whole.estimate.known_scans.tolist() == list(range(0, 90, COVARIANCE_INTERVAL))
    path = tmp_path / "stopped.npz"
    with pytest.raises(Stop):
        lrf3d.record(simulation(), path, progress=stopping)
    lrf3d.record(simulation(), path, resume=True)
    assert path.read_bytes() == (tmp_path / "whole.npz").read_bytes()
    again = tmp_path / "again.npz"
    lrf3d.save_run(whole, again)
    kept = lrf3d.load_run(again).estimate
    for name in ("poses", "known_scans", "covariances", "closures", "dropped_closures", "odometry"):
        assert getattr(kept, name).tolist() == getattr(whole.estimate, name).tolist()


def test_a_file_without_an_estimate_and_one_with_a_wrong_one(tmp_path):
    path = tmp_path / "run.npz"
    lrf3d.record(simulation(5, lrf3d.LineMapper()), path)
    assert lrf3d.load_run(path).estimate is None
    lrf3d.record(simulation(5), path)
    with np.load(path) as arrays:
        changed = {**arrays, "estimate_poses": np.zeros((4, 3))}
    np.savez(path, **changed)
    with pytest.raises(InputError, match=r"run\.npz: .*4"):
        lrf3d.load_run(path)
