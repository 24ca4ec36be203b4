"""What films skip: parts out of sight and frames that repeat; nothing of it shows."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from test_render import SIZE, city_run, drawn, needs_gl, room_run, run_of

from lrf3d import InputError, World
from lrf3d.studio.render import beside
from lrf3d.studio.render.film import Film, frame
from lrf3d.studio.render.text import band_of, row_of
from lrf3d.world.cameras import FilmPlan, FixedCamera
from lrf3d.world.generators import BLOCK_SIDE, generate_city

BLOCKS = 8


@pytest.fixture(scope="module")
def large_run():
    """A drive between some hundred buildings, round a corner."""
    heights = np.random.default_rng(3).uniform(4.0, 16.0, BLOCKS**2)
    world = replace(generate_city(4 * BLOCKS**2), heights=np.repeat(heights, 4))
    x, y = BLOCK_SIDE * (np.array([BLOCKS, BLOCKS]) - 1) / 2
    times = np.arange(0.0, 5.0, 0.25)
    ahead = np.clip(2.0 * times - 5.0, 0.0, None)
    poses = np.column_stack([x + np.minimum(2.0 * times - 5.0, 0.0), y + ahead, 0.6 * times])
    return run_of(world, times, poses)


@needs_gl
@pytest.mark.parametrize("view", ["first", "orbit", "top"])
def test_what_is_left_out_could_not_be_seen(large_run, view):
    film = Film(large_run, size=SIZE, view=view, samples=0)
    parts = film.renderer._parts
    seen, every = parts.seen, np.arange(parts.count)
    for time in (0.3, 2.2, 4.4):
        parts.seen = seen
        some = film.draw(time).astype(int)
        drawn = film.renderer._walls.count
        parts.seen = lambda matrix, eye: every
        assert np.abs(some - film.draw(time)).max() == 0
        # From above, all of it is seen.
        assert view == "top" or drawn < 0.5 * film.renderer._walls.count
    film.close()


@needs_gl
def test_a_mirror_shows_nothing_of_the_frame_before():
    wall = [[x, y, x + dx, y + dy] for x, y, dx, dy in ((0, 0, 9, 0), (9, 0, 0, 6), (9, 6, -9, 0))]
    world = World(wall, [0, 1, 2], materials=["plaster", "mirror", "plaster"])
    times = np.arange(0.0, 3.0, 0.25)
    poses = np.column_stack([2.0 + times, np.full_like(times, 3.0), 0.4 * times])
    run = run_of(world, times, poses)
    film = Film(run, size=SIZE, view="chase", samples=0)
    first, later = (film.draw(time)[:, :, :3].astype(int) for time in (0.5, 2.5))
    film.close()
    assert np.abs(first - later).max() > 50
    assert np.array_equal(later, drawn(run, 2.5, view="chase"))


@pytest.mark.parametrize("renderer", [pytest.param("gl", marks=needs_gl), "embree"])
def test_nothing_shines_through_the_inset(renderer):
    insets = []
    for view in ("chase", "orbit"):
        film = Film(
            room_run(), size=SIZE, samples=0, view=view, layers=("inset",), renderer=renderer
        )
        insets.append(film.draw(0.5)[:, -film._strip :])
        film.close()
    assert np.array_equal(*insets) and insets[0].std() > 5.0


@needs_gl
def test_beams_are_whole_lines_also_from_just_above_them():
    with_beams, bare = (
        drawn(city_run(), 1.0, size=(640, 360), view="first", layers=layers)
        for layers in (("beams",), ())
    )
    near = (with_beams - bare)[240:, :, 0] > 3
    # Each row of the ground in front is crossed by about as many beams as its neighbours.
    counts = near.sum(axis=1)
    assert counts.min() > 10 and (np.abs(np.diff(counts)) <= 6).all()


@needs_gl
def test_a_fixed_camera_looks_from_where_it_stands_also_straight_down():
    above = FixedCamera("ceiling", (5.5, 3.0, 9.0), (5.5, 3.0, 0.0))
    door = FixedCamera("door", (1.0, 1.0, 1.6), (5.0, 3.0, 0.3), 40.0)
    run = room_run()
    run = replace(run, world=replace(run.world, cameras=(door, above)))
    pictures = [frame(run, 2.5, size=SIZE, view=camera.name) for camera in (door, above)]
    assert min(picture.std() for picture in pictures) > 10.0
    with pytest.raises(InputError, match=r"view: there is no 'dor'; did you mean 'door'\?"):
        frame(run, 0.5, size=SIZE, view="dor")


@needs_gl
def test_memory_stays_flat_over_many_frames():
    if not os.path.exists("/proc/self/statm"):
        pytest.skip("no /proc on this system")
    run = city_run()
    film = Film(run, size=(96, 54), view="chase", samples=4)

    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")

    times = np.linspace(0.0, 4.0, 40)
    for time in times:
        film.draw(float(time))
    before = resident()
    for time in (*times, *times):
        film.draw(float(time))
    assert resident() - before < 3e6
    film.close()


def test_the_picture_of_another_run_frees_the_film_of_the_last(monkeypatch):
    closed = []
    monkeypatch.setattr(Film, "close", lambda film: closed.append(film))
    runs = [replace(room_run(), film=FilmPlan("top", speed)) for speed in (1.0, 2.0)]
    for run in (*runs, runs[1]):
        frame(run, 0.5, size=(64, 36), renderer="embree")
    assert [film.timeline.run for film in closed][-1:] == runs[:1]


@needs_gl
def test_a_film_is_freed_where_its_context_is_not_current():
    film = Film(room_run(), size=(64, 36), renderer="gl")

    from OpenGL import EGL

    from lrf3d.studio.render.buffers import GL, make_current

    target = film.renderer._frame
    nothing = EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, EGL.EGL_NO_CONTEXT
    EGL.eglMakeCurrent(EGL.eglGetCurrentDisplay(), *nothing)
    film.close()
    make_current()
    assert not GL.glIsFramebuffer(target)


@needs_gl
def test_threads_find_opengl_at_once_and_draw_one_at_a_time():
    program = """
from concurrent.futures import ThreadPoolExecutor
from lrf3d.studio.render.gl import gl_available
with ThreadPoolExecutor(4) as threads:
    assert all(threads.map(lambda _: gl_available(), range(4)))
    from lrf3d.studio.render.buffers import make_current
    make_current()
    assert "another thread" in str(threads.submit(make_current).exception())
"""
    path = os.pathsep.join(filter(None, sys.path))
    environment = {**os.environ, "PYTHONPATH": path}
    subprocess.run([sys.executable, "-c", program], check=True, env=environment)


@pytest.mark.parametrize("size", [(16, 16), (32, 18), (16, 600)])
def test_a_picture_too_small_for_text_has_none(size):
    assert room_run().frame(0.5, size=size, renderer="embree").shape == (*size[::-1], 3)
    assert band_of(size) == 0 < band_of((160, 90))
    assert row_of((("words", (1, 2, 3)),), 20.0, size[0] - 30).height == 0


def test_a_run_without_maps_shows_what_was_seen_and_names_no_walls(monkeypatch):
    said = list[str]()
    monkeypatch.setattr(
        beside, "row_of", lambda words, *rest: said.append(words[0][0]) or row_of(words, *rest)
    )
    mapped = room_run()
    options = {"size": (640, 360), "renderer": "embree", "view": "chase"}
    for run, name, rows in (
        (mapped, "The map so far", 4),
        (replace(mapped, snapshot_scans=(), maps=()), "Seen so far", 3),
    ):
        film = Film(run, **options)
        film.draw(1.0)
        assert name in said and len(film.maps[0].legend()) == rows
        said.clear()
