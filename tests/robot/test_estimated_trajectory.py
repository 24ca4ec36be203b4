"""What a robot believes of its way."""

import numpy as np
import pytest

import lrf3d

POSES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [2.0, 0.5, 0.2], [3.0, 1.0, 0.3]])


def test_an_ellipse_holds_a_position_with_95_percent_probability():
    covariance = np.array([[0.09, 0.05, 0.0], [0.05, 0.06, 0.0], [0.0, 0.0, 0.01]])
    estimate = lrf3d.EstimatedTrajectory(POSES, [3], covariance[None])
    rng = np.random.default_rng(0)
    points = rng.multivariate_normal(np.zeros(2), covariance[:2, :2], 20_000)
    inside = np.linalg.norm(points @ np.linalg.inv(estimate.ellipses[0]).T, axis=1) < 1.0
    assert inside.mean() == pytest.approx(0.95, abs=0.005)


def test_a_covariance_that_rounding_made_negative_has_an_ellipse_without_width():
    flat = np.diag([0.04, -1e-20, 0.0])
    ellipse = lrf3d.EstimatedTrajectory(POSES, [0], flat[None]).ellipses[0]
    assert np.isfinite(ellipse).all() and ellipse[1].tolist() == [0.0, 0.0]


def test_a_part_keeps_the_closures_between_its_own_scans():
    covariances = np.arange(2.0)[:, None, None] * np.eye(3)
    estimate = lrf3d.EstimatedTrajectory(
        POSES, [1, 3], covariances, [[0, 3], [1, 2]], [[1, 3]], POSES + 1.0
    )
    part = estimate.part(np.array([1, 3]))
    assert part.poses.tolist() == POSES[[1, 3]].tolist()
    assert part.known_scans.tolist() == [0, 1]
    assert part.covariances.tolist() == covariances.tolist()
    assert part.closures.shape == (0, 2) and part.dropped_closures.tolist() == [[0, 1]]
    assert part.odometry.tolist() == (POSES[[1, 3]] + 1.0).tolist()
    assert estimate.part(np.array([0, 3])).lines(np.array([[0, 1]])).tolist() == [[0, 0, 3, 1]]
    assert len(estimate.part(np.array([], dtype=np.int64))) == 0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"poses": np.zeros((4, 2))}, "shape"),
        ({"known_scans": [4]}, "from 0 to 3"),
        ({"closures": [[0, 9]]}, "from 0 to 3"),
        ({"closures": [0, 1]}, "expected"),
        ({"covariances": np.eye(3)}, "expected"),
        ({"odometry": np.zeros((2, 3))}, "odometry of 2 scans"),
    ],
)
def test_what_does_not_fit_together_is_refused(changes, words):
    parts = {"poses": POSES, "known_scans": [0], "covariances": np.zeros((1, 3, 3)), **changes}
    with pytest.raises(lrf3d.InputError, match=words):
        lrf3d.EstimatedTrajectory(**parts)
