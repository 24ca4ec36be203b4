import numpy as np
import pytest

from benchmarks.slam_consistency import Drive, consistency, simulated


def drives_of(scale, false=0):
    """Drives with errors as large as their covariances, times a scale."""
    rng = np.random.default_rng(1)
    covariance = np.array([[4e-4, 1e-4, 0.0], [1e-4, 1e-4, 0.0], [0.0, 0.0, 1e-6]])
    root = np.linalg.cholesky(covariance)
    return [
        Drive(scale * rng.normal(size=(40, 3)) @ root.T, np.tile(covariance, (40, 1, 1)), 1.0, 2,
              false)
        for _ in range(50)
    ]  # fmt: skip


def test_errors_as_large_as_their_covariances_are_within_the_bounds():
    figures = consistency(drives_of(1.0))
    assert figures["nees_over_3"] == pytest.approx(1.0, abs=0.1)
    assert figures["scans_within_bounds"] > 0.85
    assert figures["places_within_95_percent_ellipse"] == pytest.approx(0.95, abs=0.02)
    larger = consistency(drives_of(1.5, false=1))
    assert larger["scans_too_confident"] > 0.9
    assert larger["false_closures"] == 50


@pytest.mark.slow
def test_no_loop_is_closed_between_any_two_of_twenty_identical_rooms():
    drive = simulated("identical rooms", 3)
    assert drive.closures > 100
    assert drive.false == 0
    assert np.hypot(*drive.errors[:, :2].T).max() < 0.5


@pytest.mark.slow
def test_in_a_corridor_without_end_the_error_stays_within_its_ellipse():
    drives = [simulated("endless corridor", seed) for seed in range(3)]
    assert sum(drive.closures for drive in drives) == 0
    figures = consistency(drives)
    assert figures["scans_too_confident"] == 0.0
    assert figures["weak_direction_reported"] == 1.0
    assert figures["places_within_95_percent_ellipse"] > 0.9
    assert figures["largest_error_m"] > 0.05
