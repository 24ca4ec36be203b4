"""Pictures of a run: what stands where, from every camera, also far from the origin."""

import functools

import numpy as np
import pytest
import shapely
import synthetic_run

from lrf3d import LaserRangeFinder, LineMap, PlanarCaster, Run, Trajectory, World
from lrf3d.studio.render.film import Film
from lrf3d.studio.scene.marks import draw_beams, trail_lines
from lrf3d.studio.scene.shapes import Faces, PosedFaces
from lrf3d.studio.scene.timeline import Timeline, drive_keys
from lrf3d.world.cameras import FilmPlan

needs_gl = pytest.mark.gl
SIZE = (320, 180)


def box(*place):
    """Walls of a building, as a list."""
    return synthetic_run.box(*place).tolist()


def drawn(run, time, *, size=SIZE, samples=0, **options):
    """The picture (h, w, 3) of a run at a time, by a film of its own."""
    film = Film(run, size=size, samples=samples, **options)
    picture = film.draw(time)[:, :, :3].astype(int)
    film.close()
    return picture


def on_picture(look, place):
    """The pixel x, y of a place, by the look's own pose."""
    local = np.linalg.inv(look.pose) @ [*place, 1.0]
    focus = 0.5 * SIZE[1] / np.tan(0.5 * look.field)
    return (
        0.5 * SIZE[0] - focus * local[0] / local[2],
        0.5 * SIZE[1] + focus * local[1] / local[2],
    )


def run_of(world, times, poses, *, range_max=60.0):
    lrf = LaserRangeFinder(range_max=range_max, beams=91)
    ranges, walls = PlanarCaster(world).scan_batch(lrf, np.asarray(poses, float))
    seen = np.unique(walls[walls >= 0])
    map_ = LineMap(world.segments[seen], world.objects[seen], np.full(len(seen), 9))
    trajectory = Trajectory(np.asarray(times, float), np.asarray(poses, float))
    film = FilmPlan("chase", 1.0)
    return Run(world, lrf, trajectory, ranges, ranges, walls, (0,), (map_,), film=film)


@functools.cache
def city_run(offset=(0.0, 0.0), *, seconds=4.0):
    """A street of buildings to both sides, driven along x."""
    rng = np.random.default_rng(5)
    spots = [(x, y) for x in range(-40, 60, 20) for y in (-15, 5, 25)]
    segments = np.concatenate([box(x, y, 12, 10) for x, y in spots])
    heights = np.repeat(rng.uniform(5.0, 18.0, len(spots)), 4)
    objects = np.repeat(np.arange(len(spots)), 4)
    world = World(segments + np.tile(offset, 2), objects, heights, "street")
    times = np.arange(0.0, seconds + 1e-9, 0.2)
    x = -30.0 + 1.5 * times
    poses = np.column_stack([x + offset[0], np.zeros_like(x) + offset[1], np.zeros_like(x)])
    return run_of(world, times, poses)


@functools.cache
def room_run(*, stops=False, colours=None):
    """A room with a box in it."""
    segments = np.array([*box(0, 0, 8, 6), *box(5, 2.5, 1, 1)])
    objects = np.repeat([0, 1], 4)
    heights = np.repeat([2.5, 1.0], 4)
    world = World(segments, objects, heights, "room", colours=colours)
    times = np.array([0.0, 4.0, 8.0]) if stops else np.arange(0.0, 3.0, 0.25)
    x = np.linspace(1.5, 3.0, len(times))
    poses = np.column_stack([x, np.full_like(x, 3.0), np.zeros_like(x)])
    return run_of(world, times, poses, range_max=12.0)


@needs_gl
def test_a_wall_has_its_colour_where_the_projection_puts_it():
    green = ((0.6, 0.6, 0.6), (0.1, 0.8, 0.1))
    run = room_run(colours=green)
    film = Film(run, size=SIZE, view="first", samples=0, layers=())
    picture = film.draw(2.5)[:, :, :3].astype(int)
    look = film.camera.look(2.5, SIZE[0] / SIZE[1])
    column, row = on_picture(look, [*(np.array([5.0, 3.0]) - run.world.origin), 0.5])
    red, green_, blue = picture[round(row), round(column)]
    assert green_ > 1.4 * red and green_ > 2 * blue
    film.close()


@pytest.mark.parametrize("renderer", [pytest.param("gl", marks=needs_gl), "embree"])
def test_hit_points_do_not_show_through_a_thin_wall_and_do_in_front_of_it(renderer):
    run, shape = room_run(), {"size": SIZE, "view": "first", "samples": 0, "renderer": renderer}
    films = [Film(run, layers=layers, **shape) for layers in (("points",), ())]
    dotted, bare = (film.draw(0.0).astype(int) for film in films)
    assert (np.abs(bare - dotted).max(axis=2) > 60).sum() > 20
    for film in films:
        # From outside, at the wall that the robot looks at from inside.
        film.camera = Outside(run.world.origin)
    assert np.array_equal(*(film.draw(0.0) for film in films))


class Outside:
    def __init__(self, origin):
        self.origin = origin

    def look(self, time, aspect):
        from lrf3d.studio.scene.camera import Look

        eye = np.array([14.0 - self.origin[0], 3.0 - self.origin[1], 0.7])
        return Look(eye, eye - [5.0, 0.0, 0.1], 1.0)


@pytest.mark.parametrize("renderer", [pytest.param("gl", marks=needs_gl), "embree"])
def test_a_wall_of_a_room_does_not_hide_the_robot_that_the_eye_follows(renderer):
    # The robot drives away from a wall that stands between it and the eye.
    wall, room = [[1.4, 0.5, 1.4, 5.5]], box(0, 0, 8, 6)
    poses = np.column_stack([np.linspace(1.9, 2.6, 12), np.full(12, 3.0), np.zeros(12)])
    counts = []
    for walls in (room, room + wall):
        world = World(walls, [0, 0, 0, 0, 1][: len(walls)], np.full(len(walls), 2.5))
        run = run_of(world, 0.25 * np.arange(12), poses)
        film = Film(run, size=SIZE, samples=0, view="chase", renderer=renderer, layers=())
        picture = film.draw(0.0).astype(int)
        film.scene.robot = PosedFaces(
            Faces(*(each[:0] for each in film.scene.robot.faces)), np.eye(4)
        )
        counts.append((np.abs(film.draw(0.0) - picture).max(axis=2) > 30).sum())
        film.close()
    assert counts[1] > 0.4 * counts[0] > 20


@needs_gl
@pytest.mark.parametrize("size", [(640, 360), (1920, 1080)])
def test_the_panels_keep_their_place_at_any_size(size):
    film = Film(room_run(), size=size, samples=0)
    picture = film.draw(0.5)[..., :3].astype(int)
    film.close()
    assert film._strip == pytest.approx(0.27 * size[0], abs=1)
    # Around the map and the text beside the picture its ground is empty.
    strip = picture[:, -film._strip :]
    rim = round(0.01 * size[1])
    assert max(strip[-rim:].max(), strip[:, -rim:].max(), strip[:, :rim].max()) < 30 < strip.max()
    corner = picture[round(0.85 * size[1]) : round(0.97 * size[1]), round(0.03 * size[0]) :][
        :, :150
    ]
    assert corner.max() > 200 and np.median(corner) < 110


def test_hit_points_lie_on_their_walls_wherever_the_robot_has_gone_since():
    run = city_run()
    scan, walls = run.scan(6), run.world.segments
    for step in (0.0, 0.15, 0.29):
        apex = np.array([scan.pose.x + step, scan.pose.y])
        _, points, _ = draw_beams(scan, walls, walls[:0], apex, height=0.5, reach=9.0)
        hit = shapely.linestrings(walls[run.walls[6][scan.hits]].reshape(-1, 2, 2))
        assert shapely.distance(shapely.points(points.places[:, :2]), hit).max() < 1e-5


@pytest.mark.parametrize("around", [False, True])
def test_a_robot_goes_round_a_wall_between_stops_or_is_set_down_and_turns_before_it_goes(around):
    walls = [[2, -1, 2, 1]] if around else box(3, -1, 2, 2)
    run = run_of(
        World(np.array(walls, float)), [0.0, 4.0, 8.0], [[0, 0, 0], [4, 0, 0], [4.5, 0, 2]]
    )
    timeline = Timeline(run)
    # Neither the robot nor its trail goes through it.
    trail = trail_lines(drive_keys(timeline).thinned(), 8.0, 1e9)
    driven = np.hstack([trail.starts[:, :2], trail.ends[:, :2]]).reshape(-1, 2, 2) + timeline.origin
    wall = shapely.multilinestrings(np.reshape(walls, (-1, 2, 2)))
    assert len(driven) and not shapely.intersects(shapely.linestrings(driven), wall).any()
    assert (np.hypot(*np.ptp(driven, axis=1).T).sum() > 4.0) == around
    # It turns where it stands, and goes where it looks.
    x, y, turns = np.diff(timeline.drive.poses, axis=0).T
    heading = timeline.drive.poses[1:, 2]
    assert np.cos(heading) * y == pytest.approx(np.sin(heading) * x)
    assert not turns[np.hypot(x, y) > 0.0].any() and np.abs(turns).sum() >= 2.0


def test_stops_dwell_with_beams_on_then_the_robot_drives_with_beams_off():
    timeline = Timeline(room_run(stops=True))
    assert timeline.end == pytest.approx(10.0)
    standing, gliding = timeline.moment(1.9), timeline.moment(3.0)
    assert standing.scanning and standing.scan == 0 and standing.speed == 0.0
    assert standing.pose[0] == pytest.approx(1.5)
    assert not gliding.scanning and 1.5 < gliding.pose[0] < 2.25
    assert timeline.moment(4.0).scanning and timeline.moment(4.0).scan == 1
