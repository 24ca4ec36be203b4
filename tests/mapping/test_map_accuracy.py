"""How near the walls of a map are to the true ones."""

import pytest

import lrf3d


@pytest.fixture(scope="module")
def score():
    run = lrf3d.load_scenario("corridor").run(rng=0, snapshots=1)
    return lrf3d.score_run(run)


def test_corners_do_not_tilt_the_walls_that_meet_there(score):
    # The noise of a range is 1 to 4 mm here, and each wall has hundreds of them.
    assert score.perpendicular_rms < 0.0008


def test_no_segment_is_left_of_what_other_walls_have_taken_the_hits_of(score):
    assert score.length_precision == 1.0
