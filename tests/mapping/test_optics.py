"""Glass and mirrors in maps of the default mapper."""

from dataclasses import replace

import numpy as np
import pytest

import lrf3d
from lrf3d import LaserRangeFinder, LineMap, LineMapper, ProportionalNoise, World
from lrf3d.errors import InputError
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.mapping.robust.mirrors import (
    Reflectance,
    images,
    mirror_lines,
    mirrored,
    without_images,
)
from lrf3d.mapping.robust.optics import Optics
from lrf3d.mapping.robust.pane_stretches import frames, stretches
from lrf3d.world import Material

LRF = LaserRangeFinder(-np.pi, np.pi, beams=361, range_max=40.0)
FURNITURE = [[3, 5, 4.2, 5.3], [4.2, 5.3, 4, 6.4], [4, 6.4, 2.8, 6.1], [2.8, 6.1, 3, 5]]


def world_of(walls, materials):
    return World(walls, range(len(walls)), materials=materials)


def mapped(world, poses, lrf=LRF, sigma=0.02):
    mapper = LineMapper()
    noise = ProportionalNoise(sigma)
    run = lrf3d.simulate(world, poses, lrf, caster="planar", noise=noise, mapper=mapper, rng=0)
    return run, mapper


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
    """The largest distance of samples of each segment (m, 4) from walls (n, 4)."""
    share = np.linspace(0.02, 0.98, 33)[:, None]
    found = []
    for own in segments:
        points = own[:2] + share * (own[2:] - own[:2])
        nearest = np.full(len(points), np.inf)
        for x1, y1, x2, y2 in walls:
            along = np.array([x2 - x1, y2 - y1])
            place = np.clip((points - (x1, y1)) @ along / (along @ along), 0.0, 1.0)
            apart = points - (x1, y1) - place[:, None] * along
            nearest = np.minimum(nearest, np.hypot(apart[:, 0], apart[:, 1]))
        found.append(nearest.max())
    return np.array(found)


def test_a_front_of_glass_is_one_segment_that_is_marked():
    poses = np.column_stack([np.linspace(0, 20, 60), np.zeros(60), np.zeros(60)])
    world = glass_front()
    run, _ = mapped(world, poses)
    glass = run.map.segments[run.map.kinds == "glass"]
    assert len(glass) == 1
    # Its ends flash where the robot passes them, a scan every 0.34 m.
    assert np.sort(glass[0, [0, 2]]) == pytest.approx([6.0, 14.0], abs=0.4)
    assert glass[0, [1, 3]] == pytest.approx([4.0, 4.0], abs=0.05)
    assert off(run.map.segments, world.segments).max() < 0.1


def test_brick_in_place_of_the_glass_is_a_wall():
    poses = np.column_stack([np.linspace(0, 20, 60), np.zeros(60), np.zeros(60)])
    world = glass_front()
    plain = World(world.segments, world.objects, materials=["brick"] * 7)
    run, _ = mapped(plain, poses)
    assert (run.map.kinds == "wall").all()


def test_dark_cloth_metal_and_retro_reflectors_are_no_glass():
    walls = [[-2, 4, 22, 4], [22, -3, -2, -3], [4, 3, 6, 3], [9, 3, 11, 3], [14, 3, 16, 3]]
    materials = ["plaster", "plaster", "dark cloth", "metal", "retro-reflector"]
    poses = np.column_stack([np.linspace(0, 20, 60), np.zeros(60), np.zeros(60)])
    run, _ = mapped(world_of(walls, materials), poses)
    assert (run.map.kinds == "wall").all() and len(run.map) >= 5


def test_intensities_need_no_calibration():
    poses = np.column_stack([np.linspace(0, 20, 30), np.zeros(30), np.zeros(30)])
    run = lrf3d.simulate(glass_front(), poses, LRF, caster="planar", rng=0)
    maps = []
    for unit in (1.0, 7000.0):
        mapper = LineMapper()
        for scan in run.scans:
            mapper.update(replace(scan, intensities=unit * scan.intensities))
        maps.append(mapper.map)
    assert (maps[0].kinds == "glass").sum() == 1
    assert np.array_equal(maps[0].kinds, maps[1].kinds)


def test_a_hall_of_mirrors_has_its_walls_and_no_images():
    world = mirror_hall()
    run, _ = mapped(world, round_trip())
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
    run, _ = mapped(world, round_trip())
    assert (run.map.kinds == "wall").all()
    assert (run.map.segments[:, [0, 2]] > 20.0).any()
    assert off(run.map.segments, world.segments).max() < 0.3


def test_an_empty_square_room_has_no_mirrors():
    walls = [[0, 0, 12, 0], [12, 0, 12, 8], [12, 8, 0, 8], [0, 8, 0, 0]]
    run, _ = mapped(world_of(walls, ["plaster", "brick", "plaster", "brick"]), round_trip())
    assert len(run.map) == 4 and (run.map.kinds == "wall").all()


def test_without_intensities_nothing_is_looked_for():
    mapper = LineMapper()
    run = lrf3d.simulate(mirror_hall(), round_trip(20), LRF, caster="planar", rng=0)
    for scan in run.scans:
        mapper.update(replace(scan, intensities=None))
    assert (mapper.map.kinds == "wall").all()


def test_the_order_of_the_beams_does_not_matter():
    poses = np.column_stack([np.linspace(0, 20, 30), np.zeros(30), np.zeros(30)])
    run = lrf3d.simulate(glass_front(), poses, LRF, caster="planar", rng=0)
    ahead, back = LineMapper(), LineMapper()
    for scan in run.scans:
        ahead.update(scan)
        turned = {name: getattr(scan, name)[::-1] for name in ("angles", "ranges", "intensities")}
        back.update(replace(scan, **turned))
    assert np.array_equal(ahead.map.segments, back.map.segments)


def test_kinds_are_kept_by_maps_runs_and_recordings(tmp_path):
    segments, objects = [[0, 0, 4, 0], [4, 0, 4, 3]], np.array([0, 0])
    line_map = LineMap(np.array(segments), objects, objects, ["wall", "glass"])
    lrf3d.save_map(line_map, tmp_path / "map.geojson")
    assert lrf3d.load_map(tmp_path / "map.geojson").kinds.tolist() == ["wall", "glass"]
    assert LineMap.empty().kinds.shape == (0,)
    assert LineMap(np.array(segments), objects, objects).kinds.tolist() == ["wall", "wall"]
    with pytest.raises(InputError, match="expected wall, glass, mirror"):
        LineMap(np.array(segments), objects, objects, ["wall", "door"])
    poses = np.column_stack([np.linspace(0, 20, 30), np.zeros(30), np.zeros(30)])
    simulation = lrf3d.Simulation(glass_front(), poses, LRF, caster="planar", rng=0)
    kept = lrf3d.record(simulation, tmp_path / "run.npz")
    run = lrf3d.simulate(glass_front(), poses, LRF, caster="planar", rng=0)
    assert (run.map.kinds == "glass").any()
    assert np.array_equal(kept.map.kinds, run.map.kinds)
    lrf3d.save_run(run, tmp_path / "saved.npz")
    assert np.array_equal(lrf3d.load_run(tmp_path / "saved.npz").map.kinds, run.map.kinds)


def test_walls_and_their_images_give_the_mirror():
    rng = np.random.default_rng(1)
    for _ in range(50):
        angle, place = rng.uniform(-np.pi, np.pi), rng.uniform(-3, 3, 2)
        normal = np.array([np.cos(angle), np.sin(angle)])
        line = np.array([*normal, normal @ place - 3.0])
        real = place + rng.uniform(-2, 2, (2, 2))
        if abs((real[1] - real[0]) @ normal) < 0.3 * np.hypot(*(real[1] - real[0])):
            continue
        image = mirrored(real, line)[::-1]
        lines = mirror_lines(place, image.reshape(1, 4), real.reshape(1, 4))
        assert len(lines) <= 1
        if np.hypot(*(real[1] - real[0])) > 0.1 and len(lines):
            assert lines[0] == pytest.approx(line, abs=1e-9)


def test_images_are_taken_off_walls_that_go_on_in_them():
    walls = np.array([[0, 0, 24, 0], [24, 0, 24, 8], [24, 8, 0, 8], [0, 8, 0, 0], [13, 3, 15, 4.0]])
    left, rows = without_images(walls, np.array([[-1.0, 0.0, -12.0]]), walls)
    assert rows.tolist() == [0, 2, 3, 4]
    assert left[0] == pytest.approx([0, 0, 12, 0], abs=0.3)
    assert left[1] == pytest.approx([12, 8, 0, 8], abs=0.3)


def test_what_a_mirror_leaves_of_an_image_is_kept_if_it_is_long_enough():
    walls = np.array([[0, 0, 12, 0], [11.9, 0, 24, 0], [11, 0, 24, 0.0]])
    _, rows = without_images(walls, np.array([[-1.0, 0.0, -12.0]]), walls[:1])
    assert rows.tolist() == [0, 2]


def test_images_are_recognised_by_walls_whose_brightness_is_known():
    world, line = mirror_hall(), np.array([-1.0, 0.0, -12.0])
    real = world.segments[[kind.name != "mirror" for kind in world.materials]]
    noise, found = RangeNoise(0.02, 0.0), 0
    for scan in lrf3d.simulate(world, round_trip(12), LRF, caster="planar", rng=0).scans:
        optics = Optics(LikelihoodExtractor(2.5, 0.04, 0.01))
        beams = optics.look(scan, tuple(scan.pose[:2]), scan.pose.theta, noise).beams
        optics.mirrors.update(beams, np.empty((0, 4)), real)
        found += images(beams, line, real, optics.mirrors.known) is not None
        assert images(beams, line, real, Reflectance()) is None
    assert found > 3


def test_glass_ends_where_beams_end_on_something_opaque_or_would_have_flashed():
    pieces, reach = np.zeros((20, 5), np.int64), np.full((20, 2), (np.inf, -np.inf))
    for row in (1, 2, 5, 6, 9, 10, 11, 15, 16, 17):
        pieces[row], reach[row] = (1, 1, 4, 0, 0), (0.25 * row, 0.25 * row + 0.2)
    pieces[3:5, 2] = 5
    pieces[7:9, 3] = 5
    pieces[12:15, [2, 4]] = 5
    want = np.array([[0.25, 1.7], [2.25, 2.95], [3.75, 4.45]])
    assert np.array(stretches(pieces, reach, np.empty(0))) == pytest.approx(want)
    pieces[:, 3] += 9
    assert stretches(pieces, reach, np.empty(0)) == []


def test_glass_goes_on_where_beams_pass_until_a_wall_meets_it():
    pieces, reach = np.zeros((80, 5), np.int64), np.full((80, 2), (np.inf, -np.inf))
    pieces[:, 2] = 6
    for row in (4, 5, 70, 71):
        pieces[row, :2], reach[row] = 2, (0.25 * row, 0.25 * row + 0.2)
    whole = [(pytest.approx(1.0), pytest.approx(17.95))]
    # A single beam that ends in front of it is no wall, nor is a wall where the glass ends.
    pieces[30, 2:4] = 1
    assert stretches(pieces, reach, np.array([0.9, 18.1, 1.2])) == whole
    assert stretches(pieces, reach, np.array([9.0])) == []
    pieces[40:44, 3] = 4
    assert stretches(pieces, reach, np.empty(0)) == []


def test_walls_meet_a_line_where_they_end_on_it_or_cross_it():
    walls = np.array([[2, 0.1, 2, 5], [4, -3, 6, 3], [7, 2, 7, 9], [8, 0.05, 11, 0.1]])
    found = frames(np.array([1.0, 0.0]), np.array([1.0, 0.0]), walls)
    assert found.tolist() == pytest.approx([1.0, 4.0])


def test_reflectance_is_the_mean_in_a_cell():
    known = Reflectance()
    assert np.isnan(known.at(np.zeros((1, 2)))).all()
    known.add(np.array([[0.1, 0.1], [5.1, -3.1], [0.2, 0.2]]), np.array([0.2, 0.5, 0.4]))
    known.add(np.array([[-7.1, 0.1]]), np.array([0.9]))
    places = np.array([[0.05, 0.05], [5.2, -3.2], [-7.05, 0.2], [9.0, 9.0]])
    assert known.at(places)[:3] == pytest.approx([0.3, 0.5, 0.9])
    assert np.isnan(known.at(places)[3])


def test_a_mirror_that_reflects_all_light_is_taken_for_a_room():
    world = mirror_hall()
    perfect = Material("perfect mirror", specular=1.0)
    materials = [perfect if one.name == "mirror" else one for one in world.materials]
    run, _ = mapped(World(world.segments, world.objects, materials=materials), round_trip(40))
    assert (run.map.kinds != "mirror").all()
