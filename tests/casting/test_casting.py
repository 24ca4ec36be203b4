from fractions import Fraction

import numpy as np
import pytest
from rational import cast_exact

from lrf3d import EmbreeCaster, LaserRangeFinder, PlanarCaster, World
from lrf3d.casting.kernels.tree import FREE_LEVELS, LEAF, build_tree
from lrf3d.laser import layer_directions
from lrf3d.world.mesh import level_cut

ROOM = World(np.array([[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 0, 8], [0, 8, 0, 0.0]]))
CASTERS = [PlanarCaster, EmbreeCaster]


@pytest.mark.parametrize("caster", CASTERS)
def test_ranges_are_distances_to_walls_far_is_a_miss_and_near_is_minus_infinity(caster):
    scan = caster(ROOM).cast(LaserRangeFinder(beams=3), (2.0, 3.0, 0.0))
    assert scan.ranges == pytest.approx([3.0, 8.0, 5.0], abs=1e-12)
    assert scan.walls.tolist() == [0, 1, 2]
    lrf = LaserRangeFinder(beams=3, range_min=4.0, range_max=6.0)
    scan = caster(ROOM).cast(lrf, (2.0, 3.0, 0.0))
    assert scan.ranges[:2].tolist() == [-np.inf, np.inf]
    assert scan.walls.tolist() == [-1, -1, 2] and scan.range_max == 6.0


@pytest.mark.parametrize("caster", CASTERS)
def test_a_wall_lower_than_the_beam_is_not_hit(caster):
    low = World(np.array([[5, -1, 5, 1], [9, -1, 9, 1.0]]), heights=[0.3, 2.0])
    lrf = LaserRangeFinder(angle_min=0.0, angle_max=0.0, beams=1, height=0.5)
    assert caster(low).cast(lrf, (0, 0, 0)).ranges == pytest.approx([9.0])


def pillars(seed, count=12, far=None):
    """Square pillars of 3 m at any angle, and if asked for a triangle very far away; a mesh."""
    import trimesh

    rng, parts = np.random.default_rng(seed), []
    for _ in range(count):
        place = trimesh.transformations.rotation_matrix(rng.uniform(0, 3), (0, 0, 1))
        place[:3, 3] = (*rng.uniform(-20, 20, 2), 1.5)
        parts.append(trimesh.creation.box((*rng.uniform(0.2, 1.0, 2), 3.0), place))
    if far is not None:
        corners = [[far, 0, 0], [far, 1, 0], [far, 0, 3]]
        parts.append(trimesh.Trimesh(corners, [[0, 1, 2]], process=False))
    return trimesh.util.concatenate(parts)


def beside_corners(mesh, seed, count, least):
    """Poses (count, 3) that look past an upright edge of a pillar, `least` to 1e-7 rad beside."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-22, 22, (count, 2))
    edges = rng.integers(len(mesh.vertices) // 8 * 8, size=count)
    away = np.asarray(mesh.vertices)[edges, :2] - places
    beside = rng.choice([-1, 1], count) * 10.0 ** rng.uniform(np.log10(least), -7, count)
    return np.column_stack([places, np.arctan2(away[:, 1], away[:, 0]) + beside])


def exact_range_3d(origin, direction, triangles):
    """The least t at which a beam meets a triangle, in rational numbers, or None for a miss."""

    def dot(a, b):
        return sum(p * q for p, q in zip(a, b, strict=True))

    def cross(a, b):
        (ax, ay, az), (bx, by, bz) = a, b
        return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx

    o, d = ([Fraction(float(value)) for value in vector] for vector in (origin, direction))
    best = None
    for triangle in triangles.tolist():
        a, b, c = ([Fraction(v) - w for v, w in zip(corner, o, strict=True)] for corner in triangle)
        sides = dot(d, cross(a, b)), dot(d, cross(b, c)), dot(d, cross(c, a))
        if min(sides) < 0 < max(sides):
            continue
        normal = [x + y + z for x, y, z in zip(cross(a, b), cross(b, c), cross(c, a), strict=True)]
        if dot(normal, d) == 0:
            continue
        t = dot(normal, a) / dot(normal, d)
        if t >= 0 and (best is None or t < best):
            best = t
    return best


BEAM = LaserRangeFinder(0.0, 0.0, 1)


@pytest.mark.parametrize("far", [None, 1e7])
def test_level_beams_beside_corners_of_meshes_are_cast_exactly(far):
    mesh = pillars(1, far=far)
    caster = EmbreeCaster(mesh)
    poses = beside_corners(mesh, 2, 300, 1e-15)
    walls, faces = level_cut(np.asarray(mesh.triangles), BEAM.height)
    ranges, hits = caster.scan_batch(BEAM, poses)
    for k, pose in enumerate(poses):
        row, t = cast_exact(walls, pose[:2], BEAM.directions(pose)[0])
        beyond = t is None or t > BEAM.range_max
        assert ranges[k, 0] == (np.inf if beyond else float(t))
        assert hits[k, 0] == (-1 if beyond else faces[row])
        assert np.array_equal(caster.cast(BEAM, pose).ranges, ranges[k])
        assert np.array_equal(caster.cast_layers(BEAM, pose)[0][0], ranges[k])


@pytest.mark.parametrize("far", [None, 1e7])
def test_inclined_beams_beside_edges_of_meshes_meet_the_right_triangle(far):
    mesh = pillars(3, count=8, far=far)
    caster = EmbreeCaster(mesh)
    triangles = np.asarray(mesh.triangles)
    for k, pose in enumerate(beside_corners(mesh, 4, 60, 1e-12)):
        elevation = (1e-9, 0.02, -0.01, 0.1)[k % 4]
        ranges, _ = caster.cast_layers(BEAM, pose, [elevation])
        direction = layer_directions(BEAM, pose[2], [elevation])[0, 0]
        t = exact_range_3d([*pose[:2], BEAM.height], direction, triangles)
        expected = np.inf if t is None or t > BEAM.range_max else float(t)
        assert ranges[0, 0] == pytest.approx(expected, abs=1e-9)


def test_a_plane_cuts_triangles_where_they_meet_it():
    def cut(*corners):
        return level_cut(np.array([corners], dtype=float), 1.0)[0].tolist()

    assert cut((0, 0, 0), (4, 0, 0), (0, 0, 2)) == [[2, 0, 0, 0]]
    assert cut((0, 0, 1), (4, 0, 0), (4, 0, 2)) == [[4, 0, 0, 0]]
    assert cut((0, 0, 1), (4, 0, 1), (0, 0, 2)) == [[0, 0, 4, 0]]
    assert cut((0, 0, 1), (4, 0, 1), (0, 4, 1)) == []
    assert cut((0, 0, 1), (4, 0, 2), (0, 4, 2)) == []
    assert cut((0, 0, 2), (4, 0, 3), (0, 4, 2)) == []


def test_the_tree_of_walls_of_all_scales_is_no_deeper_than_casting_has_room_for():
    x = 10.0 ** np.arange(-150, 150)
    tree = build_tree(np.column_stack([x, -x, x, x]))
    assert sorted(tree.rows.tolist()) == list(range(300))
    depths = np.zeros(len(tree.links), np.int64)
    for node, (first, count) in enumerate(tree.links.tolist()):
        depths[first : first - count] = depths[node] + 1
        assert count <= LEAF
    assert FREE_LEVELS < depths.max() <= FREE_LEVELS + 11
