"""What is to be seen of an estimate."""

from dataclasses import replace

import numpy as np
import pytest
from estimates import estimated
from test_render import city_run, room_run

from lrf3d.scene.estimate import CORNERS, MOST_KEPT, DrawnEstimate, estimate_words
from lrf3d.scene.timeline import Timeline


def test_a_run_that_was_given_its_poses_has_nothing_to_show():
    assert DrawnEstimate.from_timeline(Timeline(room_run())) is None
    assert estimate_words(room_run(), 0) == ()


@pytest.mark.parametrize("offset", [(0.0, 0.0), (85_000.0, 447_500.0)])
def test_the_ellipse_of_now_is_that_of_the_scan_in_the_film_s_frame(offset):
    run = estimated(city_run(offset))
    timeline = Timeline(run)
    drawn = DrawnEstimate.from_timeline(timeline)
    times = run.trajectory.times[run.estimate.known_scans] - timeline.start
    sizes = np.linalg.eigvalsh(run.estimate.ellipses)[:, 1]

    def ring(time):
        return drawn.rings(time).starts[-CORNERS:, :2].astype(float)

    due = run.estimate.poses[run.estimate.known_scans[3], :2] - timeline.origin
    assert ring(times[3]).mean(axis=0) == pytest.approx(due, abs=1e-4)
    assert np.ptp(ring(times[3])[:, 0]) == pytest.approx(2.0 * sizes[3], abs=1e-4)
    # Between two scans it lies between what is known there.
    between = np.ptp(ring(0.5 * (times[3] + times[4]))[:, 0])
    assert between == pytest.approx(sizes[3] + sizes[4], abs=1e-4)


def test_ellipses_that_stay_are_few_come_in_time_and_do_not_cover_each_other():
    run = estimated(city_run(seconds=40.0))
    drawn = DrawnEstimate.from_timeline(Timeline(run))
    assert 3 < len(drawn.kept) <= MOST_KEPT
    sizes = np.linalg.norm(drawn.shapes[drawn.kept], axis=(1, 2))
    apart = np.hypot(*np.diff(drawn.outlines().mean(axis=1), axis=0).T)
    assert (apart >= sizes[1:] - 1e-9).all() and sizes.min() > 0.0
    rings = [len(drawn.rings(time).starts) // CORNERS for time in np.linspace(0.0, 41.0, 60)]
    # The last one is that of the robot now.
    assert rings[0] == 1 and rings[-1] == len(drawn.kept) + 1 and (np.diff(rings) >= 0).all()


def test_the_panel_says_the_error_only_where_the_truth_is_known():
    run = estimated(room_run())
    assert estimate_words(run, 4) == (("truth", ""), ("estimate, 95 %", "0.50 m off"))
    recorded = replace(run, estimate=estimated(run, (0.0, 0.0, 0.0)).estimate)
    assert not recorded.knows_truth
    assert estimate_words(recorded, 4) == (("estimate, 95 %", ""),)


def test_an_estimate_without_covariances_has_no_ellipses():
    run = estimated(room_run())
    bare = replace(run.estimate, known_scans=[], covariances=np.zeros((0, 3, 3)))
    run = replace(run, estimate=bare)
    assert estimate_words(run, 4)[1] == ("estimate", "0.50 m off")
    drawn = DrawnEstimate.from_timeline(Timeline(run))
    assert not len(drawn.rings(1.0).starts) and drawn.outlines().shape == (0, CORNERS, 2)
