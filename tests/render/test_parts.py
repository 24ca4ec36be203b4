"""What films skip: parts out of sight, frames that repeat, tiles of ground; nothing of it shows."""

import os
from dataclasses import replace

import numpy as np
import pytest
from test_render import SIZE, city_run, needs_gl, ranges_of, room_run, run_of

from lrf3d.errors import InputError
from lrf3d.world import World
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.generators import BLOCK_SIDE, generate_city

BLOCKS = 20


@pytest.fixture(scope="module")
def large_run():
    """A drive between some hundred buildings, round a corner."""
    heights = np.random.default_rng(3).uniform(4.0, 16.0, BLOCKS**2)
    world = replace(generate_city(4 * BLOCKS**2), heights=np.repeat(heights, 4))
    x, y = BLOCK_SIDE * np.array([9.5, 9.5])
    times = np.arange(0.0, 5.0, 0.25)
    ahead = np.clip(2.0 * times - 5.0, 0.0, None)
    poses = np.column_stack([x + np.minimum(2.0 * times - 5.0, 0.0), y + ahead, 0.6 * times])
    return run_of(world, times, poses)


class Everything:
    """All parts, whatever can be seen."""

    def __init__(self, parts):
        self.boxes = parts.boxes

    def seen(self, matrix, eye):
        return np.arange(len(self.boxes.low))


@needs_gl
@pytest.mark.parametrize(
    "view",
    [
        pytest.param("chase", marks=pytest.mark.slow),
        pytest.param("first", marks=pytest.mark.slow),
        "orbit",
        "top",
    ],
)
def test_what_is_left_out_could_not_be_seen(large_run, view):
    from lrf3d.render.film import Film

    film = Film(large_run, size=SIZE, view=view, samples=0)
    walls = film.scenery.walls
    for time in (0.3, 2.2, 4.4):
        film.scenery.walls = walls
        some = film.draw(time).astype(int)
        drawn = walls.faces.count
        film.scenery.walls = replace(walls, parts=Everything(walls.parts))
        film.forget()
        every = film.draw(time).astype(int)
        assert np.abs(some - every).max() == 0
        assert drawn < 0.25 * walls.faces.count
    film.close()


@needs_gl
def test_low_eyes_draw_little_of_a_large_city(large_run):
    from lrf3d.render.film import Film

    film = Film(large_run, size=SIZE, view="first", samples=0)
    counts = []
    for time in np.linspace(0.0, 4.5, 10):
        film.draw(float(time))
        counts.append(len(film.scenery.walls.faces._shown))
    assert max(counts) < 0.2 * BLOCKS**2
    film.close()


@needs_gl
def test_parts_are_drawn_from_near_to_far(large_run):
    from lrf3d.render.film import Film

    film = Film(large_run, size=SIZE, view="chase", samples=0)
    film.draw(1.0)
    shown = film.scenery.walls.faces._shown
    eye = film.camera.look(1.0, SIZE[0] / SIZE[1]).eye
    away = film.scenery.walls.parts.boxes.nearest(eye, shown)
    assert len(shown) > 5 and (np.diff(away) >= 0.0).all()
    film.close()


@needs_gl
@pytest.mark.slow
def test_ground_tiles_hang_on_the_eye_alone(large_run, monkeypatch):
    from lrf3d.render import ground_layer
    from lrf3d.render.film import Film

    monkeypatch.setattr(ground_layer, "_KEPT", 4)
    pictures = []
    for way in (("here",), ("there", "here")):
        film = Film(large_run, size=SIZE, view="chase", samples=0, layers=())
        layer = film.scenery.ground
        for place in way:
            aside = 0.0 if place == "here" else 90.0
            eye = large_run.trajectory.poses[0, :2] - large_run.world.origin + aside
            shown = len(list(layer.draws(np.array([*eye, 2.0]), 0.0, 500.0))) - 2
        pictures.append(film.draw(0.0).copy())
        assert shown > 0 and len(layer._tiles) <= 4 + shown
        film.close()
    assert np.array_equal(*pictures)


@needs_gl
def test_a_frame_in_which_nothing_changed_is_not_drawn_again():
    from lrf3d.render.film import Film

    film = Film(room_run(stops=True), size=SIZE, view="top", samples=0)
    drawn = []
    finish = film.renderer.finish
    film.renderer.finish = lambda: drawn.append(1) or finish()
    first = film.draw(1.0).copy()
    # The clock of the panel shows tenths of a second.
    assert np.array_equal(film.draw(1.04), first) and len(drawn) == 1
    film.draw(1.2)
    assert len(drawn) == 2
    film.draw(3.6)
    film.draw(3.61)
    assert len(drawn) == 4
    film.close()


@needs_gl
def test_beams_are_whole_lines_also_from_just_above_them():
    from lrf3d.render.film import Film

    film = Film(city_run(), size=(640, 360), view="first", samples=0, layers=("beams",))
    bare = Film(city_run(), size=(640, 360), view="first", samples=0, layers=())
    near = (film.draw(1.0).astype(int) - bare.draw(1.0))[240:, :, 0] > 3
    # Each row of the ground in front is crossed by about as many beams as its neighbours.
    counts = near.sum(axis=1)
    assert counts.min() > 10 and (np.abs(np.diff(counts)) <= 6).all()
    film.close()
    bare.close()


@needs_gl
def test_a_fixed_camera_looks_from_where_it_stands_at_its_target():
    from lrf3d.render.video import frame

    green = np.array([[0.6, 0.6, 0.6], [0.1, 0.8, 0.1]])
    run = room_run(colours=green)
    cameras = (
        FixedCamera("door", (1.0, 1.0, 1.6), (5.0, 3.0, 0.3), 40.0),
        FixedCamera("ceiling", (5.5, 3.0, 9.0), (5.5, 3.0, 0.0)),
    )
    run = replace(run, world=replace(run.world, cameras=cameras))
    for camera in cameras:
        picture = frame(run, 0.5, size=SIZE, view=camera.name, samples=0).astype(int)
        red, green_, blue = picture[SIZE[1] // 2, SIZE[0] // 2]
        assert green_ > 2 * red and green_ > 2 * blue
    with pytest.raises(InputError, match=r"view 'dor': expected .*ceiling; did you mean 'door'\?"):
        frame(run, 0.5, size=SIZE, view="dor")


@needs_gl
def test_ground_near_the_eye_looks_as_with_smaller_copies(large_run, monkeypatch):
    from lrf3d.render import ground_layer
    from lrf3d.render.film import Film

    film = Film(large_run, size=SIZE, view="chase", samples=0, layers=())
    near = film.draw(2.2).astype(int)
    piece = ground_layer._Piece
    at, none = piece.near, 0.0
    monkeypatch.setattr(piece, "near", lambda self, eye, reach: at(self, eye, none))
    film.forget()
    # Where ground and walls meet, a pixel may belong to either.
    differ = np.abs(film.draw(2.2) - near).max(axis=2) > 2
    assert differ.mean() < 1e-3
    film.close()


@pytest.mark.parametrize("renderer", [pytest.param("gl", marks=needs_gl), "embree"])
def test_nothing_shines_through_the_inset(renderer):
    from lrf3d.render.film import Film

    insets = []
    for view in ("chase", "orbit"):
        film = Film(
            room_run(), size=SIZE, view=view, samples=0, layers=("inset",), renderer=renderer
        )
        left, top, side = film._inset._box[:3]
        insets.append(film.draw(0.5)[top : top + side, left : left + side].copy())
        film.close()
    assert np.array_equal(*insets)


@needs_gl
def test_memory_stays_flat_over_many_frames():
    from lrf3d.render.film import Film

    if not os.path.exists("/proc/self/statm"):
        pytest.skip("no /proc on this system")
    run = city_run()
    film = Film(run, size=(96, 54), view="chase", samples=4)

    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")

    times = np.linspace(0.0, 4.0, 150)
    for time in times:
        film.draw(float(time))
    before = resident()
    for time in (*times, *times):
        film.draw(float(time))
    assert resident() - before < 3e6
    film.close()


def test_the_skyline_hides_nothing_that_a_ray_can_reach():
    from lrf3d.render.parts import Skyline

    rng = np.random.default_rng(8)
    heights = rng.uniform(4.0, 16.0, 150)
    world = replace(generate_city(600), heights=np.repeat(heights, 4))
    corners = world.segments[:, :2]
    skyline = Skyline(corners, np.full(150, 4), heights)
    boxes = corners.reshape(150, 4, 2)
    low = np.column_stack([boxes.min(axis=1), np.zeros(150)])
    high = np.column_stack([boxes.max(axis=1), heights])
    left_out = 0
    for k in range(6):
        eye = np.array([*(BLOCK_SIDE * (rng.integers(2, 10, 2) + 0.5)), 1.7])
        turn = 1.1 * k
        gap = np.maximum(low[:, :2] - eye[:2], eye[:2] - high[:, :2])
        away = np.hypot(*np.maximum(gap, 0.0).T)
        middles = np.arctan2(*(boxes.mean(axis=1) - eye[:2]).T[::-1])
        front = np.abs((middles - turn + np.pi) % (2 * np.pi) - np.pi) < 0.7
        order = np.flatnonzero(front)[np.argsort(away[front])]
        ahead = np.array([np.cos(turn), np.sin(turn), 0.0])
        seen = skyline.unhidden(order, away[order], low, high, eye, ahead)
        left_out += len(order) - len(seen)
        for hidden in set(order.tolist()) - set(seen.tolist()):
            for corner in boxes[hidden]:
                # From the eye to just under the roof some other building's wall is crossed.
                way = corner - eye[:2]
                walls = world.segments[world.objects != hidden]
                along, offset = walls[:, 2:] - walls[:, :2], walls[:, :2] - eye[:2]
                across = way[0] * along[:, 1] - way[1] * along[:, 0]
                share = (offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0]) / across
                place = (offset[:, 0] * way[1] - offset[:, 1] * way[0]) / across
                level = eye[2] + share * (heights[hidden] - 0.01 - eye[2])
                crossed = (share > 0) & (share < 1) & (place >= 0) & (place <= 1)
                assert (
                    level[crossed] < heights[world.objects[world.objects != hidden]][crossed]
                ).any()
    assert left_out > 20


@needs_gl
def test_the_fan_keeps_its_outline_with_fewer_triangles():
    from lrf3d.scene.beams import DrawnBeams

    run = city_run()
    scan = run.scan(6)
    apex = np.array([scan.pose.x, scan.pose.y])
    drawn = DrawnBeams.from_scan(scan, run.world.segments, run.world.objects, apex)
    fan = drawn.fan(0.5)[:, :4].reshape(-1, 3, 4)
    # These beams are two degrees apart: the angle bounds the triangles.
    assert len(fan) < 0.75 * (len(scan.ranges) - 1)
    lrf = replace(run.lrf, beams=1, angle_min=0.0, angle_max=0.0, range_max=500.0)
    for _, first, second in fan:
        middle = 0.5 * (first + second)[:2] - apex
        angle = float(np.arctan2(middle[1], middle[0]))
        seen, _ = ranges_of(run.world, lrf, np.array([*apex, angle]))
        assert np.hypot(*middle) <= seen[0] * 1.01 + 0.05


def test_cameras_of_a_world_are_kept_with_its_run(tmp_path):
    from lrf3d.io import load_run, save_run

    run = room_run()
    cameras = (FixedCamera("door", (0.1, 1.0, 1.6), (5.5, 3.0, 1.0 / 3.0), 33.3),)
    run = replace(run, world=replace(run.world, cameras=cameras))
    save_run(run, tmp_path / "run.npz")
    assert load_run(tmp_path / "run.npz").world.cameras == cameras


@needs_gl
@pytest.mark.slow
def test_more_tiles_of_ground_than_are_kept_are_drawn_while_they_are_shown():
    from lrf3d.render.film import Film

    corners = 100.0 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.8], [0.0, 0.8]])
    room = World(np.column_stack([corners, np.roll(corners, -1, axis=0)]))
    times = np.array([0.0, 0.5, 1.0])
    poses = np.column_stack([np.full((3, 2), 40.0), 0.2 * times])
    film = Film(run_of(room, times, poses), size=SIZE, view="top", samples=0)
    first = film.draw(0.5).copy()
    film.forget()
    assert np.array_equal(film.draw(0.5), first) and np.ptp(first[:, :, 0]) > 50
    film.close()
