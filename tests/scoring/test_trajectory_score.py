import numpy as np
import pytest

from lrf3d.errors import InputError
from lrf3d.scoring import Relations, score_trajectory

POSES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, np.pi / 2], [1.0, 2.0, np.pi]])


def relations(*rows, certain=True):
    table = np.array(rows, dtype=float)
    ends = table[:, 0].astype(int), table[:, 1].astype(int)
    return Relations(*ends, table[:, 2:], np.full(len(table), certain))


def test_true_relations_score_nothing():
    known = relations((0, 1, 1, 0, np.pi / 2), (1, 2, 2, 0, np.pi / 2), (2, 0, 1, 2, -np.pi))
    score = score_trajectory(POSES, known)
    assert score.translation_mean == pytest.approx(0.0, abs=1e-12)
    assert score.rotation_mean == pytest.approx(0.0, abs=1e-12)


def test_the_same_motion_of_the_whole_trajectory_changes_nothing():
    known = relations((0, 1, 1.3, 0.4, 1.0), (1, 2, 2, 0.1, 1.5))
    cos, sin = np.cos(0.7), np.sin(0.7)
    moved = POSES @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]) + [5.0, -3.0, 0.7]
    first, second = (score_trajectory(poses, known).as_dict() for poses in (POSES, moved))
    assert second == pytest.approx(first)


def test_errors_are_in_metres_and_degrees_and_turns_wrap():
    known = relations((0, 1, 1.3, 0.4, np.pi / 2 - 2 * np.pi + 0.1))
    score = score_trajectory(POSES, known)
    assert score.translation_mean == pytest.approx(0.5)
    assert score.rotation_mean == pytest.approx(np.degrees(0.1))
    assert score.certain_translation_mean == pytest.approx(0.5)


def test_without_certain_relations_their_figures_are_missing():
    score = score_trajectory(POSES, relations((0, 1, 1, 0, 0), certain=False))
    assert score.as_dict()["certain_translation_mean"] is None


def test_relations_of_another_log_are_refused():
    with pytest.raises(InputError, match="pose 7, the trajectory has 3"):
        score_trajectory(POSES, relations((0, 7, 1, 0, 0)))
