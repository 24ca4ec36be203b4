import numpy as np
import pytest

from benchmarks.glass import found_glass, images, samples
from lrf3d import LaserRangeFinder, World, load_world, simulate


def test_samples_are_by_others_where_these_are_near_and_parallel():
    own = np.array([[0.0, 0, 4, 0], [0, 1, 0, 3]])
    others = np.array([[1.0, 0.05, 3, 0.05], [-1, 2, 1, 2]])
    size, shares = samples(own, others)
    assert size.tolist() == [4.0, 2.0]
    assert shares == pytest.approx([0.5 + 0.17 / 4, 0.0], abs=0.03)
    assert samples(own, np.empty((0, 4)))[1].tolist() == [0.0, 0.0]


@pytest.mark.slow
def test_what_a_mirror_shows_is_an_image():
    walls = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0]]
    world = World(walls, range(4), materials=["plaster", "mirror", "plaster", "brick"])
    # One pose is too few to tell a mirror from a room.
    run = simulate(world, [(2.0, 3.0, 0.0)] * 2, LaserRangeFinder(beams=361), rng=0)
    assert images(run) > 0


@pytest.mark.slow
def test_glass_of_the_city_is_found_from_few_random_poses_and_no_image_is_mapped():
    lrf = LaserRangeFinder(-np.pi, np.pi, 361)
    rows = [found_glass(load_world("city"), seed, lrf, 40, 0.1) for seed in range(6)]
    assert sum(row["seen"] * row["found_share"] for row in rows) > 0.3 * sum(
        row["seen"] for row in rows
    )
    assert sum(row["marked"] > 0.0 for row in rows) >= 4
    # Where nothing is marked there is no share of it.
    assert all(row["right_share"] > 0.9 or not row["marked"] for row in rows)
    assert all(row["images"] == 0 and row["segments"] > 50 for row in rows)
