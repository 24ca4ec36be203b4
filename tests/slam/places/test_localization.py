from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from program import told
from synthetic_run import box, make_run, make_world

from lrf3d import (
    InputError,
    Localiser,
    OdometryNoise,
    Pose,
    PoseEstimate,
    World,
    localise,
    odometry_increments,
)
from lrf3d.laser import LaserRangeFinder, RangeNoise
from lrf3d.slam.places.monte_carlo import FilterSettings, score_localisation
from lrf3d.slam.places.pairing import Innovation, KnownLines

ODOMETRY = OdometryNoise()
NOISE = RangeNoise.from_sigma(0.04, 0.001, 80.0)
FAR = 1e6

numbers = st.floats(-5.0, 5.0)
poses = st.builds(Pose, numbers, numbers, st.floats(-3.1, 3.1))


def quarter():
    """A street with buildings of all depths on both sides."""
    rng = np.random.default_rng(0)
    blocks = []
    for x in np.arange(0.0, 60.0, 10.0):
        width, depth = rng.uniform(4.0, 8.0, 2)
        blocks += [box(x, 4.0 + rng.uniform(0, 1), width, depth)]
        blocks += [box(x + 2.0, -4.0 - depth, width, depth - rng.uniform(0, 1))]
    return make_world(*blocks)


@pytest.fixture(scope="module")
def run():
    x = np.arange(-4.0, 44.0, 1.5)
    poses = np.column_stack([x, np.sin(x / 8.0), np.arctan(np.cos(x / 8.0) / 8.0)])
    return make_run(quarter(), poses, LaserRangeFinder(), sigma=0.04)


def follow(run, *, scans=None, offset=0.0, seed=0, **how):
    """The track of a run, which is told its start and noisy odometry, in a world moved far away."""
    rng = np.random.default_rng(seed)
    world = World(run.world.segments + offset, run.world.objects)
    x, y, theta = run.trajectory.poses[0]
    start = PoseEstimate(Pose(x + offset, y + offset, theta), np.zeros((3, 3)))
    start = start.moved(ODOMETRY(np.zeros((1, 3)), rng)[0], ODOMETRY.covariance)
    steps = ODOMETRY(odometry_increments(run.trajectory.poses), rng)
    localiser = Localiser(KnownLines.from_world(world), start, range_noise=NOISE, **how)
    return localise(localiser, run.scans if scans is None else scans, steps)


def lines_at(normals, angle=0.0, offset=0.0, deviation=0.01):
    """Innovations of lines with normals (k,) [rad], all off by the same."""
    count = len(normals)
    off = np.column_stack([np.full(count, angle), np.broadcast_to(offset, count)])
    noise = np.tile(deviation**2 * np.eye(2), (count, 1, 1))
    normals = np.column_stack([np.cos(normals), np.sin(normals)])
    return Innovation(off, noise, normals, np.ones(count, dtype=bool))


@given(st.lists(poses, min_size=2, max_size=6))
def test_steps_lead_from_pose_to_pose(drive):
    estimate = PoseEstimate(drive[0], np.zeros((3, 3)))
    for step, pose in zip(odometry_increments(np.array(drive)), drive[1:], strict=True):
        estimate = estimate.moved(step, np.zeros((3, 3)))
        assert estimate.pose[:2] == pytest.approx(pose[:2], abs=1e-9)
        assert np.cos(estimate.pose.theta - pose.theta) == pytest.approx(1.0)
    assert (estimate.covariance == 0.0).all()


@given(poses, st.tuples(*[st.floats(-0.05, 0.05)] * 3))
def test_exact_lines_correct_the_pose(truth, off):
    normals = np.array([0.1, 1.4, -2.0])
    dx, dy, turn = off
    start = Pose(truth.x + dx, truth.y + dy, truth.theta + turn)
    offsets = np.cos(normals) * dx + np.sin(normals) * dy
    pairs = lines_at(normals, turn, offsets, deviation=1e-6)
    estimate, used = PoseEstimate(start, ODOMETRY.covariance).corrected(pairs)
    assert used.all()
    assert estimate.pose[:2] == pytest.approx(truth[:2], abs=1e-6)
    assert np.cos(estimate.pose.theta - truth.theta) == pytest.approx(1.0)


@given(st.lists(st.floats(-3, 3), max_size=12), st.floats(1e-6, 1.0))
def test_a_covariance_stays_symmetric_positive_and_never_grows(normals, deviation):
    before = PoseEstimate(Pose(0, 0, 0), ODOMETRY.covariance)
    after, _ = before.corrected(lines_at(np.array(normals), deviation=deviation))
    assert np.array_equal(after.covariance, after.covariance.T)
    assert (np.linalg.eigvalsh(after.covariance) >= -1e-18).all()
    assert (np.linalg.eigvalsh(before.covariance - after.covariance) >= -1e-12).all()
    if not normals:
        assert after.pose == before.pose
        assert after.covariance == pytest.approx(before.covariance)


def test_a_line_that_contradicts_the_others_is_left_out():
    normals = np.array([0.0, 0.1, 1.5, 1.6, 0.05])
    offsets = np.array([0.0, 0.0, 0.0, 0.0, 0.15])
    before = PoseEstimate(Pose(0, 0, 0), ODOMETRY.covariance)
    after, used = before.corrected(lines_at(normals, 0.0, offsets))
    assert used.tolist() == [True] * 4 + [False]
    assert np.hypot(*after.pose[:2]) < 1e-9


def test_many_lines_that_agree_outvote_a_prediction_that_was_far_off():
    """A prediction four deviations off, and one line that would lead along with it."""
    normals = np.radians([90.0, 90.0, 90.0, 94.0, 86.0, 0.0])
    offsets = 0.4 * np.cos(normals)
    before = PoseEstimate(Pose(0.4, 0, 0), ODOMETRY.covariance)
    after, used = before.corrected(lines_at(normals, 0.0, offsets, deviation=0.002))
    assert used.all() and abs(after.pose.x) < 0.01


def test_a_world_a_thousand_kilometres_away_changes_nothing(run):
    near, far = follow(run), follow(run, offset=FAR)
    assert np.abs(near.errors(run.trajectory.poses)[:, 2]).max() < np.radians(0.5)
    assert near.lines.min() >= 2
    assert far.poses - [FAR, FAR, 0.0] == pytest.approx(near.poses, abs=1e-6)
    assert far.covariances == pytest.approx(near.covariances, rel=1e-3, abs=1e-12)
    assert np.array_equal(far.lines, near.lines)
    assert np.array_equal(far.comparisons, near.comparisons)


def test_the_pose_stored_in_a_scan_is_never_used(run):
    moved = make_run(run.world, run.trajectory.poses[:5], run.lrf, sigma=0.04)
    scans = [replace(scan, pose=Pose(99.0, 99.0, 1.0)) for scan in moved.scans]
    assert np.array_equal(follow(moved, scans=scans).poses, follow(moved).poses)


@pytest.mark.parametrize("known", ["walls", "map"])
def test_the_filter_is_consistent_over_many_seeds(run, known):
    """The NEES of a filter that knows how well it does is 3 on average, here over 16 drives."""
    score = score_localisation(run, FilterSettings(0.04), known=known, seeds=16)
    low, high = score["nees"]["bounds_of_average_over_seeds"]
    assert 1.8 < low < 3.0 < high < 4.4
    assert low < score["nees"]["mean"] < high
    assert score["mean_position_error_m"] < 0.02


def test_a_robot_is_localised_by_ranges_without_noise(run):
    quiet = make_run(run.world, run.trajectory.poses[:6], run.lrf)
    certain = PoseEstimate(Pose(*run.trajectory.poses[0].tolist()), np.zeros((3, 3)))
    known = KnownLines.from_world(run.world)
    localiser = Localiser(known, certain, range_noise=RangeNoise.from_sigma(0.0, 0.0))
    steps = ODOMETRY(odometry_increments(quiet.trajectory.poses), np.random.default_rng(0))
    errors = localise(localiser, quiet.scans, steps).errors(quiet.trajectory.poses)
    assert np.abs(errors).max() < 1e-4


ROOM = KnownLines.from_world(quarter())
START = PoseEstimate(Pose(0, 0, 0), np.eye(3))
WRONG = {
    "symmetric": lambda: PoseEstimate(Pose(0, 0, 0), np.triu(np.ones((3, 3)))),
    "shape": lambda: PoseEstimate(Pose(0, 0, 0), np.eye(2)),
    "odometry noise": lambda: OdometryNoise(-0.1),
    "known 'a': expected a KnownLines": lambda: Localiser("a", START),
    "start 'a'": lambda: Localiser(ROOM, "a"),
    "range_noise 0.1": lambda: Localiser(ROOM, START, range_noise=0.1),
    "odometry_noise 'a'": lambda: Localiser(ROOM, START, odometry_noise="a"),
    "seen-objects-first": lambda: Localiser(ROOM, START, strategy="best"),
    "pose 0": lambda: Localiser(ROOM, START).move((1e300, 0, 0)),
}


@pytest.mark.parametrize("said", WRONG)
def test_invalid_arguments_are_refused_in_one_line(said):
    with pytest.raises(InputError, match=said) as raised:
        WRONG[said]()
    assert "\n" not in str(raised.value)


def test_a_drive_needs_a_step_between_any_two_scans_and_a_score_a_seed_and_a_map(run):
    for count in (2, 9):
        with pytest.raises(InputError, match="steps of odometry"):
            localise(Localiser(ROOM, START), list(run.scans)[:5], np.zeros((count, 3)))
    usual = FilterSettings(0.04)
    with pytest.raises(InputError, match="expected"):
        score_localisation(run, replace(usual, strategy="best"))
    for wrong in ({"known": "all"}, {"seeds": 0}):
        with pytest.raises(InputError, match="expected"):
            score_localisation(run, usual, **wrong)


def test_localise_prints_one_json_object(written):
    path = written(
        "yard.toml",
        '[[object]]\nname = "walls"\npoints = [[0, 0], [10, 0], [10, 8], [0, 8]]\nclosed = true\n'
        "[robot]\nroute = [[2, 2], [8, 2]]\nspeed = 2.0\nscan_interval = 0.5\n",
    )
    report = told("localise", path, "--seeds", "2", "--workers", "1", "--known", "map")
    assert report["seeds"] == 2 and report["known"] == "map"
    assert report["mean_position_error_m"] < 0.05
