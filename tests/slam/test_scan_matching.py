import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d.casting import PlanarCaster
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.pose import Pose, between, compose
from lrf3d.slam.scan_matching import match_scan
from lrf3d.slam.surface import SURFACE, grid_of, moved, range_noise, surface_of_scan, thinned
from lrf3d.world import World

ROOM = World([[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 2.5, 4], [2.5, 4, 0, 3], [0, 3, 0, 0]])
CORRIDOR = World([[-100, 0, 100, 0], [-100, 2, 100, 2]])
LASER = Pose(0.0, 0.0, 0.0)
WEAK = np.diag([1.0, 1.0, 1.0])


def surface_at(world, pose, beams=181, **lrf):
    scan = PlanarCaster(world).cast(LaserRangeFinder(beams=beams, **lrf), pose)
    return surface_of_scan(scan, LASER)


@pytest.mark.parametrize("beams", [30, 60, 181])
def test_normals_face_the_laser_and_points_lie_on_walls(beams):
    pose = np.array([3.0, 1.5, 0.4])
    surface = surface_at(ROOM, pose, beams=beams)
    assert len(surface) > 0.6 * beams
    assert np.hypot(surface["nx"], surface["ny"]) == pytest.approx(1.0)
    assert (surface["x"] * surface["nx"] + surface["y"] * surface["ny"] < 0.0).all()
    there = moved(surface, pose)
    on_floor = np.abs(there["y"]) < 1e-6
    assert on_floor.sum() > 0.1 * beams
    assert there["ny"][on_floor] == pytest.approx(1.0)


def test_near_walls_are_thinned_but_both_faces_of_a_wall_stay():
    x = np.array([0.0, 0.01, 0.02, 0.06, 1.06, 5.0])
    surface = np.zeros(6, SURFACE)
    surface["x"], surface["ny"] = x, 1.0
    assert thinned(surface)["x"].tolist() == [0.0, 0.06, 1.06, 5.0]
    surface["ny"][1] = -1.0
    assert thinned(surface)["x"][:2].tolist() == [0.0, 0.01]
    assert len(thinned(surface[:0])) == 0


def test_a_point_without_a_straight_neighbourhood_is_left_out():
    scan = LaserScan((0, 0, 0), 0.2 * np.arange(5), [5.0, 1.0, 5.0, 1.0, 5.0])
    assert len(surface_of_scan(scan, LASER)) == 0


@pytest.mark.parametrize("sigma", [0.0, 0.05, 0.3])
def test_the_noise_of_a_laser_is_seen_in_a_scan_and_walls_in_spite_of_it(sigma):
    rng = np.random.default_rng(0)
    scan = PlanarCaster(ROOM).cast(LaserRangeFinder(beams=361), (3.0, 1.5, 0.0))
    noisy = LaserScan(scan.pose, scan.angles, scan.ranges + sigma * rng.normal(size=361))
    assert range_noise(noisy) == pytest.approx(sigma, rel=0.2, abs=0.01)
    surface = surface_of_scan(noisy, LASER, max(range_noise(noisy), 0.01))
    assert len(surface) > (60 if sigma > 0.2 else 250)
    # A point lies on the line through its neighbours, nearer to the wall than it was measured.
    there = moved(surface, np.array([3.0, 1.5, 0.0]))
    off = np.abs(there["y"][np.abs(there["y"]) < 0.5])
    assert np.median(off) < max(0.3 * sigma, 1e-3)


@settings(max_examples=20, deadline=None)
@given(
    st.floats(-0.12, 0.12),
    st.floats(-0.12, 0.12),
    st.floats(-0.06, 0.06),
    st.floats(-np.pi, np.pi),
)
def test_a_scan_finds_back_to_where_it_was_taken(x, y, turn, heading):
    old = surface_at(ROOM, (3.0, 1.5, heading))
    true = np.array([0.1, -0.05, 0.02])
    new = surface_at(ROOM, compose(np.array([3.0, 1.5, heading]), true))
    match = match_scan(
        new,
        grid_of(old),
        true + np.array([x, y, turn]),
        1e-3 * WEAK,
        25,
    )
    error = between(true, match.pose)
    assert np.hypot(error[0], error[1]) < 0.01 and abs(error[2]) < 0.005
    assert match.explained > 0.8


def test_along_a_corridor_the_guess_stands():
    old = surface_at(CORRIDOR, (0, 1, 0), range_max=10.0)
    guess = np.array([0.3, 0.05, 0.01])
    match = match_scan(old, grid_of(old), guess, np.diag([100.0, 100.0, 400.0]), 15)
    assert match.pose[0] == pytest.approx(0.3, abs=1e-3)
    assert match.pose[1] == pytest.approx(0.0, abs=3e-3)
    assert match.information[0, 0] < 1e-3 * match.information[1, 1]
