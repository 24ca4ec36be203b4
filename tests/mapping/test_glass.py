"""Glass and mirrors in maps of the default mapper."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import shapely
from map_objects import map_of
from synthetic_run import box

import lrf3d
from lrf3d import LaserRangeFinder, LineMap, ProportionalNoise, World
from lrf3d.base.errors import InputError, Lrf3dWarning
from lrf3d.mapping.glass.optics import Optics, image_lines
from lrf3d.mapping.glass.surfaces import IS_GLASS, IS_MIRROR
from lrf3d.world import Material

ALONG = np.column_stack([np.linspace(0, 20, 60), np.zeros(60), np.zeros(60)])
LRF = LaserRangeFinder(-np.pi, np.pi, beams=361, range_max=40.0)
FURNITURE = [[3, 5, 4.2, 5.3], [4.2, 5.3, 4, 6.4], [4, 6.4, 2.8, 6.1], [2.8, 6.1, 3, 5]]


def world_of(walls, materials):
    return World(walls, range(len(walls)), materials=materials)


def mapped(world, poses, noise=0.02):
    noise = ProportionalNoise(noise)
    return lrf3d.simulate(world, poses, LRF, caster="planar", noise=noise, rng=0)


def round_trip(scans=60):
    """An ellipse in the middle of a room of 12 m by 8 m."""
    turn = np.linspace(2.5, 2.5 + 2.0 * np.pi, scans)
    x, y = 5.8 + 3.8 * np.cos(turn), 3.9 + 0.9 * np.sin(turn)
    return np.column_stack([x, y, np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))])


def mirror_hall(mirror="mirror"):
    walls = [[0, 0, 12, 0], [12, 0, 12, 1.5], [12, 1.5, 12, 6.5], [12, 6.5, 12, 8]]
    walls += [[12, 8, 0, 8], [0, 8, 0, 6], [0, 6, 0, 2], [0, 2, 0, 0], *FURNITURE]
    materials = ["plaster", "brick", mirror, "brick", "plaster", "brick", mirror, "brick"]
    return world_of(walls, materials + ["brick"] * 4)


def glass_front(glass="glass"):
    """A street, and on its left a room behind a front of glass between two of brick."""
    walls = [[-2, 4, 6, 4], [6, 4, 14, 4], [14, 4, 22, 4], [6, 4, 6, 10], [14, 10, 14, 4]]
    walls += [[6, 10, 14, 10], [-2, -3, 22, -3]]
    return world_of(walls, ["brick", glass, *["brick"] * 5])


def off(segments, walls):
    """The largest distance of samples along segments (m, 4) from walls (n, 4)."""
    share = np.linspace(0.02, 0.98, 33)[:, None, None]
    points = segments[:, :2] + share * (segments[:, 2:] - segments[:, :2])
    lines = shapely.multilinestrings(shapely.linestrings(walls.reshape(-1, 2, 2)))
    return shapely.distance(shapely.points(points.reshape(-1, 2)), lines).max()


def test_a_front_of_glass_is_one_segment_that_is_marked():
    world = glass_front()
    run = mapped(world, ALONG)
    (glass,) = run.map.segments[run.map.kinds == "glass"]
    # Its ends flash where the robot passes them, a kept scan every 0.68 m.
    assert np.sort(glass[[0, 2]]) == pytest.approx([6.0, 14.0], abs=0.68)
    assert glass[[1, 3]] == pytest.approx([4.0, 4.0], abs=0.05)
    assert off(run.map.segments, world.segments) < 0.1


def test_neither_the_unit_of_intensities_nor_the_order_of_the_beams_matters():
    run = mapped(glass_front(), ALONG[::2], 0.0)

    def other(scan):
        light = 7000.0 * scan.intensities[::-1]
        return replace(scan, angles=scan.angles[::-1], ranges=scan.ranges[::-1], intensities=light)

    usual, changed = map_of(run.scans), map_of(map(other, run.scans))
    assert (usual.kinds == "glass").sum() == 1
    assert np.array_equal(usual.kinds, changed.kinds)
    assert np.array_equal(usual.segments, changed.segments)


def test_a_hall_of_mirrors_has_its_walls_and_no_images():
    world = mirror_hall()
    run = mapped(world, round_trip())
    mirrors = run.map.segments[run.map.kinds == "mirror"]
    left, right = mirrors[np.argsort(mirrors[:, 0])]
    for own, x, low, high in ((left, 0.0, 2.0, 6.0), (right, 12.0, 1.5, 6.5)):
        assert own[[0, 2]] == pytest.approx([x, x], abs=0.05)
        assert np.sort(own[[1, 3]]) == pytest.approx([low, high], abs=0.2)
    assert off(run.map.segments, world.segments) < 0.15


def two_rooms(*materials):
    """A room, and its mirror image behind a door."""
    half = [[0, 0, 12, 0], [12, 8, 0, 8], [0, 8, 0, 0], *FURNITURE]
    walls = [*half, [12, 0, 12, 3], [12, 5, 12, 8]]
    walls += [[24 - x1, y1, 24 - x2, y2] for x1, y1, x2, y2 in half]
    kinds = ["plaster"] * len(walls)
    kinds[2], kinds[4] = materials
    return world_of(walls, kinds)


CLOTH, PERFECT = ["dark cloth", "metal", "retro-reflector"], Material("perfect", specular=1.0)
STANDS = [[-2, 4, 22, 4], [22, -3, -2, -3], [4, 3, 6, 3], [9, 3, 11, 3], [14, 3, 16, 3]]


@pytest.mark.parametrize(
    ("world", "poses", "least", "most_off"),
    [
        (glass_front("brick"), ALONG, 1, 0.3),
        (world_of(STANDS, ["plaster", "plaster", *CLOTH]), ALONG, 5, np.inf),
        (two_rooms("plaster", "plaster"), round_trip(), 5, 0.3),
        (two_rooms("brick", "dark cloth"), round_trip(), 5, 0.3),
        # An empty square room is the image of itself.
        (world_of(box(0, 0, 12, 8), ["plaster", "brick"] * 2), round_trip(), 4, 0.3),
    ],
)
def test_what_only_looks_like_glass_or_mirrors_is_walls(world, poses, least, most_off):
    found = mapped(world, poses).map
    assert (found.kinds == "wall").all() and len(found) >= least
    assert found.segments[:, 0].max() > 0.9 * world.segments[:, 0].max()
    assert off(found.segments, world.segments) < most_off


def test_a_mirror_that_reflects_all_light_is_taken_for_a_room():
    assert (mapped(mirror_hall(PERFECT), round_trip(40)).map.kinds != "mirror").all()


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
    run = mapped(glass_front(), ALONG[::2], 0.0)
    assert (run.map.kinds == "glass").any()
    lrf3d.save_run(run, tmp_path / "saved.npz")
    for other in (kept, lrf3d.load_run(tmp_path / "saved.npz")):
        assert np.array_equal(other.map.kinds, run.map.kinds)


# Intensities that are no light


@pytest.fixture(scope="module")
def scans():
    run = lrf3d.simulate(lrf3d.load_scenario("corridor"), caster="planar", scans=60, rng=0)
    return list(run.scans)


def in_units(scan, unit):
    rng, by_wall = np.random.default_rng(scan.walls), 37.0 * (scan.walls + 1) % 256
    intensities = {
        "by wall": by_wall,
        "by wall, noisy": np.abs(by_wall + rng.normal(0.0, 10.0, len(by_wall))),
        "constant": np.full(len(by_wall), 100.0),
        "noise": rng.normal(100.0, 20.0, len(by_wall)),
        "linear": np.maximum(255.0 - 8.0 * scan.ranges, 1.0),
    }[unit]
    return replace(scan, intensities=np.where(scan.hits, intensities, 0.0))


@pytest.mark.parametrize("unit", ["by wall", "by wall, noisy", "constant", "noise", "linear"])
def test_intensities_in_a_device_s_own_units_mark_nothing_and_a_line_says_so(scans, unit):
    with pytest.warns(Lrf3dWarning, match="do not fall with range and incidence") as reported:
        found = map_of([in_units(scan, unit) for scan in scans])
    assert len(reported) == 1
    assert np.array_equal(found.segments, map_of(scans).segments)
    assert (found.kinds == "wall").all()


@pytest.mark.parametrize("value", [None, np.nan, np.inf, -1.0, 0.0])
def test_intensities_that_are_no_light_are_left_out_without_a_word(scans, value):
    dark = [
        replace(scan, intensities=value if value is None else np.full(len(scan.ranges), value))
        for scan in scans
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = map_of(dark)
    assert np.array_equal(found.segments, map_of(scans).segments)


def test_scans_of_lit_points_that_are_no_walls_are_kept(scans):
    lone = [
        replace(
            one, angles=np.arange(3.0), ranges=np.array([1.0, 3.0, 9.0]), intensities=np.ones(3),
            walls=np.full(3, -1), echoes=None, echo_intensities=None,
        )
        for one in scans[:9]
    ]  # fmt: skip
    assert len(map_of(lone)) == 0 < len(map_of([*lone, *scans]))


@pytest.mark.parametrize(("kind", "ends"), [(IS_GLASS, (5.125, 6.875)), (IS_MIRROR, (5.0, 7.0))])
def test_a_pane_ends_within_its_last_pieces_and_a_mirror_behind_them(kind, ends):
    optics = Optics()
    # Eight pieces of a line at y = 2, whose middle is at x = 5; a short stretch is none.
    optics._lines[0], optics._votes[0].kind = (0.0, 1.0, 2.0, 5.0), kind
    optics._pieces[0, [*range(128, 136), 150]] = True
    assert optics._stretches().tolist() == [[ends[0], 2.0, ends[1], 2.0, kind == IS_MIRROR]]


def test_a_wall_and_its_image_show_the_line_of_the_mirror_between_them():
    real, image = np.array([[4.0, 1.0, 8.0, 3.0]]), np.array([[16.0, 3.0, 20.0, 1.0]])
    for x in (6.0, 18.0):
        lines = image_lines(np.array([x, 5.0]), image, real)
        assert lines == pytest.approx(np.array([[-1.0, 0.0, -12.0]]) if x < 12.0 else lines[:0])


def test_what_is_known_of_glass_is_in_the_map_at_once():
    mapper = lrf3d.LineMapper()
    for scan in mapped(glass_front(), ALONG).scans:
        mapper.update(scan)
        optics = mapper._mapper._optics
        # A line that is averaged further moves by less than a cell.
        assert optics.surfaces == pytest.approx(optics._stretches(), abs=0.05)
    assert len(optics.surfaces) == 1
