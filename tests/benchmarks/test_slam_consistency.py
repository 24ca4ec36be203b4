import numpy as np
import pytest

from benchmarks.slam_consistency import Drive, consistency, simulated


def test_errors_as_large_as_their_covariances_are_within_the_bounds():
    rng = np.random.default_rng(1)
    honest = [Drive(rng.chisquare(3, 40), 0.1, 2, 0) for _ in range(50)]
    figures = consistency(honest)
    assert figures["nees_over_3"] == pytest.approx(1.0, abs=0.1)
    assert figures["scans_within_bounds"] > 0.85
    doubled = [Drive(2.0 * drive.squares, 0.1, 2, 1) for drive in honest]
    assert consistency(doubled)["scans_too_confident"] > 0.9
    assert consistency(doubled)["false_closures"] == 50


def test_no_loop_is_closed_between_any_two_of_twenty_identical_rooms():
    drive = simulated("identical rooms", 3)
    assert drive.closures > 100
    assert drive.false == 0
    assert drive.largest < 0.5


def test_in_a_corridor_without_end_the_error_stays_within_its_ellipse():
    drives = [simulated("endless corridor", seed) for seed in range(3)]
    assert sum(drive.closures for drive in drives) == 0
    assert consistency(drives)["scans_too_confident"] == 0.0
    assert max(drive.largest for drive in drives) > 0.05
