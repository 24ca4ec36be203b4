"""Beams that mirrors turn, as they are drawn."""

import numpy as np
import pytest
import shapely

import lrf3d
from lrf3d.geometry import lengths
from lrf3d.laser import LaserRangeFinder, beam_directions
from lrf3d.scene.beams import RANGE_COLOURS, _lamp, draw_beams, folded, turning_walls
from lrf3d.scene.look import MATERIAL_COLOURS, object_colours

WALLS = [[0, 0, 12, 0], [12, 0, 12, 8], [12, 8, 0, 8], [0, 8, 0, 0], [4, 1, 5, 2.5]]


def hall(*materials):
    return lrf3d.World(WALLS, range(5), materials=materials)


POSE = (7.0, 4.0, 0.3)


def drawn(world, by="range"):
    scan = lrf3d.PlanarCaster(world).cast(LaserRangeFinder(-np.pi, np.pi, 181), POSE)
    walls, place = world.segments, np.array(POSE[:2])
    shape = {"height": 0.5, "reach": 80.0, "by": by}
    return scan, *draw_beams(scan, walls, walls[turning_walls(world)], place, **shape)[:2]


def off_walls(points):
    """How far (n,) points (n, 2) lie off the nearest wall."""
    walls = shapely.multilinestrings(np.reshape(WALLS, (-1, 2, 2)))
    return shapely.distance(shapely.points(points), walls)


def test_points_lie_on_the_walls_that_mirrors_show():
    world = hall("plaster", "mirror", "plaster", "mirror", "brick")
    scan, lines, points = drawn(world)
    assert np.count_nonzero(scan.hits) == len(points.places) > 150
    assert off_walls(points.places[:, :2]).max() < 1e-5
    ends = POSE[:2] + scan.ranges[scan.hits, None] * beam_directions(
        POSE[2], scan.angles[scan.hits]
    )
    legs, beams, gone = folded(np.array(POSE[:2]), ends, world.segments[turning_walls(world)])
    assert off_walls(legs[:, 2:]).max() < 1e-9
    assert np.bincount(beams, lengths(legs)) == pytest.approx(scan.ranges[scan.hits], abs=1e-9)
    assert np.bincount(beams).max() >= 4
    assert (gone + lengths(legs)).max() == pytest.approx(scan.ranges[scan.hits].max())
    _, straight, _ = drawn(hall("plaster", "plaster", "plaster", "plaster", "brick"))
    assert len(lines.starts) > len(straight.starts)


def test_points_are_coloured_by_their_intensity_if_asked():
    world = hall("plaster", "mirror", "retro-reflector", "dark cloth", "brick")
    (scan, _, by_range), (_, _, by_light) = (drawn(world, by) for by in ("range", "intensity"))
    assert np.array_equal(by_range.places, by_light.places)
    assert np.array_equal(by_range.sides, by_light.sides)
    lights, colours = scan.intensities[scan.hits], by_light.colours[:, :3]
    assert (colours[lights >= 1.0] == RANGE_COLOURS[0].astype(np.float32)).all()
    assert lights.max() > 1.0 and len(np.unique(colours, axis=0)) > 50
    # From yellow to purple the green of the colours falls all the way to red.
    order = np.argsort(-lights)
    assert (np.diff(colours[order, 1][lights[order] > 1e-3]) <= 1e-6).all()
    bare = lrf3d.World(WALLS, range(5))
    (_, _, one), (_, _, other) = (drawn(bare, by) for by in ("intensity", "range"))
    assert np.array_equal(one.colours, other.colours)


def test_mirrors_glass_and_retro_reflectors_have_their_colours():
    world = hall("glass", "mirror", "retro-reflector", "brick", None)
    assert turning_walls(world).tolist() == [False, True, False, False, False]
    colours, kinds = object_colours(world, indoor=True), ("glass", "mirror", "retro")
    assert colours[:3] == pytest.approx(np.array([MATERIAL_COLOURS[kind] for kind in kinds]))
    own = lrf3d.World(WALLS, range(5), materials=["mirror"] * 5, colours=[[0.1, 0.2, 0.3]] * 5)
    assert object_colours(own, indoor=True)[0] == pytest.approx([0.1, 0.2, 0.3])


def test_the_lamp_fades_to_nothing_at_its_reach_and_at_the_sides():
    angles = np.linspace(-1.0, 1.0, 9)
    legs = np.hstack([np.zeros((9, 2)), 20.0 * beam_directions(0.0, angles)])
    lamp = _lamp(legs, angles, 5.0)
    away, light = np.hypot(*lamp.corners[..., :2].T).T, lamp.colours[..., 3]
    assert away[:, 0] == pytest.approx(0.0) and away[:, 1:] == pytest.approx(5.0)
    assert light[:, 1:] == pytest.approx(0.0) and light[:, 0].max() > 0.1
    assert light[-1, 0] == pytest.approx(0.0)
    near = _lamp(np.hstack([legs[:, :2], legs[:, 2:] / 8.0]), angles, 5.0).colours[..., 3]
    assert near[3, 1] == pytest.approx(0.25 * near[3, 0])
