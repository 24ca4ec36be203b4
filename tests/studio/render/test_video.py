"""Films: number, size and kind of the frames, and what is left when drawing fails."""

import os
import signal
import subprocess
import sys
from dataclasses import replace

import av
import numpy as np
import pytest
from PIL import Image
from test_render import city_run, needs_gl, room_run
from waiting import until

from lrf3d.base.errors import InputError
from lrf3d.studio.render import film, video
from lrf3d.world.cameras import FilmPlan


def read(path):
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
        return stream.codec_context.name, float(stream.average_rate), frames


@pytest.mark.slow
@needs_gl
def test_a_film_has_its_frames_in_order_from_all_workers(tmp_path):
    run = city_run(seconds=2.0)
    seen = []
    path = tmp_path / "run.mp4"
    size = (320, 180)
    video.render_video(
        run, path, size=size, fps=10, samples=0, workers=2, progress=lambda *done: seen.append(done)
    )
    codec, rate, frames = read(path)
    assert (codec, rate) == ("h264", 10.0)
    assert len(frames) == 21 and {frame.shape for frame in frames} == {(180, 320, 3)}
    assert seen[-1] == (21, 21) and [done for done, _ in seen] == sorted(done for done, _ in seen)
    for index in (0, 10, 11, 20):
        alone = film.frame(run, index / 10, size=size, samples=0).astype(int)
        others = [np.abs(frame.astype(int) - alone).mean() for frame in frames]
        assert int(np.argmin(others)) == index
        assert others[index] < 6.0
    assert os.listdir(tmp_path) == ["run.mp4"]


@needs_gl
def test_maps_of_runs_stand_side_by_side_each_under_its_name(tmp_path):
    run = room_run()
    columns = {"one": run, "another name": run}
    path = tmp_path / "both.mp4"
    video.render_video(
        run, path, size=(520, 240), fps=1, view="story", workers=1, columns=columns, part=(4.0, 4.0)
    )
    (picture,) = read(path)[2]
    assert picture.shape == (240, 520, 3)
    one, other = picture[50:].astype(int).reshape(190, 2, 260, 3).swapaxes(0, 1)
    off = np.abs(one - other).max(axis=2)
    # All but the names are the same.
    assert off[40:].mean() < 5.0 and off[:40].max() > 80 and one.max() > 150


def film_by(worker, path, monkeypatch):
    """Draw a film by a worker that is a script."""
    script = path.with_name("worker")
    script.write_text(f"#!/usr/bin/env bash\n{worker}\n")
    script.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(script))
    small = {"size": (64, 36), "fps": 4, "renderer": "embree", "workers": 1}
    video.render_video(room_run(), path, **small)


def test_a_failing_worker_leaves_no_file(written, tmp_path, monkeypatch):
    path = written("run.mp4", b"before")
    with pytest.raises(RuntimeError, match="drawing the film failed with status 3"):
        film_by("exit 3", path, monkeypatch)
    assert path.read_bytes() == b"before"
    assert sorted(os.listdir(tmp_path)) == ["run.mp4", "worker"]


def test_a_worker_that_is_killed_in_the_middle_of_a_picture_is_reported(tmp_path, monkeypatch):
    # Of a message of 1000 bytes it sends three.
    sends = "printf '\\0\\0\\3\\350abc' >&$6; kill -9 $$"
    with pytest.raises(RuntimeError, match="drawing the film failed with status -9"):
        film_by(sends, tmp_path / "run.webp", monkeypatch)
    assert os.listdir(tmp_path) == ["worker"]


@needs_gl
def test_workers_end_when_their_caller_is_killed(tmp_path):
    script = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from test_render import room_run\n"
        "from lrf3d.studio.render.video import render_video\n"
        "render_video(room_run(), sys.argv[2], size=(64, 36), fps=5000, workers=1,\n"
        "             progress=lambda *done: print('drawing', flush=True))\n"
    )
    here = os.path.dirname(__file__)
    command = [sys.executable, "-c", script, here, str(tmp_path / "a.mp4")]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as caller:
        caller.stdout.readline()
        caller.send_signal(signal.SIGKILL)
    until(lambda: not os.listdir(tmp_path))


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("a.mp4", {"size": (65, 36)}),
        ("a.mp4", {"fps": 0.0}),
        ("a.mp4", {"workers": 0}),
        ("a.mp4", {"renderer": "crayon"}),
        ("a.gif", {"fps": 60.0}),
        ("a.avi", {}),
        ("a.mp4", {"size": "64x36"}),
        ("a.mp4", {"playback": None, "view": 3}),
        ("a.mp4", {"part": 3.0}),
    ],
)
def test_a_film_that_cannot_be_drawn_is_refused(tmp_path, name, wrong):
    with pytest.raises(InputError):
        video.render_video(room_run(), tmp_path / name, **{"size": (64, 36), **wrong})
    assert os.listdir(tmp_path) == []


def pictures_of(path):
    """The pictures of an animation, and how long each is shown [ms]."""
    with Image.open(path) as film:
        assert film.info.get("loop") == 0 and film.n_frames > 1
        pictures, times = [], []
        for number in range(film.n_frames):
            film.seek(number)
            pictures.append(np.array(film.convert("RGB")))
            times.append(film.info["duration"])
    return pictures, times


@needs_gl
@pytest.mark.parametrize(
    ("ending", "fps", "unlike"),
    [
        (".webp", 12.0, 7.0),
        pytest.param(".gif", 50.0, 6.0, marks=pytest.mark.slow),
    ],
)
def test_an_animation_has_its_frames_its_size_and_its_length(tmp_path, ending, fps, unlike):
    run = city_run(seconds=1.0)
    path = tmp_path / f"run{ending}"
    size = (161, 91)
    video.render_video(run, path, size=size, fps=fps, samples=0, workers=2)
    pictures, times = pictures_of(path)
    moments = video.Timeline(run).frame_times(fps)
    count = len(moments)
    assert len(pictures) == count and {picture.shape for picture in pictures} == {(91, 161, 3)}
    # No frame is early or late by more than the file's unit of time, though units do not fit.
    unit = 10.0 if ending == ".gif" else 1.0
    ends = np.cumsum(times)
    assert np.abs(ends - np.arange(1, count + 1) * 1000.0 / fps).max() <= unit
    for index in (0, count // 2, count // 2 + 1, count - 1):
        alone = film.frame(run, moments[index], size=size, samples=0).astype(int)
        others = [np.abs(picture.astype(int) - alone).mean() for picture in pictures]
        assert others[index] < unlike
        assert others[index] == min(others)
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.slow
@needs_gl
@pytest.mark.parametrize("ending", [".mp4", ".webp", ".gif"])
def test_films_may_be_as_short_as_a_frame(tmp_path, ending):
    # A run of one scan lasts no time, and is looked at for a moment.
    run, path = room_run().part(np.arange(1)), tmp_path / f"run{ending}"
    fps = 0.5 / (video.Timeline(run).end - video.Timeline(run).start)
    video.render_video(run, path, size=(128, 72), fps=fps, samples=0, workers=1)
    with av.open(str(path)) as stream:
        [picture] = [each.to_ndarray(format="rgb24").astype(int) for each in stream.decode(video=0)]
    alone = film.frame(run, 0.0, size=(128, 72), samples=0).astype(int)
    assert np.abs(picture - alone).mean() < 8.0


def test_a_picture_that_cannot_be_drawn_is_refused():
    for wrong in ({"size": (64,)}, {"playback": "slow"}, {"goal": (1.0, 2.0)}, {"samples": 3}):
        with pytest.raises(InputError):
            film.frame(room_run(), 1.0, **wrong)
    with pytest.raises(InputError):
        film.frame(room_run(), "now")


def test_a_time_past_the_run_is_refused_before_anything_is_painted(monkeypatch):
    def painted(*arguments):
        raise AssertionError("painted")

    monkeypatch.setattr(film, "_film", painted)
    run = replace(room_run(), film=FilmPlan("story", 2.0))
    with pytest.raises(InputError, match=r"time 999 s: pictures go from "):
        film.frame(run, 999.0)


@pytest.mark.parametrize("view", ["overview", "top"])
def test_a_film_that_is_no_story_has_a_given_length_too(view):
    run = city_run(seconds=12.0)
    plan = film.FilmOptions(view=view, length=6.0, renderer="embree").of(run)
    assert plan.playback == pytest.approx(run.trajectory.duration / 6.0)
    assert film.FilmOptions(view=view, renderer="embree").of(run).playback == run.playback


def test_robots_whose_paths_have_other_extents_have_a_film(tmp_path):
    run = city_run(seconds=1.0)
    moved = run.trajectory.poses + np.array([41.3, 7.7, 0.0])
    other = replace(run, trajectory=replace(run.trajectory, poses=moved))
    small = {"size": (160, 90), "renderer": "embree", "workers": 1, "fps": 1, "part": (1.0, 1.0)}
    video.render_video(run, tmp_path / "a.mp4", maps={"one": run, "two": other}, **small)
    assert len(read(tmp_path / "a.mp4")[2]) == 1
