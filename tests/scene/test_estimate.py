"""What is to be seen of an estimate."""

from dataclasses import replace

import numpy as np
import pytest
from estimates import estimated
from test_render import city_run, room_run

from lrf3d.scene.estimate import (
    CORNERS,
    MOST_KEPT,
    DrawnEstimate,
    estimate_words,
    kept_ellipses,
)
from lrf3d.scene.timeline import Timeline


def test_a_run_that_was_told_its_poses_has_nothing_to_show():
    assert DrawnEstimate.from_timeline(Timeline(room_run())) is None
    assert estimate_words(room_run(), 0) == ()


@pytest.mark.parametrize("offset", [(0.0, 0.0), (85_000.0, 447_500.0)])
def test_place_and_ellipse_are_those_of_the_scan_in_the_film_s_frame(offset):
    run = estimated(city_run(offset))
    timeline = Timeline(run)
    drawn = DrawnEstimate.from_timeline(timeline)
    scan = int(run.estimate.known_scans[3])
    time = float(run.trajectory.times[scan] - timeline.start)
    due = run.estimate.poses[scan, :2] - timeline.origin
    assert drawn.place(time) == pytest.approx(due, abs=1e-6)
    assert drawn.shape(time) == pytest.approx(run.estimate.ellipses[3])
    # Between two scans it lies between what is known there.
    later = float(run.trajectory.times[scan + 2] - timeline.start)
    middle = 0.5 * (run.estimate.ellipses[3] + run.estimate.ellipses[4])
    assert drawn.shape(0.5 * (time + later)) == pytest.approx(middle)


def test_ellipses_that_stay_are_few_come_in_time_and_do_not_cover_each_other():
    run = estimated(city_run(seconds=40.0))
    drawn = DrawnEstimate.from_timeline(Timeline(run))
    assert 3 < len(drawn.kept) <= MOST_KEPT
    sizes = np.linalg.norm(drawn.shapes[drawn.kept], axis=(1, 2))
    apart = np.hypot(*np.diff(drawn.middles[drawn.kept], axis=0).T)
    assert (apart >= sizes[1:] - 1e-9).all() and sizes.min() > 0.0
    rings = [len(drawn.rings(time).starts) // CORNERS for time in np.linspace(0.0, 41.0, 60)]
    # The last one is that of the robot now.
    assert rings[0] == 1 and rings[-1] == len(drawn.kept) + 1 and (np.diff(rings) >= 0).all()


def test_the_panel_tells_the_error_only_where_the_truth_is_known():
    run = estimated(room_run())
    assert estimate_words(run, 4) == (("truth", ""), ("estimate, 95 %", "0.50 m off"))
    recorded = replace(run, estimate=estimated(run, (0.0, 0.0, 0.0)).estimate)
    assert not recorded.knows_truth
    assert estimate_words(recorded, 4) == (("estimate, 95 %", ""),)


def test_an_estimate_without_covariances_has_no_ellipses():
    run = estimated(room_run())
    bare = replace(run.estimate, known_scans=[], covariances=np.zeros((0, 3, 3)))
    drawn = DrawnEstimate.from_timeline(Timeline(replace(run, estimate=bare)))
    assert len(kept_ellipses(bare)) == 0
    assert drawn.shape(1.0).tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert drawn.outlines().shape == (0, CORNERS, 2)
