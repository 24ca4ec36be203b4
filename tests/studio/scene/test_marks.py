"""What is drawn over a world: beams that mirrors turn, the map, and estimates."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from estimates import estimated
from test_render import city_run, room_run

import lrf3d
from lrf3d.geometry.lines import lengths
from lrf3d.laser import LaserRangeFinder, beam_directions
from lrf3d.studio.scene.cameras import chase, top
from lrf3d.studio.scene.look import FALSE_COLOUR, MATERIAL_COLOURS, TRAIL_COLOUR, object_colours
from lrf3d.studio.scene.marks import (
    CORNERS,
    MOST_KEPT,
    RANGE_COLOURS,
    DrawnEstimate,
    DrawnMap,
    _lamp,
    draw_beams,
    estimate_words,
)  # fmt: skip
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.stage.stage import stage_of
from lrf3d.studio.scene.stage.structures import Structures, folded, turning_walls
from lrf3d.studio.scene.timeline import Timeline

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


def test_segments_of_the_map_off_walls_are_ghosts_and_colour_no_wall():
    walls = np.array([[0.0, 0.0, 6.0, 0.0], [0.0, 4.0, 6.0, 4.0]])
    colours = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    structures = Structures.from_world(lrf3d.World(walls, heights=[1.5, 8.0]))
    here = walls - np.tile(structures.origin, 2)
    # One lies on its wall, the other leaves its own half-way and is 1 m off at its end.
    here[1, 3] += 1.0
    drawn = DrawnMap(here, colours)
    ghosts = drawn.ghosts(structures, 0.5)
    x = ghosts.corners[..., 0] + structures.origin[0]
    assert (ghosts.colours[..., :3] == colours[1]).all() and 2.8 < x.min() < 3.5 < x.max()
    middles = 0.5 * (here[:, :2] + here[:, 2:])
    tints, found = drawn.tints(np.vstack([middles, [[13.0, -12.0]]]), 0.6)
    assert found.tolist() == [True, True, False] and (tints[:2] == colours).all()


def test_a_false_room_is_red_and_walls_have_their_robot_s_colour_also_among_robots():
    run = room_run()
    mirrors = replace(run.world, materials=["mirror"] * 2)
    away = replace(run.map, segments=run.map.segments + 20.0)
    false = replace(run, maps=(away,), snapshot_scans=(len(run) - 1,))
    stage = stage_of(run)
    structures = Structures.from_world(mirrors)
    own = (0.1, 0.2, 0.3)
    walls, reflected = (
        DrawnMap.from_snapshot(each, len(each.maps) - 1, structures, stage.exposure, own).colours
        for each in (run, false)
    )
    assert (walls == own).all() and (reflected == FALSE_COLOUR).all()
    other = lrf3d.DynamicObstacle([[0, 0], [1, 0], [0, 1]], run.trajectory, is_robot=True)
    scenes = [Scene(Timeline(replace(run, obstacles=them))) for them in ((), (other,))]
    assert [list(scene.team.values()) for scene in scenes] == [[None], [TRAIL_COLOUR]]


def test_a_run_with_given_poses_draws_no_estimate():
    assert DrawnEstimate.from_timeline(Timeline(room_run())) is None
    assert estimate_words(room_run(), 0) == ()


@pytest.mark.parametrize("offset", [(0.0, 0.0), (85_000.0, 447_500.0)])
def test_the_ellipse_of_now_is_that_of_the_scan_in_the_film_s_frame(offset):
    run = estimated(city_run(offset))
    timeline = Timeline(run)
    drawn = DrawnEstimate.from_timeline(timeline)
    times = run.trajectory.times[run.estimate.known_scans] - timeline.start
    sizes = np.linalg.eigvalsh(run.estimate.ellipses)[:, 1]

    def ring(time):
        return drawn.rings(time).starts[-CORNERS:, :2].astype(float)

    due = run.estimate.poses[run.estimate.known_scans[3], :2] - timeline.origin
    assert ring(times[3]).mean(axis=0) == pytest.approx(due, abs=1e-4)
    assert np.ptp(ring(times[3])[:, 0]) == pytest.approx(2.0 * sizes[3], abs=1e-4)
    # Between two scans it lies between what is known there.
    between = np.ptp(ring(0.5 * (times[3] + times[4]))[:, 0])
    assert between == pytest.approx(sizes[3] + sizes[4], abs=1e-4)


def test_ellipses_that_stay_are_few_come_in_time_and_do_not_cover_each_other():
    run = estimated(city_run(seconds=40.0))
    drawn = DrawnEstimate.from_timeline(Timeline(run))
    assert 3 < len(drawn.kept) <= MOST_KEPT
    sizes = np.linalg.norm(drawn.shapes[drawn.kept], axis=(1, 2))
    apart = np.hypot(*np.diff(drawn.outlines().mean(axis=1), axis=0).T)
    assert (apart >= sizes[1:] - 1e-9).all() and sizes.min() > 0.0
    rings = [len(drawn.rings(time).starts) // CORNERS for time in np.linspace(0.0, 41.0, 60)]
    # The last one is that of the robot now.
    assert rings[0] == 1 and rings[-1] == len(drawn.kept) + 1 and (np.diff(rings) >= 0).all()


def test_the_panel_says_the_error_only_where_the_truth_is_known():
    run = estimated(room_run())
    assert estimate_words(run, 4) == (("truth", ""), ("estimate, ellipses of 95 %", "0.50 m off"))
    recorded = replace(run, estimate=estimated(run, (0.0, 0.0, 0.0)).estimate)
    assert not recorded.knows_truth
    assert estimate_words(recorded, 4) == (("estimate, ellipses of 95 %", ""),)


def test_an_estimate_without_covariances_has_no_ellipses():
    run = estimated(room_run())
    bare = replace(run.estimate, known_scans=[], covariances=np.zeros((0, 3, 3)))
    run = replace(run, estimate=bare)
    assert estimate_words(run, 4)[1] == ("estimate", "0.50 m off")
    drawn = DrawnEstimate.from_timeline(Timeline(run))
    assert not len(drawn.rings(1.0).starts) and drawn.outlines().shape == (0, CORNERS, 2)


@pytest.mark.parametrize("size", [(1280, 720), (320, 240)])
def test_a_robot_too_small_to_be_seen_has_an_arrow_as_large_as_it_must_be(size):
    scene = Scene(Timeline(city_run(seconds=10.0)))
    look = top(scene.timeline, scene.structures).look(2.0, size[0] / size[1])
    seen = scene.seen(scene.timeline.moment(2.0), look, size)
    arrow = dict(seen.marks)["marker"]
    corners = np.insert(arrow.corners.reshape(-1, 3), 3, 1.0, axis=1) @ seen.lens.matrix.T
    wide, _ = np.ptp(corners[:, :2] / corners[:, 3:] * 0.5 * np.array(size), axis=0)
    # Ten pixels of 720 lines times the length of the dart with its rim.
    assert arrow.on_top and wide == pytest.approx(10.0 * min(size) / 720.0 * 1.4 * 1.9, rel=0.01)
    near = chase(scene.timeline, scene.structures).look(2.0, size[0] / size[1])
    assert "marker" not in dict(scene.seen(scene.timeline.moment(2.0), near, size).marks)
