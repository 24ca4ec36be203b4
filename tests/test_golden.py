"""Whole chains, from a built-in world or a log to its figures: what a user gets stays as it is.

A change that moves one of these figures on purpose writes the new one here, with its reason in the
message of its commit.
"""

import numpy as np
import pytest

import lrf3d
from lrf3d.slam import SlamMapper

# For each world what is changed; scans, the distance driven [m] and the mean range [m]; segments
# and objects of the map; F1 of lengths and of segments, and the RMS of the segments [m].
DRIVES = {
    "paper_room": ({}, (3, 17.7898, 5.1310), (13, 3), (0.9967, 0.9600), 0.0045),
    "city": ({"scans": 150}, (150, 118.7450, 15.3716), (78, 48), (0.8723, 0.7582), 0.0046),
    "corridor": (
        {"mode": "paper", "scans": 40}, (40, 9.7464, 4.9286), (20, 8), (0.8129, 0.6316), 0.0183,
    ),
    "glass_office": ({"scans": 60}, (60, 14.75, 4.2975), (17, 5), (0.9651, 0.9032), 0.0012),
    "mirror_hall": ({"scans": 60}, (60, 11.7944, 7.1114), (14, 4), (1.0, 0.9231), 0.0027),
    "warehouse": ({"scans": 60}, (60, 22.1250, 4.1673), (12, 5), (0.9944, 0.9600), 0.0039),
}  # fmt: skip


# Means of red, green and blue in 4 by 4 parts of a picture of the paper's room.
FRAME = [
    [[26, 35, 52], [67, 64, 79], [54, 57, 67], [26, 36, 53]],
    [[126, 114, 125], [164, 144, 124], [129, 126, 130], [57, 69, 83]],
    [[53, 57, 75], [157, 135, 110], [162, 140, 120], [84, 88, 107]],
    [[24, 33, 49], [25, 34, 51], [24, 33, 49], [24, 33, 50]],
]


@pytest.mark.parametrize("name", DRIVES)
def test_a_world_is_driven_through_scanned_and_mapped(name):
    changes, drive, counts, shares, rms = DRIVES[name]
    run = lrf3d.load_scenario(name).run(rng=0, snapshots=1, **changes)
    mean = run.ranges[np.isfinite(run.ranges)].mean()
    assert (len(run), run.trajectory.length, mean) == pytest.approx(drive, abs=1e-4)
    assert (len(run.map), run.map.object_count) == counts
    score = lrf3d.score_run(run)
    assert (score.length_f1, score.segment_f1) == pytest.approx(shares, abs=1e-4)
    assert score.perpendicular_rms == pytest.approx(rms, abs=1e-4)


@pytest.fixture(scope="module")
def drive():
    """A drive along the corridor with wheels that slip, and SLAM on board."""
    return lrf3d.load_scenario("corridor").run(
        rng=1, mapper=SlamMapper(rng=3), snapshots=1, scans=200
    )


def test_a_robot_that_is_not_given_its_poses_finds_them_and_the_map(drive):
    off = np.hypot(*(drive.estimate.poses - drive.trajectory.poses)[:, :2].T)
    lost = np.hypot(*(drive.odometry - drive.trajectory.poses)[:, :2].T)
    assert (off.max(), lost.max(), len(drive.map)) == pytest.approx((0.0077, 0.6777, 34), abs=5e-4)


@pytest.mark.slow
def test_a_drive_goes_out_as_a_bag_and_is_solved_and_mapped(drive, tmp_path):
    lrf3d.export_run(drive, "mcap", tmp_path / "drive.mcap")
    solved = lrf3d.slam_log(tmp_path / "drive.mcap")
    mapped = lrf3d.map_log(lrf3d.load_log(tmp_path / "drive.mcap", poses="truth"))
    assert (len(solved), len(solved.map), len(mapped.map)) == (200, 34, 35)


def test_a_robot_is_followed_on_a_known_map():
    room = lrf3d.load_scenario("corridor")
    run = room.run(rng=0, scans=60, snapshots=1)
    start = lrf3d.PoseEstimate(run.scan(0).pose, np.diag([0.01, 0.01, 0.001]))
    localiser = lrf3d.Localiser(lrf3d.KnownLines.from_world(run.world), start)
    track = lrf3d.localise(localiser, run.scans, lrf3d.odometry_increments(run.trajectory.poses))
    off = np.abs(track.errors(run.trajectory.poses))
    assert off.max(axis=0) == pytest.approx([0.00581, 0.00059, 0.00025], abs=1e-5)


def test_a_frame_of_a_film_looks_as_it_did():
    run = lrf3d.load_scenario("paper_room").run(rng=0)
    picture = run.frame(1.0, size=(64, 36), view="chase", renderer="embree").astype(float)
    parts = picture.reshape(4, 9, 4, 16, 3).mean(axis=(1, 3))
    assert parts == pytest.approx(np.array(FRAME), abs=2.0)
