"""Beams that Embree is not asked about, since nothing can stand between their neighbours."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import EmbreeCaster, LaserRangeFinder, PlanarCaster, World
from lrf3d.casting.embree_library import embree_library
from lrf3d.casting.embree_walls import all_clear_parts, ends_of, narrowest_cluster
from lrf3d.casting.kernels.tree import build_tree

pytestmark = pytest.mark.skipif(embree_library() is None, reason="Embree is called by embreex")


def ring(corners):
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def posts(rng, count, width, reach):
    """Closed posts of about a width among four walls; where it is tight many overlap."""
    room = ring(1.1 * reach * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]))
    turn = rng.uniform(-np.pi, np.pi, count)
    ahead = np.column_stack([np.cos(turn), np.sin(turn)])
    left = ahead[:, ::-1] * [-1.0, 1.0]
    sides = 0.5 * width * (1.0 + rng.exponential(0.1, (2, count, 1)))
    corners = [i * sides[0] * ahead + j * sides[1] * left for i, j in ((1, 1), (-1, 1))]
    corners = np.stack([*corners, *(-corner for corner in corners)], axis=1)
    corners += rng.uniform(-reach, reach, (count, 1, 2))
    return np.concatenate([room, *(ring(four) for four in corners)])


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.3, 12.0),
    st.sampled_from([45, 91, 181, 720]),
    st.sampled_from([8.0, 20.0, 55.0]),
)
def test_no_post_is_overlooked_between_beams(seed, width, beams, reach):
    rng = np.random.default_rng(seed)
    world = World(posts(rng, 40, width, reach))
    lrf = LaserRangeFinder(-np.pi, np.pi, beams, range_max=rng.uniform(20.0, 150.0))
    poses = np.column_stack([rng.uniform(-reach, reach, (30, 2)), rng.uniform(-4, 4, 30)])
    embree, planar = EmbreeCaster(world), PlanarCaster(world)
    for found, true in zip(
        embree.scan_batch(lrf, poses), planar.scan_batch(lrf, poses), strict=True
    ):
        np.testing.assert_array_equal(found, true)


@pytest.mark.parametrize("width", [5.7, 6.5, 7.5])
@pytest.mark.parametrize("coarse", [80, 88])
def test_a_post_that_just_fits_between_two_beams_is_seen(width, coarse):
    lrf = LaserRangeFinder()
    room = ring(np.array([[-50.0, -50.0], [78.0, -50.0], [78.0, 50.0], [-50.0, 50.0]]))
    post = 0.5 * width * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    middle = lrf.angles[coarse + 4]
    place = (76.0 - 0.5 * width) * np.array([1.0, np.tan(middle)])
    world = World(np.concatenate([room, ring(post + place)]))
    ranges, walls = EmbreeCaster(world).scan_batch(lrf, np.zeros((1, 3)))
    assert (walls[0, [coarse, coarse + 8]] == 1).all()
    assert (walls[0, coarse + 1 : coarse + 8] > 3).any()
    np.testing.assert_array_equal(ranges, PlanarCaster(world).cast_batch(lrf, np.zeros((1, 3))))


@pytest.mark.parametrize("seed", [315, 2220])
def test_a_corner_that_pokes_through_a_wall_is_seen(seed):
    # Beside the corner, what is clear for steep beams lies on another side than what is for all.
    rng = np.random.default_rng(seed)
    world = World(posts(rng, 40, 1.5, 8.0))
    lrf = LaserRangeFinder(-np.pi, np.pi, 361, range_max=25.0)
    poses = np.column_stack([rng.uniform(-8, 8, (50, 2)), rng.uniform(-4, 4, 50)])
    found = EmbreeCaster(world).cast_batch(lrf, poses)
    np.testing.assert_array_equal(found, PlanarCaster(world).cast_batch(lrf, poses))


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.integers(1, 8), st.sampled_from([0.0, 1e6]), st.booleans()
)  # fmt: skip
def test_the_narrowest_cluster_is_as_wide_as_its_ends_are(seed, count, offset, closed):
    rng = np.random.default_rng(seed)
    groups = [
        rng.normal(0, 10.0 ** rng.uniform(-2, 2), (rng.integers(3, 9), 2)) for _ in range(count)
    ]
    groups = [group + rng.uniform(-1e3, 1e3, 2) + offset for group in groups]
    walls = np.concatenate([ring(group)[: None if closed else -1] for group in groups])
    # The narrowest strip lies along the line of two of the ends.
    widths = []
    for group in groups:
        steps = (group[:, None] - group)[np.triu_indices(len(group), 1)]
        across = steps[:, ::-1] * [1, -1] / np.hypot(*steps.T)[:, None]
        widths.append(np.ptp((group - group[0]) @ across.T, axis=0).min())
    found = narrowest_cluster(ends_of(rng.permutation(walls)))
    assert found <= min(widths) * (1 + 1e-9)
    assert found == pytest.approx(min(widths), rel=1e-6, abs=1e-9)


def test_where_walls_crowd_none_is_called_clear_and_casting_stays_exact():
    turn = np.pi * np.arange(200) / 200.0
    ends = 10.0 * np.column_stack([np.cos(turn), np.sin(turn)])
    world = World(np.vstack([np.column_stack([-ends, ends]), [[12.0, -9.0, 12.0, 9.0]]]))
    tree = build_tree(world.segments, np.arange(len(world.segments), dtype=np.int32))
    for delta in (1e-6, 1e-12):
        parts = all_clear_parts(tree, delta)
        for low, high in (parts[:, :2].T, parts[:, 2:].T):
            assert (low > high).sum() == 200
    poses = [(6.0, 7.0, 0.3), (11.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    lrf = LaserRangeFinder(beams=721)
    ranges, walls = EmbreeCaster(world).scan_batch(lrf, poses)
    expected = PlanarCaster(world).scan_batch(lrf, poses)
    np.testing.assert_array_equal(ranges, expected[0])
    np.testing.assert_array_equal(walls[:2], expected[1][:2])


def test_a_wall_that_stands_alone_has_no_width():
    block = ring(np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]]))
    assert narrowest_cluster(ends_of(block)) == pytest.approx(9.0)
    assert narrowest_cluster(ends_of(np.vstack([block, [20.0, 0.0, 25.0, 5.0]]))) == 0.0
    assert narrowest_cluster(ends_of(np.empty((0, 4)))) == np.inf
