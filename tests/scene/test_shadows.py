"""The sun's shade on walls and roofs, against rays to the sun from points on them."""

import numpy as np
import pytest
import shapely
from test_render import box, room_run

from lrf3d.scene.look import SUN
from lrf3d.scene.shadows import LIT, shade_quads, shade_roofs
from lrf3d.scene.structures import Structures
from lrf3d.scene.walls import wall_quads
from lrf3d.world import World


def crowded_world(seed, count=40):
    """Houses of all sorts, close to each other, some turned, some shaped like an L, and fences."""
    rng = np.random.default_rng(seed)
    segments, objects, heights = [], [], []
    for number in range(count):
        x, y = 13.0 * (number % 7), 12.0 * (number // 7)
        width, depth, turn = rng.uniform(5, 11), rng.uniform(5, 10), rng.uniform(-0.3, 0.3)
        corners = np.array([[0, 0], [1, 0], [1, 1], [0.4, 1], [0.4, 0.5], [0, 0.5]])
        if number % 3:
            corners = (
                corners[[0, 1, 2]] * [1, 1] if number % 5 == 0 else np.array(box(0, 0, 1, 1))[:, :2]
            )
        corners = corners * [width, depth]
        cos, sin = np.cos(turn), np.sin(turn)
        corners = corners @ np.array([[cos, sin], [-sin, cos]]) + [x, y]
        walls = np.hstack([corners, np.roll(corners, -1, axis=0)])
        walls = walls[:-1] if number % 5 == 0 else walls
        segments.append(walls)
        objects += [number] * len(walls)
        heights += [rng.uniform(1.0, 18.0)] * len(walls)
    return World(np.concatenate(segments), np.array(objects), np.array(heights))


def hidden(structures, points, margin):
    """Whether something lies between points (n, 3) and the sun; None's part is up to a margin."""
    level = np.hypot(*SUN[:2])
    toward, slope = SUN[:2] / level, SUN[2] / level
    start = structures.segments[None, :, :2] - points[:, None, :2]
    along = (structures.segments[:, 2:] - structures.segments[:, :2])[None]
    cross = toward[0] * along[..., 1] - toward[1] * along[..., 0]
    away = (start[..., 0] * along[..., 1] - start[..., 1] * along[..., 0]) / cross
    place = (start[..., 0] * toward[1] - start[..., 1] * toward[0]) / cross
    over = structures.heights - points[:, 2:3] - slope * away
    met = (away > 0.02 - margin) & (place > -margin) & (place < 1.0 + margin) & (over > -margin)
    return met.any(axis=1)


def judged(structures, points):
    """Which points are surely hidden, and which surely not, however a rim is rounded."""
    return hidden(structures, points, -0.01), ~hidden(structures, points, 0.01)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_walls_are_shaded_where_a_ray_to_the_sun_is_stopped(seed):
    structures = Structures.from_world(crowded_world(seed))
    quads = wall_quads(structures)[0]
    faces, _ = shade_quads(structures, quads)
    upright = (faces[:, 0, 5] == 0.0) & (faces[:, 0, 3:5] @ SUN[:2] > 0.05)
    faces = faces[upright].astype(float)
    # Points on all faces, with the shade between that of their corners.
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(0.01, 0.99, (2, len(faces), 8, 1))
    corners = faces[:, None]
    below = (1 - u) * corners[:, :, 0] + u * corners[:, :, 1]
    above = (1 - u) * corners[:, :, 3] + u * corners[:, :, 2]
    rows = ((1 - v) * below + v * above).reshape(-1, 15)
    dark, bright = judged(structures, rows[:, :3] + [*0.001 * SUN[:2], 0.0])
    assert dark.mean() > 0.05 and bright.mean() > 0.3 and (dark | bright).mean() > 0.9
    assert (rows[dark, 14] > -0.1).all()
    assert (rows[bright, 14] < 0.1).all()
    assert rows[:, 7] == pytest.approx(rows[:, 2], abs=1e-4)


def test_cut_walls_cover_what_they_did():
    structures = Structures.from_world(crowded_world(4))
    quads = wall_quads(structures)[0]
    faces, origin = shade_quads(structures, quads)
    assert len(faces) > len(quads)
    lengths = np.hypot(*(faces[:, 1, :2] - faces[:, 0, :2]).astype(float).T)
    whole = np.hypot(*(quads[:, 1, :2] - quads[:, 0, :2]).astype(float).T)
    assert np.bincount(origin, lengths, len(quads)) == pytest.approx(whole, abs=1e-3)
    assert np.array_equal(faces[:, 0, 8:14], quads[origin, 0, 8:14])
    # Neighbouring strips share their corners to the last bit.
    for number in np.unique(origin[np.bincount(origin, minlength=len(quads))[origin] > 1]):
        strips = faces[origin == number]
        strips = strips[np.argsort(strips[:, 0, 6])]
        assert np.array_equal(strips[:-1, 1, :3], strips[1:, 0, :3])
        assert np.array_equal(strips[:-1, 2, :3], strips[1:, 3, :3])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_roofs_are_shaded_where_a_ray_to_the_sun_is_stopped(seed):
    structures = Structures.from_world(crowded_world(seed))
    polygons, solids, under = shade_roofs(structures)
    rng = np.random.default_rng(seed)
    area = np.zeros(len(structures.solids))
    np.add.at(area, solids, shapely.area(polygons))
    assert area == pytest.approx(shapely.area(structures.solids), abs=1e-2)
    seen = [0, 0]
    for polygon, solid, shade in zip(polygons, solids, under, strict=True):
        low, high = np.array(polygon.bounds).reshape(2, 2)
        places = rng.uniform(low, high, (40, 2))
        inner = shapely.contains_xy(shapely.buffer(polygon, -0.05), places)
        points = np.column_stack([places, np.full(40, structures.solid_heights[solid])])[inner]
        if not len(points):
            continue
        dark, bright = judged(structures, points)
        assert not (dark if shade < 0.0 else bright).any()
        seen[int(shade > 0.0)] += len(points)
    assert min(seen) > 20


def test_indoors_there_is_no_sun():
    structures = Structures.from_run(room_run())
    faces, _ = shade_quads(structures, wall_quads(structures)[0])
    assert (faces[:, :, 14] == LIT).all()
