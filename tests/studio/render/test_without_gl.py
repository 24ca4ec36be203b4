"""Pictures that Embree draws: like OpenGL's where it is, and all there is where it is not."""

import os
import subprocess
import sys
from dataclasses import replace

import av
import numpy as np
import pytest
from PIL import Image
from test_render import city_run, drawn, needs_gl, room_run

from lrf3d.recordings import save_run
from lrf3d.world.cameras import FilmPlan

NO_GL = """
import ctypes

class CDLL(ctypes.CDLL):
    def __init__(self, name, *arguments, **keywords):
        if name is not None and ("libEGL" in str(name) or "libGL" in str(name)):
            raise OSError(f"{name}: hidden")
        super().__init__(name, *arguments, **keywords)

ctypes.CDLL = CDLL
"""


@pytest.fixture
def without_gl(tmp_path):
    """The environment of a process, and of those that it starts, that finds no OpenGL."""
    folder = tmp_path / "hidden"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(NO_GL)
    path = os.pathsep.join([str(folder), *filter(None, sys.path)])
    return {**os.environ, "PYTHONPATH": path}


@needs_gl
@pytest.mark.parametrize(
    ("view", "time"),
    [("chase", 2.0), ("first", 2.0), ("orbit", 2.0), ("top", 2.0), ("story", 1.6), ("story", 9.5)],
)
@pytest.mark.parametrize("make", [city_run, room_run])
def test_both_renderers_draw_much_the_same_picture(make, view, time):
    run = replace(make(), film=FilmPlan("story", 1.0))
    shape = {"size": (256, 144), "view": view}
    pictures = [drawn(run, time, renderer=name, **shape) for name in ("gl", "embree")]
    apart = np.abs(pictures[0] - pictures[1]).max(axis=2)
    # Lines have soft edges in one of them only, and copies of textures are chosen otherwise.
    assert apart.mean() < 8.0 and (apart > 80).mean() < 0.03


@pytest.mark.parametrize("renderer", [pytest.param("gl", marks=needs_gl), "embree"])
def test_what_lies_on_the_ground_on_both_sides_of_the_eye_is_seen_up_to_it(renderer):
    goal = (1.5, 3.0, 20.0)
    marked, bare = (
        drawn(room_run(), 1.0, size=(256, 144), goal=goal, renderer=renderer, layers=layers)
        for layers in (("goal",), ())
    )
    assert (np.abs(marked - bare).max(axis=2)[-24:-4] > 0).mean() > 0.9


@pytest.mark.slow
def test_without_opengl_a_film_is_drawn_and_one_line_says_what_to_install(tmp_path, without_gl):
    run, film = tmp_path / "run.npz", tmp_path / "film.mp4"
    save_run(city_run(seconds=1.0), run)
    command = [sys.executable, "-m", "lrf3d", "render", str(run)]
    command += ["--size", "128x72", "--fps", "5", "--out"]
    done = subprocess.run([*command, str(film)], env=without_gl, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("\n") == 1
    assert "apt-get install -y --no-install-recommends libegl1 libgl1" in done.stderr
    with av.open(str(film)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 6
    # Packing a film loses something, but far less than what passes from one frame to the next.
    small = {"samples": 4, "size": (128, 72), "renderer": "embree"}
    alone = [drawn(city_run(seconds=1.0), time, **small) for time in (0.2, 0.4, 0.6)]
    before, own, after = (np.abs(frames[2] - picture).mean() for picture in alone)
    assert own < 0.8 * min(before, after) and own < 8.0
    picture = tmp_path / "at.png"
    at = [*command[:7], "--at", "0.4", "--out", str(picture)]
    subprocess.run(at, env=without_gl, check=True, capture_output=True)
    with Image.open(picture) as read:
        assert np.array_equal(np.array(read), alone[1])


@pytest.mark.slow
@pytest.mark.parametrize(
    "broken",
    [{"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent.json"}, {"PYOPENGL_PLATFORM": "osmesa"}],
)
def test_opengl_that_does_not_start_draws_nothing_and_embree_does(tmp_path, broken):
    run, picture = tmp_path / "run.npz", tmp_path / "at.png"
    save_run(room_run(), run)
    command = [sys.executable, "-m", "lrf3d", "render", str(run), "--size", "64x64", "--at", "1"]
    done = subprocess.run(
        [*command, "--out", str(picture)], env={**os.environ, **broken},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0 and picture.exists(), done.stderr
    assert done.stderr.count("\n") <= 1 and (
        "Embree draws instead" in done.stderr or not done.stderr
    )


@pytest.mark.slow
def test_without_opengl_asking_for_it_is_refused_in_one_line(tmp_path, without_gl):
    run = tmp_path / "run.npz"
    save_run(room_run(), run)
    command = [sys.executable, "-m", "lrf3d", "render", str(run), "--renderer", "gl"]
    done = subprocess.run(command, env=without_gl, capture_output=True, text=True)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.count("\n") == 1 and "libegl1 libgl1" in done.stderr
    assert sorted(os.listdir(tmp_path)) == ["hidden", "run.npz"]
