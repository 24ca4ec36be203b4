"""Scans that take some time, of which their log says nothing."""

from dataclasses import replace

import numpy as np
import pytest
from drives import HALL

import lrf3d
from lrf3d.geometry.pose import between
from lrf3d.recordings.log import LaserLog, WheelRecord
from lrf3d.recordings.repair.recording import recordings_of
from lrf3d.recordings.repair.repairs import SOLVING, figures_of, repaired_log
from lrf3d.recordings.repair.sweep import SWEEP as REPAIR
from lrf3d.slam.offline import solve_log

INTERVAL = 0.1

# Time [s] of four radians of a mirror that turns once for each scan.
SWEEP = INTERVAL * 4.0 / (2.0 * np.pi)


def recording(sweep, *, clockwise=False):
    """Scans of sharp turns by a laser whose scans take a time [s], unsaid, and the true poses."""
    turns = np.tile([0.0, 1.6, 0.0, -1.6], 3)
    path = lrf3d.drive((2.0, 3.5, 0.0), np.full(12, 0.35), turns, duration=0.6, dt=INTERVAL)
    lrf = lrf3d.LaserRangeFinder(-2.0, 2.0, 171, range_max=12.0, scan_duration=sweep)
    run = lrf3d.simulate(HALL, path, lrf, rng=0)
    scans = [replace(scan, time_increment=0.0, motion=None) for scan in run.scans]
    poses = run.trajectory.poses
    if clockwise:
        # The mirror image of the hall: a laser that sends its first beam to the left.
        scans = [replace(scan, ranges=scan.ranges[::-1]) for scan in scans]
        poses = poses * [1.0, -1.0, -1.0]
    return scans, poses


def log_of(scans, poses):
    times = INTERVAL * np.arange(len(scans))
    return LaserLog("hall", scans, wheels=WheelRecord(times, poses, np.arange(len(scans))))


def unrolling(scans, poses):
    [recording] = recordings_of(log_of(scans, poses), SOLVING)
    sweep = REPAIR.find(recording)
    return sweep and sweep.scans


@pytest.mark.parametrize("clockwise", [False, True])
def test_scans_that_take_time_unsaid_get_the_motion_of_the_robot(clockwise):
    scans, poses = recording(SWEEP, clockwise=clockwise)
    found, turns = unrolling(scans, poses), np.diff(poses[:, 2])
    # A laser that turns clockwise is seen from its last beam on.
    turned = -turns[:-1] if clockwise else turns[1:]
    assert found[0].duration == pytest.approx(SWEEP)
    assert np.allclose([scan.motion[2] for scan in found[1:-1]], SWEEP / INTERVAL * turned)


def test_scans_of_a_moment_stay_as_they_are():
    assert unrolling(*recording(0.0)) is None
    scans, poses = recording(SWEEP)
    # So do those of a slow laser.
    assert unrolling([replace(scan, time=10.0 * scan.time) for scan in scans], poses) is None


@pytest.mark.parametrize("sweep", [0.2, 0.0])
def test_a_constant_rate_of_turn_does_not_hide_the_sweep(sweep):
    hall = lrf3d.World([[0, 0, 9, 0], [9, 0, 9, 7], [9, 7, 0, 7], [0, 7, 0, 0], [3, 2, 3.5, 2]])
    path = lrf3d.drive((3.0, 3.5, 0.0), 0.05, 0.47, duration=20.0, dt=0.2)
    lrf = lrf3d.LaserRangeFinder(-np.pi, np.pi - 0.035, 180, range_max=12.0, scan_duration=sweep)
    noise = lrf3d.ProportionalNoise(0.02)
    run = lrf3d.simulate(hall, path, lrf, noise=noise, scan_interval=0.2, rng=0)
    scans = [replace(scan, time_increment=0.0, motion=None) for scan in run.scans]
    found = unrolling(scans, run.trajectory.poses)
    assert (found is not None) == bool(sweep)
    if found:
        assert found[5].motion[2] == pytest.approx(0.47 * 0.2, rel=0.02)


@pytest.mark.parametrize(
    "sense, factor, said",
    [
        *((1, 1.0, ""), (-1, 1.0, "last beams first"), (0, 1.0, "of one moment")),
        *((1, factor, f"takes {SWEEP:.3f} s, unlike") for factor in (0.5, 1.5, 3.0)),
    ],
)
def test_the_declared_times_of_beams_are_kept_unless_scans_contradict_them(sense, factor, said):
    scans, poses = recording(SWEEP * abs(sense), clockwise=sense < 0)
    declared = [
        replace(scan, pose=tuple(pose), time_increment=factor * SWEEP / 170)
        for scan, pose in zip(scans, poses, strict=True)
    ]
    [own] = recordings_of(log_of(declared, poses), SOLVING)
    found = REPAIR.find(own)
    assert said in REPAIR.sentence(found) if said else found is None


def test_a_recording_with_unsaid_sweeps_is_solved_and_says_so():
    scans, poses = recording(SWEEP)
    solution = solve_log(log_of(scans, poses))
    assert figures_of(solution.recording)["sweep"] == pytest.approx(SWEEP, rel=0.02)
    assert any("unrolled" in sentence for sentence in solution.recording.sentences)
    assert np.hypot(*between(solution.poses, poses)[:, :2].T).max() < 0.1


def test_scans_at_known_poses_are_unrolled_for_a_map_too():
    scans, _ = recording(SWEEP)
    [said] = repaired_log(LaserLog("hall", scans)).notes
    assert "unrolled" in said
