"""Runs: their arrays fit each other when they are made, so that what is saved can be loaded."""

from dataclasses import replace

import numpy as np
import pytest

import lrf3d


@pytest.fixture(scope="module")
def run():
    room = lrf3d.load_world("paper_room")
    return lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0), (2, 2, 0)], rng=0)


@pytest.mark.parametrize("name", ["ranges", "truth", "walls"])
def test_a_run_with_fewer_rows_than_poses_is_refused_where_it_is_made(run, name):
    with pytest.raises(lrf3d.InputError, match=rf"run: {name} \(2, 181\); expected \(3, 181\)"):
        replace(run, **{name: getattr(run, name)[:2]})


@pytest.mark.parametrize(
    "scans", [(), (0, 1), (0, 1, 1), (2, 1, 0), (0, 1, 3), (-1, 0, 1), (0, 1, 1.5)]
)
def test_map_snapshots_belong_to_scans_in_order(run, scans):
    with pytest.raises(lrf3d.InputError, match="snapshot_scans"):
        replace(run, snapshot_scans=scans)


def test_light_and_estimate_are_of_as_many_scans(run):
    with pytest.raises(lrf3d.InputError, match="intensities"):
        replace(run, intensities=np.ones((2, 181)))
    with pytest.raises(lrf3d.InputError, match="echoes"):
        replace(run, echoes=np.ones((3, 180, 2)))
    estimate = lrf3d.EstimatedTrajectory(np.zeros((2, 3)), [], np.empty((0, 3, 3)))
    with pytest.raises(lrf3d.InputError, match="estimate of 2 scans; expected 3"):
        replace(run, estimate=estimate)


def test_the_numbers_of_objects_cannot_be_changed(run):
    for numbers in run.lasting_objects:
        with pytest.raises(ValueError, match="read-only"):
            numbers[0] = 7


def test_a_long_estimate_is_shown_in_one_short_line():
    poses = np.zeros((5000, 3))
    estimate = lrf3d.EstimatedTrajectory(poses, [4], [np.eye(3)], [(0, 4)])
    assert repr(estimate) == "EstimatedTrajectory(5000 poses, 1 covariances, 1 loop closures)"


def test_a_seed_is_called_rng_in_python():
    with pytest.raises(lrf3d.InputError, match="there is no seed; did you mean rng"):
        lrf3d.load_scenario("paper_room").run(seed=1)
    with pytest.raises(lrf3d.InputError, match="there is no seed; did you mean rng"):
        lrf3d.simulate(lrf3d.load_world("paper_room"), [(1, 1, 0)], seed=1)
