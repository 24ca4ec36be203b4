"""The sun's shade on walls and roofs, against rays to the sun from points on them."""

import numpy as np
import pytest
import shapely
from test_render import box

from lrf3d.geometry import directions, lengths
from lrf3d.scene.look import SUN
from lrf3d.scene.shadows import shade_roofs, shade_walls
from lrf3d.scene.structures import Structures
from lrf3d.scene.walls import wall_sides
from lrf3d.world import World


def crowded_world(seed, count=40):
    """Houses of all sorts, close to each other, some turned, some shaped like an L, and fences."""
    rng = np.random.default_rng(seed)
    shapes = (
        [[0, 0], [1, 0], [1, 1], [0.4, 1], [0.4, 0.5], [0, 0.5]],
        np.array(box(0, 0, 1, 1))[:, :2],
    )
    walls = []
    for number in range(count):
        corners = shapes[number % 3 > 0] * rng.uniform([5.0, 5.0], [11.0, 10.0])
        turn = rng.uniform(-0.3, 0.3)
        corners = corners @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
        corners += [13.0 * (number % 7), 12.0 * (number // 7)]
        fence = number % 5 == 0
        walls.append(np.hstack([corners, np.roll(corners, -1, axis=0)])[: len(corners) - fence])
    sizes = [len(each) for each in walls]
    objects, heights = np.repeat(np.arange(count), sizes), rng.uniform(1.0, 18.0, count)
    return World(np.concatenate(walls), objects, heights[objects])


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


def shaded(structures):
    """The sides of walls (n, 4), and the strips in which the edge of their shadow is straight."""
    _, segments = wall_sides(structures)
    return segments, shade_walls(structures, segments)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_walls_are_shaded_where_a_ray_to_the_sun_is_stopped(seed):
    structures = Structures.from_world(crowded_world(seed))
    segments, strips = shaded(structures)
    along = directions(segments)[strips.face]
    sunny = along[:, 1] * SUN[0] - along[:, 0] * SUN[1] > 0.05
    heights = structures.heights[wall_sides(structures)[0]][strips.face]
    # Points on all faces, with the shadow's edge between those at the ends of its strip.
    rng = np.random.default_rng(seed)
    for share in rng.uniform(0.01, 0.99, 8):
        up = rng.uniform(0.01, 0.99, len(heights)) * heights
        place = strips.start + share * (strips.end - strips.start)
        points = segments[strips.face, :2] + place[:, None] * along
        points = np.column_stack([points + 0.001 * SUN[:2], up])[sunny]
        under = (strips.low + share * (strips.high - strips.low) - up)[sunny]
        dark, bright = judged(structures, points)
        assert dark.mean() > 0.03 and bright.mean() > 0.3 and (dark | bright).mean() > 0.85
        assert (under[dark] > -0.1).all() and (under[bright] < 0.1).all()


def test_strips_cover_their_walls_and_join_without_a_gap():
    structures = Structures.from_world(crowded_world(4))
    segments, strips = shaded(structures)
    assert len(strips.face) > len(segments)
    order = np.lexsort([strips.start, strips.face])
    face, start, end = (column[order] for column in strips[:3])
    same = face[1:] == face[:-1]
    assert np.array_equal(end[:-1][same], start[1:][same])
    assert (start[np.append(True, ~same)] == 0.0).all()
    assert end[np.append(~same, True)] == pytest.approx(lengths(segments), abs=1e-6)


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
