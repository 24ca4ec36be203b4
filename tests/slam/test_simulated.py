import numpy as np
import pytest

import lrf3d
from lrf3d.slam import SlamMapper
from lrf3d.slam.simulated import COVARIANCE_INTERVAL, COVARIANCE_SHARE


@pytest.fixture(scope="module")
def corridor():
    scenario = lrf3d.load_scenario("corridor")
    mapper = SlamMapper(rng=3)
    return scenario.run(rng=1, mapper=mapper, snapshots=3), mapper


def test_a_drive_is_mapped_without_true_poses(corridor):
    run, mapper = corridor
    # 1 to 5 % of the way, as wheels have it.
    assert 0.005 < mapper.report(run, None)["odometry_largest_error_m"] / 75.5 < 0.05
    assert mapper.errors().max() < 0.15
    assert lrf3d.score_run(run).length_precision > 0.95


def test_online_estimates_are_stored_with_covariances_of_some_scans(corridor):
    run, mapper = corridor
    estimate = run.estimate
    assert len(estimate) == len(run) and run.knows_truth
    assert estimate.errors(run.trajectory.poses).max() < 0.2
    assert len(estimate.closures) == len(mapper.slam.closures) > 0
    assert (estimate.closures[:, 0] < estimate.closures[:, 1]).all()
    # On a long drive covariances come more seldom.
    gaps = np.diff(estimate.known_scans)
    assert gaps[0] == COVARIANCE_INTERVAL and (np.diff(gaps) >= 0).all()
    assert gaps[-1] == estimate.known_scans[-2] // COVARIANCE_SHARE > COVARIANCE_INTERVAL


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["carmen", "mcap"])
def test_a_simulated_recording_is_solved_from_what_its_wheels_measured(corridor, kind, tmp_path):
    run, _ = corridor
    path = tmp_path / {"carmen": "run.log.gz", "mcap": "run.mcap"}[kind]
    lrf3d.export_run(run, kind, path)
    log = lrf3d.load_log(path, poses="odom" if kind == "mcap" else "auto")
    wheels = log.poses if log.wheels is None else log.wheels.poses
    assert wheels == pytest.approx(run.estimate.odometry, abs=1e-6)
    solved = lrf3d.slam_log(log)
    assert np.hypot(*(solved.trajectory.poses - run.trajectory.poses)[:, :2].T).max() < 0.15
    assert not solved.knows_truth and len(solved.estimate.closures) > 0
    sizes = np.linalg.norm(solved.estimate.ellipses, axis=(1, 2))
    assert sizes[0] == 0.0 and 0.0 < sizes[1:].min() and sizes.max() < 2.0
