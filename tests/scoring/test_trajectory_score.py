"""Errors of trajectories: the figures of evo_ape and evo_rpe, and those by relations."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from program import lrf3d as run_program

import lrf3d
from lrf3d.geometry.pose import compose
from lrf3d.recordings.formats.trajectory import load_tum, save_tum
from lrf3d.scoring import Relations, score_trajectory
from lrf3d.scoring.trajectory_score import pose_errors

ANGLE = 0.1 * np.arange(40.0)
TRUTH = lrf3d.Trajectory(
    0.25 * np.arange(40.0),
    np.column_stack([4.0 * np.cos(ANGLE), 3.0 * np.sin(ANGLE), ANGLE + 0.5 * np.pi]),
)
WAVES = np.column_stack([0.05 * np.sin(7.0 * ANGLE), 0.03 * np.cos(5.0 * ANGLE), 0.01 * ANGLE])
MOVED = compose(np.array([3.0, -2.0, 0.7]), TRUTH.poses + WAVES)
OTHER = lrf3d.Trajectory(TRUTH.times + 0.002, MOVED)

# What evo 1.38.1 prints as rmse for TUM files of these two with 15 digits: by evo_ape --align,
# evo_ape, and evo_rpe with trans_part and angle_deg.
EVO = {"ape_m": 0.041315, "ape_unaligned_m": 4.252497, "rpe_m": 0.026614, "rpe_deg": 0.057296}


def test_the_figures_are_those_of_evo():
    figures = pose_errors(TRUTH, OTHER).as_dict()
    assert figures["matched_poses"] == 40
    assert {name: figures[name]["rmse"] for name in EVO} == pytest.approx(EVO, abs=1e-6)


def relations(*rows, certain=True):
    table = np.array(rows, dtype=float)
    ends = table[:, 0].astype(int), table[:, 1].astype(int)
    return Relations(*ends, table[:, 2:], np.full(len(table), certain))


@given(st.floats(-9, 9), st.floats(-9, 9), st.floats(-3, 3))
def test_another_frame_changes_nothing(x, y, theta):
    moved = lrf3d.Trajectory(OTHER.times, compose(np.array([x, y, theta]), OTHER.poses))
    one, other = pose_errors(TRUTH, OTHER), pose_errors(TRUTH, moved)
    assert np.allclose(one.absolute, other.absolute, atol=1e-9)
    assert np.allclose(one.relative, other.relative, atol=1e-9)
    known = relations((0, 1, 1.3, 0.4, 1.0), (1, 2, 2, 0.1, 1.5))
    first, second = (score_trajectory(each.poses, known).as_dict() for each in (OTHER, moved))
    assert second == pytest.approx(first)


@pytest.mark.parametrize(
    ("times", "poses", "said"),
    [
        (TRUTH.times + 1e6, TRUTH.poses, "do not overlap; shifted by -1000000.000000 s"),
        (1e3 * TRUTH.times, TRUTH.poses, "look like milliseconds"),
        (1e9 * TRUTH.times, TRUTH.poses, "look like nanoseconds"),
        (TRUTH.times, 1e3 * TRUTH.poses, "1000 times as large"),
    ],
)
def test_what_does_not_meet_the_truth_is_reported_with_both_spans(times, poses, said):
    with pytest.raises(lrf3d.InputError, match=said):
        pose_errors(TRUTH, lrf3d.Trajectory(times, poses))


def test_between_stamps_the_truth_is_interpolated():
    between = lrf3d.Trajectory(TRUTH.times[:-1] + 0.1, TRUTH.at(TRUTH.times[:-1] + 0.1))
    errors = pose_errors(TRUTH, between)
    assert errors.interpolated and errors.absolute.max() < 1e-9


def test_relations_give_metres_and_degrees_and_turns_wrap():
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, np.pi / 2], [1.0, 2.0, np.pi]])
    true = (0, 1, 1, 0, np.pi / 2), (1, 2, 2, 0, np.pi / 2), (2, 0, 1, 2, -np.pi)
    score = score_trajectory(poses, relations(*true))
    assert (score.translation_mean, score.rotation_mean) == pytest.approx((0.0, 0.0), abs=1e-12)
    score = score_trajectory(poses, relations((0, 1, 1.3, 0.4, np.pi / 2 - 2 * np.pi + 0.1)))
    assert (score.translation_mean, score.rotation_mean) == pytest.approx((0.5, np.degrees(0.1)))
    assert score.certain_translation_mean == pytest.approx(0.5)
    unsure = score_trajectory(poses, relations((0, 1, 1, 0, 0), certain=False)).as_dict()
    assert unsure["certain_translation_mean"] is None
    with pytest.raises(lrf3d.InputError, match="pose 7, the trajectory has 3"):
        score_trajectory(poses, relations((0, 7, 1, 0, 0)))


def test_a_tum_file_is_read_back_or_its_line_named(tmp_path):
    path = tmp_path / "a.tum"
    save_tum(TRUTH.times, TRUTH.poses, path)
    assert np.allclose(load_tum(path).poses, TRUTH.poses, atol=1e-6)
    for text, expected in (
        ("0 0 0 0 0 0 0\n", ":1: expected t x y z .* found 7 numbers"),
        ("0 0 0 0 0 0 0 0\n", ":1: a quaternion of length 0"),
        ("0 " * 12, "as KITTI's"),
        ("1.7e18 0 0 0 0 0 0 1\n", "not nanoseconds"),
        ("0 1 2 0 1 0 0 0\n", "lie on their side"),
        ("0 0 0 0 0 0 0 1\n0 1 0 0 0 0 0 1\n", ":2: the stamp"),
        ("# none\n", "no pose"),
    ):
        path.write_text(text)
        with pytest.raises(lrf3d.InputError, match=expected):
            load_tum(path)


def test_comments_names_of_columns_and_quaternions_of_any_length_are_read(written):
    path = written(
        "a.csv", "% theirs\nt,x,y,z,qx,qy,qz,qw\n0,1,2,0,0,0,3,3\n1;1;2;0;0;0;0;9 # end\n"
    )
    assert load_tum(path).poses == pytest.approx(np.array([[1, 2, np.pi / 2], [1, 2, 0]]))


def test_a_run_is_scored_with_somebodys_trajectory_and_map(tmp_path):
    room = lrf3d.load_world("paper_room")
    drive = lrf3d.follow_route([[1, 1], [4, 1], [4, 2.5]], speed=1.0)
    run = lrf3d.simulate(room, drive, rng=0)
    lrf3d.save_run(run, tmp_path / "run.npz")
    away = np.array([5.0, 1.0, 0.3])
    save_tum(drive.times, compose(away, drive.poses), tmp_path / "theirs.tum")
    ends = lrf3d.Pose(*away).apply(run.map.segments.reshape(-1, 2)).reshape(-1, 4)
    lrf3d.save_map(lrf3d.LineMap(ends, run.map.objects, run.map.points), tmp_path / "map.geojson")
    done = run_program(
        "score", tmp_path, "--trajectory", tmp_path / "theirs.tum", "--map",
        tmp_path / "map.geojson", "--out", tmp_path / "out", "--json",
    )  # fmt: skip
    found = json.loads(done.stdout)
    assert found["trajectory"]["ape_m"]["max"] < 1e-5
    assert found["trajectory"]["ape_unaligned_m"]["rmse"] > 1.0
    assert found["map"]["length_f1"] == pytest.approx(lrf3d.score_run(run).length_f1, abs=0.01)
    assert (tmp_path / "out" / "score.png").stat().st_size > 10_000
