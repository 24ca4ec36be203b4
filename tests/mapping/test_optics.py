"""Glass and mirrors in maps of the default mapper."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from map_objects import map_of

import lrf3d
from lrf3d import LaserRangeFinder, LineMap, ProportionalNoise, World
from lrf3d.errors import InputError
from lrf3d.world import Material

ALONG = np.column_stack([np.linspace(0, 20, 60), np.zeros(60), np.zeros(60)])
LRF = LaserRangeFinder(-np.pi, np.pi, beams=361, range_max=40.0)
FURNITURE = [[3, 5, 4.2, 5.3], [4.2, 5.3, 4, 6.4], [4, 6.4, 2.8, 6.1], [2.8, 6.1, 3, 5]]


def world_of(walls, materials):
    return World(walls, range(len(walls)), materials=materials)


def mapped(world, poses):
    return lrf3d.simulate(world, poses, LRF, caster="planar", noise=ProportionalNoise(0.02), rng=0)


def round_trip(scans=60):
    """An ellipse in the middle of a room of 12 m by 8 m."""
    turn = np.linspace(2.5, 2.5 + 2.0 * np.pi, scans)
    x, y = 5.8 + 3.8 * np.cos(turn), 3.9 + 0.9 * np.sin(turn)
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    return np.column_stack([x, y, heading])


def mirror_hall():
    walls = [[0, 0, 12, 0], [12, 0, 12, 1.5], [12, 1.5, 12, 6.5], [12, 6.5, 12, 8]]
    walls += [[12, 8, 0, 8], [0, 8, 0, 6], [0, 6, 0, 2], [0, 2, 0, 0], *FURNITURE]
    materials = ["plaster", "brick", "mirror", "brick", "plaster", "brick", "mirror", "brick"]
    return world_of(walls, materials + ["brick"] * 4)


def glass_front():
    """A street, and on its left a room behind a front of glass between two of brick."""
    walls = [[-2, 4, 6, 4], [6, 4, 14, 4], [14, 4, 22, 4], [6, 4, 6, 10], [14, 10, 14, 4]]
    walls += [[6, 10, 14, 10], [-2, -3, 22, -3]]
    return world_of(walls, ["brick", "glass", *["brick"] * 5])


def off(segments, walls):
    """The distances of samples along segments (m, 4) from walls (n, 4)."""
    share = np.linspace(0.02, 0.98, 33)[:, None, None]
    points = segments[:, :2] + share * (segments[:, 2:] - segments[:, :2])
    lines = shapely.multilinestrings(shapely.linestrings(walls.reshape(-1, 2, 2)))
    return shapely.distance(shapely.points(points.reshape(-1, 2)), lines)


def test_a_front_of_glass_is_one_segment_that_is_marked():
    world = glass_front()
    run = mapped(world, ALONG)
    glass = run.map.segments[run.map.kinds == "glass"]
    assert len(glass) == 1
    # Its ends flash where the robot passes them, a kept scan every 0.68 m.
    assert np.sort(glass[0, [0, 2]]) == pytest.approx([6.0, 14.0], abs=0.68)
    assert glass[0, [1, 3]] == pytest.approx([4.0, 4.0], abs=0.05)
    assert off(run.map.segments, world.segments).max() < 0.1


def test_brick_in_place_of_the_glass_is_a_wall():
    world = glass_front()
    plain = World(world.segments, world.objects, materials=["brick"] * 7)
    run = mapped(plain, ALONG)
    assert (run.map.kinds == "wall").all()


def test_dark_cloth_metal_and_retro_reflectors_are_no_glass():
    walls = [[-2, 4, 22, 4], [22, -3, -2, -3], [4, 3, 6, 3], [9, 3, 11, 3], [14, 3, 16, 3]]
    materials = ["plaster", "plaster", "dark cloth", "metal", "retro-reflector"]
    run = mapped(world_of(walls, materials), ALONG)
    assert (run.map.kinds == "wall").all() and len(run.map) >= 5


def test_neither_the_unit_of_intensities_nor_the_order_of_the_beams_matters():
    run = lrf3d.simulate(glass_front(), ALONG[::2], LRF, caster="planar", rng=0)

    def other(scan):
        angles, ranges = scan.angles[::-1], scan.ranges[::-1]
        return replace(
            scan, angles=angles, ranges=ranges, intensities=7000.0 * scan.intensities[::-1]
        )

    usual, changed = map_of(run.scans), map_of(map(other, run.scans))
    assert (usual.kinds == "glass").sum() == 1
    assert np.array_equal(usual.kinds, changed.kinds)
    assert np.array_equal(usual.segments, changed.segments)


def test_a_hall_of_mirrors_has_its_walls_and_no_images():
    world = mirror_hall()
    run = mapped(world, round_trip())
    mirrors = run.map.segments[run.map.kinds == "mirror"]
    assert len(mirrors) == 2
    for x, low, high in ((0.0, 2.0, 6.0), (12.0, 1.5, 6.5)):
        own = mirrors[np.abs(mirrors[:, 0] - x) < 0.1][0]
        assert own[[0, 2]] == pytest.approx([x, x], abs=0.05)
        assert np.sort(own[[1, 3]]) == pytest.approx([low, high], abs=0.2)
    assert off(run.map.segments, world.segments).max() < 0.15


@pytest.mark.parametrize("materials", ["plaster", "mixed"])
def test_a_symmetrical_room_behind_a_door_is_no_image(materials):
    half = [[0, 0, 12, 0], [12, 8, 0, 8], [0, 8, 0, 0], *FURNITURE]
    walls = [*half, [12, 0, 12, 3], [12, 5, 12, 8]]
    walls += [[24 - x1, y1, 24 - x2, y2] for x1, y1, x2, y2 in half]
    kinds = ["plaster"] * len(walls)
    if materials == "mixed":
        kinds[2], kinds[4] = "brick", "dark cloth"
    world = world_of(walls, kinds)
    run = mapped(world, round_trip())
    assert (run.map.kinds == "wall").all()
    assert (run.map.segments[:, [0, 2]] > 20.0).any()
    assert off(run.map.segments, world.segments).max() < 0.3


def test_an_empty_square_room_has_no_mirrors():
    walls = [[0, 0, 12, 0], [12, 0, 12, 8], [12, 8, 0, 8], [0, 8, 0, 0]]
    run = mapped(world_of(walls, ["plaster", "brick", "plaster", "brick"]), round_trip())
    assert len(run.map) == 4 and (run.map.kinds == "wall").all()


def test_without_intensities_nothing_is_looked_for():
    run = lrf3d.simulate(mirror_hall(), round_trip(20), LRF, caster="planar", rng=0)
    dark = map_of(replace(scan, intensities=None) for scan in run.scans)
    assert (dark.kinds == "wall").all()


def test_kinds_are_kept_by_maps_runs_and_recordings(tmp_path):
    segments, objects = [[0, 0, 4, 0], [4, 0, 4, 3]], np.array([0, 0])
    line_map = LineMap(np.array(segments), objects, objects, ["wall", "glass"])
    lrf3d.save_map(line_map, tmp_path / "map.geojson")
    assert lrf3d.load_map(tmp_path / "map.geojson").kinds.tolist() == ["wall", "glass"]
    assert LineMap.empty().kinds.shape == (0,)
    assert LineMap(np.array(segments), objects, objects).kinds.tolist() == ["wall", "wall"]
    with pytest.raises(InputError, match="expected wall, glass, mirror"):
        LineMap(np.array(segments), objects, objects, ["wall", "door"])
    simulation = lrf3d.Simulation(glass_front(), ALONG[::2], LRF, caster="planar", rng=0)
    kept = lrf3d.record(simulation, tmp_path / "run.npz")
    run = lrf3d.simulate(glass_front(), ALONG[::2], LRF, caster="planar", rng=0)
    assert (run.map.kinds == "glass").any()
    assert np.array_equal(kept.map.kinds, run.map.kinds)
    lrf3d.save_run(run, tmp_path / "saved.npz")
    assert np.array_equal(lrf3d.load_run(tmp_path / "saved.npz").map.kinds, run.map.kinds)


def test_a_mirror_that_reflects_all_light_is_taken_for_a_room():
    world = mirror_hall()
    perfect = Material("perfect mirror", specular=1.0)
    materials = [perfect if one.name == "mirror" else one for one in world.materials]
    run = mapped(World(world.segments, world.objects, materials=materials), round_trip(40))
    assert (run.map.kinds != "mirror").all()
