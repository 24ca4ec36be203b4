import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_run import box, make_run, make_world

from lrf3d import InputError, LineMap, Pose, World
from lrf3d.geometry.lines import normal_lines, wrap_angle
from lrf3d.laser import LaserRangeFinder, RangeNoise
from lrf3d.slam.places.pairing import KnownLines, LocalLines, innovation, pair_lines

PRIOR = np.diag([0.1**2, 0.1**2, np.radians(2.0) ** 2])
NONE = np.empty(0, int)
NOISE = RangeNoise.from_sigma(0.04, 0.001, 80.0)

angles = st.floats(-np.pi, np.pi)
places = st.floats(-50.0, 50.0)


def town(rows=16, spacing=10.0, seed=0):
    """A world of 4·rows² walls: buildings of all sizes and turns, a street between any two."""
    rng = np.random.default_rng(seed)
    blocks = []
    for x in range(rows):
        for y in range(rows):
            width, depth = rng.uniform(3.5, 6.0, 2)
            turn = rng.normal(0.0, 0.1)
            matrix = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
            walls = box(-width / 2, -depth / 2, width, depth).reshape(-1, 2) @ matrix
            blocks.append((walls + np.array([spacing * x, spacing * y])).reshape(-1, 4))
    return make_world(*blocks)


@pytest.fixture(scope="module")
def drive():
    """A drive of 80 m through a town of 1,024 walls, and back by another street."""
    world = town()
    x = np.arange(15.0, 95.0, 1.0)
    there = np.column_stack([x, np.full_like(x, 45.0), np.zeros_like(x)])
    back = np.column_stack([x[::-1], np.full_like(x, 55.0), np.full_like(x, np.pi)])
    poses = np.vstack([there, back])
    return make_run(world, poses, LaserRangeFinder(), sigma=0.04)


def drawn_lines(*segments):
    """Lines of a scan that found segments, each known to a millimetre and a milliradian."""
    ends = np.reshape(segments, (-1, 4))
    return LocalLines(ends, normal_lines(ends), np.tile(1e-6 * np.eye(2), (len(ends), 1, 1)))


def predicted(pose, rng):
    return Pose(*(np.array(pose) + rng.multivariate_normal(np.zeros(3), PRIOR)).tolist())


def test_pairs_are_the_walls_that_beams_hit_and_seen_objects_take_a_third_of_the_comparisons(drive):
    known, rng = KnownLines.from_world(drive.world), np.random.default_rng(1)
    assert len(known) == 1024
    right = wrong = count_all = count_first = 0
    seen = NONE
    for scan in drive.scans:
        local, pose = LocalLines.from_scan(scan, NOISE), predicted(scan.pose, rng)
        every = pair_lines(local, known, pose, PRIOR, NONE)
        first = pair_lines(local, known, pose, PRIOR, seen)
        assert np.array_equal([every.local, every.known], [first.local, first.known])
        count_all, count_first = count_all + every.comparisons, count_first + first.comparisons
        seen = first.objects
        directions = np.arctan2(local.segments[:, 1::2], local.segments[:, ::2])
        for row, wall in zip(every.local, every.known, strict=True):
            inside = (scan.angles > directions[row, 0]) & (scan.angles < directions[row, 1])
            hit = np.bincount(scan.walls[inside & (scan.walls >= 0)]).argmax()
            right, wrong = right + (wall == hit), wrong + (wall != hit)
    assert right > 600 and wrong <= 0.01 * right
    assert count_first <= count_all / 3


@given(angles, places, places, st.floats(1, 20), st.tuples(*[st.floats(-0.1, 0.1)] * 3))
def test_an_innovation_is_the_error_of_the_pose(alpha, x, y, away, off):
    normal = np.array([np.cos(alpha), np.sin(alpha)])
    along = np.array([-normal[1], normal[0]])
    middle = np.array([x, y]) + away * normal + 0.3 * along
    known = KnownLines.from_world(World(np.concatenate([middle - along, middle + along])[None]))
    theta = 0.4
    lines = np.array([[wrap_angle(alpha - theta), away]])
    local = LocalLines(np.array([[away, -0.7, away, 1.3]]), lines, np.eye(2)[None])
    dx, dy, turn = off
    pose = Pose(x + dx, y + dy, theta + turn)
    found = innovation(local, known, pose, np.array([0]), np.array([0]))
    assert found.difference[0] == pytest.approx([turn, normal @ [dx, dy]], abs=1e-9)
    assert found.normal[0] == pytest.approx(normal, abs=1e-9)


@settings(max_examples=30)
@given(st.floats(0.001, 0.02), st.floats(-3, 3))
def test_a_known_lines_uncertainty_is_that_of_its_ends(deviation, along):
    """Where a known line turns about its middle, p moves with the lever, and alpha with it."""
    line_map = LineMap(np.array([[5.0, along + 2, 5, along - 2]]), np.zeros(1, int), np.array([50]))
    known = KnownLines.from_map(line_map, deviation=deviation)
    segments = np.array([[5.0, along - 2, 5, along + 2]])
    local = LocalLines(segments, np.array([[0.0, 5.0]]), np.zeros((1, 2, 2)))
    found = innovation(local, known, Pose(0, 0, 0), np.array([0]), np.array([0]))
    offset = deviation**2 / 50
    turn = offset * 12 / 16
    both = along * turn
    expected = np.array([[turn, both], [both, offset + along**2 * turn]])
    assert found.noise[0] == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_the_two_faces_of_a_thin_wall_are_distinguished():
    faces = [[5.0, -1, 5, 1], [5.02, 1, 5.02, -1]]
    known = KnownLines.from_map(LineMap(faces, [0, 1], [50, 50]))
    local = drawn_lines([5.01, -1, 5.01, 1])
    assert pair_lines(local, known, Pose(0, 0, 0), PRIOR, NONE).known.tolist() == [0]
    mirrored = drawn_lines([4.99, -1, 4.99, 1])
    back = pair_lines(mirrored, known, Pose(10.0, 0, np.pi), PRIOR, NONE)
    assert back.known.tolist() == [1]


def test_among_walls_on_one_line_the_one_alongside_is_the_pair():
    walls = np.array([[5.0, y, 5.0, y + 3.0] for y in (-8.0, -4.0, 0.0, 4.0)])
    known = KnownLines.from_world(World(walls))
    local = drawn_lines([5.0, 0.1, 5.0, 2.9])
    assert pair_lines(local, known, Pose(0.02, -0.1, 0.01), PRIOR, NONE).known.tolist() == [2]


def test_without_lines_there_are_no_pairs():
    nothing = drawn_lines()
    known = KnownLines.from_world(make_world(box(0, 0, 4, 4)))
    none_known = KnownLines.from_map(LineMap.empty())
    local = drawn_lines([5.0, -1, 5, 1])
    for lines, walls in ((nothing, known), (nothing, none_known), (local, none_known)):
        pairs = pair_lines(lines, walls, Pose(2, 2, 0), PRIOR, NONE)
        assert len(pairs.local) == 0 and pairs.comparisons == 0


@pytest.mark.parametrize("values", [{"sigma": -1.0}, {"floor": np.inf}, {"range_max": np.nan}])
def test_invalid_noise_is_refused(values):
    with pytest.raises(InputError, match="range noise"):
        RangeNoise.from_sigma(**values)
