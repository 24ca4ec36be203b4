"""Beams that mirrors turn, as they are drawn."""

import numpy as np
import pytest
import shapely

import lrf3d
from lrf3d.geometry import lengths
from lrf3d.laser import LaserRangeFinder
from lrf3d.scene.beams import RANGE_COLOURS, DrawnBeams, turning_walls
from lrf3d.scene.look import GLASS_COLOUR, MIRROR_COLOUR, RETRO_COLOUR, object_colours

WALLS = [[0, 0, 12, 0], [12, 0, 12, 8], [12, 8, 0, 8], [0, 8, 0, 0], [4, 1, 5, 2.5]]


def hall(*materials):
    return lrf3d.World(WALLS, range(5), materials=materials)


def drawn(world, pose=(7.0, 4.0, 0.3)):
    lrf = LaserRangeFinder(-np.pi, np.pi, 181)
    scan = lrf3d.PlanarCaster(world).cast(lrf, pose)
    beams = DrawnBeams.from_scan(scan, world.segments, np.array(pose[:2]), turning_walls(world))
    return scan, beams


def off_walls(points):
    """How far (n,) points (n, 2) lie off the nearest wall."""
    walls = shapely.multilinestrings(np.reshape(WALLS, (-1, 2, 2)))
    return shapely.distance(shapely.points(points), walls)


def test_points_lie_on_the_walls_that_mirrors_show():
    scan, beams = drawn(hall("plaster", "mirror", "plaster", "mirror", "brick"))
    assert np.count_nonzero(scan.hits) == len(beams.points) > 150
    assert off_walls(beams.points).max() < 1e-9
    assert off_walls(beams.legs[scan.hits[beams.beams], 2:]).max() < 1e-9
    whole = np.bincount(beams.beams, lengths(beams.legs))
    assert whole[scan.hits] == pytest.approx(scan.ranges[scan.hits], abs=1e-9)
    assert np.bincount(beams.beams).max() >= 4
    assert (beams.gone + lengths(beams.legs)).max() == pytest.approx(whole.max())
    straight = drawn(hall("plaster", "plaster", "plaster", "plaster", "brick"))[1]
    assert len(beams.single(0.5, 80.0).starts) > len(straight.single(0.5, 80.0).starts)
    assert len(beams.glow(0.5, indoor=True).corners)


def test_points_are_coloured_by_their_intensity_if_asked():
    scan, beams = drawn(hall("plaster", "mirror", "retro-reflector", "dark cloth", "brick"))
    by_range, by_light = (beams.hit_points(0.5, 80.0, by=by) for by in ("range", "intensity"))
    assert np.array_equal(by_range.places, by_light.places)
    assert np.array_equal(by_range.sides, by_light.sides)
    lights, colours = scan.intensities[scan.hits], by_light.colours[:, :3]
    assert (colours[lights >= 1.0] == RANGE_COLOURS[0].astype(np.float32)).all()
    assert lights.max() > 1.0 and len(np.unique(colours, axis=0)) > 50
    # From yellow to purple the green of the colours falls all the way to red.
    order = np.argsort(-lights)
    assert (np.diff(colours[order, 1][lights[order] > 1e-3]) <= 1e-6).all()
    bare = drawn(lrf3d.World(WALLS, range(5)))[1]
    one, other = (bare.hit_points(0.5, 80.0, by=by) for by in ("intensity", "range"))
    assert np.array_equal(one.colours, other.colours)


def test_only_mirrors_turn_beams():
    assert not turning_walls(lrf3d.load_world("paper_room")).any()
    optics = turning_walls(hall("glass", "mirror", None, "brick", "metal"))
    assert optics.tolist() == [False, True, False, False, False]


def test_mirrors_glass_and_retro_reflectors_have_their_colours():
    world = hall("glass", "mirror", "retro-reflector", "brick", None)
    colours = object_colours(world, indoor=True)
    assert colours[:3] == pytest.approx(np.array([GLASS_COLOUR, MIRROR_COLOUR, RETRO_COLOUR]))
    own = lrf3d.World(WALLS, range(5), materials=["mirror"] * 5, colours=[[0.1, 0.2, 0.3]] * 5)
    assert object_colours(own, indoor=True)[0] == pytest.approx([0.1, 0.2, 0.3])
