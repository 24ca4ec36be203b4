"""The checks of stress find what is wrong, and lrf3d keeps their bounds."""

import math
from fractions import Fraction

import numpy as np
import pytest

from lrf3d import PlanarCaster
from lrf3d.errors import MissingLibraryError
from lrf3d.geometry import wrap_angle
from lrf3d.localization import PoseEstimate
from lrf3d.localization.pairing import Innovation
from lrf3d.robot.free_space import find_free_space
from lrf3d.world import World
from lrf3d.world.generators import generate_city
from stress import CASES, rational, stress
from stress.cases import Findings, check
from stress.estimates import priors

SLOW = "planned in", "rooms of"
"""What takes seconds: a short run of stress tries it too."""

LIGHT = [c for c in CASES if c.tries and not c.heavy and not any(s in c.name for s in SLOW)]


MIRRORS = [case for case in CASES if case.part == "light"]


@pytest.mark.parametrize("case", LIGHT, ids=lambda case: case.name)
def test_a_few_trials_keep_the_bound(case):
    found = case.attempt(np.random.default_rng(1), 3, 0)
    assert found.tried >= 3 and found.failed == 0, found.examples
    assert found.error <= case.bound


def row(measure, bound=1.0):
    return check("part", "name", measure, bound=bound, unit="m", tries=10)


def test_errors_beyond_the_bound_and_nan_fail_and_leave_their_seed():
    errors = np.array([0.5, 2.0, np.nan, 1.0])
    found = row(lambda rng: errors).attempt(np.random.default_rng(0), 4, 0)
    assert (found.tried, found.failed, found.error) == (4, 2, np.inf)
    assert [example["trial"] for example in found.examples] == [1, 2]
    seed = found.examples[0]["seed"]
    again = row(lambda rng: rng.random(2) + 1.0).attempt(np.random.default_rng(0), 1, 0)
    assert again.examples[0]["seed"] == seed
    assert repr(float(np.random.default_rng(seed).random() + 1.0)) == again.examples[0]["error"]


def test_what_is_raised_fails_and_the_next_trial_goes_on():
    def measure(rng):
        if rng.random() < 0.5:
            raise ZeroDivisionError("oh")
        return np.zeros(1)

    found = row(measure).attempt(np.random.default_rng(0), 20, 0)
    assert found.tried == 20 and 0 < found.failed < 20
    assert "ZeroDivisionError" in found.examples[0]["raised"]


def test_what_the_machine_lacks_is_left_out_and_no_failure():
    def measure(rng):
        raise MissingLibraryError("no OpenGL here")

    found = row(measure).attempt(np.random.default_rng(0), 20, 0)
    assert (found.tried, found.failed, found.left_out) == (0, 0, "no OpenGL here")
    assert (Findings() + found).left_out and (found + Findings()).left_out


def test_a_run_of_chosen_parts_tries_just_these():
    report = stress(1000, parts=("angles", "driving"), quick=True, processes=1)
    assert report.passed and report.complete and report.total.tried == 0
    assert {case.part for case, _ in report.rows} == {"angles", "driving"}
    assert all(found.tried for _, found in report.rows)
    rows = report.as_dict()["rows"]
    assert all({"part", "name", "cases", "failures", "bound", "unit"} <= set(row) for row in rows)


def test_rational_pi_and_elimination_are_right():
    assert float(rational.pi()) == math.pi
    assert abs(float(rational.pi() - Fraction(math.pi)) - 1.2246467991473532e-16) < 1e-31
    left = rational.matrix(np.array([[0.0, 2.0], [3.0, 1.0]]))
    right = rational.matrix(np.array([[4.0], [5.0]]))
    assert rational.times(left, rational.solved(left, right)) == right


@pytest.mark.parametrize("turns", [1, 3, -1, 1001])
def test_angles_a_hair_beyond_half_turns_stay_inside(turns):
    angle = turns * np.pi
    for _ in range(20):
        angle = np.nextafter(angle, np.inf)
        assert -np.pi < wrap_angle(angle) <= np.pi


def test_a_pair_that_alone_decides_the_pose_is_no_contradiction():
    """Nothing is left to vary where the prior is wide and the pair all but exact."""
    tiny, wide = 1e-15, np.eye(3) * 100.0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        turn = rng.uniform(-np.pi, np.pi)
        normal = np.array([np.cos(turn)]), np.array([np.sin(turn)])
        one = np.ones(1)
        pair = Innovation(
            0.1 * one, 3.0 * one, *normal, tiny * one, 0.0 * one, tiny * one, one > 0.0
        )
        estimate, used = PoseEstimate((0.0, 0.0, 0.0), wide).corrected(pair)
        assert used.all() and np.isfinite(estimate.covariance).all()
        assert (np.diag(estimate.covariance) >= 0.0).all()


def test_priors_are_nearly_singular():
    values = [np.linalg.eigvalsh(priors(np.random.default_rng(s)).covariance) for s in range(50)]
    assert sum(v[0] < 1e-9 * v[-1] for v in values) > 25


def test_walls_far_from_the_window_change_no_free_space():
    """What is planned in is the part with the most walls, whatever stands far away."""
    town = generate_city(400)
    far = np.array([[2000.0, 0.0, 2010.0, 0.0], [-2010.0, 0.0, -2000.0, 0.0]])
    both = World(np.vstack([town.segments, far]))
    more = World(np.vstack([both.segments, 0.5 * far]))
    spaces = [find_free_space(world, least=0.65, clearance=2.0) for world in (both, more)]
    near = [space.cells[np.abs(space.cells).max(axis=1) < 200.0] for space in spaces]
    assert len(near[0]) > 1000 and np.array_equal(*near)


@pytest.mark.parametrize("case", MIRRORS, ids=lambda case: case.name)
def test_every_wall_of_each_way_through_mirrors_and_glass_is_right(case):
    found = case.attempt(np.random.default_rng(1), 1000, 10)
    assert found.failed == 0 and found.tried >= 1000, found.examples
    assert found.counts["outright_by_rationals"] >= 10
    assert found.counts["certified_by_bound"] > 800


def test_a_caster_that_names_a_wrong_wall_on_the_way_fails(monkeypatch):
    truth = PlanarCaster.chains

    def renamed(self, lrf, pose):
        chains = truth(self, lrf, pose)
        chains[chains[:, 1] >= 0, 0] += 1
        return chains

    monkeypatch.setattr(PlanarCaster, "chains", renamed)
    found = MIRRORS[0].attempt(np.random.default_rng(1), 1000, 0)
    assert found.failed == found.counts["planar.wrong"] > 50
    assert found.counts["embree.wrong"] == 0
